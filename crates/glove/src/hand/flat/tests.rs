use super::*;
use crate::hand::{JOINT_COUNT, JOINT_NAMES, Side, joint_angles, segment_orientations};
use crate::imu::Fault;
use crate::scan::{Health, Sample};

extern crate std;
use std::format;

const SCAN: u64 = 27_000;
const S: u64 = 1_000_000;

fn at(us: u64) -> Instant {
    Instant::from_ticks(us)
}

fn frame(orientations: [Quaternion; SEGMENT_COUNT], us: u64) -> Frame {
    Frame {
        samples: orientations.map(|orientation| Sample {
            orientation,
            stamp: at(us),
            health: Health::Good,
        }),
        sequence: 0,
    }
}

/// Feeds what `hand` makes of the time, scan by scan, until the end.
fn run(
    mut flat: FlatHand,
    mut hand: impl FnMut(u64) -> Frame,
) -> (Result<Calibration, Refusal>, u64) {
    let mut us = 0;
    loop {
        us += SCAN;
        match flat.take(&hand(us), at(us)) {
            Progress::Waiting { .. } => assert!(us < 40 * S, "a bounded wait"),
            Progress::Done(calibration) => return (Ok(calibration), us),
            Progress::Refused(refusal) => return (Err(refusal), us),
        }
    }
}

fn start(wait: u64) -> FlatHand {
    FlatHand::start(at(0), Duration::from_ticks(wait), &Calibration::identity())
}

fn posed(angles: &[f32; JOINT_COUNT]) -> [Quaternion; SEGMENT_COUNT] {
    segment_orientations(angles, Side::Right)
}

fn joint(name: &str) -> usize {
    JOINT_NAMES.iter().position(|n| *n == name).unwrap()
}

fn turned(degrees: f32) -> Quaternion {
    Quaternion::from_euler_angles(degrees.to_radians(), 0.0, 0.0)
}

#[test]
fn a_hand_still_for_a_second_is_taken_and_not_a_frame_earlier() {
    let flat = [turned(20.0); SEGMENT_COUNT];
    let (result, took) = run(start(2 * S), |us| frame(flat, us));
    let angles = joint_angles(&flat, &result.unwrap(), Side::Right);
    assert!(angles.iter().all(|a| a.abs() < 1e-3), "{angles:?}");
    assert!((S + SCAN..S + 2 * SCAN).contains(&took), "{took}");
}

#[test]
fn the_mean_of_the_second_is_taken_and_not_one_frame() {
    // The index's tip swings by 2.5° once a scan: each frame is off, their mean is not.
    let (result, _) = run(start(2 * S), |us| {
        let mut q = [Quaternion::identity(); SEGMENT_COUNT];
        let side = if (us / SCAN).is_multiple_of(2) {
            1.25
        } else {
            -1.25
        };
        q[6] = turned(side);
        frame(q, us)
    });
    let tip = result.unwrap().mounting()[6];
    assert!(
        imu::angle_between(&tip, &Quaternion::identity()).to_degrees() < 0.1,
        "{tip}"
    );
}

#[test]
fn the_sign_of_a_quaternion_does_not_spoil_the_mean() {
    let q = turned(40.0);
    let (result, _) = run(start(2 * S), |us| {
        let mut hand = [q; SEGMENT_COUNT];
        if (us / SCAN).is_multiple_of(2) {
            hand[9] = Quaternion::new_unchecked(-q.into_inner());
        }
        frame(hand, us)
    });
    let mounting = result.unwrap().mounting()[9];
    assert!(imu::angle_between(&mounting, &Quaternion::identity()) < 1e-3);
}

