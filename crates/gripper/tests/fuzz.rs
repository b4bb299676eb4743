//! The fuzz targets of `support/fuzz.rs` over the kept corpus and seeded input. `cargo xtask fuzz` runs the same functions
//! under a coverage-guided fuzzer; what breaks them is kept in `tests/corpus`.
#![allow(clippy::unwrap_used)]

mod support;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::path::Path;
use support::fuzz;

/// What is kept of a target: starting points, and every input that ever broke it.
fn corpus(target: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/corpus")
        .join(target);
    let mut paths: Vec<_> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    paths.sort();
    assert!(!paths.is_empty(), "{} is empty", folder.display());
    paths
        .iter()
        .map(|path| std::fs::read(path).unwrap())
        .collect()
}

fn random(rng: &mut ChaCha8Rng, most: u64) -> Vec<u8> {
    let length = (rng.next_u64() % (most + 1)) as usize;
    let mut bytes = vec![0; length];
    rng.fill_bytes(&mut bytes);
    bytes
}

/// A frame of `corpus` with a few bytes changed, taken out or put in; with a right CRC every other time.
fn mutated(rng: &mut ChaCha8Rng, corpus: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = corpus[rng.next_u64() as usize % corpus.len()].clone();
    for _ in 0..rng.next_u64() % 4 {
        let at = rng.next_u64() as usize % bytes.len().max(1);
        match rng.next_u64() % 3 {
            0 if !bytes.is_empty() => bytes[at] = rng.next_u64() as u8,
            1 if !bytes.is_empty() => drop(bytes.remove(at)),
            _ => bytes.insert(at.min(bytes.len()), rng.next_u64() as u8),
        }
    }
    if bytes.len() > 2 && rng.next_u64().is_multiple_of(2) {
        let body = bytes.len() - 2;
        let crc = gripper::rtu::crc16(&bytes[..body]).to_le_bytes();
        bytes[body..].copy_from_slice(&crc);
    }
    bytes
}

#[test]
fn frames_of_any_bytes_never_panic_and_survive_the_round_trip() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let corpus = corpus("frames");
    corpus.iter().for_each(|frame| fuzz::frames(frame));
    for _ in 0..100_000 {
        fuzz::frames(&random(&mut rng, 64));
        fuzz::frames(&mutated(&mut rng, &corpus));
    }
}

#[test]
fn the_link_holds_its_rules_under_any_operations() {
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let mut all = fuzz::Seen::default();
    for data in corpus("link") {
        fuzz::link(&data);
    }
    for _ in 0..8_000 {
        let seen = fuzz::link(&random(&mut rng, 800));
        all.answers += seen.answers;
        all.failures += seen.failures;
        all.late_replies += seen.late_replies;
    }
    println!("{all:?}");
    assert!(all.answers > 1_000 && all.failures > 1_000 && all.late_replies > 1_000);
}

#[test]
fn a_driver_writes_nothing_to_another_family_under_any_operations() {
    let mut rng = ChaCha8Rng::seed_from_u64(14);
    let (mut requests, mut writes) = (0, 0);
    for data in corpus("family") {
        fuzz::family(&data);
    }
    for _ in 0..3_000 {
        let seen = fuzz::family(&random(&mut rng, 600));
        requests += seen.0;
        writes += seen.1;
    }
    println!("{requests} requests, {writes} writes, all of them to its own family");
    assert!(requests > 10_000 && writes > 3_000);
}

#[test]
fn the_driver_holds_its_rules_under_any_operations() {
    let mut rng = ChaCha8Rng::seed_from_u64(13);
    let (mut requests, mut writes) = (0, 0);
    for data in corpus("driver") {
        fuzz::driver(&data);
    }
    for _ in 0..1_500 {
        let seen = fuzz::driver(&random(&mut rng, 600));
        requests += seen.0;
        writes += seen.1;
    }
    println!("{requests} requests, {writes} writes");
    assert!(requests > 10_000 && writes > 3_000);
}
