//! A flipped bit 15 of a sample's bytes, put back.

use super::{Fault, SAMPLE_BYTES};
use crate::hand::Quaternion;

/// The largest count a component of a unit quaternion has, 1.
const ONE: i16 = 16_384;

/// Squared norm of bytes that are unit but for rounding: 16385.5 counts. A component of 16383 or less that was flipped makes more.
const UNIT: i64 = 268_484_610;

/// Bytes whose bit 15 of one component is flipped, with the bit put back; others as they are. True if something was repaired.
///
/// A component of a unit quaternion is at most 16384 counts, and the flip moves it by 32768: it always leaves that range. Two of
/// them outside are not repaired: the norm refuses them. Neither is one that is outside by a count of rounding: then the bytes are
/// unit as they are, and with the bit changed they would be the opposite of a small turn.
pub fn repaired(raw: [u8; SAMPLE_BYTES]) -> ([u8; SAMPLE_BYTES], bool) {
    let outside = |pair: &[u8]| match pair {
        [low, high] => !(-ONE..=ONE).contains(&i16::from_le_bytes([*low, *high])),
        _ => false,
    };
    let mut mended = raw;
    if raw.chunks(2).filter(|pair| outside(pair)).count() != 1 || squared(&raw) <= UNIT {
        return (raw, false);
    }
    for pair in mended.chunks_mut(2) {
        if outside(pair)
            && let [_, high] = pair
        {
            *high ^= 0x80;
        }
    }
    // What it was is exactly unit; another fault is not made to look like it.
    match orientation(&mended) {
        Ok(_) => (mended, true),
        Err(_) => (raw, false),
    }
}

/// Squared norm in counts.
fn squared(raw: &[u8; SAMPLE_BYTES]) -> i64 {
    let squares = super::counts(raw).map(|count| i64::from(count) * i64::from(count));
    squares.iter().sum()
}

/// The orientation in bytes that a repair may have touched: norm within 1 ± 0.01.
pub(crate) fn orientation(raw: &[u8; SAMPLE_BYTES]) -> Result<Quaternion, Fault> {
    let squared = squared(raw);
    const LOW: i64 = 16_220 * 16_220;
    const HIGH: i64 = 16_548 * 16_548;
    match super::orientation(raw) {
        Ok(_) if !(LOW..=HIGH).contains(&squared) => Err(Fault::NotUnit),
        judged => judged,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes(counts: [i16; 4]) -> [u8; 8] {
        let mut raw = [0; 8];
        for (pair, count) in raw.chunks_mut(2).zip(counts) {
            pair.copy_from_slice(&count.to_le_bytes());
        }
        raw
    }

    #[test]
    fn a_component_beyond_one_by_a_count_of_rounding_is_left_as_it_is() {
        for clean in [[16_385, 0, 0, 0], [16_385, 57, -1, 0], [0, 1, -16_385, 100]] {
            let raw = bytes(clean);
            assert_eq!(repaired(raw), (raw, false), "{clean:?}");
        }
        let raw = bytes([16_383, 150, 100, 0]);
        let mut flipped = raw;
        flipped[1] ^= 0x80;
        assert_eq!(repaired(flipped), (raw, true));
    }

    #[test]
    fn a_flipped_bit_15_of_any_component_is_put_back_and_clean_bytes_are_not_touched() {
        for clean in [
            [3_668, -14_654, -2_584, -5_792],
            [16_384, 0, 0, 0],
            [0, -16_384, 0, 0],
            [8_192, 8_192, -8_192, -8_192],
        ] {
            let raw = bytes(clean);
            assert_eq!(repaired(raw), (raw, false));
            for component in 0..4 {
                let mut flipped = raw;
                flipped[2 * component + 1] ^= 0x80;
                let exact_one = clean[component].unsigned_abs() == 16_384;
                // −1 flipped is +1, and the other way round: only that cannot be told.
                if !exact_one {
                    assert_eq!(repaired(flipped), (raw, true), "{clean:?} {component}");
                }
                let other = (component + 1) % 4;
                if !exact_one && clean[other].unsigned_abs() != 16_384 {
                    flipped[2 * other + 1] ^= 0x80;
                    assert_eq!(repaired(flipped), (flipped, false), "two");
                }
            }
        }
    }
}
