//! One fact of the rules a test, with hand-made times.

extern crate std;

use super::*;
use crate::config::{SafeAction, Settings};
use gripper::Contact;
use std::vec::Vec;

const MS: u64 = 1_000;

/// A supervisor with a gripper that does what it is told, at a finite speed, and a hand that stands still.
struct Bench {
    now: u64,
    supervisor: Supervisor<4>,
    inputs: Inputs<4>,
    /// The heartbeat comes, frames come, the gripper answers, it obeys.
    beating: bool,
    frames: bool,
    answering: bool,
    output: [f32; 4],
    /// Counts per 10 ms.
    speed: u8,
    sent: Vec<(u64, [u8; 4])>,
    last: Option<Output<4>>,
}

fn at(us: u64) -> Instant {
    Instant::from_ticks(us)
}

fn status(position: [u8; 4]) -> Status<4> {
    Status {
        stamp: at(0),
        activation: Activation::Ready,
        going_to: true,
        contact: [Contact::AtPosition; 4],
        echo: position,
        position,
        current: [0; 4],
        fault: Fault::None,
    }
}

impl Bench {
    fn new(settings: Settings<4>) -> Self {
        Self {
            now: 1_000 * MS,
            supervisor: Supervisor::new(Config::new(settings).unwrap()),
            inputs: Inputs {
                heartbeat: None,
                hand: None,
                status: Some(status([10, 20, 30, 137])),
                weights: Weights::Ready,
            },
            beating: false,
            frames: true,
            answering: true,
            output: [200.0, 150.0, 100.0, 100.0],
            speed: 2,
            sent: Vec::new(),
            last: None,
        }
    }

    fn status(&mut self) -> &mut Status<4> {
        self.inputs.status.as_mut().unwrap()
    }

    /// 10 ms: the gripper moves, devices answer, the supervisor steps.
    fn tick(&mut self) -> Output<4> {
        self.now += 10 * MS;
        let now = self.now;
        if self.answering {
            self.answer(now);
        }
        if self.frames && (now / (10 * MS)).is_multiple_of(3) {
            self.frame(Ok(self.output), now - 5 * MS);
        }
        if self.beating {
            self.inputs.heartbeat = Some(at(now));
        }
        self.step()
    }

    fn step(&mut self) -> Output<4> {
        let output = self.supervisor.step(at(self.now), &self.inputs);
        if let Some(motion) = output.motion {
            self.sent.push((self.now, motion.position));
            if self.answering {
                self.status().echo = motion.position;
                self.status().going_to = true;
            }
        }
        self.last = Some(output);
        output
    }

    fn answer(&mut self, now: u64) {
        let speed = self.speed;
        let status = self.status();
        status.stamp = at(now);
        for axis in 0..4 {
            if status.contact[axis] == Contact::AtPosition {
                let (here, goal) = (status.position[axis], status.echo[axis]);
                status.position[axis] =
                    goal.clamp(here.saturating_sub(speed), here.saturating_add(speed));
            }
        }
    }

    fn frame(&mut self, output: Result<[f32; 4], HoldReason>, stamp: u64) {
        let sequence = self.inputs.hand.map_or(0, |hand| hand.sequence + 1);
        self.inputs.hand = Some(Hand {
            sequence,
            stamp: at(stamp),
            output,
        });
    }

    fn ticks(&mut self, count: usize) -> Output<4> {
        for _ in 0..count {
            self.tick();
        }
        self.last.unwrap()
    }

    /// Ticks until `state`; panics after 5 s.
    fn until(&mut self, state: impl Fn(State) -> bool) -> Output<4> {
        for _ in 0..500 {
            let output = self.tick();
            if state(output.state) {
                return output;
            }
        }
        panic!("still {:?} after 5 s", self.supervisor.state());
    }

    fn following(settings: Settings<4>) -> Self {
        let mut bench = Self::new(settings);
        bench.beating = true;
        bench.until(|state| state == State::Following);
        bench
    }
}

fn following() -> Bench {
    Bench::following(Settings::default())
}

// Rule 1

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
    bench.inputs.heartbeat = None;
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
    bench.inputs.heartbeat = None;
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
    bench.inputs.heartbeat = None;
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

// Rule 2

