use super::*;
use crate::calibration::algebra::quaternion;
use crate::hand::Side;

const SCAN: u64 = 28_571;

/// A straight glove on a hand that lies flat; each sensor has a heading of its own.
struct Bench {
    headings: Headings,
    scan: u64,
}

impl Bench {
    fn new() -> Self {
        let profile = Profile::straight(Side::Right);
        Self {
            headings: Headings::new(&profile, Config::default()),
            scan: 0,
        }
    }

    /// The segment's orientation is `turned` of the flat hand's.
    fn aligned(&self, turned: impl Fn(usize) -> Quaternion) -> Aligned {
        let level = quaternion(0.5f32.sqrt(), 0.5f32.sqrt(), 0.0, 0.0);
        Aligned {
            at: Instant::from_ticks(self.scan * SCAN),
            orientations: core::array::from_fn(|k| {
                let [c, s] = algebra::half(0.4 * k as f32 - 3.0);
                quaternion(c, 0.0, 0.0, s) * level * turned(k)
            }),
            good: u16::MAX,
        }
    }

    fn take(&mut self, scans: u64, turned: impl Fn(usize) -> Quaternion) -> Reading {
        let mut reading = None;
        for _ in 0..scans {
            self.scan += 1;
            reading = Some(self.headings.take(&self.aligned(&turned)));
        }
        reading.expect("a scan")
    }

    fn asked(&mut self, turned: impl Fn(usize) -> Quaternion) -> Result<PoseReport, NotFlat> {
        self.headings.begin_flat();
        let at = self.take(70, turned).at;
        self.headings.end_flat(at)
    }
}

fn flat(_: usize) -> Quaternion {
    Quaternion::identity()
}

#[test]
fn a_flat_pose_of_two_seconds_makes_all_angles_of_a_flat_hand_zero() {
    let mut bench = Bench::new();
    assert_ne!(bench.take(1, flat).held, 0);
    bench.asked(flat).expect("flat");
    let reading = bench.take(1, flat);
    assert_eq!((reading.held, bench.headings.unknown()), (0, 0));
    for (joint, angle) in reading.angles.iter().enumerate() {
        assert!(angle.abs().to_degrees() < 0.1, "{joint}: {angle}");
    }
}

#[test]
fn a_hand_that_is_not_flat_is_refused_with_its_segment() {
    let mut bench = Bench::new();
    let bent = |k: usize| {
        let [c, s] = algebra::half(if k == 5 || k == 6 { rad(45.0) } else { 0.0 });
        quaternion(c, s, 0.0, 0.0)
    };
    let refused = bench.asked(bent).expect_err("a bent finger");
    assert!(matches!(refused, NotFlat::Tilted { segment: 5, .. }));
    let on_hand = |k: &usize| is_base(*k);
    let bases = (1..SEGMENT_COUNT)
        .filter(on_hand)
        .fold(0, |mask, k| mask | 1 << k);
    assert_eq!(bench.headings.unknown(), bases, "hinges show themselves");
    let at = Instant::from_ticks(bench.scan * SCAN);
    assert_eq!(bench.headings.end_flat(at), Err(NotFlat::Missing(u16::MAX)));
}

#[test]
fn numbers_that_are_none_spoil_one_scan_and_no_heading() {
    let mut bench = Bench::new();
    let wrong = |k: usize| match k {
        5 => quaternion(f32::NAN, 0.0, 0.0, 0.0),
        _ => flat(k),
    };
    bench.asked(wrong).expect("flat, as far as can be told");
    bench.asked(flat).expect("flat");
    bench.take(40, flat);
    bench.take(7, wrong);
    bench
        .headings
        .restarted(5, Instant::from_ticks(bench.scan * SCAN));
    bench.take(7, wrong);
    let reading = bench.take(40, flat);
    assert_eq!(reading.held, 0);
    assert!(reading.angles.iter().all(|angle| angle.abs() < rad(0.5)));
    assert!(bench.headings.sigma().iter().all(|sigma| sigma.is_finite()));
}

/// A finder's pose: a flat hand whose headings are known, seen `before` a pause of `pause` scans and `after` it.
fn found_across(before: u64, pause: u64, after: u64) -> bool {
    let mut bench = Bench::new();
    bench.asked(flat).expect("flat");
    // Long after the pose that was asked for, the hand was elsewhere.
    let bent = |k: usize| {
        let [c, s] = algebra::half(if k == 5 { rad(45.0) } else { 0.0 });
        quaternion(c, s, 0.0, 0.0)
    };
    bench.take(250, bent);
    let mut found = false;
    for k in 0..before + after {
        bench.scan += if k == before { pause } else { 0 };
        found |= bench.take(1, flat).pose.is_some();
    }
    found
}

#[test]
fn a_flat_pose_is_not_found_across_a_pause_that_nobody_looked_at() {
    assert!(found_across(10, 0, 45), "1.5 s without a pause are one");
    assert!(!found_across(10, 70, 1), "2 s, of which 11 scans were seen");
    assert!(!found_across(40, 8, 40), "229 ms");
    assert!(found_across(10, 70, 55), "1.5 s after it");
    assert!(found_across(30, 5, 25), "what a flipped bit or two cost");
}

#[test]
fn a_hand_that_moves_when_the_look_is_renewed_is_not_still() {
    // A jump of 8° in the first scan that is later than 0.7 s: flat before and after it.
    let found = |jump: f32| {
        let mut bench = Bench::new();
        bench.asked(flat).expect("flat");
        let bent = |by: f32| {
            move |k: usize| {
                let [c, s] = algebra::half(if k == 5 { rad(by) } else { 0.0 });
                quaternion(c, s, 0.0, 0.0)
            }
        };
        bench.take(250, bent(45.0));
        let first = bench.take(25, flat).pose.is_some();
        first || (0..35).any(|_| bench.take(1, bent(jump)).pose.is_some())
    };
    assert!(found(0.0));
    assert!(!found(8.0));
}
