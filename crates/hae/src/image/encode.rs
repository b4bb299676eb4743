//! Parameters to image bytes.

use super::checksum::crc32;
use super::fields::offset;
use super::{Element, Error, FORMAT, HEADER_LEN, MAGIC, Meta, Parameters, encoded_len};
use crate::{LANES, units_per_lane};

/// Writes the image of `parameters` to the start of `out` and returns its length, [`encoded_len`].
///
/// # Errors
/// Parameters that are not fit for an image ([`Parameters::check`]), a joint order that does not go with the number of
/// inputs, or a buffer that is too small; `out` is then unchanged.
pub fn encode(parameters: &Parameters<'_>, meta: &Meta, out: &mut [u8]) -> Result<usize, Error> {
    parameters.check_for(meta)?;
    let &Parameters {
        inputs,
        hidden,
        outputs,
        ..
    } = parameters;
    let length = encoded_len(inputs, hidden, outputs);
    let found = out.len();
    let Some(out) = out.get_mut(..length) else {
        return Err(Error::Buffer {
            found,
            needed: length,
        });
    };
    out.fill(0);
    put_header(out, [inputs, hidden, outputs], Element::F32, meta);
    let words = out[HEADER_LEN..].chunks_exact_mut(4);
    for (word, value) in words.zip(lane_major(parameters).chain(parameters.b2.iter().copied())) {
        word.copy_from_slice(&value.to_le_bytes());
    }
    seal(out);
    Ok(length)
}

/// The parameters of all lane records in the image's order, padding included.
fn lane_major<'a>(p: &'a Parameters<'a>) -> impl Iterator<Item = f32> + 'a {
    let units = units_per_lane(p.hidden);
    (0..LANES).flat_map(move |lane| {
        // Section 0 is b1, 1..=Q are the inputs, the rest the outputs.
        (0..1 + p.inputs + p.outputs).flat_map(move |section| {
            (0..units).map(move |m| {
                let j = m * LANES + lane;
                if j >= p.hidden {
                    0.0
                } else if section == 0 {
                    p.b1[j]
                } else if section <= p.inputs {
                    p.w1[j * p.inputs + section - 1]
                } else {
                    p.w2[(section - 1 - p.inputs) * p.hidden + j]
                }
            })
        })
    })
}

/// Writes every header field but the CRC; `out` is the whole image, zeroed.
pub(crate) fn put_header(out: &mut [u8], shape: [usize; 3], element: Element, meta: &Meta) {
    let length = out.len() as u32;
    let mut put = |at: usize, bytes: &[u8]| out[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &MAGIC);
    put(offset::FORMAT, &FORMAT.to_le_bytes());
    put(offset::HEADER_LEN, &(HEADER_LEN as u16).to_le_bytes());
    put(offset::LENGTH, &length.to_le_bytes());
    put(offset::ELEMENT, &(element as u16).to_le_bytes());
    put(offset::ORDER, &meta.joint_order.id().to_le_bytes());
    put(offset::INPUTS, &(shape[0] as u32).to_le_bytes());
    put(offset::HIDDEN, &(shape[1] as u32).to_le_bytes());
    put(offset::OUTPUTS, &(shape[2] as u32).to_le_bytes());
    put(offset::MODEL_ID, &meta.model_id.to_le_bytes());
    put(offset::VERSION, &meta.version.to_le_bytes());
}

/// Writes the CRC of a finished image into it.
pub(crate) fn seal(image: &mut [u8]) {
    let crc = crc32(image);
    image[offset::CRC..offset::CRC + 4].copy_from_slice(&crc.to_le_bytes());
}
