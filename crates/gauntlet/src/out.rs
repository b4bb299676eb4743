//! Printing that outlives its reader: `gauntlet … | head` ends quietly, not in a panic.

use std::fmt::Arguments;
use std::io::{ErrorKind, Write};
use std::sync::OnceLock;

use anyhow::Result;

use crate::failure::Failure;

/// The first error of standard output, of this process.
static FAULT: OnceLock<std::io::Error> = OnceLock::new();

/// One line to standard output. What goes wrong is kept for [`closed`] and [`check`].
pub fn line(text: Arguments<'_>) {
    let mut stdout = std::io::stdout().lock();
    if let Err(error) = writeln!(stdout, "{text}").and_then(|()| stdout.flush()) {
        // Only the first counts.
        let _ = FAULT.set(error);
    }
}

/// Whether standard output takes nothing any more: its reader left, or its disk is full.
pub fn closed() -> bool {
    FAULT.get().is_some()
}

/// Whether everything was printed. A reader that left had enough: no error.
///
/// # Errors
/// A failure where the system took a line for another reason not.
pub fn check() -> Result<()> {
    match FAULT.get() {
        Some(error) if error.kind() != ErrorKind::BrokenPipe => Err(Failure::new(
            format!("standard output took not all of the result: {error}"),
            "a place with room",
        )
        .into()),
        _ => Ok(()),
    }
}

/// One line to standard error.
pub fn note(text: Arguments<'_>) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}

/// A question to standard error, the cursor left behind it.
pub fn ask(text: Arguments<'_>) {
    let mut stderr = std::io::stderr().lock();
    let _ = write!(stderr, "{text}").and_then(|()| stderr.flush());
}

/// One line to standard output.
#[macro_export]
macro_rules! say {
    ($($argument:tt)*) => { $crate::out::line(format_args!($($argument)*)) };
}

/// One line to standard error.
#[macro_export]
macro_rules! note {
    ($($argument:tt)*) => { $crate::out::note(format_args!($($argument)*)) };
}

/// A result as JSON on standard output, indented.
///
/// # Errors
/// A value that has no JSON form; none of this tool's.
pub fn json(value: &impl serde::Serialize) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(value)?;
    line(format_args!("{text}"));
    Ok(())
}
