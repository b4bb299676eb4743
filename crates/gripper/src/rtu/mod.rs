//! Modbus RTU frames: the bytes of requests and replies, for a master and for a slave.
//!
//! Follows "MODBUS over Serial Line" 1.02 and "MODBUS Application Protocol" 1.1b3 for the function
//! codes Robotiq grippers use: 03, 04, 06, 16 and 23, and exceptions. A [`Frame`] is a checked view
//! (length and CRC); [`Request`] and [`Response`] are small values with `parse`, `emit` and
//! `buffer_len`. Both also come as bare PDUs (`parse_pdu`, `emit_pdu`), the part Modbus TCP shares.
//!
//! Nothing here knows time, a port or the meaning of a register.

mod request;
mod response;

pub use request::Request;
pub use response::{Exception, Response};

/// Longest frame on a serial line, bytes (address + 253-byte PDU + CRC).
pub const MAX_FRAME: usize = 256;
/// Shortest frame: address, function code, CRC.
pub const MIN_FRAME: usize = 4;
/// Length of an exception reply, bytes.
pub const EXCEPTION_FRAME: usize = 5;
/// Most registers one FC03, FC04 or FC23 may read.
pub const MAX_READ: u16 = 125;
/// Most registers one FC16 may write.
pub const MAX_WRITE: u16 = 123;
/// Most registers one FC23 may write.
pub const MAX_READ_WRITE: u16 = 121;

/// Function codes by name.
pub mod function {
    /// Read holding registers.
    pub const READ_HOLDING: u8 = 0x03;
    /// Read input registers.
    pub const READ_INPUT: u8 = 0x04;
    /// Write single register.
    pub const WRITE_SINGLE: u8 = 0x06;
    /// Write multiple registers.
    pub const WRITE_MULTIPLE: u8 = 0x10;
    /// Read/write multiple registers.
    pub const READ_WRITE: u8 = 0x17;
    /// Set in the function code of an exception reply.
    pub const EXCEPTION: u8 = 0x80;
}

const CRC: crc::Crc<u16> = crc::Crc::<u16>::new(&crc::CRC_16_MODBUS);

/// CRC-16/MODBUS of `bytes` (polynomial 0xA001 reflected, initial 0xFFFF). Sent low byte first.
#[must_use]
pub fn crc16(bytes: &[u8]) -> u16 {
    CRC.checksum(bytes)
}

/// Why bytes are not the frame they should be, or a frame cannot be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// Fewer bytes than the structure needs.
    Short {
        /// Bytes needed at least.
        needed: usize,
        /// Bytes there.
        found: usize,
    },
    /// More bytes than the structure has.
    Long {
        /// Bytes the structure has.
        expected: usize,
        /// Bytes there.
        found: usize,
    },
    /// The last two bytes are not the CRC of the rest.
    Crc {
        /// CRC computed over the frame.
        computed: u16,
        /// CRC found in the frame.
        found: u16,
    },
    /// A function code this codec does not speak.
    Function(u8),
    /// A register count outside what the function code allows.
    Quantity(u16),
    /// The byte count does not fit the register count.
    ByteCount(u8),
    /// The buffer given is too small to write the frame.
    Buffer {
        /// Bytes needed.
        needed: usize,
        /// Bytes given.
        given: usize,
    },
}

impl core::fmt::Display for Error {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match *self {
            Self::Short { needed, found } => {
                write!(f, "{found} bytes where at least {needed} are needed")
            }
            Self::Long { expected, found } => {
                write!(f, "{found} bytes where {expected} are expected")
            }
            Self::Crc { computed, found } => {
                write!(
                    f,
                    "CRC {found:04X} in the frame, {computed:04X} computed over it"
                )
            }
            Self::Function(code) => {
                write!(f, "function code {code:02X} is not 03, 04, 06, 10 or 17")
            }
            Self::Quantity(n) => write!(
                f,
                "{n} registers are more or fewer than the function allows"
            ),
            Self::ByteCount(n) => write!(f, "byte count {n} does not fit the register count"),
            Self::Buffer { needed, given } => {
                write!(f, "the frame needs {needed} bytes, the buffer has {given}")
            }
        }
    }
}

impl core::error::Error for Error {}

/// A frame whose length and CRC have been checked. The bytes are borrowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a>(&'a [u8]);

impl<'a> Frame<'a> {
    /// Checks `bytes` as one whole frame: 4 to 256 bytes, CRC right.
    ///
    /// # Errors
    /// [`Error::Short`], [`Error::Long`] or [`Error::Crc`].
    pub fn new_checked(bytes: &'a [u8]) -> Result<Self, Error> {
        let found = bytes.len();
        if found > MAX_FRAME {
            return Err(Error::Long {
                expected: MAX_FRAME,
                found,
            });
        }
        let (body, crc) = match bytes.split_last_chunk::<2>() {
            Some((body, crc)) if body.len() + 2 >= MIN_FRAME => (body, u16::from_le_bytes(*crc)),
            _ => {
                return Err(Error::Short {
                    needed: MIN_FRAME,
                    found,
                });
            }
        };
        let computed = crc16(body);
        if computed != crc {
            return Err(Error::Crc {
                computed,
                found: crc,
            });
        }
        Ok(Self(bytes))
    }

