//! Image bytes to a [`Checked`] token: the full check, at once or in pieces. Without panics: every access is a `get`.

use core::ops::Range;

use crc::Digest;

use super::bound::HiddenBound;
use super::checksum::{CRC32, update};
use super::fields::{field, offset, u16_at, u32_at};
use super::{
    ALIGNMENT, Checked, Element, Error, FORMAT, HEADER_LEN, Header, JointOrder, MAGIC, Meta,
    encoded_len, lane_words, record_words, shape_is_valid, stated_crc,
};
use crate::quantized::{self, TileCheck};
use crate::{LANES, units_per_lane};

/// Bytes that one [`Verifier::step`] takes at most through the CRC.
const CRC_STEP: usize = 1024;

/// Checks the image at the start of `bytes` completely: header, length, CRC-32, padding, finite parameters, no sum that
/// could overflow. Bytes after the image are not looked at (a flash slot is longer than its image).
///
/// # Errors
/// The first thing found wrong. Never panics, whatever the bytes.
pub fn parse(bytes: &[u8]) -> Result<Checked, Error> {
    let mut verifier = Verifier::new(bytes)?;
    loop {
        if let Some(checked) = verifier.step(bytes)? {
            return Ok(checked);
        }
    }
}

/// As [`parse`], and refuses bytes after the image: for files.
///
/// # Errors
/// As [`parse`], and [`Error::TrailingBytes`].
pub fn parse_exact(bytes: &[u8]) -> Result<Checked, Error> {
    let header = read_header(bytes)?;
    if bytes.len() > header.length {
        return Err(Error::TrailingBytes {
            found: bytes.len(),
            expected: header.length,
        });
    }
    parse(bytes)
}

/// The check of [`parse`] in pieces, so that a loop with a time limit can do it: each step looks at about 1 KB for the
/// CRC, then at one lane. It does not hold the bytes; the caller passes the same ones every time.
pub struct Verifier {
    header: Header,
    stage: Stage,
}

enum Stage {
    Crc {
        next: usize,
        digest: Digest<'static, u32>,
    },
    Lanes {
        next: usize,
        bound: HiddenBound,
    },
    Tiles(TileCheck),
}

impl Verifier {
    /// Checks the header and begins.
    ///
    /// # Errors
    /// What is wrong with the header, its length or the alignment of the bytes.
    pub fn new(bytes: &[u8]) -> Result<Self, Error> {
        let header = read_header(bytes)?;
        Ok(Self {
            header,
            stage: Stage::Crc {
                next: 0,
                digest: CRC32.digest(),
            },
        })
    }

    /// The next piece: `Some` when everything was found right.
    ///
    /// # Errors
    /// What is wrong; call no more after that. Other bytes than at the start show as a wrong CRC.
    pub fn step(&mut self, bytes: &[u8]) -> Result<Option<Checked>, Error> {
        let header = self.header;
        let Some(image) = bytes.get(..header.length) else {
            return Err(Error::Truncated {
                found: bytes.len(),
                needed: header.length,
            });
        };
        let done = match &mut self.stage {
            Stage::Crc { next, digest } => {
                let end = (*next + CRC_STEP).min(image.len());
                update(digest, image, *next, end);
                *next = end;
                if end == image.len() {
                    let computed = digest.clone().finalize();
                    if computed != header.crc {
                        return Err(Error::Crc {
                            found: header.crc,
                            computed,
                        });
                    }
                    check_zero(image, offset::RESERVED, HEADER_LEN)?;
                    self.stage = match header.element {
                        Element::F32 => Stage::Lanes {
                            next: 0,
                            bound: HiddenBound::new(),
                        },
                        Element::I16 => Stage::Tiles(TileCheck::new(&header)),
                    };
                }
                false
            }
            Stage::Lanes { next, bound } if *next < LANES => {
                check_lane(payload(image)?, &header, *next, bound)?;
                *next += 1;
                false
            }
            Stage::Lanes { bound, .. } => {
                check_output_bias(image, &header, bound)?;
                true
            }
            Stage::Tiles(check) => check.step(payload(image)?)?,
        };
        Ok(done.then_some(Checked { header }))
    }
}

