//! Rule 1: nothing moves at start; holds repeat; engaging blends.

use super::*;

#[test]
fn nothing_is_written_before_the_clutch_closes() {
    let mut bench = Bench::new(Settings::default());
    assert_eq!(bench.ticks(300).state, State::Idle);
    assert!(bench.sent.is_empty());
}

#[test]
fn first_command_repeats_the_echo_in_contact_and_the_position_elsewhere() {
    let mut bench = Bench::new(Settings::default());
    bench.beating = true;
    *bench.status() = Status {
        contact: [
            Contact::ContactClosing,
            Contact::ContactOpening,
            Contact::Moving,
            Contact::AtPosition,
        ],
        echo: [255, 0, 99, 137],
        ..status([100, 50, 60, 136])
    };
    // The gripper stands still, so that what is repeated can only be this.
    bench.speed = 0;
    bench.until(|state| state == State::Blending);
    assert_eq!(bench.sent[0].1, [255, 0, 60, 136]);
    assert_eq!(
        bench.sent.last().unwrap().1[..2],
        [255, 0],
        "the first step of the blend still repeats"
    );
}

#[test]
fn a_hold_repeats_the_echo_in_contact_and_the_position_elsewhere() {
    let mut bench = following();
    bench.output = [20.0; 4];
    bench.ticks(30);
    bench.status().contact[1] = Contact::ContactClosing;
    bench.beating = false;
    bench.inputs.clutch = Clutch::Open;
    let echo = bench.status().echo;
    let output = bench.tick();
    let position = bench.status().position;
    assert_eq!(output.state, State::Idle);
    let held = output.motion.unwrap().position;
    assert_eq!(held, [position[0], echo[1], position[2], position[3]]);
    assert_ne!(echo[0], held[0], "it was still on its way");
    // The same again and again, wherever the gripper comes to rest.
    for _ in 0..100 {
        assert_eq!(bench.tick().motion.unwrap().position, held);
    }
}

#[test]
fn an_axis_that_meets_something_while_held_keeps_pressing_as_it_did() {
    let mut bench = following();
    bench.output = [20.0; 4];
    bench.ticks(10);
    bench.inputs.clutch = Clutch::Open;
    bench.beating = false;
    let pressed = bench.status().echo[0];
    bench.tick();
    // The status of the next cycle still echoes the command before the hold, and now it touches.
    bench.status().echo[0] = pressed;
    bench.status().contact[0] = Contact::ContactClosing;
    assert_eq!(bench.tick().motion.unwrap().position[0], pressed);
}

#[test]
fn a_gripper_that_goes_nowhere_is_not_written_to_by_a_hold() {
    let mut bench = Bench::new(Settings::default());
    bench.beating = true;
    bench.status().going_to = false;
    bench.frames = false;
    assert!(matches!(bench.ticks(20).state, State::Holding(_)));
    assert!(bench.sent.is_empty(), "raising rGTO could start it");
}

#[test]
fn speed_and_force_are_the_configured_ones_in_every_command() {
    let settings = Settings {
        speed: [1, 2, 3, 4],
        force: [5, 6, 7, 8],
        ..Settings::default()
    };
    let mut bench = Bench::new(settings);
    bench.beating = true;
    for tick in 0..600 {
        bench.frames = tick < 300;
        if let Some(motion) = bench.tick().motion {
            assert_eq!((motion.speed, motion.force), ([1, 2, 3, 4], [5, 6, 7, 8]));
        }
    }
}

#[test]
fn motion_starts_after_five_fresh_frames_in_a_row_and_not_before() {
    let mut bench = Bench::new(Settings::default());
    bench.beating = true;
    bench.frames = false;
    bench.ticks(3);
    for frame in 1..=5 {
        bench.frame(Ok(bench.output), bench.now);
        let state = bench.tick().state;
        if frame < 5 {
            assert_eq!(state, State::Holding(HoldReason::Settling), "after {frame}");
        } else {
            assert_eq!(state, State::Blending);
        }
    }
}

