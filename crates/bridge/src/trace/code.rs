//! Numbers and runs of bytes in a trace, written and read.

use heapless::Vec;

/// What a trace begins with.
pub const MAGIC: [u8; 6] = *b"GTRACE";
/// The version of this coding. A trace of another one is not read.
pub const VERSION: u8 = 1;
/// Bytes of an entry before its own: a tag, two numbers and a little.
const HEAD: usize = 32;

/// Why a trace cannot be read on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Damage {
    /// It ends within an entry.
    Cut,
    /// No entry begins so.
    Tag(u8),
    /// A number or a code that cannot be.
    Value,
    /// It is of another version.
    Version(u8),
}

impl core::fmt::Display for Damage {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Cut => f.write_str("it ends within an entry"),
            Self::Tag(tag) => write!(f, "no entry begins with {tag:#04x}"),
            Self::Value => f.write_str("an entry holds a value that cannot be"),
            Self::Version(version) => write!(
                f,
                "it is a trace of version {version}, and this program reads version {}",
                VERSION
            ),
        }
    }
}

impl core::error::Error for Damage {}

/// The first bytes of an entry.
#[derive(Debug, Default)]
pub(super) struct Head(Vec<u8, HEAD>);

impl Head {
    pub(super) fn bytes(&self) -> &[u8] {
        &self.0
    }

    pub(super) fn byte(&mut self, byte: u8) {
        // The longest head has 22 bytes.
        let _ = self.0.push(byte);
    }

    /// LEB128: seven bits a byte, the lowest first.
    pub(super) fn number(&mut self, mut number: u64) {
        while number >= 0x80 {
            self.byte(number as u8 | 0x80);
            number >>= 7;
        }
        self.byte(number as u8);
    }

    pub(super) fn counted<'b>(&mut self, bytes: &'b [u8]) -> &'b [u8] {
        self.number(bytes.len() as u64);
        bytes
    }
}

/// What is taken from the bytes of an entry.
#[derive(Debug)]
pub(super) struct Take<'t> {
    pub(super) rest: &'t [u8],
}

impl<'t> Take<'t> {
    pub(super) fn byte(&mut self) -> Result<u8, Damage> {
        let (byte, rest) = self.rest.split_first().ok_or(Damage::Cut)?;
        self.rest = rest;
        Ok(*byte)
    }

    pub(super) fn number(&mut self) -> Result<u64, Damage> {
        let mut number = 0_u64;
        for place in 0..10 {
            let byte = self.byte()?;
            let bits = u64::from(byte & 0x7F);
            let shifted = bits << (7 * place);
            if shifted >> (7 * place) != bits {
                return Err(Damage::Value);
            }
            number |= shifted;
            if byte & 0x80 == 0 {
                return Ok(number);
            }
        }
        Err(Damage::Value)
    }

    pub(super) fn bytes(&mut self, length: usize) -> Result<&'t [u8], Damage> {
        let (bytes, rest) = self.rest.split_at_checked(length).ok_or(Damage::Cut)?;
        self.rest = rest;
        Ok(bytes)
    }

    pub(super) fn counted(&mut self) -> Result<&'t [u8], Damage> {
        let length = usize::try_from(self.number()?).map_err(|_| Damage::Value)?;
        self.bytes(length)
    }
}
