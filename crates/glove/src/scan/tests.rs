use super::*;
use crate::bus;
use crate::hand::{Quaternion, segment_orientations};
use crate::imu::{Fault, Mode};

mod fake;
mod noise;

use fake::{Chip, Fake, registers};

extern crate std;
use std::vec::Vec;

struct Run {
    scanner: BusScanner<Fake>,
    now: u64,
}

impl Run {
    fn new(pose: impl FnMut(u64, usize) -> Quaternion + 'static) -> Self {
        Self {
            scanner: BusScanner::on(Fake::new(pose), Config::default()),
            now: 0,
        }
    }

    /// Frames until `end`, in µs.
    fn until(&mut self, end: u64) -> Vec<Frame> {
        let mut frames = Vec::new();
        while self.now < end {
            frames.extend(self.scanner.poll(Instant::from_ticks(self.now)));
            let due = self.scanner.next_due().map_or(end, |d| d.as_ticks());
            self.now = due.clamp(self.now + 10, end.max(self.now + 10));
        }
        frames
    }

    fn for_ms(&mut self, ms: u64) -> Vec<Frame> {
        self.until(self.now + ms * 1_000)
    }

    fn chip(&mut self, k: usize) -> &mut Chip {
        &mut self.scanner.bus_mut().chips[k]
    }
}

/// A hand that turns slowly and bends its fingers: every sensor moves.
fn moving(micros: u64, sensor: usize) -> Quaternion {
    let t = micros as f32 * 1e-6;
    let angles = core::array::from_fn(|j| 0.3 * libm::sinf(1.3 * t + j as f32));
    let hand = Quaternion::from_euler_angles(0.5 * libm::sinf(t), 0.3 * libm::sinf(0.7 * t), t);
    hand * segment_orientations(&angles, crate::hand::Side::Right)[sensor]
}

fn still(_: u64, _: usize) -> Quaternion {
    Quaternion::identity()
}

const ALL: u16 = 0xFFFF;

/// From the start to six scans, microseconds, on a bus that takes 1 ms for everything: 16 sensors are asked who they are (7 transactions),
/// set to CONFIG (4) and reset (2); 650 ms; then they are set up (12) and looked at (9), 10 ms between. Each of those five steps selects
/// its channel first.
const UP: u64 = 1_000 * (16 * (7 + 4 + 2 + 3) + 650 + 16 * (12 + 9 + 2) + 10 + 6 * 16);

#[test]
fn all_sensors_are_reset_before_the_one_wait_and_frames_come_soon_after() {
    let mut run = Run::new(moving);
    let frames = run.until(UP);
    assert!(frames.len() > 3, "{} frames", frames.len());
    assert!(frames.iter().all(|f| f.good() == ALL), "{:?}", frames[0]);
    assert_eq!(run.scanner.state(), State::Scanning);
    assert_eq!(run.scanner.counters().starts, [1; 16]);
    assert!((0..16).all(|k| run.chip(k).resets == 1 && run.chip(k).units == 0x00));
    let sequence: Vec<u32> = frames.iter().map(|f| f.sequence).collect();
    assert_eq!(sequence, (0..frames.len() as u32).collect::<Vec<_>>());
}

#[test]
fn ndof_is_set_when_asked_for() {
    let imu = imu::Config {
        mode: Mode::Ndof,
        external_crystal: false,
    };
    let mut run = Run::new(moving);
    run.scanner = BusScanner::on(
        Fake::new(moving),
        Config {
            imu,
            ..Config::default()
        },
    );
    assert!(!run.until(UP).is_empty());
    assert!((0..16).all(|k| run.chip(k).mode == 0x0C));
}

#[test]
fn one_scan_is_16_batches_and_each_sample_is_stamped_when_it_was_asked_for() {
    let mut run = Run::new(moving);
    run.until(UP);
    let before = run.scanner.bus_mut().batches;
    let first = run.scanner.counters().frames;
    let frames = run.for_ms(160);
    assert_eq!(
        run.scanner.bus_mut().batches - before,
        16 * (run.scanner.counters().frames - first)
    );
    let stamps = frames[5].samples.map(|s| s.stamp.as_ticks());
    assert!(
        stamps.windows(2).all(|w| w[1] == w[0] + 1_000),
        "{stamps:?}"
    );
    let k = 6;
    let expected = moving(stamps[k], k);
    assert!(imu::angle_between(&frames[5].samples[k].orientation, &expected) < 2e-3);
}