#[test]
fn a_frame_that_gives_no_output_starts_the_count_anew() {
    let mut bench = Bench::new(Settings::default());
    bench.beating = true;
    bench.frames = false;
    let lost = Err(HoldReason::SensorsLost(1));
    let good = Ok(bench.output);
    for output in [good, good, good, good, lost, good, good, good, good] {
        bench.frame(output, bench.now);
        assert!(!bench.tick().state.is_moving());
    }
    bench.frame(good, bench.now);
    assert_eq!(bench.tick().state, State::Blending);
}

#[test]
fn the_same_frame_given_again_does_not_count_again() {
    let mut bench = Bench::new(Settings::default());
    bench.beating = true;
    bench.frames = false;
    bench.frame(Ok(bench.output), bench.now);
    for _ in 0..8 {
        assert!(!bench.tick().state.is_moving());
    }
}

#[test]
fn motion_needs_a_gripper_that_is_ready() {
    for activation in [
        Activation::Reset,
        Activation::Activating,
        Activation::ChangingMode,
    ] {
        let mut bench = Bench::new(Settings::default());
        bench.beating = true;
        bench.status().activation = activation;
        let output = bench.ticks(200);
        assert_eq!(
            output.state,
            State::Holding(HoldReason::GripperNotReady(activation))
        );
        assert!(bench.sent.is_empty());
        bench.status().activation = Activation::Ready;
        bench.until(|state| state == State::Following);
    }
}

#[test]
fn motion_needs_a_gripper_that_answers() {
    let mut bench = Bench::new(Settings::default());
    bench.beating = true;
    bench.answering = false;
    bench.inputs.status = None;
    assert_eq!(
        bench.ticks(100).state,
        State::Holding(HoldReason::GripperSilent)
    );
    assert!(bench.sent.is_empty());
}

#[test]
fn without_weights_nothing_moves() {
    let mut bench = Bench::new(Settings::default());
    bench.beating = true;
    bench.inputs.weights = Weights::Missing;
    assert_eq!(
        bench.ticks(100).state,
        State::Holding(HoldReason::NoWeights)
    );
    bench.inputs.weights = Weights::Busy;
    assert_eq!(
        bench.ticks(100).state,
        State::Holding(HoldReason::StoreBusy)
    );
    let start = bench.sent[0].1;
    assert!(bench.sent.iter().all(|(_, position)| *position == start));
}

#[test]
fn engaging_blends_from_where_the_gripper_is_within_the_stated_time() {
    let mut bench = Bench::new(Settings::default());
    bench.speed = 10;
    bench.beating = true;
    let first = bench.until(|state| state == State::Blending);
    assert_eq!(first.motion.unwrap().position, [10, 20, 30, 137]);
    let start = bench.now;
    // Halfway through the second, about halfway there: smoothstep(0.5) = 0.5.
    bench.ticks(50);
    let half = bench.last.unwrap().motion.unwrap().position;
    assert!((i16::from(half[0]) - 105).abs() <= 3, "{half:?}");
    let done = bench.until(|state| state == State::Following);
    assert_eq!(bench.now - start, 1_000 * MS);
    assert!((i16::from(done.motion.unwrap().position[0]) - 200).abs() <= 1);
}

#[test]
fn engaging_again_blends_from_where_the_gripper_is_then() {
    let mut bench = following();
    bench.speed = 10;
    bench.ticks(100);
    bench.beating = false;
    bench.inputs.clutch = Clutch::Open;
    bench.ticks(100);
    bench.output = [0.0, 0.0, 0.0, 0.0];
    bench.beating = true;
    let before = bench.status().position;
    let output = bench.until(|state| state == State::Blending);
    assert_eq!(output.motion.unwrap().position, before);
    let next = bench.tick().motion.unwrap().position;
    assert!(
        (0..4).all(|axis| before[axis].abs_diff(next[axis]) <= 2),
        "{before:?} {next:?}"
    );
}