#[test]
fn a_glove_that_stops_is_held_when_its_oldest_sample_is_older_than_100_ms() {
    let mut bench = following();
    bench.frames = false;
    let stamp = bench.inputs.hand.unwrap().stamp;
    loop {
        let output = bench.tick();
        let age = at(bench.now).checked_duration_since(stamp).unwrap();
        assert_eq!(output.state.is_moving(), age <= timing::MAX_AGE, "{age}");
        if !output.state.is_moving() {
            assert_eq!(output.state, State::Holding(HoldReason::SamplesStale));
            break;
        }
        assert!(output.stamp <= stamp);
    }
}

#[test]
fn a_sample_of_exactly_100_ms_serves_and_one_microsecond_more_does_not() {
    let mut bench = following();
    bench.frames = false;
    bench.frame(Ok(bench.output), bench.now);
    bench.beating = false;
    for (age, moving) in [(50_000, true), (100_000, true), (100_001, false)] {
        let mut copy = Bench {
            supervisor: bench.supervisor.clone(),
            sent: Vec::new(),
            ..bench
        };
        copy.now = bench.now + age;
        copy.inputs.heartbeat = Some(at(copy.now));
        copy.inputs.status.as_mut().unwrap().stamp = at(copy.now);
        // No stall: a step in between.
        let now = copy.now;
        copy.now = bench.now + age / 2;
        copy.inputs.status.as_mut().unwrap().stamp = at(copy.now);
        copy.step();
        copy.now = now;
        copy.inputs.status.as_mut().unwrap().stamp = at(now);
        assert_eq!(copy.step().state.is_moving(), moving, "{age}");
    }
}

#[test]
fn a_status_older_than_100_ms_ends_commands_altogether() {
    let mut bench = following();
    bench.answering = false;
    let output = bench.ticks(11);
    assert_eq!(output.state, State::Holding(HoldReason::GripperSilent));
    assert_eq!(output.motion, None);
    bench.answering = true;
    // It answers again, and enough fresh frames came meanwhile: motion goes on by itself, blending.
    let output = bench.tick();
    assert_eq!(output.state, State::Blending);
    assert_eq!(output.motion.unwrap().position, bench.status().position);
}

#[test]
fn the_clutch_opens_250_ms_after_the_last_heartbeat() {
    let mut bench = following();
    bench.beating = false;
    let start = bench.now;
    bench.until(|state| state == State::Holding(HoldReason::HeartbeatLost));
    assert_eq!(bench.now - start, 250 * MS);
}

#[test]
fn a_release_holds_in_the_next_step() {
    let mut bench = following();
    bench.beating = false;
    bench.inputs.heartbeat = None;
    assert_eq!(bench.tick().state, State::Idle);
}

#[test]
fn after_500_ms_of_hold_the_safe_action_comes_and_hold_is_the_default() {
    let mut bench = following();
    bench.ticks(50);
    bench.frames = false;
    bench.until(|state| state == State::Holding(HoldReason::SamplesStale));
    let start = bench.now;
    let held = bench.last.unwrap().motion.unwrap().position;
    bench.until(|state| state == State::SafeAction(HoldReason::SamplesStale));
    assert_eq!(bench.now - start, 500 * MS);
    assert_eq!(bench.ticks(500).motion.unwrap().position, held);
}

#[test]
fn opening_slowly_opens_the_fingers_at_its_rate_and_leaves_the_scissor() {
    let settings = Settings {
        safe_action: SafeAction::OpenSlowly,
        ..Settings::default()
    };
    let mut bench = Bench::following(settings);
    bench.ticks(200);
    bench.frames = false;
    bench.until(|state| matches!(state, State::SafeAction(_)));
    let start = bench.last.unwrap().motion.unwrap().position;
    // 40 counts/s for a second.
    let later = bench.ticks(100).motion.unwrap().position;
    for axis in 0..3 {
        assert_eq!(start[axis].saturating_sub(later[axis]), 40, "axis {axis}");
    }
    assert_eq!(start[3], later[3]);
    let end = bench.ticks(700).motion.unwrap().position;
    assert_eq!(end, [0, 0, 0, start[3]]);
}

