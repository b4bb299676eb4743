//! The fuzz target of `common/fuzz.rs` over the kept corpus and seeded input. `cargo xtask fuzz` runs the same function
//! under a coverage-guided fuzzer; what breaks it is kept in `tests/corpus`.

mod common;

use common::fuzz;

/// What is kept: starting points, and every input that ever broke the target.
fn corpus() -> Vec<Vec<u8>> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/corpus/sc18im");
    let files = std::fs::read_dir(folder).expect("the corpus");
    files
        .map(|file| std::fs::read(file.expect("a file").path()).expect("its bytes"))
        .collect()
}

/// SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn bytes(&mut self, most: u64) -> Vec<u8> {
        let length = self.next() % (most + 1);
        (0..length).map(|_| self.next() as u8).collect()
    }
}

#[test]
fn the_serial_bridge_ends_every_transaction_and_comes_back_whatever_bytes_come() {
    const SEED: u64 = 15;
    let kept = corpus();
    assert!(!kept.is_empty());
    let mut all = fuzz::Seen::default();
    let mut random = Random(SEED);
    let random = (0..8_000).map(|round| {
        let mut data = random.bytes(600);
        // Half of them begin with a link that is up.
        let up: &[u8] = if round % 2 == 0 {
            // One answer more where the speed is tried.
            &[2, 5, 2, 5, 2, 5, 2, 5, 2, 5, 2]
        } else {
            &[]
        };
        data.splice(0..0, up.iter().copied());
        data
    });
    let inputs = kept.into_iter().chain(random);
    for data in inputs {
        let seen = fuzz::sc18im(&data);
        all.replies += seen.replies;
        all.failures += seen.failures;
        all.resyncs += seen.resyncs;
    }
    println!("seed {SEED}: {all:?}");
    assert!(all.replies > 9_000 && all.failures > 2_000 && all.resyncs > 2_000);
}
