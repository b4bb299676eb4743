//! The fuzz targets of `common/fuzz.rs` over the kept corpus and seeded input. `cargo xtask fuzz` runs the same functions
//! under a coverage-guided fuzzer; what breaks them is kept in `tests/corpus`.

mod common;

use common::fuzz;
use common::host::framed;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// What is kept of a target: starting points, and every input that ever broke it.
fn corpus(target: &str) -> Vec<Vec<u8>> {
    let folder = format!("{}/tests/corpus/{target}", env!("CARGO_MANIFEST_DIR"));
    let files = std::fs::read_dir(folder).expect("the corpus");
    let kept: Vec<_> = files
        .map(|file| std::fs::read(file.expect("a file").path()).expect("its bytes"))
        .collect();
    assert!(!kept.is_empty(), "{target}");
    kept
}

fn random(rng: &mut ChaCha8Rng, most: u64) -> Vec<u8> {
    let length = (rng.next_u64() % (most + 1)) as usize;
    let mut bytes = vec![0; length];
    rng.fill_bytes(&mut bytes);
    bytes
}

#[test]
fn frames_and_messages_of_any_bytes_never_panic_and_survive_the_round_trip() {
    let kept = corpus("frames");
    kept.iter().for_each(|bytes| fuzz::frames(bytes));
    let mut rng = ChaCha8Rng::seed_from_u64(16);
    for _ in 0..60_000 {
        let bytes = random(&mut rng, 64);
        fuzz::frames(&bytes);
        fuzz::frames(&framed(&bytes));
        // A kept frame with a byte changed, and with the message changed inside a right frame.
        let mut frame = kept[rng.next_u64() as usize % kept.len()].clone();
        let at = rng.next_u64() as usize % frame.len();
        frame[at] = rng.next_u64() as u8;
        fuzz::frames(&frame);
        fuzz::frames(&framed(&frame[1..]));
    }
}

#[test]
fn the_bridge_hears_the_next_host_whatever_came_before() {
    const SEED: u64 = 17;
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let inputs = (0..600).map(|_| random(&mut rng, 300));
    let said: u32 = corpus("server")
        .into_iter()
        .chain(inputs)
        .map(|data| fuzz::server(&data))
        .sum();
    println!("seed {SEED}: {said} messages of the bridge");
    assert!(said > 1_000);
}
