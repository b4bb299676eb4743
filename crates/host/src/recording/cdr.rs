//! ROS 2's `std_msgs/msg/String` as CDR: what Rerun takes a robot's description from.

/// Name of the schema.
pub(super) const STRING_NAME: &str = "std_msgs/msg/String";
/// Its text, encoding `ros2msg`.
pub(super) const STRING_SCHEMA: &str = "string data\n";

/// A string: the encapsulation (plain CDR, little-endian, no options), the length with its final 0, the bytes, the 0.
pub(super) fn string(text: &str) -> Vec<u8> {
    let length = u32::try_from(text.len() + 1).unwrap_or(u32::MAX);
    let mut bytes = vec![0x00, 0x01, 0x00, 0x00];
    bytes.extend(length.to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes.push(0);
    bytes
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_string_is_its_length_with_the_zero_its_bytes_and_the_zero() {
        let bytes = super::string("hi");
        assert_eq!(bytes, [0, 1, 0, 0, 3, 0, 0, 0, b'h', b'i', 0]);
    }
}
