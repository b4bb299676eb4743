//! What a person sees while the bridge runs: a drawn view on a terminal, one plain line a second elsewhere.

mod bars;
mod draw;
mod view;

use std::io::{IsTerminal, Stdout, stdout};
use std::time::{Duration, Instant};

use ratatui::Terminal;
use ratatui::backend::CrosstermBackend;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};

pub use draw::draw;
pub use view::{Axis, Finger, View};

use crate::say;

/// Pause between two drawings.
const DRAW_EVERY: Duration = Duration::from_millis(80);
/// Pause between two plain lines.
const LINE_EVERY: Duration = Duration::from_secs(1);

/// What a person asked for with a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Key {
    /// `q`, Escape or Ctrl-C: hold and end.
    End,
    /// Space: close or open the clutch.
    Clutch,
    /// `c`: the hand is flat now, calibrate on it.
    Calibrate,
}

/// Where the view goes.
#[derive(Debug)]
enum Target {
    Drawn(Terminal<CrosstermBackend<Stdout>>),
    Lines,
    Quiet,
}

/// The running view. Dropping it gives the terminal back as it was, also in a panic.
#[derive(Debug)]
pub struct Live {
    target: Target,
    shown: Option<Instant>,
}

impl Live {
    /// Draws where standard input and output are a terminal, prints lines elsewhere; `quiet` prints nothing.
    ///
    /// # Errors
    /// The terminal's error where it refuses raw mode.
    pub fn start(quiet: bool) -> std::io::Result<Self> {
        let target = if stdout().is_terminal() && std::io::stdin().is_terminal() && !quiet {
            // Also installs a panic hook that restores the terminal before the message is printed.
            Target::Drawn(ratatui::try_init()?)
        } else if quiet {
            Target::Quiet
        } else {
            Target::Lines
        };
        Ok(Self {
            target,
            shown: None,
        })
    }

    /// Whether keys can be read.
    pub fn interactive(&self) -> bool {
        matches!(self.target, Target::Drawn(_))
    }

    /// Shows `view` where it is time to.
    ///
    /// # Errors
    /// The terminal's error.
    pub fn show(&mut self, view: impl FnOnce() -> View) -> std::io::Result<()> {
        let every = match self.target {
            Target::Drawn(_) => DRAW_EVERY,
            Target::Lines => LINE_EVERY,
            Target::Quiet => return Ok(()),
        };
        let now = Instant::now();
        let first = *self.shown.get_or_insert_with(|| {
            if matches!(self.target, Target::Drawn(_)) {
                now.checked_sub(every).unwrap_or(now)
            } else {
                now
            }
        });
        if now.duration_since(first) < every {
            return Ok(());
        }
        // Kept on the beat, but never more than one beat behind.
        self.shown = Some((first + every).max(now.checked_sub(every).unwrap_or(now)));
        match &mut self.target {
            Target::Drawn(terminal) => {
                let view = view();
                terminal.draw(|frame| draw(&view, frame))?;
            }
            Target::Lines => say!("{}", view().line()),
            Target::Quiet => {}
        }
        Ok(())
    }

    /// Keys pressed since the last call. Never waits.
    ///
    /// # Errors
    /// The terminal's error.
    pub fn keys(&mut self) -> std::io::Result<Vec<Key>> {
        let mut keys = Vec::new();
        if self.interactive() {
            while event::poll(Duration::ZERO)? {
                keys.extend(meaning(&event::read()?));
            }
        }
        Ok(keys)
    }
}

fn meaning(event: &Event) -> Option<Key> {
    let Event::Key(key) = event else {
        return None;
    };
    if key.kind != KeyEventKind::Press {
        return None;
    }
    match key.code {
        KeyCode::Char('q') | KeyCode::Esc => Some(Key::End),
        KeyCode::Char('c' | 'd') if key.modifiers.contains(KeyModifiers::CONTROL) => Some(Key::End),
        KeyCode::Char('c') => Some(Key::Calibrate),
        KeyCode::Char(' ') => Some(Key::Clutch),
        _ => None,
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        if let Target::Drawn(_) = self.target {
            ratatui::restore();
        }
    }
}

#[cfg(test)]
mod tests;