/// Reads and checks the header against itself, the bytes' length and their alignment.
fn read_header(bytes: &[u8]) -> Result<Header, Error> {
    if bytes.len() < HEADER_LEN {
        return Err(Error::Truncated {
            found: bytes.len(),
            needed: HEADER_LEN,
        });
    }
    let magic = field(bytes, 0);
    if magic != MAGIC {
        return Err(Error::Magic { found: magic });
    }
    let format = u16_at(bytes, offset::FORMAT);
    if format != FORMAT {
        return Err(Error::Format { found: format });
    }
    let header_len = u16_at(bytes, offset::HEADER_LEN);
    if usize::from(header_len) != HEADER_LEN {
        return Err(Error::HeaderLength { found: header_len });
    }
    let element = u16_at(bytes, offset::ELEMENT);
    let element = Element::from_id(element).ok_or(Error::Element { found: element })?;
    let order = u16_at(bytes, offset::ORDER);
    let joint_order = JointOrder::from_id(order).ok_or(Error::JointOrder { found: order })?;
    let shape =
        [offset::INPUTS, offset::HIDDEN, offset::OUTPUTS].map(|at| u32_at(bytes, at) as usize);
    let [inputs, hidden, outputs] = shape;
    if !shape_is_valid(inputs, hidden, outputs) {
        return Err(Error::Shape { found: shape });
    }
    if joint_order.inputs().is_some_and(|n| n != inputs) {
        return Err(Error::JointOrderInputs {
            order: joint_order,
            inputs,
        });
    }
    let length = u32_at(bytes, offset::LENGTH) as usize;
    let expected = match element {
        Element::F32 => encoded_len(inputs, hidden, outputs),
        Element::I16 => quantized::encoded_len(inputs, hidden, outputs),
    };
    if length != expected {
        return Err(Error::Length {
            found: length,
            expected,
        });
    }
    if bytes.len() < length {
        return Err(Error::Truncated {
            found: bytes.len(),
            needed: length,
        });
    }
    let misaligned = bytes.as_ptr().addr() % ALIGNMENT;
    if misaligned != 0 {
        return Err(Error::Alignment { offset: misaligned });
    }
    let meta = Meta {
        model_id: u32_at(bytes, offset::MODEL_ID),
        version: u32_at(bytes, offset::VERSION),
        joint_order,
    };
    Ok(Header {
        inputs,
        hidden,
        outputs,
        element,
        meta,
        length,
        crc: stated_crc(bytes),
    })
}

fn check_zero(image: &[u8], start: usize, end: usize) -> Result<(), Error> {
    let bytes = image.get(start..end).unwrap_or(&[]);
    match bytes.iter().position(|&byte| byte != 0) {
        Some(at) => Err(Error::Reserved { offset: start + at }),
        None => Ok(()),
    }
}

/// The words after the header.
fn payload<T: bytemuck::AnyBitPattern>(image: &[u8]) -> Result<&[T], Error> {
    let bytes = image.get(HEADER_LEN..).unwrap_or(&[]);
    bytemuck::try_cast_slice(bytes).map_err(|_| Error::Alignment {
        offset: bytes.as_ptr().addr() % ALIGNMENT,
    })
}

/// One lane: padded units all zero, every parameter finite; adds the lane to the overflow bound.
fn check_lane(
    words: &[f32],
    header: &Header,
    lane: usize,
    bound: &mut HiddenBound,
) -> Result<(), Error> {
    let stride = record_words(header.inputs, header.hidden, header.outputs);
    let units = units_per_lane(header.hidden);
    let start = lane * stride;
    let record = words.get(start..start + stride).unwrap_or(&[]);
    let byte_offset = |word: usize| HEADER_LEN + 4 * (start + word);
    if let Some(at) = record.iter().position(|v| !v.is_finite()) {
        return Err(Error::NotFinite {
            at: byte_offset(at),
        });
    }
    let sections = 1 + header.inputs + header.outputs;
    for (m, &b1) in record.iter().enumerate().take(units) {
        let column = |sections: Range<usize>| {
            sections.filter_map(move |section| record.get(section * units + m))
        };
        if m * LANES + lane < header.hidden {
            let second = 1 + header.inputs;
            bound.unit(b1, column(1..second), column(second..sections));
        } else if let Some(section) = column(0..sections).position(|v| v.to_bits() != 0) {
            return Err(Error::Reserved {
                offset: byte_offset(section * units + m),
            });
        }
    }
    Ok(())
}

fn check_output_bias(image: &[u8], header: &Header, bound: &HiddenBound) -> Result<(), Error> {
    let start = lane_words(header.inputs, header.hidden, header.outputs);
    let end = start + header.outputs;
    let b2 = payload::<f32>(image)?.get(start..end).unwrap_or(&[]);
    if let Some(at) = b2.iter().position(|v| !v.is_finite()) {
        return Err(Error::NotFinite {
            at: HEADER_LEN + 4 * (start + at),
        });
    }
    check_zero(image, HEADER_LEN + 4 * end, header.length)?;
    if bound.is_safe(b2.iter()) {
        Ok(())
    } else {
        Err(Error::Overflow)
    }
}
