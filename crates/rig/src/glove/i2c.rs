//! The glove's I2C bus without the serial bridge, as a computer's own I2C port shows it: a blocking `embedded-hal` bus.

use embedded_hal::i2c::{ErrorKind, ErrorType, I2c, NoAcknowledgeSource, Operation};

use super::VirtualGlove;
use super::bus::{Segment, Status, Timing};
use crate::clock::lock;
use crate::{Clock, Duration};

/// After this long a port gives a hung bus up (an adapter of Linux waits a second, or what it is told).
pub const GIVES_UP: Duration = Duration::from_millis(20);

/// The multiplexer and its 16 sensors on an I2C port. A transaction takes its time on `clock`.
#[derive(Clone)]
pub struct I2cPort {
    glove: VirtualGlove,
    clock: Clock,
    bit_ns: u64,
}

impl VirtualGlove {
    /// The glove's I2C bus as a port of `hz` clocks a second.
    #[must_use]
    pub fn i2c(&self, clock: &Clock, hz: u32) -> I2cPort {
        I2cPort {
            glove: self.clone(),
            clock: clock.clone(),
            bit_ns: 1_000_000_000 / u64::from(hz.max(1)),
        }
    }
}

impl ErrorType for I2cPort {
    type Error = ErrorKind;
}

impl I2c for I2cPort {
    fn transaction(
        &mut self,
        address: u8,
        operations: &mut [Operation<'_>],
    ) -> Result<(), ErrorKind> {
        let segments: Vec<Segment> = operations.iter().map(|o| segment(address, o)).collect();
        let timing = Timing {
            bit_ns: self.bit_ns,
            timeout: Some(GIVES_UP),
        };
        let now = self.clock.now();
        let nobody = ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address);
        if lock(&self.glove.state).off {
            return Err(nobody);
        }
        let outcome = self
            .glove
            .with(|_, bus, orientation| bus.run(&segments, now, timing, orientation))
            .flatten()
            .ok_or(ErrorKind::Other)?;
        self.clock.advance(outcome.takes);
        match outcome.status {
            Status::Done => {}
            Status::NackAddress => return Err(nobody),
            Status::NackData => {
                return Err(ErrorKind::NoAcknowledge(NoAcknowledgeSource::Data));
            }
            Status::TimedOut => return Err(ErrorKind::Bus),
        }
        if outcome.mute {
            return Err(ErrorKind::Other);
        }
        let mut answer = outcome.answer.into_iter();
        for operation in operations {
            if let Operation::Read(buffer) = operation {
                for slot in buffer.iter_mut() {
                    *slot = answer.next().ok_or(ErrorKind::Overrun)?;
                }
            }
        }
        Ok(())
    }
}

fn segment(address: u8, operation: &Operation<'_>) -> Segment {
    match operation {
        Operation::Read(buffer) => Segment::Read {
            address,
            count: buffer.len(),
        },
        Operation::Write(bytes) => Segment::Write {
            address,
            bytes: bytes.to_vec(),
        },
    }
}
