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
