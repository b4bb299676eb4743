//! What a person sees while something runs, the bridge or a glove alone: a drawn view on a terminal, one plain line a second
//! elsewhere.

mod bars;
mod draw;
pub mod glove;
pub mod guided;
pub mod headings;
mod key;
mod keys;
mod moving;
mod parts;
pub mod postures;
mod raw;
mod small;
pub mod teach;
mod view;

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use ratatui::backend::CrosstermBackend;
use ratatui::layout::Rect;
use ratatui::{Frame, Terminal, TerminalOptions, Viewport};

pub use key::{Bindings, Key};
pub use moving::{Axis, Finger};
pub use small::LEAST;
pub use view::View;

use crate::{out, say};
use host::clock::since_boot;
use keys::{Keyboard, hung_up};
use raw::Raw;

/// Pause between two drawings.
const DRAW_EVERY: Duration = Duration::from_millis(80);
/// Pause between two plain lines.
const LINE_EVERY: Duration = Duration::from_secs(1);
/// A view that was not taken for so long is one that nobody sees.
const UNSEEN: Duration = Duration::from_millis(250);

/// What was said before a view is waited for so long, to stand on the terminal first.
const SAID: Duration = Duration::from_millis(250);

/// Keys that came while nobody looked for longer than this are old.
const LOOKED: Duration = Duration::from_millis(300);

/// A space bar that comes again within this is held down: terminals wait half a second before they repeat.
const REPEATS: Duration = Duration::from_millis(700);

/// What the lines say that stand for a view of a run.
const LEGEND: &str = "           a line a second: the state, each axis asked→at (counts, 0 open to 255 closed), rates, what is wrong";

/// What is shown at one moment.
pub trait Scene {
    /// What the lines say that stand for the view; said once, above them.
    const LEGEND: &'static str;

    /// Drawn over the whole of `frame`.
    fn draw(&self, frame: &mut Frame<'_>);

    /// In one line, for a log file or a pipe.
    fn line(&self) -> String;
}

impl Scene for View {
    const LEGEND: &'static str = LEGEND;

    fn draw(&self, frame: &mut Frame<'_>) {
        draw::draw(self, frame);
    }

    fn line(&self) -> String {
        self.line()
    }
}

/// Where the view goes.
#[derive(Debug)]
enum Target {
    Drawn(Box<Drawn>),
    /// Plain ones; whether what they mean was told.
    Lines {
        told: bool,
    },
    Quiet,
}

#[derive(Debug)]
struct Drawn {
    terminal: Terminal<CrosstermBackend<out::Screen>>,
    area: Rect,
    keyboard: Keyboard,
    raw: Raw,
}

impl Drawn {
    fn start() -> std::io::Result<Self> {
        // Lines that wait would begin where the one before ended: in raw mode a line feed is no carriage return.
        out::settle(SAID);
        let raw = Raw::enter()?;
        let area = raw::size();
        Ok(Self {
            terminal: empty(area)?,
            area,
            keyboard: Keyboard::new(Bindings::load()),
            raw,
        })
    }

    fn show(&mut self, scene: &impl Scene) -> std::io::Result<()> {
        let area = raw::size();
        if area != self.area {
            self.area = area;
            self.terminal.resize(area)?;
        }
        self.terminal.draw(|frame| scene.draw(frame))?;
        Ok(())
    }
}

/// A terminal on which nothing is drawn yet.
fn empty(area: Rect) -> std::io::Result<Terminal<CrosstermBackend<out::Screen>>> {
    let backend = CrosstermBackend::new(out::Screen::default());
    let options = TerminalOptions {
        viewport: Viewport::Fixed(area),
    };
    Terminal::with_options(backend, options)
}

/// The running view. Dropping it gives the terminal back as it was, also in a panic.
#[derive(Debug)]
pub struct Live {
    target: Target,
    shown: Option<Instant>,
    /// When keys were looked for last, since the computer's start.
    looked: Option<Duration>,
    /// When the space bar was pressed last.
    space: Option<Duration>,
    /// The newest other key, and when it was pressed.
    other: Option<(u8, Duration)>,
    /// Whether somebody sits at a terminal, who may close it.
    terminal: bool,
}

/// Keys that were pressed before anybody looked, as what is safe: whoever pressed space then may have meant to open.
fn safe(keys: Vec<Key>) -> Vec<Key> {
    keys.into_iter()
        .filter(|key| !matches!(key, Key::Calibrate | Key::Undo))
        .map(|key| match key {
            Key::Clutch => Key::Open,
            key => key,
        })
        .collect()
}

impl Live {
    /// Draws where standard input and output are a terminal, prints lines elsewhere; `quiet` prints nothing.
    ///
    /// # Errors
    /// The terminal's error where it refuses raw mode.
    pub fn start(quiet: bool) -> std::io::Result<Self> {
        out::hurry();
        let terminal = std::io::stdin().is_terminal();
        let target = if quiet {
            Target::Quiet
        } else if std::io::stdout().is_terminal() && terminal {
            Target::Drawn(Box::new(Drawn::start()?))
        } else {
            Target::Lines { told: false }
        };
        Ok(Self {
            target,
            shown: None,
            looked: None,
            space: None,
            other: None,
            terminal,
        })
    }

