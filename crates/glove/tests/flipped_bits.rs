//! What the norm and the jump check cannot see: bits flipped inside a quaternion. The figures stand in docs/safety.md.

use glove::hand::Quaternion;
use glove::imu::repair::repaired;
use glove::imu::{angle_between, is_reachable, orientation};
use glove::timing;

/// Numbers in [−1, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        // 40 bits.
        self.bits() as f32 / (1u64 << 39) as f32 - 1.0
    }

    fn bits(&mut self) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 24
    }

    fn registers(&mut self) -> [u8; 8] {
        loop {
            let q: [f32; 4] = core::array::from_fn(|_| self.next());
            let norm = q.iter().map(|c| c * c).sum::<f32>().sqrt();
            if (0.1..=1.0).contains(&norm) {
                let mut bytes = [0; 8];
                for (pair, c) in bytes.chunks_mut(2).zip(q) {
                    pair.copy_from_slice(&((c / norm * 16_384.0).round() as i16).to_le_bytes());
                }
                return bytes;
            }
        }
    }
}

/// What came of many flips.
#[derive(Debug, Default)]
struct Tally {
    flips: u32,
    norm_kept: u32,
    /// Of these: turned by more than 1°, 5°, 20°; caught as a jump in a scan of 26.6 ms.
    over: [u32; 3],
    jumps: u32,
    furthest: f32,
}

impl Tally {
    fn take(&mut self, before: &Quaternion, flipped: &[u8; 8]) {
        self.flips += 1;
        let Ok(after) = orientation(&repaired(*flipped).0) else {
            return;
        };
        self.norm_kept += 1;
        let by = angle_between(before, &after);
        for (count, limit) in self.over.iter_mut().zip([1.0f32, 5.0, 20.0]) {
            *count += u32::from(by.to_degrees() > limit);
        }
        let scan = timing::serial(306, 115_200);
        if is_reachable(before, &after, scan) {
            self.furthest = self.furthest.max(by.to_degrees());
        } else {
            self.jumps += 1;
        }
    }

    fn tell(&self, what: &str) {
        let share = |n: u32| 100.0 * f64::from(n) / f64::from(self.flips);
        println!(
            "{what}: {:.1} % keep the norm; by more than 1°: {:.1} %, 5°: {:.2} %, 20°: {:.3} %; caught as a jump: {:.4} %; furthest not caught {:.1}°",
            share(self.norm_kept),
            share(self.over[0]),
            share(self.over[1]),
            share(self.over[2]),
            share(self.jumps),
            self.furthest
        );
    }
}

#[test]
fn a_flipped_bit_that_keeps_the_norm_turns_a_sensor_by_a_bounded_angle() {
    let mut random = Random(0x5EED_0004);
    let (mut one, mut two) = (Tally::default(), Tally::default());
    for _ in 0..20_000 {
        let raw = random.registers();
        let before = orientation(&raw).expect("unit");
        for bit in 0..64 {
            let mut flipped = raw;
            flipped[bit / 8] ^= 1 << (bit % 8);
            one.take(&before, &flipped);
            let other = (bit + 1 + random.bits() as usize % 63) % 64;
            flipped[other / 8] ^= 1 << (other % 8);
            two.take(&before, &flipped);
        }
    }
    one.tell("one bit");
    two.tell("two bits");
    assert!(one.furthest < 35.0, "{one:?}");
}
