//! Errors as a person meets them: the thing and its value, then the next step.
//!
//! Inside the tool errors travel as `anyhow::Error`. Whatever a person can cause is a [`Failure`], which carries what
//! to try next and the exit code; [`report`] prints either as `error: …` and `try: …`.

use std::fmt;

use serde::Serialize;
use trainer::remedy::Remedy;

use crate::next::NextStep;

/// Exit code when the work was done.
pub const EXIT_DONE: u8 = 0;
/// Exit code when the work failed.
pub const EXIT_FAILED: u8 = 1;
/// Exit code when the command was given wrongly.
pub const EXIT_USAGE: u8 = 2;

/// One fault a person can meet: what it is and what to do next.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    what: String,
    next: NextStep,
    exit: u8,
    /// What else went wrong.
    others: Vec<String>,
}

impl Failure {
    /// A failure of the work: exit code 1. `what` names the thing and its value, `next` the next step.
    pub fn new(what: impl Into<String>, next: impl Into<NextStep>) -> Self {
        Self {
            what: what.into(),
            next: next.into(),
            exit: EXIT_FAILED,
            others: Vec::new(),
        }
    }

    /// A command given wrongly: exit code 2.
    pub fn usage(what: impl Into<String>, next: impl Into<NextStep>) -> Self {
        Self {
            exit: EXIT_USAGE,
            ..Self::new(what, next)
        }
    }

    /// The same as a command, or a file of settings, given wrongly: exit code 2.
    #[must_use]
    pub fn as_usage(self) -> Self {
        Self {
            exit: EXIT_USAGE,
            ..self
        }
    }

    /// Somebody asked for the end before `what` was done.
    pub fn interrupted(what: &str) -> Self {
        Self::new(
            format!("interrupted {what}; nothing was moved"),
            "the same again",
        )
    }

    /// What a person can do next.
    pub fn next(&self) -> &NextStep {
        &self.next
    }

    /// The same in words.
    pub fn next_step(&self) -> String {
        self.next.to_string()
    }

    /// The process's exit code.
    pub fn exit_code(&self) -> u8 {
        self.exit
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what)
    }
}

impl std::error::Error for Failure {}

/// Turns an error into a [`Failure`] that names the thing it happened to.
pub trait OrFail<T> {
    /// `what` names the thing ("the model file a.safetensors"); the error's own text follows it after a colon.
    ///
    /// # Errors
    /// The failure, where `self` was an error.
    fn or_fail(self, what: impl FnOnce() -> String, next: impl Into<NextStep>)
    -> anyhow::Result<T>;
}

impl<T, E: fmt::Display> OrFail<T> for Result<T, E> {
    fn or_fail(
        self,
        what: impl FnOnce() -> String,
        next: impl Into<NextStep>,
    ) -> anyhow::Result<T> {
        self.map_err(|error| Failure::new(format!("{}: {error}", what()), next).into())
    }
}

/// An error of the trainer, with what helps.
pub fn told(error: impl Remedy) -> anyhow::Error {
    Failure::new(error.to_string(), error.remedy()).into()
}

/// `first`, and what went wrong besides, which is told after it.
pub fn with_others(first: anyhow::Error, others: Vec<String>) -> anyhow::Error {
    if others.is_empty() {
        return first;
    }
    match first.downcast::<Failure>() {
        Ok(failure) => Failure { others, ..failure }.into(),
        Err(first) => {
            let failure = Failure::new(format!("{first:#}"), "");
            Failure { others, ..failure }.into()
        }
    }
}

/// `error` for whoever typed `words`: where its next step is "the same again with", it is a command.
pub fn typed(error: anyhow::Error, words: &[String]) -> anyhow::Error {
    let what = format!("{error:#}");
    match error.downcast::<Failure>() {
        Ok(failure) => {
            let next = failure.next.typed(words);
            Failure {
                what,
                next,
                ..failure
            }
            .into()
        }
        Err(error) => error,
    }
}

/// A failure as data.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Told {
    /// What failed.
    pub error: String,
    /// What a person can do next.
    #[serde(flatten)]
    pub next: NextStep,
    /// What else went wrong.
    pub also: Vec<String>,
    /// Exit code of the process.
    pub exit_code: u8,
}

impl Told {
    /// Any error.
    pub fn of(error: &anyhow::Error) -> Self {
        let failure = error.downcast_ref::<Failure>();
        Self {
            error: one_line(&format!("{error:#}")),
            next: failure.map_or_else(NextStep::default, |failure| failure.next.clone()),
            also: failure.map_or_else(Vec::new, |failure| failure.others.clone()),
            exit_code: failure.map_or(EXIT_FAILED, Failure::exit_code),
        }
    }
}

/// The lines for standard error, and the exit code.
pub fn report(error: &anyhow::Error) -> (String, u8) {
    let told = Told::of(error);
    let mut text = format!("error: {}", told.error);
    if !told.next.is_empty() {
        text.push_str("\n  try: ");
        text.push_str(&one_line(&told.next.to_string()));
    }
    for other in &told.also {
        text.push_str("\nalso: ");
        text.push_str(&one_line(other));
    }
    (text, told.exit_code)
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn report_is_one_line_for_the_fault_and_one_for_the_next_step() {
        let error: anyhow::Error =
            Failure::new("the file a.csv:\n row 3 is empty", "look at row 3").into();
        let (text, code) = report(&error);
        assert_eq!(
            text,
            "error: the file a.csv: row 3 is empty\n  try: look at row 3"
        );
        assert_eq!(code, EXIT_FAILED);
    }

    #[test]
    fn what_else_went_wrong_is_told_after_the_first_failure_and_its_next_step() {
        let others = vec!["the log is incomplete".to_owned()];
        let told = |first| report(&with_others(first, others.clone()));
        let first = Failure::usage("the hold was not confirmed", "look at it");
        assert_eq!(
            told(first.into()),
            (
                "error: the hold was not confirmed\n  try: look at it\nalso: the log is incomplete"
                    .to_owned(),
                EXIT_USAGE
            )
        );
        let (text, code) = told(anyhow::anyhow!("plain").context("more"));
        assert_eq!(text, "error: more: plain\nalso: the log is incomplete");
        assert_eq!(code, EXIT_FAILED);
    }

    #[test]
    fn context_keeps_the_next_step_and_the_exit_code() {
        let error = anyhow::Error::from(Failure::usage("--seconds is 0", "give 1 or more"))
            .context("the run did not start");
        let (text, code) = report(&error);
        assert_eq!(
            text,
            "error: the run did not start: --seconds is 0\n  try: give 1 or more"
        );
        assert_eq!(code, EXIT_USAGE);
    }
}