    /// From now on the pedal that this person has is a key without a meaning of its own: see [`Live::others`].
    pub fn with_pedal(&mut self) {
        if let Target::Drawn(drawn) = &mut self.target {
            drawn.keyboard.with_pedal();
        }
    }

    /// Whether keys can be read.
    pub fn interactive(&self) -> bool {
        matches!(self.target, Target::Drawn(_))
    }

    /// Whether the view was not taken for so long that nobody can be said to see it: then no heartbeat is due.
    pub fn unseen(&self) -> bool {
        !matches!(self.target, Target::Quiet) && out::unseen() >= UNSEEN
    }

    /// Shows what `scene` makes where it is time to, and where the view before was taken. Never waits.
    ///
    /// # Errors
    /// The terminal's error.
    pub fn show<S: Scene>(&mut self, scene: impl FnOnce() -> S) -> std::io::Result<()> {
        let every = match &mut self.target {
            Target::Drawn(_) => DRAW_EVERY,
            Target::Lines { told } => {
                if !std::mem::replace(told, true) {
                    say!("{}", S::LEGEND);
                }
                LINE_EVERY
            }
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
        if now.duration_since(first) < every || out::pending() {
            return Ok(());
        }
        // Kept on the beat, but never more than one beat behind.
        self.shown = Some((first + every).max(now.checked_sub(every).unwrap_or(now)));
        match &mut self.target {
            Target::Drawn(drawn) => drawn.show(&scene())?,
            Target::Lines { .. } => say!("{}", scene().line()),
            Target::Quiet => {}
        }
        Ok(())
    }

    /// Keys pressed since the last call; [`Key::End`] where the terminal was closed. Never waits.
    ///
    /// # Errors
    /// None; kept for views that have any.
    pub fn keys(&mut self) -> std::io::Result<Vec<Key>> {
        let now = since_boot();
        let looked = self.looked.replace(now);
        let old = looked.is_none_or(|before| now.saturating_sub(before) > LOOKED);
        let keys = match &mut self.target {
            Target::Drawn(drawn) => drawn.keyboard.read(Instant::now()),
            _ if self.terminal && hung_up(&std::io::stdin()) => vec![Key::End],
            _ => Vec::new(),
        };
        // A key that is held down repeats: only its first press may close the clutch.
        let repeated = self
            .space
            .is_some_and(|before| now.saturating_sub(before) < REPEATS);
        if keys.contains(&Key::Clutch) {
            self.space = Some(now);
        }
        Ok(if old || repeated { safe(keys) } else { keys })
    }

    /// Keys without a meaning of their own, pressed one by one since the last call of [`Live::keys`]: 0 for one that sends more than a
    /// byte. One that is held down counts once.
    pub fn others(&mut self) -> Vec<u8> {
        let Target::Drawn(drawn) = &mut self.target else {
            return Vec::new();
        };
        let now = since_boot();
        let mut pressed = drawn.keyboard.others();
        pressed.retain(|key| {
            let before = self.other.replace((*key, now));
            before.is_none_or(|(k, at)| k != *key || now.saturating_sub(at) >= REPEATS)
        });
        pressed
    }

    /// Gives the terminal back while `stop` stops this program, and takes it again when it goes on.
    ///
    /// # Errors
    /// The terminal's error, or that of `stop`.
    pub fn aside(&mut self, stop: impl FnOnce() -> std::io::Result<()>) -> std::io::Result<()> {
        if let Target::Drawn(drawn) = &mut self.target {
            drawn.raw.leave();
        }
        stop()?;
        if let Target::Drawn(drawn) = &mut self.target {
            drawn.raw.again()?;
            // Whatever stands there now is drawn over, all of it.
            drawn.terminal = empty(drawn.area)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
