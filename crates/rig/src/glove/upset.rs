//! One message on the I2C bus that goes wrong: which one, how, and whom it met.

use crate::Duration;

/// How long a bridge is mute that an upset makes so.
pub(super) const MUTE: Duration = Duration::from_millis(4);

/// How a message on the I2C bus goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Upset {
    /// Nobody acknowledges the address; nothing is done.
    NackAddress,
    /// The first data byte is not acknowledged; nothing is done.
    NackData,
    /// The bus hangs until whoever drives it gives up; nothing is done.
    TimedOut,
    /// Nothing is done, and nobody is told: what it would have read does not come.
    Ignored,
    /// It is done, but of what it read only so many bytes come: 0 is silence.
    Short(usize),
    /// It is done, but whoever drives the bus says nothing for 4 ms: no data, no status.
    Mute,
    /// It is done, but one bit of what it read comes flipped.
    Flipped {
        /// Which byte of the answer; the last one if it has fewer.
        byte: usize,
        /// Which bit, 0 to 7.
        bit: u8,
    },
}

impl Upset {
    /// Spoils what was read.
    pub(super) fn spoil(self, answer: &mut Vec<u8>) {
        match self {
            Self::Short(count) => answer.truncate(count),
            Self::Flipped { byte, bit } => {
                let last = answer.len().saturating_sub(1);
                if let Some(byte) = answer.get_mut(byte.min(last)) {
                    *byte ^= 1 << (bit & 7);
                }
            }
            Self::NackAddress | Self::NackData | Self::TimedOut | Self::Ignored | Self::Mute => {}
        }
    }
}

/// Whom an upset message was for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Met {
    /// The sensor; `None` is the multiplexer.
    pub sensor: Option<usize>,
    /// The sensor's register: the one written, or where its pointer stood.
    pub register: Option<u8>,
    /// Bytes that it was to read.
    pub reads: usize,
}

/// The one message that is to go wrong.
#[derive(Debug, Default)]
pub(super) struct Upsets {
    at: Option<(u64, Upset)>,
    met: Option<Met>,
}

impl Upsets {
    /// Message `number` goes wrong so.
    pub fn of(number: u64, upset: Upset) -> Self {
        Self {
            at: Some((number, upset)),
            met: None,
        }
    }

    /// Whom it was for, if it has come.
    pub fn whom(&self) -> Option<Met> {
        self.met
    }

    pub fn due(&self, number: u64) -> Option<Upset> {
        self.at
            .filter(|(at, _)| *at == number)
            .map(|(_, upset)| upset)
    }

    pub fn met(&mut self, met: Met) {
        self.met = Some(met);
    }
}
