//! Protocol Buffers on the wire, as far as the log's drawing channels need them: a message is written field by field.
//!
//! Encoding: protobuf.dev/programming-guides/encoding. As in proto3 a field that holds its default (0, false, an empty text) is left
//! out; a number that is not finite is written as it is.

/// A message being written.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Message {
    bytes: Vec<u8>,
}

const VARINT: u64 = 0;
const FIXED_64: u64 = 1;
const LENGTH: u64 = 2;

impl Message {
    /// The whole.
    pub(super) fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    fn varint_bytes(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.bytes.push((value & 0x7f) as u8 | 0x80);
            value >>= 7;
        }
        self.bytes.push(value as u8);
    }

    fn tag(&mut self, field: u32, wire: u64) {
        self.varint_bytes((u64::from(field) << 3) | wire);
    }

    /// An int32, int64, bool or enum, none of them negative.
    pub(super) fn whole(self, field: u32, value: u64) -> Self {
        match value {
            0 => self,
            value => self.whole_even_zero(field, value),
        }
    }

    /// As [`Message::whole`], where a 0 that stands there is not a number that is missing (proto2).
    pub(super) fn whole_even_zero(mut self, field: u32, value: u64) -> Self {
        self.tag(field, VARINT);
        self.varint_bytes(value);
        self
    }

    /// A double. −0 is written: it is another number.
    pub(super) fn double(mut self, field: u32, value: f64) -> Self {
        if value.to_bits() != 0 {
            self.tag(field, FIXED_64);
            self.bytes.extend(value.to_le_bytes());
        }
        self
    }

    fn block(mut self, field: u32, block: &[u8]) -> Self {
        self.tag(field, LENGTH);
        self.varint_bytes(block.len() as u64);
        self.bytes.extend(block);
        self
    }

    /// A string.
    pub(super) fn text(self, field: u32, text: &str) -> Self {
        match text {
            "" => self,
            text => self.block(field, text.as_bytes()),
        }
    }

    /// A message in this one; written even where it is empty.
    pub(super) fn message(self, field: u32, message: Self) -> Self {
        self.block(field, &message.bytes)
    }

    /// Several of them, a repeated field.
    pub(super) fn messages(self, field: u32, all: impl IntoIterator<Item = Self>) -> Self {
        all.into_iter()
            .fold(self, |whole, message| whole.message(field, message))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_the_bytes_of_the_encoding_guide() {
        // The guide's examples: 150 in field 1; "testing" in field 2; the first inside field 3.
        let number = Message::default().whole(1, 150);
        assert_eq!(number.bytes, [0x08, 0x96, 0x01]);
        let text = Message::default().text(2, "testing");
        assert_eq!(text.bytes, b"\x12\x07testing");
        let inner = Message::default().message(3, number);
        assert_eq!(inner.bytes, [0x1a, 0x03, 0x08, 0x96, 0x01]);
    }

    #[test]
    fn defaults_are_left_out_and_numbers_that_are_none_are_kept() {
        let defaults = Message::default().whole(1, 0).double(2, 0.0).text(3, "");
        assert!(defaults.into_bytes().is_empty());
        let nan = Message::default().double(1, f64::NAN).into_bytes();
        assert_eq!(nan[0], 0x09);
        assert!(f64::from_le_bytes(nan[1..].try_into().unwrap()).is_nan());
        let minus = Message::default().double(1, -0.0).into_bytes();
        assert_eq!(minus.len(), 9);
    }
}
