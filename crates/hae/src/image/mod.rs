//! The weights image: the map's parameters as bytes that a chip reads in place from mapped flash.
//!
//! The bytes are fixed in `docs/weights-image.md`: a header of [`HEADER_LEN`] bytes, then the parameters in lane-major
//! order, then zeros up to a multiple of 64. All numbers are little-endian. Hidden unit j belongs to lane j mod 16 as its
//! unit number m = j / 16; a lane's record is
//! `b1[m]` for every m, then for every input i `w1[m][i]` for every m, then for every output x `w2[x][m]` for every m.
//! Sixteen records follow each other, then `b2`.
//!
//! [`parse`] checks everything once, the CRC included, and returns a [`Checked`] token; with it
//! [`Map::view`](crate::Map::view) looks at the same bytes again at no cost. [`Verifier`] does the same check in small
//! pieces for a loop that may not stop.

mod bound;
mod checksum;
mod encode;
mod error;
mod fields;
mod parameters;
mod verify;

pub use encode::encode;
pub(crate) use encode::{put_header, seal};
pub use error::Error;
pub(crate) use fields::stated_crc;
pub use parameters::Parameters;
pub use verify::{Verifier, parse, parse_exact};

use crate::{LANES, units_per_lane};

/// The first eight bytes of every image.
pub const MAGIC: [u8; 8] = *b"HAE-MAP\0";
/// The format this crate reads and writes.
pub const FORMAT: u16 = 1;
/// Bytes before the parameters.
pub const HEADER_LEN: usize = 192;
/// An image starts at a multiple of this many bytes, and its length is one.
pub const ALIGNMENT: usize = 64;
/// Most inputs an image may have.
pub const MAX_INPUTS: usize = 4096;
/// Most hidden units an image may have.
pub const MAX_HIDDEN: usize = 65_536;
/// Most outputs an image may have.
pub const MAX_OUTPUTS: usize = 4096;

/// What the elements of a map's input vector are, and in which order: an image trained for one order is worthless, and
/// dangerous, under another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[repr(u16)]
pub enum JointOrder {
    /// The 25 joint angles of a hand in radians, `thumb_cmc_flex` … `little_dip_flex`.
    Hand25 = 1,
    /// Any other domain: columns `q0`, `q1`, … by position, any number of them.
    Columns = 2,
}

impl JointOrder {
    /// The order with this id, if there is one.
    pub const fn from_id(id: u16) -> Option<Self> {
        match id {
            1 => Some(Self::Hand25),
            2 => Some(Self::Columns),
            _ => None,
        }
    }

    /// The id in the header.
    pub const fn id(self) -> u16 {
        self as u16
    }

    /// The number of inputs the order demands; `None` if it fits any number.
    pub const fn inputs(self) -> Option<usize> {
        match self {
            Self::Hand25 => Some(25),
            Self::Columns => None,
        }
    }

    /// The order that [`Map::from_image`](crate::Map::from_image) expects of a map with this many inputs: the hand for
    /// 25, columns for every other number.
    pub const fn natural(inputs: usize) -> Self {
        if inputs == 25 {
            Self::Hand25
        } else {
            Self::Columns
        }
    }
}

/// How the parameters are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[repr(u16)]
pub enum Element {
    /// IEEE 754 binary32.
    F32 = 1,
    /// 16-bit integers ([`quantized`](crate::quantized)).
    I16 = 2,
}

impl Element {
    /// The element type with this id, if there is one.
    pub const fn from_id(id: u16) -> Option<Self> {
        match id {
            1 => Some(Self::F32),
            2 => Some(Self::I16),
            _ => None,
        }
    }
}

/// What the maker of an image says about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Meta {
    /// Which model this is; the maker's choice.
    pub model_id: u32,
    /// Grows with every image made of the model; a store may refuse to go back.
    pub version: u32,
    /// Meaning and order of the inputs.
    pub joint_order: JointOrder,
}

/// An image's header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Number of inputs (Q).
    pub inputs: usize,
    /// Number of hidden units (H), without padding.
    pub hidden: usize,
    /// Number of outputs (X).
    pub outputs: usize,
    /// How the parameters are stored.
    pub element: Element,
    /// What the maker says.
    pub meta: Meta,
    /// Bytes of the whole image, header and padding included.
    pub length: usize,
    /// CRC-32 of the image.
    pub crc: u32,
}

/// Proof that an image was checked completely. It can be had only from [`parse`] or a [`Verifier`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Checked {
    header: Header,
}

impl Checked {
    /// The header of the checked image.
    pub const fn header(&self) -> &Header {
        &self.header
    }
}

impl core::ops::Deref for Checked {
    type Target = Header;

    fn deref(&self) -> &Header {
        &self.header
    }
}

/// Words (f32) of one lane's record.
pub(crate) const fn record_words(inputs: usize, hidden: usize, outputs: usize) -> usize {
    units_per_lane(hidden) * (1 + inputs + outputs)
}

/// Words of all lane records; `b2` follows.
pub(crate) const fn lane_words(inputs: usize, hidden: usize, outputs: usize) -> usize {
    LANES * record_words(inputs, hidden, outputs)
}

/// Bytes of an f32 image of this shape: 192 + 64·⌈H/16⌉·(1 + Q + X) + 64·⌈X/16⌉.
pub const fn encoded_len(inputs: usize, hidden: usize, outputs: usize) -> usize {
    HEADER_LEN + 4 * lane_words(inputs, hidden, outputs) + (4 * outputs).next_multiple_of(ALIGNMENT)
}

/// True for shapes that an image can have.
pub(crate) const fn shape_is_valid(inputs: usize, hidden: usize, outputs: usize) -> bool {
    inputs >= 1
        && inputs <= MAX_INPUTS
        && hidden >= 1
        && hidden <= MAX_HIDDEN
        && outputs >= 1
        && outputs <= MAX_OUTPUTS
}