#[test]
fn the_sign_of_each_sensors_quaternion_is_continuous() {
    let spin = |micros: u64, _| Quaternion::from_euler_angles(0.0, 0.0, micros as f32 * 3e-6);
    let mut run = Run::new(move |micros, k| {
        let q = spin(micros, k);
        // The chip may give either sign.
        if micros / 16_000 % 2 == 0 {
            q
        } else {
            Quaternion::new_unchecked(-q.into_inner())
        }
    });
    let frames = run.until(5_000_000);
    for pair in frames.windows(2) {
        let (a, b) = (
            pair[0].samples[5].orientation,
            pair[1].samples[5].orientation,
        );
        assert!(a.coords.dot(&b.coords) > 0.5);
    }
}

#[test]
fn a_sensor_that_is_absent_is_named_and_the_others_are_scanned() {
    let mut run = Run::new(moving);
    run.chip(9).present = false;
    let frames = run.until(3_000_000);
    let last = frames.last().unwrap();
    assert_eq!(last.good(), ALL & !(1 << 9));
    let cause = imu::Error::Bus {
        register: 0x07,
        cause: bus::Error::NackAddress,
    };
    assert_eq!(last.samples[9].health, Health::Missing(cause));
    assert!(
        frames.len() > 100,
        "the absent one costs little: {} frames",
        frames.len()
    );
    // Plugged in later, it comes up by itself.
    run.chip(9).present = true;
    assert_eq!(run.for_ms(3_500).last().unwrap().good(), ALL);
}

#[test]
fn a_sensor_that_falls_silent_is_rechecked_and_comes_back_without_a_reset() {
    let mut run = Run::new(moving);
    run.until(UP);
    run.chip(4).present = false;
    let out = run.for_ms(100);
    assert!(out.last().unwrap().good() == ALL & !(1 << 4));
    run.chip(4).present = true;
    assert_eq!(run.for_ms(100).last().unwrap().good(), ALL);
    assert_eq!(run.chip(4).resets, 1, "only the one of the bring-up");
    assert_eq!(run.scanner.counters().starts[4], 1);
}

#[test]
fn a_sensor_that_resets_itself_is_brought_up_alone_while_the_others_go_on() {
    let mut run = Run::new(moving);
    run.until(UP);
    let now = run.now;
    run.chip(11).reset(now);
    let frames = run.for_ms(650 + 300);
    assert!(
        frames.iter().all(|f| f.good() | 1 << 11 == ALL),
        "no other sensor suffers"
    );
    assert!(frames.len() > 40, "{} frames", frames.len());
    let longest = frames
        .windows(2)
        .map(|w| w[1].samples[0].stamp - w[0].samples[0].stamp)
        .max();
    assert!(longest.unwrap().as_ticks() < 60_000, "{longest:?}");
    assert_eq!(frames.last().unwrap().good(), ALL);
    assert_eq!(
        run.scanner.counters().starts[11],
        2,
        "its heading is new: said so"
    );
    assert_eq!(run.scanner.counters().starts[10], 1);
}

#[test]
fn the_chips_identification_in_place_of_a_sample_is_taken_for_a_restart() {
    let mut run = Run::new(moving);
    run.until(UP);
    // Reset and booted again between two reads: pointer 0, mode CONFIG.
    let now = run.now;
    let chip = run.chip(3);
    chip.reset(now);
    chip.boot_until = 0;
    let frames = run.for_ms(200);
    let restarted = Health::Rejected(Fault::Restarted);
    assert!(frames.iter().any(|f| f.samples[3].health == restarted));
    assert_eq!(frames.last().unwrap().good(), ALL);
    assert_eq!(run.scanner.counters().starts[3], 2);
}

