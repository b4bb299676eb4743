//! The host of a recorded trace: a script of requests, by the bridge's time.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use bridge::protocol::frame;
use bridge::protocol::message::{CHUNK, Call, Request, VERSION};
use crc::{CRC_32_ISO_HDLC, Crc};
use embedded_io::{ErrorType, Read, ReadReady, Write};
use glove::calibration::Bound;

const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
const SESSION: u32 = 7;
/// Time between two requests of the host, µs: what a chunk takes on the line, and its reply.
const REQUEST_EVERY: u64 = 60_000;
const BEAT: u64 = 100_000;
/// Glove and gripper are up by then, µs.
const UP: u64 = 6_000_000;
/// The glove was calibrated on a flat hand by then, µs.
pub(super) const CALIBRATED: u64 = 14_000_000;
/// Time between two calibrations, µs: the longest a try takes.
const CALIBRATE_EVERY: u64 = 2_100_000;
/// The virtual gripper has activated by then, µs.
pub(super) const ACTIVE: u64 = 20_000_000;

/// Bytes from the host; what the bridge says is not looked at.
#[derive(Clone, Default)]
pub(super) struct HostLine(Rc<RefCell<VecDeque<u8>>>);

impl ErrorType for HostLine {
    type Error = core::convert::Infallible;
}

impl ReadReady for HostLine {
    fn read_ready(&mut self) -> Result<bool, Self::Error> {
        Ok(!self.0.borrow().is_empty())
    }
}

impl Read for HostLine {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Self::Error> {
        let mut bytes = self.0.borrow_mut();
        let count = buffer.len().min(bytes.len());
        for (to, from) in buffer.iter_mut().zip(bytes.drain(..count)) {
            *to = from;
        }
        Ok(count)
    }
}

impl Write for HostLine {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

/// What the host says and when.
pub(super) struct Host<'i> {
    image: &'i [u8],
    /// The glove's profile, if it has one.
    profile: Vec<u8>,
    profile_offset: usize,
    sequence: u16,
    offset: usize,
    /// When it speaks next, µs.
    pub(super) due: u64,
    activated: bool,
    /// When it calibrates next.
    calibrate: u64,
    beats: u32,
    /// Engages said so far: the epoch, where none was lost.
    epoch: u32,
    until: u64,
    released: bool,
}

impl<'i> Host<'i> {
    pub(super) fn new(image: &'i [u8], profile: Option<&Bound>, seconds: u64) -> Self {
        Self {
            image,
            profile: profile.map_or_else(Vec::new, |profile| profile.to_bytes().to_vec()),
            profile_offset: 0,
            sequence: 0,
            offset: 0,
            due: 0,
            activated: false,
            calibrate: UP,
            beats: 0,
            epoch: 0,
            until: ACTIVE + seconds * 1_000_000,
            released: false,
        }
    }

    /// Says what is due at `now`.
    pub(super) fn speak(&mut self, now: u64, line: &HostLine) {
        if now < self.due {
            return;
        }
        self.due = now + REQUEST_EVERY;
        let image = self.image;
        if self.sequence == 0 {
            self.say(line, Call::Hello { version: VERSION });
        } else if self.sequence == 1 && !image.is_empty() {
            self.say(
                line,
                Call::WeightsBegin {
                    length: image.len() as u32,
                    crc: 0x5EED,
                },
            );
        } else if self.offset < image.len() {
            let end = (self.offset + CHUNK).min(image.len());
            let offset = self.offset as u32;
            let bytes = &image[self.offset..end];
            self.offset = end;
            self.say(line, Call::WeightsChunk { offset, bytes });
        } else if self.offset == image.len() && !image.is_empty() {
            self.offset += 1;
            self.say(line, Call::WeightsCommit);
        } else if self.profile_offset < self.profile.len() {
            let from = self.profile_offset;
            let bytes = self.profile[from..].to_vec();
            let bytes = &bytes[..bytes.len().min(CHUNK)];
            self.profile_offset = from + bytes.len();
            let offset = from as u32;
            self.say(line, Call::ProfileChunk { offset, bytes });
        } else if self.profile_offset == self.profile.len() && !self.profile.is_empty() {
            self.profile_offset += 1;
            let call = Call::ProfileCommit {
                length: self.profile.len() as u32,
                crc: CRC32.checksum(&self.profile),
            };
            self.say(line, call);
        } else if !self.activated && now >= UP {
            self.activated = true;
            self.say(line, Call::Activate);
        } else if now >= self.calibrate && now < CALIBRATED - CALIBRATE_EVERY {
            // More than once: on a line with faults a request may be lost, and a second with a lost sensor is refused.
            self.calibrate = now + CALIBRATE_EVERY;
            let call = if self.profile.is_empty() {
                Call::CalibrateStraight
            } else {
                Call::CalibrateFlatHand
            };
            self.say(line, call);
        } else if now < ACTIVE {
            // A line that is not clean: what is no frame is counted and passed over.
            line.0.borrow_mut().extend([0x55, 0x00, 0x13]);
            self.say(line, Call::Status);
            self.due = now + 10 * REQUEST_EVERY;
        } else if now < self.until {
            // Now and then a person closes it anew: one Engage may be lost.
            let call = if self.beats.is_multiple_of(10) {
                self.epoch += 1;
                Call::Engage
            } else {
                Call::Heartbeat { epoch: self.epoch }
            };
            self.beats += 1;
            self.say(line, call);
            self.due = now + BEAT;
        } else {
            let call = if self.released {
                Call::Counters
            } else {
                Call::Release
            };
            self.released = true;
            self.say(line, call);
        }
    }

    fn say(&mut self, line: &HostLine, call: Call<'_>) {
        self.sequence += 1;
        let request = Request {
            session: SESSION,
            sequence: self.sequence,
            call,
        };
        let mut scratch = [0; frame::SCRATCH];
        let length = postcard::to_slice(&request, &mut scratch[..frame::MAX_MESSAGE])
            .expect("a request fits")
            .len();
        let mut out = [0; frame::MAX_FRAME];
        let coded = frame::encode(&mut scratch, length, &mut out).expect("a message fits");
        let mut bytes = line.0.borrow_mut();
        bytes.push_back(0);
        bytes.extend(coded.iter());
    }
}
