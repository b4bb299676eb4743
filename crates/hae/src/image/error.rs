//! Everything that can be wrong with an image, each with the value found and what to do.

use core::fmt;

use super::{FORMAT, JointOrder, MAX_HIDDEN, MAX_INPUTS, MAX_OUTPUTS};

/// Why bytes are not an image that can be used, or parameters cannot become one.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// Fewer bytes than the header, or than the length the header states.
    Truncated {
        /// Bytes there are.
        found: usize,
        /// Bytes there should be.
        needed: usize,
    },
    /// More bytes than the image has, where the image alone was expected.
    TrailingBytes {
        /// Bytes there are.
        found: usize,
        /// Bytes of the image.
        expected: usize,
    },
    /// The bytes do not start at a multiple of 64.
    Alignment {
        /// The start address modulo 64.
        offset: usize,
    },
    /// The first eight bytes are not the magic: not a weights image.
    Magic {
        /// What they are.
        found: [u8; 8],
    },
    /// A format this crate does not know.
    Format {
        /// The format stated.
        found: u16,
    },
    /// A header length that does not belong to the format.
    HeaderLength {
        /// The length stated.
        found: u16,
    },
    /// An element type this crate does not know.
    Element {
        /// The id stated.
        found: u16,
    },
    /// A joint order this crate does not know.
    JointOrder {
        /// The id stated.
        found: u16,
    },
    /// The joint order does not go with the number of inputs.
    JointOrderInputs {
        /// The joint order.
        order: JointOrder,
        /// The number of inputs stated.
        inputs: usize,
    },
    /// A shape with a zero or a number beyond the limits.
    Shape {
        /// Inputs, hidden units, outputs.
        found: [usize; 3],
    },
    /// The length stated is not the one of the shape.
    Length {
        /// The length stated.
        found: usize,
        /// The length of the shape.
        expected: usize,
    },
    /// The CRC-32 differs: the bytes were damaged.
    Crc {
        /// The CRC stated.
        found: u32,
        /// The CRC of the bytes.
        computed: u32,
    },
    /// A reserved or padding byte is not zero.
    Reserved {
        /// Where, counted from the start of the image.
        offset: usize,
    },
    /// A parameter is NaN or infinite.
    NotFinite {
        /// Where: in an image the byte offset, in [`Parameters`](super::Parameters) the index counted through w1, b1, w2, b2.
        at: usize,
    },
    /// Parameters so large that a sum could overflow for inputs within ±2π.
    Overflow,
    /// A sound image, but of another shape than the map's.
    WrongShape {
        /// The image's inputs, hidden units, outputs.
        found: [usize; 3],
        /// The map's.
        expected: [usize; 3],
    },
    /// A sound image, but for another joint order.
    WrongJointOrder {
        /// The image's.
        found: JointOrder,
        /// The one asked for.
        expected: JointOrder,
    },
    /// A parameter slice's length does not fit the shape.
    ParameterLength {
        /// `w1`, `b1`, `w2` or `b2`; not part of the serialised form, since only encoding meets this error.
        name: &'static str,
        /// Its length.
        found: usize,
        /// The length of the shape.
        expected: usize,
    },
    /// The buffer to write to is too small.
    Buffer {
        /// Its length.
        found: usize,
        /// The length needed.
        needed: usize,
    },
    /// A calibration pose has an angle beyond ±2π, which a map refuses as an input.
    PoseRange {
        /// Index of the value, counted through all poses.
        at: usize,
        /// The value, radians.
        value: f32,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Truncated { found, needed } => {
                write!(
                    f,
                    "the weights image needs {needed} bytes, {found} are there: copy it again"
                )
            }
            Self::TrailingBytes { found, expected } => {
                write!(
                    f,
                    "the weights image has {expected} bytes, {found} are there: copy it again"
                )
            }
            Self::Alignment { offset } => {
                write!(
                    f,
                    "the weights image starts {offset} bytes past a multiple of 64: align its buffer to 64 bytes"
                )
            }
            Self::Magic { found } => {
                write!(
                    f,
                    "not a weights image: it starts with {found:02x?}: make one with gauntlet export"
                )
            }
            Self::Format { found } => {
                write!(
                    f,
                    "weights image format {found}, only {FORMAT} is known here: update this program or export the model again"
                )
            }
            Self::HeaderLength { found } => {
                write!(
                    f,
                    "weights image header of {found} bytes does not belong to format {FORMAT}: export the model again"
                )
            }
            Self::Element { found } => {
                write!(
                    f,
                    "weights image element type {found} is not known here: update this program or export the model again"
                )
            }
            Self::JointOrder { found } => {
                write!(
                    f,
                    "weights image joint order {found} is not known here: update this program or export the model again"
                )
            }
            Self::JointOrderInputs { order, inputs } => {
                write!(
                    f,
                    "joint order {order:?} does not go with {inputs} inputs: export the model again"
                )
            }
            Self::Shape {
                found: [inputs, hidden, outputs],
            } => write!(
                f,
                "shape {inputs} inputs, {hidden} hidden units, {outputs} outputs is out of range: 1 to {MAX_INPUTS}, {MAX_HIDDEN}, {MAX_OUTPUTS}"
            ),
            Self::Length { found, expected } => {
                write!(
                    f,
                    "the weights image states {found} bytes, its shape has {expected}: export the model again"
                )
            }
            Self::Crc { found, computed } => {
                write!(
                    f,
                    "the weights image is damaged: CRC-32 {found:08x} stated, {computed:08x} computed: copy it again"
                )
            }
            Self::Reserved { offset } => {
                write!(
                    f,
                    "reserved byte {offset} of the weights image is not zero: export the model again"
                )
            }
            Self::NotFinite { at } => {
                write!(
                    f,
                    "the parameter at {at} is NaN or infinite: train the model again"
                )
            }
            Self::Overflow => {
                write!(
                    f,
                    "the parameters are so large that a sum could overflow for inputs within ±2π: train the model again"
                )
            }
            Self::WrongShape {
                found: [q, h, x],
                expected: [eq, eh, ex],
            } => write!(
                f,
                "the weights image maps {q} inputs over {h} hidden units to {x} outputs, this map has {eq}, {eh}, {ex}: train a model of that shape"
            ),
            Self::WrongJointOrder { found, expected } => {
                write!(
                    f,
                    "the weights image is for joint order {found:?}, this map for {expected:?}: train a model for it"
                )
            }
            Self::ParameterLength {
                name,
                found,
                expected,
            } => {
                write!(f, "{name} has {found} values, the shape needs {expected}")
            }
            Self::Buffer { found, needed } => {
                write!(
                    f,
                    "a buffer of {found} elements is too small, {needed} are needed"
                )
            }
            Self::PoseRange { at, value } => {
                write!(
                    f,
                    "value {at} of the calibration poses is {value}, beyond ±2π: poses are in radians, one value for each input"
                )
            }
        }
    }
}

impl core::error::Error for Error {}
