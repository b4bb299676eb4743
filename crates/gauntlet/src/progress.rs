//! A progress bar with an estimate on a terminal, a plain line now and then elsewhere. Always on standard error, so
//! that results on standard output stay clean.

use std::fmt::Write;
use std::io::IsTerminal;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle, TermLike};
use rustix::termios::tcgetwinsize;

use crate::{note, out};
use host::report::Reporter;
use host::stats::seconds;

/// Pause between two plain lines.
const LINE_EVERY: Duration = Duration::from_secs(5);
/// What is left stands first and is never cut off; a narrow terminal cuts the details at the end.
const TEMPLATE: &str = "{percent:>3} % {prefix} {bar:16} {wide_msg}";
/// For what is printed beside the bar to be taken.
const SETTLE: Duration = Duration::from_millis(50);
/// Redraws a second.
const REDRAWS: u8 = 10;

/// The progress of one long piece of work with a known number of steps.
#[derive(Debug)]
pub struct Progress {
    what: &'static str,
    total: u64,
    started: Instant,
    shown: Display,
}

#[derive(Debug)]
enum Display {
    Bar(ProgressBar),
    Lines { last: Instant },
    Quiet,
}

impl Progress {
    /// Begins `what` with `total` steps; `quiet` shows nothing at all.
    pub fn start(what: &'static str, total: u64, quiet: bool) -> Self {
        let started = Instant::now();
        let shown = if quiet {
            Display::Quiet
        } else if std::io::stderr().is_terminal() {
            Display::Bar(bar(what, total))
        } else {
            Display::Lines { last: started }
        };
        Self {
            what,
            total,
            started,
            shown,
        }
    }

    /// `done` steps are done; `detail` says how it goes.
    pub fn at(&mut self, done: u64, detail: impl FnOnce() -> String) {
        self.at_with(done, None, detail);
    }

    /// As [`Progress::at`], with an estimate that knows better than "as fast as so far".
    pub fn at_with(&mut self, done: u64, left: Option<Duration>, detail: impl FnOnce() -> String) {
        let left = left.or_else(|| remaining(self.started.elapsed(), done, self.total));
        let done = done.min(self.total);
        let left = left.map_or_else(String::new, |left| {
            format!(", about {} left", seconds(left))
        });
        match &mut self.shown {
            Display::Bar(bar) => {
                bar.set_position(done);
                bar.set_prefix(format!("{}{left}", self.what));
                bar.set_message(detail());
            }
            Display::Lines { last } if last.elapsed() >= LINE_EVERY => {
                *last = Instant::now();
                let percent = 100 * done / self.total.max(1);
                note!("{}: {percent} %, {}{left}", self.what, detail());
            }
            Display::Lines { .. } | Display::Quiet => {}
        }
    }

    /// A line above the bar.
    pub fn say(&self, text: &str) {
        match &self.shown {
            Display::Bar(bar) => bar.suspend(|| note!("{text}")),
            Display::Lines { .. } => note!("{text}"),
            Display::Quiet => {}
        }
    }

    /// Prints with the bar out of the way.
    pub fn aside(&self, print: impl FnOnce()) {
        match &self.shown {
            Display::Bar(bar) => bar.suspend(|| {
                print();
                // Else the bar might be drawn before it.
                out::settle(SETTLE);
            }),
            Display::Lines { .. } | Display::Quiet => print(),
        }
    }

    /// Takes the bar away; returns how long the work took.
    pub fn finish(self) -> Duration {
        if let Display::Bar(bar) = &self.shown {
            bar.finish_and_clear();
        }
        self.started.elapsed()
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Display::Bar(bar) = &self.shown {
            bar.finish_and_clear();
        }
    }
}

fn bar(what: &'static str, total: u64) -> ProgressBar {
    let target = ProgressDrawTarget::term_like_with_hz(Box::<Terminal>::default(), REDRAWS);
    let bar = ProgressBar::with_draw_target(Some(total), target);
    if let Ok(style) = ProgressStyle::with_template(TEMPLATE) {
        bar.set_style(style.progress_chars("━╸─"));
    }
    bar.set_prefix(what);
    bar
}

/// A person at the terminal hears of the work that `host` does.
#[derive(Debug, Clone, Copy, Default)]
pub struct Person;

impl Reporter for Person {
    fn note(&self, text: &str) {
        note!("{text}");
    }

    fn begin(&self, what: &'static str, total: u64) -> Box<dyn host::report::Progress> {
        Box::new(Progress::start(what, total, false))
    }
}

impl host::report::Progress for Progress {
    fn at(&mut self, done: u64, left: Option<Duration>, detail: &dyn Fn() -> String) {
        self.at_with(done, left, detail);
    }

    fn note(&self, text: &str) {
        self.say(text);
    }
}

/// The terminal at standard error, drawn on through the queue of `out`.
#[derive(Debug, Default)]
struct Terminal {
    drawn: Mutex<String>,
}

/// Columns where the terminal does not say.
const COLUMNS: u16 = 80;

impl Terminal {
    fn draw(&self) -> MutexGuard<'_, String> {
        self.drawn.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A control sequence with a number; nothing for none.
    fn control(&self, count: usize, what: char) -> std::io::Result<()> {
        if count > 0 {
            // A string takes everything.
            let _ = write!(self.draw(), "\x1b[{count}{what}");
        }
        Ok(())
    }
}

impl TermLike for Terminal {
    fn width(&self) -> u16 {
        let told = tcgetwinsize(std::io::stderr()).map_or(0, |size| size.ws_col);
        if told > 0 { told } else { COLUMNS }
    }

    fn move_cursor_up(&self, count: usize) -> std::io::Result<()> {
        self.control(count, 'A')
    }

    fn move_cursor_down(&self, count: usize) -> std::io::Result<()> {
        self.control(count, 'B')
    }

    fn move_cursor_right(&self, count: usize) -> std::io::Result<()> {
        self.control(count, 'C')
    }

    fn move_cursor_left(&self, count: usize) -> std::io::Result<()> {
        self.control(count, 'D')
    }

    fn write_line(&self, text: &str) -> std::io::Result<()> {
        let mut drawn = self.draw();
        drawn.push_str(text);
        drawn.push('\n');
        Ok(())
    }

    fn write_str(&self, text: &str) -> std::io::Result<()> {
        self.draw().push_str(text);
        Ok(())
    }

    fn clear_line(&self) -> std::io::Result<()> {
        self.write_str("\r\x1b[2K")
    }

    fn flush(&self) -> std::io::Result<()> {
        out::sketch(std::mem::take(&mut *self.draw()).as_bytes());
        Ok(())
    }
}

fn remaining(elapsed: Duration, done: u64, total: u64) -> Option<Duration> {
    (done > 0).then(|| elapsed.mul_f64(total.saturating_sub(done) as f64 / done as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_estimate_is_proportional_and_absent_before_the_first_step() {
        let elapsed = Duration::from_secs(10);
        assert_eq!(remaining(elapsed, 0, 100), None);
        assert_eq!(remaining(elapsed, 25, 100), Some(Duration::from_secs(30)));
        assert_eq!(remaining(elapsed, 100, 100), Some(Duration::ZERO));
    }
}