#[test]
fn a_release_ends_the_opening_where_the_gripper_is() {
    let settings = Settings {
        safe_action: SafeAction::OpenSlowly,
        ..Settings::default()
    };
    let mut bench = Bench::following(settings);
    bench.ticks(200);
    bench.beating = false;
    bench.until(|state| state == State::SafeAction(HoldReason::HeartbeatLost));
    bench.ticks(100);
    bench.inputs.heartbeat = None;
    let output = bench.tick();
    assert_eq!(output.motion.unwrap().position, bench.status().position);
    let stays = bench.ticks(100).motion.unwrap().position;
    assert_eq!(stays, output.motion.unwrap().position);
}

#[test]
fn the_safe_action_never_moves_what_has_not_moved_under_this_clutch() {
    let settings = Settings {
        safe_action: SafeAction::OpenSlowly,
        ..Settings::default()
    };
    let mut bench = Bench::new(settings);
    bench.beating = true;
    bench.frames = false;
    let output = bench.ticks(300);
    assert_eq!(output.state, State::Holding(HoldReason::SamplesStale));
    assert_eq!(output.motion.unwrap().position, [10, 20, 30, 137]);
}

#[test]
fn a_glove_that_comes_back_is_followed_again_with_a_blend() {
    let mut bench = following();
    bench.frames = false;
    bench.ticks(300);
    bench.frames = true;
    bench.until(|state| state == State::Blending);
    bench.until(|state| state == State::Following);
}

// Rule 3

#[test]
fn no_command_leads_a_gripper_that_does_not_move_by_more_than_40_counts() {
    let mut bench = Bench::new(Settings::default());
    bench.speed = 0;
    bench.beating = true;
    bench.output = [255.0, 255.0, 255.0, 0.0];
    bench.ticks(400);
    let greatest: [u8; 4] = bench.sent.last().unwrap().1;
    assert_eq!(greatest, [50, 60, 70, 97]);
    let start = [10u8, 20, 30, 137];
    for (_, position) in &bench.sent {
        assert!(
            (0..4).all(|axis| position[axis].abs_diff(start[axis]) <= 40),
            "{position:?}"
        );
    }
}

#[test]
fn a_smaller_lead_can_be_configured() {
    let mut bench = Bench::new(Settings {
        lead: 7,
        ..Settings::default()
    });
    bench.speed = 0;
    bench.beating = true;
    bench.ticks(400);
    assert_eq!(bench.sent.last().unwrap().1, [17, 27, 37, 130]);
}

#[test]
fn a_held_axis_that_is_pushed_away_is_given_up_to_the_lead() {
    let mut bench = following();
    bench.speed = 0;
    bench.beating = false;
    bench.inputs.heartbeat = None;
    let held = bench.ticks(5).motion.unwrap().position;
    bench.status().position[0] = held[0] - 60;
    let pushed = bench.tick().motion.unwrap().position;
    assert_eq!(pushed[0], held[0] - 20);
    assert_eq!(pushed[1..], held[1..]);
}

#[test]
fn no_command_changes_faster_than_the_configured_rate() {
    let mut bench = Bench::following(Settings {
        rate: 100.0,
        ..Settings::default()
    });
    bench.speed = 255;
    bench.ticks(300);
    bench.output = [0.0; 4];
    bench.sent.clear();
    bench.ticks(300);
    for pair in bench.sent.windows(2) {
        let steps = (0..4).map(|axis| pair[0].1[axis].abs_diff(pair[1].1[axis]));
        assert!(steps.max().unwrap() <= 1, "{pair:?}");
    }
    assert_eq!(bench.sent.last().unwrap().1, [0; 4]);
}

// Rule 4 and the map

#[test]
fn one_bad_frame_does_not_end_motion_and_100_ms_of_them_do() {
    let mut bench = following();
    bench.frames = false;
    bench.frame(Err(HoldReason::SensorsLost(0b11)), bench.now);
    assert_eq!(bench.ticks(8).state, State::Following);
    bench.frame(Err(HoldReason::SensorsLost(0b11)), bench.now);
    assert_eq!(
        bench.ticks(5).state,
        State::Holding(HoldReason::SensorsLost(0b11))
    );
}

