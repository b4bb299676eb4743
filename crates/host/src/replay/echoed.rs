//! A gripper in a log that repeats what another bridge commands: its answers are those of the log, with the echo of the
//! commands put in. Else a bridge that commands something else would take the gripper for one that does not obey.

use bridge::trace::{Failed, Port, Source};
use crc::{CRC_16_MODBUS, Crc};
use embedded_io::{ErrorType, Read, ReadReady, Write};

const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_MODBUS);
/// First register of what the gripper is told, and of what it says.
const COMMAND: u16 = 0x03E8;
const STATUS: u16 = 0x07D0;
/// Bytes of an answer before its registers.
const HEAD: usize = 3;
/// Where the axes' positions are in both, from the first register: rPR and gPR.
const POSITIONS: [usize; 4] = [3, 6, 9, 12];

/// The line to such a gripper.
#[derive(Debug)]
pub(super) struct Echoed<'s, S> {
    port: Port<'s, S>,
    /// Echo in the log until it is first told something.
    told: [Option<u8>; 4],
    /// From which byte of the status on the answer to the newest request has it; `None` where it has none.
    from: Option<usize>,
    /// That answer so far: in the log, and with the echo.
    logged: Vec<u8>,
    given: Vec<u8>,
}

impl<'s, S: Source> Echoed<'s, S> {
    pub(super) fn new(port: Port<'s, S>) -> Self {
        Self {
            port,
            told: [None; 4],
            from: None,
            logged: Vec::new(),
            given: Vec::new(),
        }
    }

    fn asked(&mut self, request: &[u8]) {
        let word = |at: usize| {
            Some(u16::from_be_bytes([
                *request.get(at)?,
                *request.get(at + 1)?,
            ]))
        };
        let (start, written) = match request.get(1) {
            Some(0x03 | 0x04) => (word(2), None),
            Some(0x17) => (word(2), word(6).zip(request.get(11..))),
            Some(0x10) => (None, word(2).zip(request.get(7..))),
            _ => (None, None),
        };
        if let Some((COMMAND, data)) = written {
            for (told, place) in self.told.iter_mut().zip(POSITIONS) {
                // The last two bytes are the checksum.
                let is_there = place + 2 < data.len();
                *told = data.get(place).copied().filter(|_| is_there).or(*told);
            }
        }
        let offset = start.and_then(|start| start.checked_sub(STATUS));
        self.from = offset.map(|offset| 2 * usize::from(offset));
        self.logged.clear();
        self.given.clear();
    }

    /// The next byte of an answer. A checksum that is wrong in the log is wrong here, too.
    fn answer(&mut self, byte: u8) -> u8 {
        let (at, Some(from)) = (self.logged.len(), self.from) else {
            return byte;
        };
        let length = self
            .logged
            .get(2)
            .map_or(usize::MAX, |n| HEAD + usize::from(*n));
        let given = if at >= HEAD && at < length {
            let place = from + at - HEAD;
            let axis = POSITIONS.iter().position(|position| *position == place);
            axis.and_then(|axis| self.told[axis]).unwrap_or(byte)
        } else if at == length || at == length.saturating_add(1) {
            let sums = [&self.logged, &self.given].map(|bytes| {
                let frame = bytes.get(..length).unwrap_or_default();
                CRC.checksum(frame).to_le_bytes()
            });
            let [logged, given] = sums.map(|sum| sum[at - length]);
            byte ^ logged ^ given
        } else {
            byte
        };
        self.logged.push(byte);
        self.given.push(given);
        given
    }
}

impl<S> ErrorType for Echoed<'_, S> {
    type Error = Failed;
}

impl<S: Source> ReadReady for Echoed<'_, S> {
    fn read_ready(&mut self) -> Result<bool, Failed> {
        self.port.read_ready()
    }
}

impl<S: Source> Read for Echoed<'_, S> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Failed> {
        let count = self.port.read(buffer)?;
        for byte in buffer.iter_mut().take(count) {
            *byte = self.answer(*byte);
        }
        Ok(count)
    }
}

impl<S: Source> Write for Echoed<'_, S> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Failed> {
        self.asked(bytes);
        self.port.write(bytes)
    }

    fn flush(&mut self) -> Result<(), Failed> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bridge::trace::{Entry, GRIPPER, Loose, Recorder, Sink};

    struct Bytes(Vec<u8>);

    impl Sink for Bytes {
        fn put(&mut self, head: &[u8], body: &[u8]) {
            self.0.extend_from_slice(head);
            self.0.extend_from_slice(body);
        }
    }

    fn framed(mut bytes: Vec<u8>) -> Vec<u8> {
        let sum = CRC.checksum(&bytes).to_le_bytes();
        bytes.extend(sum);
        bytes
    }

    #[test]
    fn an_answer_repeats_what_was_commanded_with_a_right_checksum_and_a_wrong_one_stays_wrong() {
        let status: Vec<u8> = (0..16).collect();
        let answer = framed([&[9, 0x17, 16], &status[..]].concat());
        let mut wrong = answer.clone();
        wrong[20] ^= 0x40;
        let mut recorder = Recorder::new(Bytes(Vec::new()));
        for (at, bytes) in [(1_000, &answer), (2_000, &wrong)] {
            recorder.waited();
            recorder.clock(bridge::Instant::from_ticks(at));
            let port = GRIPPER;
            recorder.note(&Entry::Read { port, bytes });
        }
        let trace = recorder.release().0;
        let source = Loose::new(&trace);
        let mut line = Echoed::new(Port::new(&source, GRIPPER));
        let told: Vec<u8> = (100..116).collect();
        let head = [9, 0x17, 0x07, 0xD0, 0, 8, 0x03, 0xE8, 0, 8, 16];
        let request = framed([&head[..], &told].concat());
        let mut exchange = || {
            line.write(&request).unwrap();
            let mut found = Vec::new();
            let mut some = [0; 5];
            while line.read_ready().unwrap() {
                let count = line.read(&mut some).unwrap();
                found.extend_from_slice(&some[..count]);
            }
            source.wait_until(bridge::Instant::from_ticks(0));
            found
        };
        let mut echo = status;
        POSITIONS
            .iter()
            .for_each(|&place| echo[place] = told[place]);
        let expected = framed([&[9, 0x17, 16], &echo[..]].concat());
        assert_eq!(exchange(), expected);
        let mut damaged = expected;
        damaged[20] ^= 0x40;
        assert_eq!(exchange(), damaged);
    }
}
