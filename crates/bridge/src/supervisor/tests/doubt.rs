//! What the gripper says is doubted where it cannot be.

use super::*;

/// Steps with positions of this status that are not true; the gripper itself goes on as before.
fn lie(
    bench: &mut Bench,
    lies: impl Fn(usize, [u8; 4]) -> [u8; 4],
    steps: usize,
) -> Vec<Output<4>> {
    (0..steps)
        .map(|step| {
            bench.now += 10 * MS;
            let now = bench.now;
            bench.answer(now);
            bench.frame(Ok(bench.output), now - 5 * MS);
            bench.inputs.clutch = closed(at(now));
            let truth = bench.status().position;
            bench.status().position = lies(step, truth);
            let output = bench.supervisor.step(at(now), &bench.inputs);
            bench.status().position = truth;
            if let Some(motion) = output.motion {
                bench.status().echo = motion.position;
            }
            output
        })
        .collect()
}

fn farthest(outputs: &[Output<4>], from: [u8; 4]) -> u8 {
    let far = |output: &Output<4>| {
        let motion = output.motion?;
        (0..4)
            .map(|axis| motion.position[axis].abs_diff(from[axis]))
            .max()
    };
    outputs.iter().filter_map(far).max().unwrap_or(0)
}

#[test]
fn one_position_that_jumps_by_100_moves_no_command() {
    let mut bench = following();
    bench.ticks(300);
    let before = bench.status().position;
    let outputs = lie(
        &mut bench,
        |step, truth| {
            if step == 3 {
                truth.map(|x| x.saturating_add(100))
            } else {
                truth
            }
        },
        20,
    );
    assert!(
        outputs
            .iter()
            .all(|output| output.state == State::Following)
    );
    assert!(farthest(&outputs, before) <= 2, "{outputs:?}");
}

#[test]
fn positions_that_jump_again_and_again_hold_and_are_a_named_fault() {
    let mut bench = following();
    bench.ticks(300);
    let before = bench.status().position;
    let outputs = lie(
        &mut bench,
        |step, truth| truth.map(|x| x ^ if step % 2 == 0 { 0x80 } else { 0xC0 }),
        100,
    );
    assert!(matches!(
        outputs[3].state,
        State::Faulted(GripperFault::Implausible { .. })
    ));
    assert!(farthest(&outputs, before) <= 2, "{outputs:?}");
    // Opened and closed again by a person, and the positions true again: it follows.
    bench.beating = false;
    bench.inputs.clutch = Clutch::Open;
    bench.ticks(5);
    bench.beating = true;
    bench.until(|state| state == State::Following);
}

#[test]
fn an_echo_that_stays_what_it_was_is_a_fault_within_two_seconds() {
    let mut bench = following();
    let stuck = bench.status().echo;
    let start = bench.now;
    bench.output = [30.0, 40.0, 50.0, 200.0];
    loop {
        bench.now += 10 * MS;
        let now = bench.now;
        // It goes nowhere, and answers.
        bench.status().stamp = at(now);
        bench.status().echo = stuck;
        bench.frame(Ok(bench.output), now - 5 * MS);
        bench.inputs.clutch = closed(at(now));
        let output = bench.supervisor.step(at(now), &bench.inputs);
        if output.state == State::Faulted(GripperFault::CommandIgnored) {
            break;
        }
        assert!(now - start < 2_000 * MS, "still {:?}", output.state);
    }
}

#[test]
fn an_axis_that_stands_although_it_is_told_to_move_is_told_within_two_seconds() {
    let mut bench = following();
    bench.ticks(300);
    bench.speed = 0;
    bench.status().contact = [Contact::Moving; 4];
    bench.output = [30.0, 40.0, 50.0, 200.0];
    let start = bench.now;
    while bench.tick().stands.is_none() {
        assert!(bench.now - start < 2_000 * MS);
    }
}

#[test]
fn a_finger_that_stands_is_told_while_the_others_move_and_a_software_limit_is_not() {
    let mut bench = following();
    bench.ticks(300);
    let start = bench.now;
    let stuck = bench.status().position[2];
    bench.output = [60.0, 60.0, 20.0, 100.0];
    let told = loop {
        bench.tick();
        // Finger C is jammed, and says that it is at its position.
        bench.status().position[2] = stuck;
        if (bench.now / (400 * MS)).is_multiple_of(2) {
            bench.output[0] = 60.0;
        } else {
            bench.output[0] = 160.0;
        }
        if let Some(axis) = bench.last.unwrap().stands {
            break axis;
        }
        assert!(bench.now - start < 2_500 * MS);
    };
    assert_eq!(told, 2);
    // The scissor's range follows the fingers: at its position it may stand anywhere.
    let mut bench = following();
    bench.ticks(300);
    let here = bench.status().position;
    bench.output = here.map(f32::from);
    bench.output[3] = 60.0;
    for _ in 0..300 {
        bench.tick();
        bench.status().position[3] = here[3];
        assert_eq!(bench.last.unwrap().stands, None);
    }
}

#[test]
fn nothing_is_commanded_from_a_first_status_that_no_second_one_confirms() {
    let mut bench = Bench::new(Settings::default());
    bench.beating = true;
    bench.status().position = [200; 4];
    let first = bench.tick();
    assert_eq!(
        (first.motion, first.state),
        (None, State::Holding(HoldReason::GripperSilent))
    );
}

