//! The map over a weights image.

use core::fmt;

use crate::INPUT_LIMIT;
use crate::image::{self, Checked, Element, Error, HEADER_LEN, JointOrder};
use crate::kernel::{IntegerWeights, Kernel, Weights, all_in_range};

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
    weights: Parts<'w, Q, H, X>,
}

#[derive(Clone, Copy, Debug)]
enum Parts<'w, const Q: usize, const H: usize, const X: usize> {
    Float(Weights<'w, Q, H, X>),
    Integer(IntegerWeights<'w, Q, H, X>),
}

impl<'w, const Q: usize, const H: usize, const X: usize> Map<'w, Q, H, X> {
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
        // One by one: two arrays would be compared by a call.
        if checked.inputs != Q
            || checked.hidden != H
            || checked.outputs != X
            || image::stated_crc(bytes) != checked.crc
        {
            return None;
        }
        let words: &[u32] =
            bytemuck::try_cast_slice(bytes.get(HEADER_LEN..checked.length)?).ok()?;
        let weights = match checked.element {
            Element::F32 => Parts::Float(Weights::in_image(bytemuck::cast_slice(words))?),
            Element::I16 => Parts::Integer(IntegerWeights::in_image(words)?),
        };
        Some(Self { weights })
    }

    /// The same map with its weights copied to `buffer` in the order of this machine's fastest kernel, which is chosen
    /// here, once. `buffer` holds [`packed_len`](crate::packed_len) values or more and starts at a multiple of 64 bytes
    /// ([`PackedBuffer`](crate::PackedBuffer)).
    ///
    /// # Errors
    /// As [`Map::repack_for`].
    pub fn repack<'b>(&self, buffer: &'b mut [f32]) -> Result<Map<'b, Q, H, X>, RepackError> {
        self.repack_for(Kernel::best(), buffer)
    }

    /// As [`Map::repack`] for a kernel that is named.
    ///
    /// # Errors
    /// A buffer that is too short or not aligned; a kernel that this machine cannot run; a map that was repacked already
    /// or is in 16-bit integers.
    pub fn repack_for<'b>(
        &self,
        kernel: Kernel,
        buffer: &'b mut [f32],
    ) -> Result<Map<'b, Q, H, X>, RepackError> {
        let needed = crate::packed_len(Q, H, X);
        let found = buffer.len();
        let offset = buffer.as_ptr().addr() % image::ALIGNMENT;
        if found < needed {
            return Err(RepackError::Length { found, needed });
        }
        if offset != 0 {
            return Err(RepackError::Alignment { offset });
        }
        let repacked = match self.weights {
            Parts::Float(weights) => weights.repack(kernel, buffer),
            Parts::Integer(_) => None,
        };
        match repacked {
            Some(weights) => Ok(Map {
                weights: Parts::Float(weights),
            }),
            None => Err(RepackError::Kernel { kernel }),
        }
    }

    /// The same map with the portable kernel; `None` if it was repacked for another.
    pub fn portable(self) -> Option<Self> {
        let weights = match self.weights {
            Parts::Float(weights) => Parts::Float(weights.portable()?),
            Parts::Integer(weights) => Parts::Integer(weights.portable()),
        };
        Some(Self { weights })
    }

    /// The kernel that computes this map.
    pub fn kernel(&self) -> Kernel {
        match self.weights {
            Parts::Float(weights) => weights.kernel(),
            Parts::Integer(weights) => weights.kernel(),
        }
    }

    /// How the image stores the weights, and so which arithmetic this map follows.
    pub fn element(&self) -> Element {
        match self.weights {
            Parts::Float(_) => Element::F32,
            Parts::Integer(_) => Element::I16,
        }
    }

    /// f(q): radians in, counts out, in exactly the [arithmetic of this crate](crate#the-arithmetic), or that of the
    /// [16-bit map](crate::quantized#the-arithmetic) if the image is one. The outputs are finite; they may lie outside
    /// 0 … 255.
    ///
    /// # Errors
    /// An input that is NaN, infinite or beyond ±2π.
    #[inline]
    pub fn eval(&self, q: &[f32; Q]) -> Result<[f32; X], InputError> {
        if !all_in_range(q) {
            return Err(first_out_of_range(q));
        }
        Ok(match &self.weights {
            Parts::Float(weights) => weights.eval(q),
            Parts::Integer(weights) => weights.eval(q),
        })
    }
}

/// Why a map could not be repacked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RepackError {
    /// The buffer is too short.
    Length {
        /// Its length in values.
        found: usize,
        /// The length needed.
        needed: usize,
    },
    /// The buffer does not start at a multiple of 64 bytes.
    Alignment {
        /// Its address modulo 64.
        offset: usize,
    },
    /// This machine cannot run the kernel, the map is not in the image's order any more, or it is in 16-bit integers,
    /// which have no other order.
    Kernel {
        /// The kernel asked for.
        kernel: Kernel,
    },
}

impl fmt::Display for RepackError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Length { found, needed } => {
                write!(
                    f,
                    "a buffer of {found} values is too short to repack the map, {needed} are needed"
                )
            }
            Self::Alignment { offset } => {
                write!(
                    f,
                    "the buffer starts {offset} bytes past a multiple of 64: use hae::PackedBuffer"
                )
            }
            Self::Kernel { kernel } => {
                write!(
                    f,
                    "the map cannot be repacked for {kernel:?} here: use Kernel::best() on a map from its image"
                )
            }
        }
    }
}

impl core::error::Error for RepackError {}

#[cold]
fn first_out_of_range(q: &[f32]) -> InputError {
    let mut inputs = q.iter().copied().enumerate();
    // No range contains a NaN.
    let found = inputs.find(|(_, q)| !(-INPUT_LIMIT..=INPUT_LIMIT).contains(q));
    let (input, value) = found.unwrap_or((0, f32::NAN));
    InputError { input, value }
}