#[test]
fn bad_samples_are_rejected_and_the_last_good_one_keeps_its_stamp() {
    // Bit 13 of a component; bit 15 would be put back.
    let flipped = [0x00, 0x20, 0x00, 0x00, 0x00, 0x20, 0x00, 0x20];
    // 170° away from anything near identity, unit.
    let far = [0x94, 0x05, 0x00, 0x00, 0xC1, 0x3F, 0x00, 0x00];
    for (bytes, fault) in [
        (flipped, Fault::NotUnit),
        ([0; 8], Fault::Zero),
        (far, Fault::TooFast),
    ] {
        let mut run = Run::new(still);
        run.until(UP);
        run.chip(8).instead = Some((bytes, 1));
        let frames = run.for_ms(100);
        let index = frames.iter().position(|f| f.good() != ALL).unwrap();
        let (before, bad) = (
            frames[index.max(1) - 1].samples[8],
            frames[index].samples[8],
        );
        assert_eq!(bad.health, Health::Rejected(fault));
        if index > 0 {
            assert_eq!(
                (bad.orientation, bad.stamp),
                (before.orientation, before.stamp)
            );
        }
        assert_eq!(
            frames.iter().filter(|f| f.good() != ALL).count(),
            1,
            "{fault:?}: one sample lost"
        );
        assert_eq!(run.chip(8).resets, 1);
    }
}

#[test]
fn a_sensor_that_stays_bad_is_brought_up_again_ever_more_rarely() {
    let mut run = Run::new(moving);
    run.until(UP);
    run.chip(2).instead = Some(([0x11; 8], u32::MAX));
    let frames = run.for_ms(20_000);
    assert!(frames.iter().skip(5).all(|f| f.good() == ALL & !(1 << 2)));
    let resets = run.chip(2).resets;
    assert!((5..15).contains(&resets), "{resets} resets in 20 s");
    assert!(frames.len() > 1_000);
    assert_eq!(
        run.scanner.counters().zero,
        0,
        "zeros before the first output are no fault"
    );
}

#[test]
fn a_hand_held_still_is_not_frozen_nor_a_finger_that_rests() {
    let mut run = Run::new(still);
    assert!(run.until(5_000_000).iter().all(|f| f.good() == ALL));
    // Only the index moves; 13 sensors give the very same bytes for seconds.
    let index = |micros: u64, k: usize| {
        let mut angles = [0.0; 25];
        angles[5] = 0.8 + 0.8 * libm::sinf(micros as f32 * 2e-6);
        segment_orientations(&angles, crate::hand::Side::Right)[k]
    };
    let mut run = Run::new(index);
    assert!(run.until(10_000_000).iter().all(|f| f.good() == ALL));
}

#[test]
fn a_sensor_whose_parent_turns_while_its_bytes_stand_still_is_frozen() {
    let mut run = Run::new(moving);
    run.until(1_500_000);
    let stuck = registers(&moving(run.now, 5));
    run.chip(5).frozen = Some(stuck);
    let frames = run.for_ms(900);
    let from = frames.iter().position(|f| f.good() != ALL).unwrap();
    assert!((450_000..800_000).contains(&(frames[from].samples[0].stamp.as_ticks() - 1_500_000)));
    assert!(
        frames[from..]
            .iter()
            .all(|f| f.samples[5].health == Health::Rejected(Fault::Frozen))
    );
    assert!(
        frames.iter().all(|f| f.good() | 1 << 5 == ALL),
        "its neighbours are not blamed"
    );
    // It is restarted, and believed again only when it moves.
    let frames = run.for_ms(4_000);
    assert!(frames.iter().all(|f| f.samples[5].health != Health::Good));
    assert!(run.chip(5).resets > 1);
    run.chip(5).frozen = None;
    assert_eq!(run.for_ms(4_000).last().unwrap().good(), ALL);
}

#[test]
fn a_sensor_that_always_flickered_and_stops_while_others_turn_is_frozen() {
    // The hand stands still in the world; every sensor flickers by one count; the little finger moves.
    let flickering = |micros: u64, k: usize| {
        let mut angles = [0.0; 25];
        angles[20] = 0.7 + 0.7 * libm::sinf(micros as f32 * 4e-6);
        let mut q = segment_orientations(&angles, crate::hand::Side::Right)[k].into_inner();
        q.k += if (micros / 10_000).is_multiple_of(2) {
            1.0 / 16_384.0
        } else {
            0.0
        };
        Quaternion::new_unchecked(q)
    };
    let mut run = Run::new(flickering);
    assert!(run.until(4_000_000).iter().all(|f| f.good() == ALL));
    let stuck = registers(&flickering(run.now, 4));
    run.chip(4).frozen = Some(stuck);
    let frames = run.for_ms(1_200);
    assert!(frames.iter().all(|f| f.good() | 1 << 4 == ALL));
    assert_eq!(
        frames.last().unwrap().samples[4].health,
        Health::Rejected(Fault::Frozen)
    );
}