#[test]
fn opening_the_clutch_after_positions_that_cannot_be_true_sends_the_gripper_nowhere() {
    let mut bench = following();
    bench.ticks(300);
    let told = bench.status().echo;
    // They jump, and stay so.
    let off = |_: usize, truth: [u8; 4]| truth.map(|x| if x > 127 { x - 100 } else { x + 100 });
    let outputs = lie(&mut bench, off, 50);
    assert!(matches!(
        outputs[49].state,
        State::Faulted(GripperFault::Implausible { .. })
    ));
    bench.beating = false;
    for _ in 0..300 {
        bench.now += 10 * MS;
        let now = bench.now;
        bench.answer(now);
        bench.inputs.clutch = Clutch::Open;
        let truth = bench.status().position;
        bench.status().position = off(0, truth);
        let output = bench.supervisor.step(at(now), &bench.inputs);
        bench.status().position = truth;
        assert_eq!(output.state, State::Idle);
        let farthest = farthest(&[output], told);
        assert!(farthest <= 2, "told to go {farthest} counts");
    }
}

#[test]
fn an_echo_that_is_not_ours_is_not_what_a_hold_repeats() {
    let mut bench = following();
    bench.ticks(300);
    bench.output = [30.0, 40.0, 50.0, 200.0];
    for step in 0..600 {
        bench.now += 10 * MS;
        let now = bench.now;
        let status = bench.status();
        status.stamp = at(now);
        (status.echo, status.contact) = ([255; 4], [Contact::ContactClosing; 4]);
        let here = status.position;
        bench.frame(Ok(bench.output), now - 5 * MS);
        // A person opens it in the end.
        bench.inputs.clutch = if step < 300 {
            closed(at(now))
        } else {
            Clutch::Open
        };
        let output = bench.supervisor.step(at(now), &bench.inputs);
        assert!(farthest(&[output], here) <= 40, "{output:?}");
    }
    assert_eq!(bench.supervisor.state(), State::Idle);
}

/// Opens the clutch, and closes it again, while positions come as `lies` makes them.
fn reclose(
    bench: &mut Bench,
    lies: impl Fn(usize, [u8; 4]) -> [u8; 4],
    steps: usize,
) -> Vec<Output<4>> {
    bench.inputs.clutch = Clutch::Open;
    bench.now += 10 * MS;
    bench.supervisor.step(at(bench.now), &bench.inputs);
    lie(bench, lies, steps)
}

#[test]
fn positions_that_were_not_true_are_not_believed_for_being_said_again_after_the_next_closing() {
    let mut bench = following();
    bench.ticks(300);
    let told = bench.status().echo;
    let off = |_: usize, truth: [u8; 4]| truth.map(|x| if x > 127 { x - 100 } else { x + 100 });
    lie(&mut bench, off, 20);
    for _ in 0..3 {
        let outputs = reclose(&mut bench, off, 100);
        assert!(farthest(&outputs, told) <= 2, "{outputs:?}");
        assert!(matches!(
            outputs[99].state,
            State::Faulted(GripperFault::Implausible { .. })
        ));
    }
    // An activation finds the stops: its positions count anew.
    bench.status().activation = Activation::Activating;
    let off = |_: usize, truth: [u8; 4]| truth.map(|x| x.saturating_add(50));
    reclose(&mut bench, off, 5);
    bench.status().activation = Activation::Ready;
    let outputs = reclose(&mut bench, off, 200);
    assert!(outputs[199].state.is_moving(), "{:?}", outputs[199].state);
}

#[test]
fn a_gripper_found_elsewhere_after_a_silence_waits_for_a_person() {
    for (moved, waits) in [(100, true), (15, false)] {
        let mut bench = following();
        bench.ticks(300);
        bench.answering = false;
        bench.ticks(70);
        bench.answering = true;
        bench.status().position[1] -= moved;
        bench.status().echo = bench.inputs.status.unwrap().position;
        let sent = bench.sent.len();
        bench.ticks(200);
        if !waits {
            assert_eq!(bench.supervisor.state(), State::Following);
            continue;
        }
        assert_eq!(
            bench.supervisor.state(),
            State::Faulted(GripperFault::Implausible { axis: 1 })
        );
        assert_eq!(bench.sent.len(), sent, "nothing is written");
        // A person looked, opens and closes: it follows from there.
        bench.beating = false;
        bench.inputs.clutch = Clutch::Open;
        bench.ticks(5);
        bench.beating = true;
        bench.until(|state| state == State::Following);
    }
}

#[test]
fn an_echo_in_contact_that_it_was_never_told_is_repeated_by_no_hold_from_the_first_moment_on() {
    for lasts in 1..20 {
        let mut bench = following();
        bench.ticks(300);
        let here = bench.status().position;
        for step in 0..lasts + 100 {
            bench.now += 10 * MS;
            let now = bench.now;
            let status = bench.status();
            status.stamp = at(now);
            (status.echo, status.contact) = ([255; 4], [Contact::ContactClosing; 4]);
            bench.frame(Ok(bench.output), now - 5 * MS);
            // A person opens it, and closes it again.
            bench.inputs.clutch = if (lasts..lasts + 30).contains(&step) {
                Clutch::Open
            } else {
                closed(at(now))
            };
            let output = bench.supervisor.step(at(now), &bench.inputs);
            assert!(farthest(&[output], here) <= 40, "{lasts}: {output:?}");
        }
    }
}
