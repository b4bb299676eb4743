//! What a verb says on the way: on standard output, or with `--json` on standard error, which leaves the output clean.

use std::fmt::Arguments;

use crate::out;
use host::recording::Written;

/// Where the words go.
#[derive(Debug, Clone, Copy)]
pub struct Tell {
    json: bool,
}

impl Tell {
    /// `json`: standard output belongs to the result.
    pub fn new(json: bool) -> Self {
        Self { json }
    }

    /// One line.
    pub fn say(&self, text: Arguments<'_>) {
        if self.json {
            out::note(text);
        } else {
            out::line(text);
        }
    }

    /// What became of the session log.
    pub fn log(&self, log: Option<&Written>) {
        if let Some(log) = log {
            self.say(format_args!("log        {}", log.line()));
        }
    }
}