    /// The slave's address, 0 to 255 (Robotiq's default is 9).
    #[must_use]
    pub fn unit(&self) -> u8 {
        self.0.first().copied().unwrap_or(0)
    }

    /// The function code, with bit 7 set in an exception reply.
    #[must_use]
    pub fn function(&self) -> u8 {
        self.0.get(1).copied().unwrap_or(0)
    }

    /// The protocol data unit: function code and data, without address and CRC.
    #[must_use]
    pub fn pdu(&self) -> &'a [u8] {
        self.0.get(1..self.0.len().saturating_sub(2)).unwrap_or(&[])
    }
}

/// Registers as they lie in a frame: big-endian 16-bit values, borrowed. Robotiq manuals number the
/// bytes of this very order (register k = byte 2k << 8 | byte 2k+1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Registers<'a>(&'a [u8]);

impl<'a> Registers<'a> {
    /// Registers from their bytes; `None` for an odd number of bytes or more than 125 registers.
    #[must_use]
    pub fn from_bytes(bytes: &'a [u8]) -> Option<Self> {
        (bytes.len().is_multiple_of(2) && bytes.len() <= 2 * MAX_READ as usize)
            .then_some(Self(bytes))
    }

    /// The bytes, high byte of register 0 first.
    #[must_use]
    pub fn bytes(&self) -> &'a [u8] {
        self.0
    }

    /// Number of registers.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.len() / 2
    }

    /// Whether there is no register.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Register `index`.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<u16> {
        self.0
            .as_chunks::<2>()
            .0
            .get(index)
            .map(|pair| u16::from_be_bytes(*pair))
    }

    /// The registers in order.
    pub fn iter(&self) -> impl Iterator<Item = u16> + 'a {
        self.0
            .as_chunks::<2>()
            .0
            .iter()
            .map(|pair| u16::from_be_bytes(*pair))
    }

    /// The number of registers as it stands in a frame.
    pub(crate) fn quantity(&self) -> u16 {
        // At most 125 by construction.
        (self.0.len() / 2) as u16
    }
}

/// Writes bytes one after the other into a slice whose room was checked before.
struct Writer<'b> {
    out: &'b mut [u8],
    at: usize,
}

impl<'b> Writer<'b> {
    /// A PDU of `needed` bytes that begins with this function code.
    fn new(out: &'b mut [u8], needed: usize, function: u8) -> Result<Self, Error> {
        let given = out.len();
        if given < needed {
            return Err(Error::Buffer { needed, given });
        }
        let mut writer = Self { out, at: 0 };
        writer.put(&[function]);
        Ok(writer)
    }

    fn put(&mut self, bytes: &[u8]) {
        if let Some(room) = self.out.get_mut(self.at..self.at + bytes.len()) {
            room.copy_from_slice(bytes);
        }
        self.at += bytes.len();
    }

    fn put_u16(&mut self, value: u16) {
        self.put(&value.to_be_bytes());
    }

    /// A register and a second word: its value, or how many.
    fn put_pair(&mut self, address: u16, second: u16) {
        self.put_u16(address);
        self.put_u16(second);
    }

    /// A byte count and the bytes.
    fn put_counted(&mut self, values: Registers<'_>) {
        self.put(&[(2 * values.quantity()) as u8]);
        self.put(values.bytes());
    }
}

/// Puts address and CRC around the PDU that `emit_pdu` writes.
fn emit_frame(
    unit: u8,
    length: usize,
    out: &mut [u8],
    emit_pdu: impl FnOnce(&mut [u8]) -> Result<usize, Error>,
) -> Result<usize, Error> {
    let given = out.len();
    let frame = out.get_mut(..length).ok_or(Error::Buffer {
        needed: length,
        given,
    })?;
    if let Some((first, rest)) = frame.split_first_mut() {
        *first = unit;
        emit_pdu(rest)?;
    }
    if let Some((body, crc)) = frame.split_last_chunk_mut::<2>() {
        *crc = crc16(body).to_le_bytes();
    }
    Ok(length)
}

fn u16_at(bytes: &[u8], at: usize) -> Result<u16, Error> {
    match bytes.get(at..at + 2) {
        Some(&[high, low]) => Ok(u16::from_be_bytes([high, low])),
        _ => Err(Error::Short {
            needed: at + 2,
            found: bytes.len(),
        }),
    }
}

/// The function code that a PDU begins with.
fn code_of(pdu: &[u8]) -> Result<u8, Error> {
    pdu.first().copied().ok_or(Error::Short {
        needed: 1,
        found: 0,
    })
}

/// The two words of a PDU that has nothing else behind its function code.
fn pair_of(pdu: &[u8]) -> Result<(u16, u16), Error> {
    exact(pdu, 5)?;
    Ok((u16_at(pdu, 1)?, u16_at(pdu, 3)?))
}

fn exact(bytes: &[u8], expected: usize) -> Result<(), Error> {
    let found = bytes.len();
    match found.cmp(&expected) {
        core::cmp::Ordering::Less => Err(Error::Short {
            needed: expected,
            found,
        }),
        core::cmp::Ordering::Greater => Err(Error::Long { expected, found }),
        core::cmp::Ordering::Equal => Ok(()),
    }
}

fn quantity(value: u16, most: u16) -> Result<u16, Error> {
    if value == 0 || value > most {
        Err(Error::Quantity(value))
    } else {
        Ok(value)
    }
}
