//! Who is told what happens on the way: a person at a terminal, a log, nobody.

use std::fmt::Debug;
use std::time::Duration;

/// Hears what a long piece of work has to say.
pub trait Reporter: Debug + Sync {
    /// Something a person should know, and no failure.
    fn note(&self, text: &str);

    /// Work of `total` steps begins; it is over when what comes back is dropped.
    fn begin(&self, what: &'static str, total: u64) -> Box<dyn Progress>;
}

/// How far one piece of work is.
pub trait Progress {
    /// `done` steps are done. `left`: an estimate that knows better than "as fast as so far"; `detail` says how it goes.
    fn at(&mut self, done: u64, left: Option<Duration>, detail: &dyn Fn() -> String);

    /// Something a person should know meanwhile.
    fn note(&self, text: &str);
}

/// Tells nobody.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Nobody;

impl Reporter for Nobody {
    fn note(&self, _: &str) {}

    fn begin(&self, _: &'static str, _: u64) -> Box<dyn Progress> {
        Box::new(Self)
    }
}

impl Progress for Nobody {
    fn at(&mut self, _: u64, _: Option<Duration>, _: &dyn Fn() -> String) {}

    fn note(&self, _: &str) {}
}