#[test]
fn a_tremor_within_limits_and_a_flicker_by_a_digit_are_accepted() {
    let (result, _) = run(start(2 * S), |us| {
        let t = us as f32 * 1e-6;
        let tremor = turned(1.0 * libm::sinf(t * 9.0 * core::f32::consts::TAU));
        let mut raw = tremor.into_inner();
        raw.k += if (us / SCAN).is_multiple_of(3) {
            1.0 / 16_384.0
        } else {
            0.0
        };
        frame([Quaternion::new_normalize(raw); SEGMENT_COUNT], us)
    });
    assert!(result.is_ok(), "{result:?}");
}

#[test]
fn a_moving_hand_is_refused_and_the_segment_named() {
    let (result, took) = run(start(2 * S), |us| {
        let mut angles = [0.0; JOINT_COUNT];
        angles[joint("ring_pip_flex")] = 0.5 + 0.5 * libm::sinf(us as f32 * 6e-6);
        frame(posed(&angles), us)
    });
    let Err(refusal @ Refusal::Moving { segment, by }) = result else {
        panic!("{result:?}")
    };
    let name = SEGMENT_NAMES[usize::from(segment)];
    assert!(["ring_middle", "ring_distal"].contains(&name), "{refusal}");
    assert!(by.to_degrees() > 3.0);
    assert!((2 * S..2 * S + 2 * SCAN).contains(&took), "in time: {took}");
    assert!(
        format!("{refusal}").starts_with("the hand moves: ring_"),
        "{refusal}"
    );
}

#[test]
fn a_hand_that_turns_slowly_all_the_while_is_moving() {
    let (result, _) = run(start(4 * S), |us| {
        frame([turned(us as f32 * 6e-6); SEGMENT_COUNT], us)
    });
    assert!(matches!(result, Err(Refusal::Moving { .. })), "{result:?}");
}

#[test]
fn a_hand_that_comes_to_rest_within_the_wait_is_taken_then() {
    let (result, took) = run(start(30 * S), |us| {
        let t = us.min(12 * S) as f32 * 1e-6;
        frame(
            [turned(20.0 * libm::sinf(3.0 * (t - 12.0))); SEGMENT_COUNT],
            us,
        )
    });
    assert!(result.is_ok());
    assert!(
        (12 * S + 900_000..13 * S + 2 * SCAN).contains(&took),
        "{took}"
    );
}

#[test]
fn a_fist_is_refused_in_any_attitude_that_tilts_it_and_the_joint_named() {
    let mut fist = [0.0; JOINT_COUNT];
    for finger in ["index", "middle", "ring", "little"] {
        fist[joint(&format!("{finger}_mcp_flex"))] = 1.2;
        fist[joint(&format!("{finger}_pip_flex"))] = 1.43;
        fist[joint(&format!("{finger}_dip_flex"))] = 0.9;
    }
    // Fingers up, palm down, thumb half up; each with a heading of its own.
    for (attitude, (roll, pitch)) in [(0.0, 0.0), (-1.57, 0.0), (-1.0, 0.8)]
        .into_iter()
        .enumerate()
    {
        let hand = Quaternion::from_euler_angles(roll, pitch, 0.0);
        let (result, _) = run(start(2 * S), |us| {
            let mut sensors = posed(&fist).map(|q| hand * q);
            for (k, q) in sensors.iter_mut().enumerate() {
                *q = Quaternion::from_euler_angles(0.0, 0.0, 0.7 * k as f32) * *q;
            }
            frame(sensors, us)
        });
        let Err(refusal @ Refusal::Bent { joint, by }) = result else {
            panic!("attitude {attitude}: {result:?}")
        };
        assert!(JOINT_NAMES[usize::from(joint)].ends_with("_flex"));
        assert!(by.to_degrees() > 35.0, "{refusal}");
    }
}

#[test]
fn fingers_bent_a_little_at_every_joint_are_refused_for_their_sum() {
    let mut angles = [0.0; JOINT_COUNT];
    for part in ["mcp", "pip", "dip"] {
        angles[joint(&format!("middle_{part}_flex"))] = 0.45;
    }
    let (result, _) = run(start(2 * S), |us| frame(posed(&angles), us));
    assert!(
        matches!(result, Err(Refusal::Bent { joint, .. }) if JOINT_NAMES[usize::from(joint)] == "middle_dip_flex"),
        "{result:?}"
    );
}

