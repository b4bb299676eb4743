//! The map over a weights image.

use core::fmt;

use crate::image::{self, Checked, Error, HEADER_LEN, JointOrder, lane_words, record_words};
use crate::{LANES, units_per_lane};

/// Largest magnitude of an input: 2π rad (as f32, 6.2831855).
pub const INPUT_LIMIT: f32 = core::f32::consts::TAU;

/// An input the map refuses before it computes anything.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputError {
    /// Index of the first such input.
    pub input: usize,
    /// Its value: NaN, infinite, or beyond ±2π rad.
    pub value: f32,
}

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { input, value } = self;
        write!(
            f,
            "input {input} of the map is {value}, not an angle within ±2π rad: check the sensor or the column it comes from"
        )
    }
}

impl core::error::Error for InputError {}

/// The map f: `Q` joint angles in radians to `X` gripper positions in counts, over `H` hidden units.
///
/// It borrows its weights; making one from checked bytes costs a few comparisons.
#[derive(Clone, Copy, Debug)]
pub struct Map<'w, const Q: usize, const H: usize, const X: usize> {
    lanes: &'w [f32],
    b2: &'w [f32; X],
}

impl<'w, const Q: usize, const H: usize, const X: usize> Map<'w, Q, H, X> {
    /// Hidden units in one lane.
    const UNITS: usize = units_per_lane(H);

    /// Checks the image at the start of `bytes` completely and makes the map. The image's joint order must be
    /// [`JointOrder::natural`] for `Q` inputs.
    ///
    /// # Errors
    /// As [`image::parse`], and [`Error::WrongShape`], [`Error::WrongJointOrder`].
    pub fn from_image(bytes: &'w [u8]) -> Result<Self, Error> {
        Self::from_image_in_order(bytes, JointOrder::natural(Q))
    }

    /// As [`Map::from_image`] for a joint order that is named.
    ///
    /// # Errors
    /// As [`Map::from_image`].
    pub fn from_image_in_order(bytes: &'w [u8], expected: JointOrder) -> Result<Self, Error> {
        let checked = image::parse(bytes)?;
        let found = [checked.inputs, checked.hidden, checked.outputs];
        if found != [Q, H, X] {
            return Err(Error::WrongShape {
                found,
                expected: [Q, H, X],
            });
        }
        if checked.meta.joint_order != expected {
            return Err(Error::WrongJointOrder {
                found: checked.meta.joint_order,
                expected,
            });
        }
        Self::view(bytes, &checked).ok_or(Error::Truncated {
            found: bytes.len(),
            needed: checked.length,
        })
    }

    /// The map over bytes that were checked before, without the check: for a loop that borrows them anew each time.
    ///
    /// `None` if the token cannot belong to these bytes: other length, alignment, CRC field, or a shape that is not
    /// this map's. It does not read the parameters. The joint order is the caller's to compare.
    pub fn view(bytes: &'w [u8], checked: &Checked) -> Option<Self> {
        if [checked.inputs, checked.hidden, checked.outputs] != [Q, H, X]
            || image::stated_crc(bytes) != checked.crc
            || !bytes.as_ptr().addr().is_multiple_of(image::ALIGNMENT)
        {
            return None;
        }
        let words: &[f32] =
            bytemuck::try_cast_slice(bytes.get(HEADER_LEN..checked.length)?).ok()?;
        let lanes = words.get(..lane_words(Q, H, X))?;
        let b2 = words.get(lanes.len()..lanes.len() + X)?.try_into().ok()?;
        Some(Self { lanes, b2 })
    }

    /// f(q): radians in, counts out, in exactly the [arithmetic of this crate](crate#the-arithmetic). The outputs are
    /// finite; they may lie outside 0 … 255.
    ///
    /// # Errors
    /// An input that is NaN, infinite or beyond ±2π.
    pub fn eval(&self, q: &[f32; Q]) -> Result<[f32; X], InputError> {
        check_inputs(q)?;
        let mut sums = [[0.0; LANES]; X];
        for (lane, record) in self.lanes.chunks_exact(record_words(Q, H, X)).enumerate() {
            self.lane(record, q, lane, &mut sums);
        }
        let mut y = [0.0; X];
        for ((y, sums), b2) in y.iter_mut().zip(&mut sums).zip(self.b2) {
            *y = halving_tree(sums) + b2;
        }
        Ok(y)
    }

    fn lane(&self, record: &[f32], q: &[f32; Q], lane: usize, sums: &mut [[f32; LANES]; X]) {
        let column = |m: usize| record.iter().skip(m).step_by(Self::UNITS);
        for (m, &b1) in record.iter().enumerate().take(Self::UNITS) {
            let mut z = b1;
            for (w, q) in column(m).skip(1).zip(q) {
                z += w * q;
            }
            let h = if z > 0.0 { z } else { 0.0 };
            for (w, sums) in column(m).skip(1 + Q).zip(sums.iter_mut()) {
                sums[lane] += w * h;
            }
        }
    }
}

/// Refuses inputs that are not angles within ±2π.
fn check_inputs<const Q: usize>(q: &[f32; Q]) -> Result<(), InputError> {
    // No range contains a NaN.
    match q
        .iter()
        .position(|q| !(-INPUT_LIMIT..=INPUT_LIMIT).contains(q))
    {
        Some(input) => Err(InputError {
            input,
            value: q[input],
        }),
        None => Ok(()),
    }
}

/// Sums 16 lanes: distance 8, 4, 2, 1.
fn halving_tree(sums: &mut [f32; LANES]) -> f32 {
    for distance in [8, 4, 2, 1] {
        for k in 0..distance {
            sums[k] += sums[k + distance];
        }
    }
    sums[0]
}
