//! Printing that outlives its reader: `gauntlet … | head` ends quietly, not in a panic.

use std::fmt::Arguments;
use std::io::Write;

/// One line to standard output. A reader that left is not an error.
pub fn line(text: Arguments<'_>) {
    let mut stdout = std::io::stdout().lock();
    let _ = writeln!(stdout, "{text}").and_then(|()| stdout.flush());
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
