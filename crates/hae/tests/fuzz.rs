//! The fuzz target of `common/fuzz.rs` over the kept corpus and seeded input. `cargo xtask fuzz` runs the same function
//! under a coverage-guided fuzzer; what breaks it is kept in `tests/corpus`.
#![cfg(not(miri))]

mod common;

use common::{fuzz, rng};
use rand_chacha::rand_core::Rng;

/// What is kept: starting points, and every input that ever broke the target.
fn corpus() -> Vec<Vec<u8>> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/corpus/image");
    let files = std::fs::read_dir(folder).expect("the corpus");
    files
        .map(|file| std::fs::read(file.expect("a file").path()).expect("its bytes"))
        .collect()
}

#[test]
fn images_of_any_bytes_are_judged_alike_and_a_sound_one_gives_finite_numbers() {
    const SEED: u64 = 18;
    let kept = corpus();
    assert!(kept.iter().all(|image| fuzz::image(image)), "the corpus");
    let mut rng = rng(SEED);
    let mut sound = 0;
    for _ in 0..40_000 {
        let mut image = kept[rng.next_u64() as usize % kept.len()].clone();
        for _ in 0..1 + rng.next_u64() % 3 {
            let at = rng.next_u64() as usize % image.len();
            // A header's bytes are few among the parameters'.
            let at = if rng.next_u64() & 1 == 0 { at % 48 } else { at };
            image[at] = rng.next_u64() as u8;
        }
        if rng.next_u64().is_multiple_of(8) {
            image.truncate(rng.next_u64() as usize % image.len());
        }
        sound += u32::from(fuzz::image(&image));
    }
    println!("seed {SEED}: {sound} of 40,000 were sound");
    assert!((1_000..39_000).contains(&sound), "{sound}");
}
