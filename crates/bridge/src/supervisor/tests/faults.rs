//! Faults of the gripper, clocks and deadlines.

use super::*;

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
    bench.inputs.clutch = Clutch::Open;
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
    bench.inputs.clutch = closed(at(bench.now + 1_000 * MS));
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
            bench.inputs.clutch = closed(at(now));
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