#[test]
fn sensors_sewn_on_by_eye_and_any_headings_are_taken() {
    // 15° each, every which way; headings all around.
    let (result, _) = run(start(2 * S), |us| {
        frame(
            core::array::from_fn(|k| {
                let askew =
                    Quaternion::from_euler_angles(if k % 2 == 0 { 0.26 } else { -0.26 }, 0.0, 0.0);
                Quaternion::from_euler_angles(0.0, 0.0, k as f32)
                    * Quaternion::from_euler_angles(-1.57, 0.0, 0.0)
                    * askew
            }),
            us,
        )
    });
    assert!(result.is_ok(), "{result:?}");
}

#[test]
fn what_is_flat_is_judged_against_the_calibration_before() {
    // Sewn on upside down: refused as straight ones, taken against a calibration that knows it.
    let mut sensors = [Quaternion::identity(); SEGMENT_COUNT];
    sensors[8] = turned(180.0);
    let (result, _) = run(start(2 * S), |us| frame(sensors, us));
    assert!(matches!(result, Err(Refusal::Bent { .. })), "{result:?}");
    let before = Calibration::from_flat_hand(&sensors);
    let wait = Duration::from_ticks(2 * S);
    let known = FlatHand::start(at(0), wait, &before);
    let (result, _) = run(known, |us| frame(sensors, us));
    assert!(result.is_ok(), "{result:?}");
}

#[test]
fn one_dropped_sample_is_tolerated_and_a_sensor_that_is_away_is_named() {
    let rejected = Health::Rejected(Fault::NotUnit);
    let drop = |away: fn(u64) -> bool| {
        run(start(2 * S), move |us| {
            let mut frame = frame([Quaternion::identity(); SEGMENT_COUNT], us);
            if away(us / SCAN) {
                frame.samples[5].health = rejected;
                frame.samples[5].orientation = turned(90.0);
            }
            frame
        })
    };
    let (result, took) = drop(|scan| scan == 1 || scan.is_multiple_of(10));
    assert!(
        result.is_ok() && took < S + 3 * SCAN,
        "{result:?} after {took}"
    );
    let (result, _) = drop(|scan| scan > 20);
    assert_eq!(result, Err(Refusal::Missing { segments: 1 << 5 }));
    let (result, _) = drop(|_| true);
    assert_eq!(result, Err(Refusal::Missing { segments: 1 << 5 }));
    assert_eq!(
        format!("{}", result.unwrap_err()),
        "no good sample from: index_middle"
    );
}

#[test]
fn no_frames_are_a_refusal_in_time_and_a_gap_begins_the_second_anew() {
    let flat = start(2 * S);
    assert!(matches!(
        flat.progress(at(2 * S - 1)),
        Progress::Waiting { .. }
    ));
    assert_eq!(
        flat.progress(at(2 * S)),
        Progress::Refused(Refusal::NoFrames)
    );
    let mut flat = start(30 * S);
    let still = |us| frame([Quaternion::identity(); SEGMENT_COUNT], us);
    for us in [100_000, 250_000, 400_000, 1_300_000] {
        assert!(matches!(
            flat.take(&still(us), at(us)),
            Progress::Waiting { .. }
        ));
    }
    let Progress::Waiting { still: so_far, .. } = flat.progress(at(1_310_000)) else {
        panic!("still waiting")
    };
    assert!(so_far.as_ticks() <= 10_000, "{so_far:?}");
}

#[test]
fn a_time_too_short_says_so() {
    let (result, _) = run(start(S / 2), |us| {
        frame([Quaternion::identity(); SEGMENT_COUNT], us)
    });
    assert!(matches!(result, Err(Refusal::TooShort { .. })));
}
