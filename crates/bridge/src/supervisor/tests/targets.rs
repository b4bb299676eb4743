//! Rules 3 and 4: lead, rate, what the map gives, configuration space.

use super::*;

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
    bench.inputs.clutch = Clutch::Open;
    let held = bench.ticks(5).motion.unwrap().position;
    // By hand, not faster than a finger moves.
    let mut pushed = held;
    for by in 1..=60 {
        bench.status().position[0] = held[0] - by;
        pushed = bench.tick().motion.unwrap().position;
    }
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

/// From anywhere allowed to anywhere allowed, whatever the axes' speeds: the gripper arrives, and is inside all the way.
#[test]
fn every_way_through_the_configuration_space_ends_at_its_goal() {
    let mut state = 1u32;
    let mut byte = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    let mut longest = 0;
    for round in 0..400 {
        let mut position: [u8; 4] = core::array::from_fn(|_| byte());
        let goal: [f32; 4] = limits::project(core::array::from_fn(|_| f32::from(byte())));
        let speed: [u8; 4] = core::array::from_fn(|_| 1 + byte() % 6);
        if !limits::inside(&position) {
            continue;
        }
        let mut command = position;
        let mut steps = 0;
        while (0..4).any(|axis| (f32::from(position[axis]) - goal[axis]).abs() > 1.0) {
            let wanted = core::array::from_fn(|axis| {
                let here = f32::from(command[axis]);
                limits::round(
                    limits::approach(goal[axis], here, 4.0, position[axis], 40),
                    position[axis],
                )
            });
            command = limits::keep_inside(wanted, &position, &position, &goal);
            for axis in 0..4 {
                assert!(command[axis].abs_diff(position[axis]) <= 40);
                position[axis] = command[axis]
                    .max(position[axis].saturating_sub(speed[axis]))
                    .min(position[axis].saturating_add(speed[axis]));
            }
            assert!(limits::inside(&position), "round {round}: {position:?}");
            steps += 1;
            assert!(
                steps < 3_000,
                "round {round}: stuck at {position:?} for {goal:?}"
            );
        }
        longest = longest.max(steps);
    }
    std::println!("longest way: {longest} steps");
}

#[test]
fn a_gripper_of_one_axis_has_no_configuration_space_and_all_the_other_limits() {
    let mut supervisor = Supervisor::<1>::new(Config::default());
    let mut position = 3u8;
    let mut echo = 3u8;
    for step in 1..400u64 {
        let now = at(step * 10 * MS);
        let inputs = Inputs {
            clutch: closed(now),
            hand: Some(Hand {
                sequence: step as u32,
                stamp: now,
                output: Ok([300.0]),
            }),
            status: Some(Status {
                stamp: now,
                activation: Activation::Ready,
                going_to: true,
                contact: [Contact::AtPosition],
                echo: [echo],
                position: [position],
                current: [0],
                fault: Fault::None,
            }),
            weights: Weights::Ready,
        };
        if let Some(motion) = supervisor.step(now, &inputs).motion {
            echo = motion.position[0];
            assert!(echo.abs_diff(position) <= 40);
        }
        position += (echo.saturating_sub(position)).min(2);
    }
    assert_eq!((echo, position), (255, 255));
}
