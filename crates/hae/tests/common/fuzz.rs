//! The fuzz target as a plain function: any bytes in, a panic only when something is wrong. Run by `tests/fuzz.rs` on
//! stable; a coverage-guided fuzzer calls the same function.

use super::{Aligned, reseal};
use hae::image::{self, Checked, Error, Verifier};
use hae::{INPUT_LIMIT, Map};

/// The most steps that an image of `length` bytes takes to be checked: a bound of the time in a loop.
fn steps_at_most(length: usize) -> usize {
    length / 64 + 64
}

/// Bytes as a weights image, as they are and under a right CRC. At once, in pieces and as a file they are judged alike; in a
/// bounded number of pieces; and a map of an image that was found sound gives finite numbers for every input in range.
/// Whether an image was sound.
pub fn image(data: &[u8]) -> bool {
    let mut image = Aligned::copy_of(data);
    let as_is = judge(&image);
    if data.len() < 20 {
        return as_is;
    }
    // The length is the header's: a CRC over what would be the image.
    let stated = data[12..16].try_into().map_or(0, u32::from_le_bytes) as usize;
    let end = if (20..=data.len()).contains(&stated) {
        stated
    } else {
        data.len()
    };
    reseal(&mut image[..end]);
    judge(&image) || as_is
}

fn judge(bytes: &[u8]) -> bool {
    let at_once = image::parse(bytes);
    // By what they print: a NaN in an error is not equal to itself.
    let told = format!("{at_once:?}");
    assert_eq!(format!("{:?}", in_pieces(bytes)), told);
    match image::parse_exact(bytes) {
        Err(Error::TrailingBytes { found, expected }) => {
            assert!(found == bytes.len() && expected < found);
        }
        exact => assert_eq!(format!("{exact:?}"), told),
    }
    let Ok(checked) = at_once else { return false };
    assert!(checked.length <= bytes.len());
    maps(bytes);
    true
}

fn in_pieces(bytes: &[u8]) -> Result<Checked, Error> {
    let mut verifier = Verifier::new(bytes)?;
    for _ in 0..steps_at_most(bytes.len()) {
        if let Some(checked) = verifier.step(bytes)? {
            return Ok(checked);
        }
    }
    panic!("not done after {} steps", steps_at_most(bytes.len()));
}

/// The shapes of the corpus.
fn maps(bytes: &[u8]) {
    finite::<1, 2, 1>(bytes);
    finite::<3, 7, 2>(bytes);
}

fn finite<const Q: usize, const J: usize, const X: usize>(bytes: &[u8]) {
    let Ok(map) = Map::<Q, J, X>::from_image(bytes) else {
        return;
    };
    for angle in [0.0, 1.0, -1.0, INPUT_LIMIT, -INPUT_LIMIT] {
        for odd in [angle, -angle] {
            let q: [f32; Q] = core::array::from_fn(|i| if i % 2 == 0 { angle } else { odd });
            let x = map.eval(&q).expect("in range");
            assert!(x.iter().all(|x| x.is_finite()), "{q:?} gives {x:?}");
        }
    }
}
