//! One question on a port, and whatever comes back with its times, byte by byte: the drivers would hide what is wrong.

use std::time::{Duration, Instant};

use embedded_io::{Read, ReadReady, Write};

use crate::interrupt::Interrupt;
use crate::lines::port::Port;

/// Silence that ends an answer: longer than an adapter's 16 ms latency timer.
const QUIET: Duration = Duration::from_millis(20);
/// Silence after bytes that are no answer, after which none is expected: a slow tunnel pauses between its pieces.
const GIVEN_UP: Duration = Duration::from_millis(150);
/// Pause between two looks.
const LOOK: Duration = Duration::from_millis(1);
/// More bytes than this are no answer to anything asked here.
const MOST: usize = 512;

/// What came after a question.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Heard {
    /// The bytes.
    pub bytes: Vec<u8>,
    /// From the question to the first byte that is no echo of it.
    pub first: Duration,
    /// From the question to the last byte of the answer; to the last byte where none came.
    pub last: Duration,
}

/// What is still to be expected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Expect {
    /// The answer: these bytes are none, or only its beginning.
    Answer,
    /// Nothing: the answer is there.
    Nothing,
    /// The answer, however long it takes: these bytes are the adapter's own echo.
    AnswerAfterEcho,
}

/// Sends `bytes` and collects what comes, until nothing more is expected, for `wait` at most whatever comes.
pub fn ask(
    port: &mut Port,
    bytes: &[u8],
    wait: Duration,
    interrupt: &Interrupt,
    expect: impl Fn(&[u8]) -> Expect,
) -> Heard {
    discard(port);
    let mut heard = Heard::default();
    if port.write(bytes) != Ok(bytes.len()) {
        return heard;
    }
    collect(port, &mut heard, wait, interrupt, expect);
    heard
}

/// Listens for `time`, or until more came than anybody says unasked.
pub fn listen(port: &mut Port, time: Duration, interrupt: &Interrupt) -> Vec<u8> {
    let mut heard = Heard::default();
    let expect = |_: &[u8]| Expect::AnswerAfterEcho;
    collect(port, &mut heard, time, interrupt, expect);
    heard.bytes
}

fn collect(
    port: &mut Port,
    heard: &mut Heard,
    wait: Duration,
    interrupt: &Interrupt,
    expect: impl Fn(&[u8]) -> Expect,
) {
    let start = Instant::now();
    let mut last = start;
    let mut expected = Expect::Answer;
    while start.elapsed() < wait && heard.bytes.len() < MOST {
        let mut chunk = [0; 64];
        if port.read_ready() == Ok(true)
            && let Ok(count) = port.read(&mut chunk)
        {
            heard.bytes.extend_from_slice(&chunk[..count]);
            last = Instant::now();
            if heard.bytes.len() == count || expected == Expect::AnswerAfterEcho {
                heard.first = start.elapsed();
            }
            // What comes after the answer does not make it late.
            if expected != Expect::Nothing {
                heard.last = start.elapsed();
            }
            expected = expect(&heard.bytes);
            continue;
        }
        let quiet = last.elapsed();
        let over = match expected {
            Expect::Nothing => quiet >= QUIET,
            Expect::Answer => !heard.bytes.is_empty() && quiet >= GIVEN_UP,
            Expect::AnswerAfterEcho => false,
        };
        if over || interrupt.sleep(LOOK) {
            return;
        }
    }
}

/// Throws away what is there, 4 kB at most.
fn discard(port: &mut Port) {
    for _ in 0..64 {
        if port.read_ready() != Ok(true) || port.read(&mut [0; 64]).is_err() {
            return;
        }
    }
}

/// The text in these bytes, where they are text: what a console or a log says.
pub fn text(bytes: &[u8]) -> Option<String> {
    let readable =
        |byte: &&u8| byte.is_ascii_graphic() || matches!(byte, b' ' | b'\r' | b'\n' | b'\t');
    let count = bytes.iter().filter(readable).count();
    // Noise has one readable byte in three.
    if bytes.len() < 4 || count * 10 < bytes.len() * 9 {
        return None;
    }
    let words = String::from_utf8_lossy(bytes);
    let clean: String = words.chars().filter(|c| !c.is_control()).take(40).collect();
    Some(clean.trim().to_owned())
}

/// Bytes as a person writes them, eight at most.
pub fn hex(bytes: &[u8]) -> String {
    let shown: Vec<String> = bytes.iter().take(8).map(|b| format!("{b:02X}")).collect();
    let more = if bytes.len() > 8 { " …" } else { "" };
    format!("{}{more}", shown.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_told_from_noise() {
        assert_eq!(text(b"login: \r\n"), Some("login:".to_owned()));
        assert_eq!(text(&[9, 3, 6, 0x31, 0, 0, 1, 2, 3]), None);
        assert_eq!(text(b"ok"), None);
        let long = "boot ".repeat(30);
        assert!(text(long.as_bytes()).is_some_and(|text| text.len() <= 40));
    }

    #[test]
    fn bytes_are_written_as_hexadecimal_and_not_without_end() {
        assert_eq!(hex(&[0, 0xFF]), "00 FF");
        assert!(hex(&[1; 100]).ends_with('…'));
    }
}