#[test]
fn what_the_map_refuses_or_gives_out_of_range_holds_at_once() {
    type Case = (Result<[f32; 4], HoldReason>, HoldReason);
    let cases: [Case; 5] = [
        (Err(HoldReason::InputRefused), HoldReason::InputRefused),
        (Ok([0.0, f32::NAN, 0.0, 0.0]), HoldReason::OutputRefused),
        (
            Ok([0.0, f32::INFINITY, 0.0, 0.0]),
            HoldReason::OutputRefused,
        ),
        (Ok([0.0, 0.0, 511.0, 0.0]), HoldReason::OutputRefused),
        (Ok([-256.0, 0.0, 0.0, 0.0]), HoldReason::OutputRefused),
    ];
    for (output, reason) in cases {
        let mut bench = following();
        bench.frames = false;
        bench.frame(output, bench.now);
        assert_eq!(bench.tick().state, State::Holding(reason));
        bench.frames = true;
        bench.until(|state| state == State::Following);
    }
}

// Configuration space

#[test]
fn a_target_outside_the_configuration_space_is_answered_inside() {
    let mut bench = Bench::new(Settings::default());
    bench.speed = 10;
    bench.beating = true;
    bench.output = [250.0, 250.0, 250.0, 250.0];
    bench.ticks(600);
    for (_, position) in &bench.sent {
        assert!(limits::inside(position), "{position:?}");
    }
}

/// From "fingers closed, scissor wide" to "fingers open, pinch" and back: the straight line leaves the space.
#[test]
fn the_way_around_the_forbidden_corner_is_found_both_ways_without_touching_it() {
    let mut bench = Bench::new(Settings::default());
    // The scissor is as fast as the fingers are slow: commands alone inside the space would not do.
    bench.speed = 3;
    bench.beating = true;
    for goal in [
        [240.0, 240.0, 240.0, 60.0],
        [40.0, 40.0, 40.0, 250.0],
        [240.0, 240.0, 240.0, 60.0],
    ] {
        bench.output = goal;
        for _ in 0..600 {
            bench.tick();
            let position = bench.status().position;
            assert!(limits::inside(&position), "{position:?}");
        }
        let position = bench.status().position;
        assert!(
            (0..4).all(|axis| (f32::from(position[axis]) - goal[axis]).abs() <= 1.0),
            "{position:?} {goal:?}"
        );
    }
}

#[test]
fn a_gripper_found_outside_the_space_opens_until_it_is_inside() {
    let mut bench = Bench::new(Settings::default());
    *bench.status() = status([200, 200, 200, 230]);
    bench.beating = true;
    bench.output = [250.0, 100.0, 100.0, 100.0];
    let mut before = [200, 200, 200, 230];
    for _ in 0..800 {
        let position = bench.tick().motion.map_or(before, |motion| motion.position);
        if !limits::inside(&bench.status().position) {
            assert!((0..4).all(|axis| position[axis]
                <= bench.inputs.status.unwrap().position[axis].max(before[axis])));
        }
        before = position;
    }
    let position = bench.status().position;
    assert!(
        (0..4).all(|axis| (f32::from(position[axis]) - bench.output[axis]).abs() <= 1.0),
        "{position:?}"
    );
}

// Faults of the gripper

#[test]
fn a_fault_ends_motion_until_the_clutch_is_opened_and_the_fault_is_gone() {
    let mut bench = following();
    bench.status().fault = Fault::Interference;
    let faulted = State::Faulted(GripperFault::Reported(Fault::Interference));
    assert_eq!(bench.tick().state, faulted);
    bench.status().fault = Fault::None;
    assert_eq!(
        bench.ticks(300).state,
        faulted,
        "the person has not opened the clutch"
    );
    bench.beating = false;
    bench.inputs.heartbeat = None;
    assert_eq!(bench.tick().state, State::Idle);
    bench.beating = true;
    bench.until(|state| state == State::Following);
}

#[test]
fn a_minor_fault_is_held_and_a_release_or_major_fault_is_left_alone() {
    for (fault, written) in [
        (Fault::Interference, true),
        (Fault::ChipNotReady, true),
        (Fault::Releasing, false),
        (Fault::Released, false),
        (Fault::InterferenceLasting, false),
        (Fault::Activation, false),
    ] {
        let mut bench = following();
        bench.status().fault = fault;
        assert_eq!(bench.tick().motion.is_some(), written, "{fault:?}");
    }
}

#[test]
fn a_lost_activation_is_a_fault_of_its_own() {
    let mut bench = following();
    bench.status().activation = Activation::Reset;
    let output = bench.tick();
    assert_eq!(
        output.state,
        State::Faulted(GripperFault::ActivationLost(Activation::Reset))
    );
    assert_eq!(output.motion, None);
    // Activated again by somebody: still nothing moves before the clutch was opened.
    bench.status().activation = Activation::Ready;
    assert!(matches!(bench.ticks(200).state, State::Faulted(_)));
}

