//! What the store refuses, and why.

use embedded_storage::nor_flash::NorFlashErrorKind;
use hae::image::{self, JointOrder};

/// Why the store did not do what it was asked. The image that was active before stays active.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Error {
    /// The slot's flash has sizes the store cannot work with.
    Geometry {
        /// Which slot.
        slot: usize,
        /// Its program unit, bytes; must be a power of two up to 256.
        write_size: usize,
        /// Its erase block, bytes; must be a multiple of the program unit and of 32.
        erase_size: usize,
        /// Its capacity, bytes; must be two erase blocks or more, and a multiple of one.
        capacity: usize,
    },
    /// The clutch is closed.
    Engaged,
    /// No image was begun, or what was begun has been given up.
    NotBegun,
    /// An image is being written.
    Busy,
    /// The image does not fit into a slot.
    TooLong {
        /// Bytes announced.
        length: usize,
        /// Bytes a slot can take.
        capacity: usize,
    },
    /// The chunk does not continue where the last one ended.
    Offset {
        /// Where it begins.
        found: usize,
        /// Where it should begin.
        expected: usize,
    },
    /// The chunk goes beyond the length announced.
    Overrun {
        /// Where it ends.
        end: usize,
        /// Length announced.
        length: usize,
    },
    /// Commit before all bytes came.
    Incomplete {
        /// Bytes that came.
        found: usize,
        /// Length announced.
        expected: usize,
    },
    /// The bytes are not a weights image.
    Image(image::Error),
    /// The image is shorter or longer than was announced.
    Length {
        /// What its header says.
        found: usize,
        /// Length announced.
        expected: usize,
    },
    /// The image maps between other numbers of values than this bridge: inputs, hidden units, outputs.
    Shape {
        /// The image's.
        found: [usize; 3],
        /// The bridge's.
        expected: [usize; 3],
    },
    /// The image takes its inputs in another order.
    JointOrder {
        /// The image's.
        found: JointOrder,
        /// The bridge's.
        expected: JointOrder,
    },
    /// The image's version is lower than the active one's.
    Older {
        /// The image's version.
        found: u32,
        /// The active image's version.
        active: u32,
    },
    /// The flash does not hold what was written.
    ReadBack {
        /// Which slot.
        slot: usize,
        /// Where, bytes from the slot's start.
        offset: usize,
    },
    /// The flash reported an error.
    Flash {
        /// Which slot.
        slot: usize,
        /// Where, bytes from the slot's start.
        offset: usize,
        /// Its kind.
        kind: NorFlashErrorKind,
    },
    /// The slot holds no whole image.
    NoImage {
        /// Which slot.
        slot: usize,
    },
    /// No slot of this number.
    NoSlot {
        /// The number.
        slot: usize,
    },
    /// No room for another record in this slot.
    RecordsFull {
        /// Which slot.
        slot: usize,
    },
}

/// What is wrong, without what helps.
struct Problem<'a>(&'a Error);

/// What helps.
struct Remedy<'a>(&'a Error);

impl Error {
    /// What is wrong, without what helps.
    pub fn problem(&self) -> impl core::fmt::Display + '_ {
        Problem(self)
    }

    /// What helps.
    pub fn remedy(&self) -> impl core::fmt::Display + '_ {
        Remedy(self)
    }
}

impl core::fmt::Display for Problem<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self.0 {
            Error::Geometry {
                slot,
                write_size,
                erase_size,
                capacity,
            } => write!(
                f,
                "slot {slot}: program unit {write_size}, erase block {erase_size}, capacity {capacity} bytes do not fit"
            ),
            Error::Engaged => f.write_str("the clutch is closed"),
            Error::NotBegun => f.write_str("no weights image is being written"),
            Error::Busy => f.write_str("a weights image is being written"),
            Error::TooLong { length, capacity } => {
                write!(f, "the image has {length} bytes, a slot takes {capacity}")
            }
            Error::Offset { found, expected } => {
                write!(
                    f,
                    "the chunk begins at byte {found}, byte {expected} comes next"
                )
            }
            Error::Overrun { end, length } => {
                write!(
                    f,
                    "the chunk ends at byte {end}, {length} bytes were announced"
                )
            }
            Error::Incomplete { found, expected } => {
                write!(f, "{found} of {expected} bytes came")
            }
            Error::Image(error) => write!(f, "not a weights image: {error}"),
            Error::Length { found, expected } => {
                write!(
                    f,
                    "the image's header says {found} bytes, {expected} were announced"
                )
            }
            Error::Shape { found, expected } => {
                write!(
                    f,
                    "the image is {found:?} (inputs, hidden units, outputs), this bridge takes {expected:?}"
                )
            }
            Error::JointOrder { found, expected } => {
                write!(
                    f,
                    "the image takes {found:?} inputs, this bridge gives {expected:?}"
                )
            }
            Error::Older { found, active } => {
                write!(
                    f,
                    "the image's version {found} is below the active one's {active}"
                )
            }
            Error::ReadBack { slot, offset } => {
                write!(
                    f,
                    "slot {slot} does not read back what was written at byte {offset}"
                )
            }
            Error::Flash { slot, offset, kind } => {
                write!(f, "slot {slot}, byte {offset}: {kind}")
            }
            Error::NoImage { slot } => write!(f, "slot {slot} holds no whole image"),
            Error::NoSlot { slot } => write!(f, "there is no slot {slot}"),
            Error::RecordsFull { slot } => {
                write!(f, "slot {slot} has no room for another record")
            }
        }
    }
}

impl core::fmt::Display for Remedy<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self.0 {
            Error::Geometry { .. } => {
                "give a program unit that is a power of two up to 256 and two erase blocks or more"
            }
            Error::Engaged => "release it, then write weights",
            Error::NotBegun => "begin one",
            Error::Busy => "commit or abort it first",
            Error::TooLong { .. } => "choose a smaller map",
            Error::Offset { .. } => "send from there",
            Error::Overrun { .. } => "begin anew with the right length",
            Error::Incomplete { .. } => "send the rest, then commit",
            Error::Image(_) => "give one that is whole",
            Error::Length { found, .. } => return write!(f, "begin anew with {found}"),
            Error::Shape { .. } => "train a model for this gripper",
            Error::JointOrder { .. } => "train on poses with the 25 joint names",
            Error::Older { active, .. } => {
                return write!(
                    f,
                    "export it with version {active} or higher, or select the other slot"
                );
            }
            Error::ReadBack { .. } => "try again; if it stays, the flash is worn out",
            Error::Flash { .. } => "try again",
            Error::NoImage { .. } => "select the other one, or flash one",
            Error::NoSlot { .. } => "choose 0 or 1",
            Error::RecordsFull { .. } => "flash an image instead",
        })
    }
}

impl core::fmt::Display for Error {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            // Its own words end with what helps.
            Self::Image(_) => write!(f, "{}", self.problem()),
            _ => write!(f, "{}: {}", self.problem(), self.remedy()),
        }
    }
}

impl core::error::Error for Error {}
