//! Printing that never holds up the program, and outlives its reader: `gauntlet … | head` ends quietly, not in a panic.
//!
//! Each stream has a queue and a thread that writes it (`out::stream`). A terminal that takes nothing (its reader stands, a
//! full pipe) stops that thread alone: whoever drives a gripper goes on, and sees through [`unseen`] that nobody sees.

mod stream;

use std::fmt::Arguments;
use std::io::{ErrorKind, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Result;

use host::failure::Failure;
use host::interrupt;
use stream::{STDERR, STDOUT};

/// What one stream may wait for the other, so that lines keep their order on a terminal that shows both.
const SETTLE: Duration = Duration::from_millis(50);
/// At the end of a run or after Ctrl-C: a stream that took nothing for so long is given up.
const GIVE_UP: Duration = Duration::from_secs(2);
/// Pause between two looks at whether somebody asked for the end.
const LOOK: Duration = Duration::from_millis(50);

/// Whether this process drove something: then its end does not wait for ever for a reader.
static DROVE: AtomicBool = AtomicBool::new(false);

/// One line to standard output. What goes wrong is kept for [`reader_left`] and [`check`].
pub fn line(text: Arguments<'_>) {
    STDERR.settle(SETTLE);
    STDOUT.push((harmless(text) + "\n").as_bytes());
}

/// The text with what would steer a terminal written out: a file's or a device's words may hold anything.
fn harmless(text: Arguments<'_>) -> String {
    let mut shown = String::new();
    for character in text.to_string().chars() {
        match character {
            '\n' | '\t' => shown.push(character),
            _ if character.is_control() => shown.extend(character.escape_default()),
            _ => shown.push(character),
        }
    }
    shown
}

/// Whether a person sits at a terminal that can be drawn on, and has keys.
pub fn is_drawn() -> bool {
    use std::io::IsTerminal;
    std::io::stdin().is_terminal() && std::io::stdout().is_terminal()
}

/// Rings the terminal's bell.
pub fn bell() {
    STDOUT.push(b"\x07");
}

/// Whether standard output's reader left: a run that nobody sees had better end.
///
/// # Errors
/// A failure where it takes nothing for another reason, such as a full disk.
pub fn reader_left() -> Result<bool> {
    match STDOUT.fault() {
        Some(_) => check().map(|()| true),
        None => Ok(false),
    }
}

/// How long standard output has not taken what waits for it; zero where nothing waits.
pub fn unseen() -> Duration {
    STDOUT.stalled().unwrap_or_default()
}

/// Whether something still waits for standard output: what is newer had better wait, too.
pub fn pending() -> bool {
    STDOUT.stalled().is_some()
}

/// Waits until standard output took everything, for `time` at most.
pub fn settle(time: Duration) {
    STDOUT.settle(time);
}

/// This process drives something: from here on its end waits for no reader longer than two seconds.
pub fn hurry() {
    DROVE.store(true, Ordering::Relaxed);
}

/// Waits until everything was printed, and says whether it was. A reader that left had enough: no error.
///
/// # Errors
/// A failure where the system took a line for another reason not.
pub fn check() -> Result<()> {
    let whole = drain(&STDOUT);
    let next = "a place with room";
    match STDOUT.fault() {
        Some((ErrorKind::BrokenPipe, _)) => Ok(()),
        // The terminal was closed: nobody is there to be told.
        Some((_, Some(code))) if code == rustix::io::Errno::IO.raw_os_error() => Ok(()),
        Some((kind, code)) => {
            let error = code.map_or_else(|| kind.into(), std::io::Error::from_raw_os_error);
            let what = format!("standard output took not all of the result: {error}");
            Err(Failure::new(what, next).into())
        }
        None if !whole => Err(Failure::new(
            format!(
                "standard output took not all of the result: nothing for {} s",
                GIVE_UP.as_secs()
            ),
            "a terminal or a program that reads it",
        )
        .into()),
        None => Ok(()),
    }
}

/// Waits until standard error took everything; no longer than it is worth.
pub fn finish() {
    drain(&STDERR);
}

/// Whether all was taken. Given up where nothing moves for [`GIVE_UP`], and either something was driven or somebody asked
/// for the end; a result for a pager waits as long as its reader reads.
fn drain(stream: &'static stream::Stream) -> bool {
    loop {
        if stream.settle(LOOK) {
            return true;
        }
        let impatient = DROVE.load(Ordering::Relaxed) || interrupt::process_was_asked();
        if impatient && stream.stalled().is_some_and(|time| time >= GIVE_UP) {
            return false;
        }
    }
}

/// One line to standard error.
pub fn note(text: Arguments<'_>) {
    STDOUT.settle(SETTLE);
    STDERR.push((harmless(text) + "\n").as_bytes());
}

/// A question to standard error, the cursor left behind it.
pub fn ask(text: Arguments<'_>) {
    STDOUT.settle(SETTLE);
    STDERR.push(harmless(text).as_bytes());
}

/// A picture of how something goes to standard error: dropped where the one before was not taken, and never waited for.
pub fn sketch(bytes: &[u8]) {
    STDERR.offer(bytes);
}

/// Standard output as a writer of whole pictures: what is written leaves with the next flush.
#[derive(Debug, Default)]
pub struct Screen(Vec<u8>);

impl Write for Screen {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        STDOUT.push(&std::mem::take(&mut self.0));
        Ok(())
    }
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

#[cfg(test)]
mod tests {
    use super::harmless;

    #[test]
    fn what_would_steer_a_terminal_is_written_out() {
        let foreign = "library \u{1b}]0;title\u{7}\u{1b}[2J\r\u{9b}1m, a tab\tand ß\nnext";
        assert_eq!(
            harmless(format_args!("{foreign}")),
            "library \\u{1b}]0;title\\u{7}\\u{1b}[2J\\r\\u{9b}1m, a tab\tand ß\nnext"
        );
    }
}