#[test]
fn the_hand_sensor_is_frozen_when_everything_on_it_turns_as_one() {
    // The hand turns as a whole, fingers still in it.
    let whole = |micros: u64, _| Quaternion::from_euler_angles(0.0, micros as f32 * 0.5e-6, 0.0);
    let mut run = Run::new(whole);
    run.until(1_500_000);
    let stuck = registers(&whole(run.now, 0));
    run.chip(0).frozen = Some(stuck);
    let frames = run.for_ms(1_000);
    assert_eq!(
        frames.last().unwrap().samples[0].health,
        Health::Rejected(Fault::Frozen)
    );
    assert_eq!(frames.last().unwrap().good(), ALL & !1);
}

#[test]
fn a_selection_that_did_not_take_never_lets_another_fingers_sample_through() {
    let mut run = Run::new(|_, k| Quaternion::from_euler_angles(0.1 * k as f32, 0.0, 0.0));
    run.until(UP);
    run.scanner.bus_mut().mux_deaf = true;
    let frames = run.for_ms(60);
    for frame in &frames {
        for (k, sample) in frame.samples.iter().enumerate() {
            let own = Quaternion::from_euler_angles(0.1 * k as f32, 0.0, 0.0);
            assert!(
                imu::angle_between(&sample.orientation, &own) < 1e-3,
                "sensor {k}"
            );
        }
    }
    assert!(run.scanner.counters().mux_errors > 0);
    run.scanner.bus_mut().mux_deaf = false;
    assert_eq!(run.for_ms(3_000).last().unwrap().good(), ALL);
}

#[test]
fn a_dead_link_costs_nothing_but_its_state_and_the_sensors_are_not_blamed() {
    let mut run = Run::new(moving);
    run.until(UP);
    run.scanner.bus_mut().up = false;
    let before = run.scanner.bus_mut().batches;
    let frames = run.for_ms(2_000);
    assert!(frames.len() <= 1);
    assert_eq!(
        (run.scanner.state(), run.scanner.bus_mut().batches),
        (State::Resync, before)
    );
    // Nobody knows what the sensors' register pointers did meanwhile.
    (0..16).for_each(|k| run.chip(k).pointer = 0);
    run.scanner.bus_mut().up = true;
    let frames = run.for_ms(300);
    assert_eq!(frames.last().unwrap().good(), ALL);
    assert_eq!(
        run.scanner.counters().restarted,
        0,
        "pointers are written anew"
    );
    assert!(
        (0..16).all(|k| run.chip(k).resets == 1),
        "no sensor is brought up again"
    );
}

#[test]
fn a_missing_multiplexer_is_told_from_missing_sensors() {
    let mut run = Run::new(moving);
    run.scanner.bus_mut().mux_deaf = true;
    assert!(run.until(3_000_000).is_empty());
    assert_eq!(run.scanner.state(), State::Starting);
    let mux = Health::Missing(imu::Error::Mux(bus::Error::Status(0)));
    assert_eq!(run.scanner.health(), [mux; 16]);
}

#[test]
fn a_sensor_whose_register_pointer_runs_on_has_it_written_for_every_read() {
    let mut run = Run::new(moving);
    run.chip(6).runs_on = true;
    let frames = run.until(3_000_000);
    assert!(frames.len() > 100 && frames.iter().all(|f| f.good() == ALL));
}

#[test]
fn a_period_keeps_scans_apart() {
    let mut run = Run::new(moving);
    let config = Config {
        period: Duration::from_ticks(50_000),
        ..Config::default()
    };
    run.scanner = BusScanner::on(Fake::new(moving), config);
    let frames = run.until(3_000_000);
    let gaps = frames
        .windows(2)
        .map(|w| (w[1].samples[0].stamp - w[0].samples[0].stamp).as_ticks());
    assert!(
        gaps.clone().all(|gap| (50_000..51_000).contains(&gap)),
        "{:?}",
        gaps.collect::<Vec<_>>()
    );
}
