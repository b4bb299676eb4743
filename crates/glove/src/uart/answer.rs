//! What a sensor in UART mode answers, by its bytes.

use crate::bus::MESSAGE_MAX;

/// First byte of a command.
pub const COMMAND: u8 = 0xAA;
/// Second byte: write.
pub const WRITE: u8 = 0x00;
/// Second byte: read.
pub const READ: u8 = 0x01;
/// First byte of an answer with data.
const DATA: u8 = 0xBB;
/// First byte of an answer without: a status follows.
const STATUS: u8 = 0xEE;

/// Bytes before an answer's data, and length of one without.
pub const HEAD: usize = 2;

/// Longest answer.
pub const LONGEST: usize = HEAD + MESSAGE_MAX;

/// Statuses of an answer without data.
pub mod status {
    /// A write is done.
    pub const DONE: u8 = 0x01;
    /// A read failed.
    pub const READ_FAILED: u8 = 0x02;
    /// A write failed.
    pub const WRITE_FAILED: u8 = 0x03;
    /// No such register.
    pub const NO_REGISTER: u8 = 0x04;
    /// The register cannot be written.
    pub const NOT_WRITABLE: u8 = 0x05;
    /// The first byte was not AA.
    pub const WRONG_START: u8 = 0x06;
    /// Bytes came faster than the sensor took them.
    pub const OVERRUN: u8 = 0x07;
    /// Longer than 128 bytes.
    pub const TOO_LONG: u8 = 0x08;
    /// No bytes asked for.
    pub const TOO_SHORT: u8 = 0x09;
    /// The rest of a command did not come.
    pub const TIMEOUT: u8 = 0x0A;
}

/// What is to be answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Expected {
    /// Bytes of data; 0 for a write.
    pub data: usize,
    /// The command resets the sensor, which then answers nothing.
    pub resets: bool,
}

impl Expected {
    /// Bytes of the whole answer.
    pub fn bytes(self) -> usize {
        HEAD + self.data
    }
}

/// What the bytes so far are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer<'a> {
    /// More are to come.
    Incomplete,
    /// The data asked for; none for a write that is done.
    Data(&'a [u8]),
    /// Refused, and the status.
    Refused(u8),
    /// No answer to this.
    Garbled,
}

impl Answer<'_> {
    /// Reads the bytes that have come.
    pub fn of(received: &[u8], expected: Expected) -> Answer<'_> {
        match received {
            [] | [STATUS] => Answer::Incomplete,
            [DATA] if expected.data > 0 => Answer::Incomplete,
            [STATUS, status::DONE] if expected.data == 0 => Answer::Data(&[]),
            [STATUS, status::DONE] => Answer::Garbled,
            [STATUS, code] => Answer::Refused(*code),
            [DATA, count, data @ ..]
                if expected.data > 0 && usize::from(*count) == expected.data =>
            {
                match data.len().cmp(&expected.data) {
                    core::cmp::Ordering::Less => Answer::Incomplete,
                    core::cmp::Ordering::Equal => Answer::Data(data),
                    core::cmp::Ordering::Greater => Answer::Garbled,
                }
            }
            _ => Answer::Garbled,
        }
    }
}

/// Whether the same command may well be taken a moment later.
pub fn may_pass(code: u8) -> bool {
    matches!(
        code,
        status::READ_FAILED
            | status::WRITE_FAILED
            | status::WRONG_START
            | status::OVERRUN
            | status::TIMEOUT
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_all_first_two_bytes_only_the_right_ones_are_an_answer() {
        for (first, second) in (0..=255).flat_map(|a| (0..=255).map(move |b| (a, b))) {
            let of = |data| {
                let expected = Expected {
                    data,
                    resets: false,
                };
                match Answer::of(&[first, second], expected) {
                    Answer::Data(_) => 'd',
                    Answer::Incomplete => 'i',
                    Answer::Refused(code) if code == second => 'r',
                    Answer::Refused(_) => '!',
                    Answer::Garbled => 'g',
                }
            };
            let to_write = match (first, second) {
                (0xEE, 0x01) => 'd',
                (0xEE, _) => 'r',
                _ => 'g',
            };
            let to_read = match (first, second) {
                (0xEE, 0x01) => 'g',
                (0xEE, _) => 'r',
                (0xBB, 8) => 'i',
                _ => 'g',
            };
            assert_eq!(
                (of(0), of(8)),
                (to_write, to_read),
                "{first:02X} {second:02X}"
            );
        }
    }

    #[test]
    fn a_read_is_answered_by_as_many_bytes_as_were_asked_for() {
        let expected = Expected {
            data: 2,
            resets: false,
        };
        assert_eq!(Answer::of(&[0xBB], expected), Answer::Incomplete);
        assert_eq!(Answer::of(&[0xBB, 2, 7], expected), Answer::Incomplete);
        assert_eq!(
            Answer::of(&[0xBB, 2, 7, 9], expected),
            Answer::Data(&[7, 9])
        );
        assert_eq!(Answer::of(&[0xBB, 2, 7, 9, 1], expected), Answer::Garbled);
    }
}
