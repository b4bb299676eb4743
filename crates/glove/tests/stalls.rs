//! A caller that stands still: what lies in the port when it goes on is old, and nothing of it counts.

mod common;

use common::{ALL, Bench, assert_true, cost, waving};
use glove::{Duration, Instant};

/// A small generator, so that a run can be repeated.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % limit
    }
}

#[test]
fn after_a_stall_no_sample_rests_on_bytes_from_before_its_end() {
    let seed = 0x5EED_0001;
    println!("seed {seed:#x}");
    let mut random = Random(seed);
    let mut bench = Bench::new(waving).up();
    for stall in 0..1_000 {
        let at = bench.clock.now() + Duration::from_ticks(random.below(120_000));
        bench.until(at.as_ticks());
        let length = 100_000 + random.below(9_900_000);
        bench.clock.advance(Duration::from_ticks(length));
        let end = bench.clock.now();
        // After half a second the sensors are asked first who they are.
        const ASKED: u64 = cost::who_is_there(115_200);
        let (asked, look) = match length > 500_000 {
            true => (ASKED, 280_000),
            false => (0, 100_000),
        };
        let frames = bench.until_timed(end.as_ticks() + look);
        let what = format!("stall {stall} of {length} us at {at:?}");
        let (first_at, _) = frames.first().expect("frames again in time");
        assert!(
            (*first_at - end).as_ticks() < 70_000 + asked,
            "{what}: late"
        );
        for (_, frame) in &frames {
            assert_eq!(
                frame.good(),
                ALL,
                "{what}: {:?}",
                frame.samples.map(|s| s.health)
            );
            for (k, sample) in frame.samples.iter().enumerate() {
                assert!(
                    sample.stamp >= end,
                    "{what}: sensor {k} is of {:?}",
                    sample.stamp
                );
            }
            assert_true(&bench, std::slice::from_ref(frame));
        }
    }
    println!("{:?}", bench.scanner.link_counters());
}

#[test]
fn a_stall_while_the_sensors_are_brought_up_only_takes_time() {
    let mut random = Random(0x5EED_0002);
    for _ in 0..40 {
        let mut bench = Bench::new(waving);
        for _ in 0..5 {
            bench.until(bench.clock.now().as_ticks() + random.below(150_000));
            bench
                .clock
                .advance(Duration::from_ticks(100_000 + random.below(2_000_000)));
        }
        let end: Instant = bench.clock.now();
        let frames = bench.until(end.as_ticks() + 2_500_000);
        assert_eq!(frames.last().map(glove::scan::Frame::good), Some(ALL));
    }
}