#[test]
fn a_mode_change_holds_and_motion_goes_on_after_it() {
    let mut bench = following();
    bench.status().activation = Activation::ChangingMode;
    let output = bench.ticks(50);
    assert_eq!(
        output.state,
        State::Holding(HoldReason::GripperNotReady(Activation::ChangingMode))
    );
    assert_eq!(
        output.motion, None,
        "commands meanwhile would give fault 06"
    );
    bench.status().activation = Activation::Ready;
    bench.until(|state| state == State::Following);
}

#[test]
fn a_gripper_that_ignores_its_commands_for_500_ms_is_a_fault() {
    let mut bench = following();
    bench.answering = false;
    let mut ticks = 0;
    loop {
        bench.status().going_to = false;
        bench.status().stamp = at(bench.now + 10 * MS);
        ticks += 1;
        if bench.tick().state == State::Faulted(GripperFault::CommandIgnored) {
            break;
        }
        assert!(ticks < 60);
    }
    assert_eq!(ticks, 51);
}

// Clocks and deadlines

#[test]
fn a_step_that_comes_more_than_2_ms_late_says_so() {
    for (gap, late) in [(10, None), (12, None), (13, Some(3)), (60, Some(50))] {
        let mut bench = following();
        bench.now += gap * MS;
        let output = bench.step();
        assert_eq!(
            output.late,
            late.map(|ms: u64| Duration::from_ticks(ms * MS)),
            "{gap} ms"
        );
    }
}

#[test]
fn a_stall_of_more_than_100_ms_holds_and_settles_anew() {
    let mut bench = following();
    bench.now += 91 * MS;
    let output = bench.tick();
    assert_eq!(output.state, State::Holding(HoldReason::ClockGap));
    let State::Holding(reason) = bench.tick().state else {
        panic!("moving");
    };
    assert!(matches!(
        reason,
        HoldReason::SamplesStale | HoldReason::Settling
    ));
    bench.until(|state| state == State::Following);
}

#[test]
fn a_clock_that_runs_backwards_holds() {
    let mut bench = following();
    bench.now -= 1;
    let output = bench.step();
    assert!(!output.state.is_moving());
}

#[test]
fn stamps_and_heartbeats_from_the_future_are_not_believed() {
    let mut bench = following();
    bench.frames = false;
    bench.frame(Ok(bench.output), bench.now + 1_000 * MS);
    assert_eq!(
        bench.ticks(10).state,
        State::Holding(HoldReason::SamplesStale)
    );

    let mut bench = following();
    bench.beating = false;
    bench.inputs.heartbeat = Some(at(bench.now + 1_000 * MS));
    assert_eq!(
        bench.tick().state,
        State::Holding(HoldReason::HeartbeatLost)
    );
}

#[test]
fn a_command_between_two_periods_moves_no_faster() {
    let run = |period: u64| {
        let mut bench = Bench::following(Settings {
            rate: 50.0,
            ..Settings::default()
        });
        bench.speed = 255;
        bench.ticks(300);
        bench.output = [0.0; 4];
        let from = bench.last.unwrap().motion.unwrap().position[0];
        for step in 0..(600 * MS / period) {
            bench.now += period;
            let now = bench.now;
            bench.answer(now);
            if step.is_multiple_of(30 * MS / period) {
                bench.frame(Ok(bench.output), now);
            }
            bench.inputs.heartbeat = Some(at(now));
            bench.step();
        }
        from - bench.last.unwrap().motion.unwrap().position[0]
    };
    let (slow, fast) = (run(10 * MS), run(MS));
    assert!(slow.abs_diff(fast) <= 2, "{slow} {fast}");
    assert!((25..=30).contains(&slow), "{slow}");
}

/// Every state and reason has words for a person.
#[test]
fn states_speak() {
    use std::string::ToString;
    assert_eq!(
        State::Holding(HoldReason::SensorsLost(0b1000_0000_0001)).to_string(),
        "holding: sensors lost: hand ring_middle"
    );
    assert_eq!(State::Idle.to_string(), "idle");
    assert!(
        State::Faulted(GripperFault::Reported(Fault::Interference))
            .to_string()
            .contains("fault 0A")
    );
}
