//! What the verbs print with `--json`: one object each. `"result"` names the verb as it is typed, `"version"` what the
//! names in it mean; the same name is the same thing in every verb (docs/json.md).
//!
//! Times end in `_s`, `_ms` or `_us`, currents in `_ma`. What cannot be told is `null`; a number that is none is a word
//! ("NaN").

pub mod calibrations;
pub mod devices;
pub mod gloves;
pub mod headings;
pub mod maps;
pub mod paper;
pub mod recordings;
pub mod replays;
pub mod runs;
pub mod settings;

use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Result;
use serde::Serialize;

use crate::{options, out};
use host::failure::{self, Told};

/// What the names in a result mean. A name that changes, or goes, makes it one more; a new one does not.
pub const VERSION: u32 = 1;

/// Whether a result was printed.
static PRINTED: AtomicBool = AtomicBool::new(false);

/// A result as it is printed.
#[derive(Debug, Serialize)]
pub struct Named<T> {
    /// The verb as it is typed, or `failure`.
    pub result: &'static str,
    /// [`VERSION`].
    pub version: u32,
    /// Its own names.
    #[serde(flatten)]
    pub value: T,
}

/// Names a result of `verb`.
pub fn named<T>(verb: &'static str, value: T) -> Named<T> {
    Named {
        result: verb,
        version: VERSION,
        value,
    }
}

/// Prints the result of `verb`.
///
/// # Errors
/// A value that has no JSON form; none of this tool's.
pub fn print(verb: &'static str, value: impl Serialize) -> Result<()> {
    PRINTED.store(true, Ordering::Relaxed);
    out::json(&named(verb, value))
}

/// The judgement over a run, and as data why it failed: as whoever typed this command is told it.
pub fn judged<T>(judgement: Result<T>) -> (Result<T>, Option<Told>) {
    let judgement = judgement.map_err(|error| failure::typed(error, &options::typed()));
    let told = judgement.as_ref().err().map(Told::of);
    (judgement, told)
}

/// A result of `verb` in one line: one of many. Empty for a value that has no JSON form; none of this tool's.
pub fn line(verb: &'static str, value: impl Serialize) -> String {
    serde_json::to_string(&named(verb, value)).unwrap_or_default()
}

/// Prints why there is no result, where none was printed; in one line, as one of many.
///
/// # Errors
/// As [`print()`].
pub fn print_failure(error: &anyhow::Error) -> Result<()> {
    if PRINTED.load(Ordering::Relaxed) {
        return Ok(());
    }
    let text = serde_json::to_string(&named("failure", Told::of(error)))?;
    out::line(format_args!("{text}"));
    Ok(())
}
