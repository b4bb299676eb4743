//! What the blocks of both families are made of.

/// A bit that is always 0 is set: byte and the bits concerned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReservedBits {
    /// Byte of the block.
    pub byte: u8,
    /// The reserved bits that are set in it.
    pub bits: u8,
}

/// The first byte of `block` with a bit of `mask` set.
pub(super) fn reserved(block: &[u8], mask: &[u8]) -> Result<(), ReservedBits> {
    for (byte, (value, mask)) in block.iter().zip(mask).enumerate() {
        if value & mask != 0 {
            return Err(ReservedBits {
                byte: byte as u8,
                bits: value & mask,
            });
        }
    }
    Ok(())
}

/// The request for one axis: position, speed, force.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Axis {
    /// rPRx: 0 open to 255 closed.
    pub position: u8,
    /// rSPx: 0 slowest to 255 fastest.
    pub speed: u8,
    /// rFRx: 0 least to 255 most.
    pub force: u8,
}

/// What an axis reports: echo, position, current.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AxisStatus {
    /// gPRx: the position last asked for.
    pub echo: u8,
    /// gPOx: where it is.
    pub position: u8,
    /// gCUx: motor current, 10 mA a count.
    pub current: u8,
}
