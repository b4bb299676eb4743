//! A progress bar with an estimate on a terminal, a plain line now and then elsewhere. Always on standard error, so
//! that results on standard output stay clean.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::note;
use crate::stats::seconds;

/// Pause between two plain lines.
const LINE_EVERY: Duration = Duration::from_secs(5);
/// What is left stands first and is never cut off; a narrow terminal cuts the details at the end.
const TEMPLATE: &str = "{percent:>3} % {prefix} {bar:16} {wide_msg}";
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
            Display::Bar(bar) => bar.suspend(print),
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
    let bar =
        ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr_with_hz(REDRAWS));
    if let Ok(style) = ProgressStyle::with_template(TEMPLATE) {
        bar.set_style(style.progress_chars("━╸─"));
    }
    bar.set_prefix(what);
    bar
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
