//! The fuzz targets of `support/fuzz.rs` over the golden frames and seeded input.
#![allow(clippy::unwrap_used)]

mod support;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use support::fuzz;

/// Frames of both directions to start from.
const CORPUS: [&[u8]; 6] = [
    &[
        0x09, 0x10, 0x03, 0xE8, 0x00, 0x03, 0x06, 0x09, 0x00, 0x00, 0xFF, 0xFF, 0xFF, 0x42, 0x29,
    ],
    &[0x09, 0x03, 0x07, 0xD0, 0x00, 0x08, 0x45, 0xC9],
    &[
        0x09, 0x03, 0x06, 0x39, 0x00, 0x00, 0xFF, 0x0E, 0x0A, 0xF7, 0x8B,
    ],
    &[
        0x09, 0x17, 0x07, 0xD0, 0x00, 0x02, 0x03, 0xE9, 0x00, 0x02, 0x04, 0x00, 0xE6, 0x3C, 0xC8,
        0x2D, 0x0C,
    ],
    &[0x09, 0x17, 0x04, 0x01, 0x00, 0x09, 0xE6, 0xF6, 0xC1],
    &[0x0A, 0x81, 0x02, 0xB0, 0x53],
];

fn random(rng: &mut ChaCha8Rng, most: u64) -> Vec<u8> {
    let length = (rng.next_u64() % (most + 1)) as usize;
    let mut bytes = vec![0; length];
    rng.fill_bytes(&mut bytes);
    bytes
}

/// A corpus frame with a few bytes changed, taken out or put in; with a right CRC every other time.
fn mutated(rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = CORPUS[rng.next_u64() as usize % CORPUS.len()].to_vec();
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
    CORPUS.iter().for_each(|frame| fuzz::frames(frame));
    for _ in 0..100_000 {
        fuzz::frames(&random(&mut rng, 64));
        fuzz::frames(&mutated(&mut rng));
    }
}

#[test]
fn the_link_holds_its_rules_under_any_operations() {
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let mut all = fuzz::Seen::default();
    for _ in 0..6_000 {
        let seen = fuzz::link(&random(&mut rng, 800));
        all.answers += seen.answers;
        all.failures += seen.failures;
        all.late_replies += seen.late_replies;
    }
    println!("{all:?}");
    assert!(all.answers > 1_000 && all.failures > 1_000 && all.late_replies > 1_000);
}

#[test]
fn the_driver_holds_its_rules_under_any_operations() {
    let mut rng = ChaCha8Rng::seed_from_u64(13);
    let (mut requests, mut writes) = (0, 0);
    for _ in 0..1_500 {
        let seen = fuzz::driver(&random(&mut rng, 600));
        requests += seen.0;
        writes += seen.1;
    }
    println!("{requests} requests, {writes} writes");
    assert!(requests > 10_000 && writes > 3_000);
}
