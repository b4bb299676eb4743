//! Rule 2: ages, heartbeat, safe action.

use super::*;

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
        copy.inputs.clutch = closed(at(copy.now));
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
    bench.inputs.clutch = Clutch::Open;
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
    bench.inputs.clutch = Clutch::Open;
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
