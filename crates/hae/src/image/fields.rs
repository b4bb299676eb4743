//! The header's fields as bytes.

/// Byte offsets of the header's fields; everything not named here is reserved and zero.
pub(crate) mod offset {
    pub const FORMAT: usize = 8;
    pub const HEADER_LEN: usize = 10;
    pub const LENGTH: usize = 12;
    pub const CRC: usize = 16;
    pub const ELEMENT: usize = 20;
    pub const ORDER: usize = 22;
    pub const INPUTS: usize = 24;
    pub const HIDDEN: usize = 28;
    pub const OUTPUTS: usize = 32;
    pub const MODEL_ID: usize = 36;
    pub const VERSION: usize = 40;
    pub const RESERVED: usize = 44;
}

pub(super) fn field<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    bytes
        .get(at..)
        .and_then(|bytes| bytes.first_chunk())
        .copied()
        .unwrap_or([0; N])
}

pub(super) fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(field(bytes, at))
}

pub(super) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(field(bytes, at))
}

/// The CRC stated in an image's header; 0 if the bytes are too few.
pub(crate) fn stated_crc(bytes: &[u8]) -> u32 {
    u32_at(bytes, offset::CRC)
}
