//! The drivers against the rig's virtual grippers, which were written from the documents by other
//! hands with a register table of their own.
#![allow(clippy::unwrap_used)]

mod bench;

use bench::*;
use gripper::driver::{Control, Error, Failure, Task};
use gripper::registers::three_finger::Mode;
use gripper::registers::two_finger::{Model, Release};
use gripper::{Activation, Contact, Duration, Event, Fault, Gripper, Motion};

#[test]
fn nothing_moves_before_activation_is_asked_for() {
    let mut bench = three();
    for _ in 0..100 {
        let motion = Motion {
            position: [200; 4],
            speed: [255; 4],
            force: [255; 4],
        };
        bench.driver.set_motion(Some(motion), bench.clock.now());
        assert_eq!(bench.cycle().activation, Activation::Reset);
    }
    assert_eq!((bench.truth.writes(), bench.truth.motions()), (0, 0));
    let status = bench.activate();
    assert_eq!(
        (status.activation, status.fault),
        (Activation::Ready, Fault::None)
    );
    assert!(bench.truth.motions() > 0);
    // 0x01 and nothing else, until the gripper showed it.
    assert_eq!(
        bench.truth.command_block(),
        [1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]
    );
}

#[test]
fn a_motion_that_leaves_is_told_once_and_an_activation_is_none() {
    let mut bench = three();
    let told = |bench: &mut Three, cycles: u32| {
        let (mut sent, mut ended) = (0, 0);
        while ended < cycles {
            let now = bench.clock.now();
            match bench.driver.poll(now) {
                Some(Event::Sent) => sent += 1,
                Some(event) => ended += u32::from(event.ended().is_some()),
                None => {}
            }
            let due = bench.driver.next_due().max(now + Duration::from_micros(1));
            bench.clock.wait_until(due);
        }
        sent
    };
    bench.driver.activate();
    assert_eq!(told(&mut bench, 1_000), 0);
    let activating = bench.driver.counters().writes;
    assert!(activating > 0);
    for _ in 0..10 {
        let motion = Motion {
            position: [50; 4],
            speed: [255; 4],
            force: [255; 4],
        };
        bench.driver.set_motion(Some(motion), bench.clock.now());
        assert_eq!(told(&mut bench, 1), 1);
    }
    assert_eq!(bench.driver.counters().writes, activating + 10);
}

#[test]
fn every_axis_goes_where_it_is_sent_on_its_own() {
    let mut bench = three();
    bench.activate();
    for target in [[30, 90, 150, 100], [210, 40, 120, 60], [20, 20, 20, 200]] {
        let status = bench.go(target);
        let truth = bench.truth.positions();
        for axis in 0..4 {
            assert!(
                (truth[axis] - f32::from(target[axis])).abs() <= 1.0,
                "{truth:?} for {target:?}"
            );
            assert!(status.position[axis].abs_diff(target[axis]) <= 1);
        }
        assert_eq!(
            (status.echo, status.contact),
            (target, [Contact::AtPosition; 4])
        );
    }
    // Past a software limit: at position, short of the request.
    let status = bench.go([0, 0, 0, 128]);
    assert_eq!(status.contact, [Contact::AtPosition; 4]);
    assert!(
        status.position[..3]
            .iter()
            .all(|count| (6..=7).contains(count))
    );
}

#[test]
fn connecting_to_a_gripper_that_holds_an_object_changes_nothing() {
    let mut bench = holding();
    let before = (
        bench.truth.command_block(),
        bench.truth.writes(),
        bench.truth.motions(),
        bench.truth.positions(),
    );
    let status = bench.for_ms(2_000);
    assert_eq!(status.fault, Fault::None);
    let after = (
        bench.truth.command_block(),
        bench.truth.writes(),
        bench.truth.motions(),
        bench.truth.positions(),
    );
    assert_eq!(before, after);
    // Not even when told to activate: it is active.
    bench.activate();
    assert_eq!(bench.truth.writes(), before.1);
}

#[test]
fn the_first_command_of_a_hold_moves_no_axis_and_lets_nothing_go() {
    let mut bench = holding();
    let status = bench.cycle();
    // B and C follow A's request; the scissor, not in contact, stays where it is.
    assert_eq!(status.hold(), [255, 255, 255, status.position[3]]);
    let (before, motions) = (bench.truth.positions(), bench.truth.motions());
    for _ in 0..100 {
        let motion = Motion {
            position: status.hold(),
            speed: [255; 4],
            force: [100; 4],
        };
        bench.driver.set_motion(Some(motion), bench.clock.now());
        let now = bench.cycle();
        assert_eq!(now.contact[..3], [Contact::ContactClosing; 3]);
    }
    let after = bench.truth.positions();
    assert!(
        before.iter().zip(after).all(|(p, q)| (p - q).abs() < 1.0),
        "{before:?} {after:?}"
    );
    assert_eq!(bench.truth.motions(), motions);
    assert_eq!(bench.truth.command_block()[..2], [0x09, 0x0C]);
}

#[test]
fn a_finger_at_a_software_limit_far_from_what_it_was_told_stands_there_and_is_held_there() {
    let mut bench = three();
    bench.truth.preset_active();
    bench.truth.set_limits(0, Some((6.0, 120.0)));
    let status = bench.go([250, 200, 200, 137]);
    assert_eq!(
        (status.contact[0], status.echo[0], status.position[0]),
        (Contact::AtPosition, 250, 120)
    );
    assert!(bench.driver.accepted(), "it repeats the motion");
    // The hold is where it is, not where it was told to be: the limit may move, the finger must not.
    assert_eq!(status.hold(), [120, 200, 200, 137]);
    let held = bench.go(status.hold());
    bench.truth.set_limits(0, None);
    let status = bench.for_ms(500);
    assert_eq!(
        (held.position, status.position),
        (status.hold(), held.position)
    );
    assert!((bench.truth.positions()[0] - 120.0).abs() < 1.0);
}

#[test]
fn all_modes_can_be_set_and_are_kept() {
    let mut bench = three();
    bench.activate();
    bench.driver.set_control(Control::SIMPLIFIED);
    for mode in [
        Mode::Pinch,
        Mode::Wide,
        Mode::Scissor,
        Mode::Basic,
        Mode::Basic,
        Mode::Pinch,
    ] {
        bench.driver.set_mode(mode);
        let status = bench.run_task(10_000);
        assert_eq!(
            (bench.driver.mode(), status.activation),
            (Some(mode), Activation::Ready)
        );
        assert_eq!(bench.truth.status_block()[0] >> 1 & 3, mode.bits());
        if mode != Mode::Scissor {
            // In simplified control B and C follow A.
            let status = bench.go([120, 0, 0, 0]);
            assert!(
                status.position[..3]
                    .iter()
                    .all(|count| count.abs_diff(120) <= 1),
                "{status:?}"
            );
        }
        assert_eq!(bench.truth.status_block()[0] >> 1 & 3, mode.bits());
    }
    // Back to every axis on its own: the mode stays as it was.
    bench.driver.set_control(Control::INDIVIDUAL);
    bench.go([50, 60, 70, 120]);
    assert_eq!(bench.driver.mode(), Some(Mode::Pinch));
}

#[test]
fn a_mode_change_is_refused_while_the_gripper_is_not_ready() {
    let mut bench = three();
    bench.driver.set_mode(Mode::Pinch);
    let failure = Error::Task {
        task: Task::Mode(Mode::Pinch),
        why: Failure::NotReady(Activation::Reset),
    };
    assert_eq!(bench.next(Duration::from_millis(100)), Some(Err(failure)));
    assert_eq!(bench.truth.writes(), 0);
}

#[test]
fn automatic_release_opens_everything_and_an_activation_brings_it_back() {
    let mut bench = holding();
    bench.driver.automatic_release();
    let status = bench.run_task(30_000);
    assert_eq!(status.fault, Fault::Released);
    assert!(
        bench.truth.positions()[..3]
            .iter()
            .all(|count| *count < 10.0)
    );
    // Nothing is written to it, whatever the motion.
    let writes = bench.truth.writes();
    for _ in 0..20 {
        let motion = Motion {
            position: [200; 4],
            speed: [255; 4],
            force: [255; 4],
        };
        bench.driver.set_motion(Some(motion), bench.clock.now());
        bench.cycle();
    }
    assert_eq!(bench.truth.writes(), writes);
    bench.driver.set_motion(None, bench.clock.now());
    let status = bench.activate();
    assert_eq!(
        (status.activation, status.fault),
        (Activation::Ready, Fault::None)
    );
}

#[test]
fn a_release_under_way_is_not_broken_off_by_a_motion() {
    let mut bench = holding();
    bench.driver.automatic_release();
    bench.until(5_000, |_, status| status.fault == Fault::Releasing);
    for _ in 0..50 {
        let motion = Motion {
            position: [200; 4],
            speed: [255; 4],
            force: [255; 4],
        };
        bench.driver.set_motion(Some(motion), bench.clock.now());
        bench.cycle();
        assert_eq!(bench.truth.command_block()[0] & 0x10, 0x10);
    }
}

#[test]
fn a_reset_clears_the_activation_and_only_when_asked() {
    let mut bench = holding();
    bench.for_ms(100);
    assert_eq!(bench.truth.command_block()[0] & 1, 1);
    bench.driver.reset();
    let status = bench.run_task(2_000);
    assert_eq!(status.activation, Activation::Reset);
    assert_eq!(bench.truth.command_block(), [0; 16]);
}

/// What the manuals say of each number, in a table of the test's own: 3-Finger gripper.
fn three_finger_fault(code: u8) -> Fault {
    match code {
        0x00 => Fault::None,
        0x05 => Fault::ActivationNeeded,
        0x06 => Fault::ModeChangeNeeded,
        0x07 => Fault::NotActivated,
        0x09 => Fault::ChipNotReady,
        0x0A => Fault::Interference,
        0x0B => Fault::Releasing,
        0x0D => Fault::Activation,
        0x0E => Fault::InterferenceLasting,
        0x0F => Fault::Released,
        other => Fault::Unknown(other),
    }
}

/// The same for the 2F-85, 2F-140 and Hand-E.
fn two_finger_fault(code: u8) -> Fault {
    match code {
        0x06 => Fault::Unknown(6),
        0x08 => Fault::OverTemperature,
        0x09 => Fault::NoCommunication,
        0x0A => Fault::UnderVoltage,
        0x0C => Fault::Internal,
        0x0E => Fault::OverCurrent,
        other => three_finger_fault(other),
    }
}

#[test]
fn every_fault_number_becomes_a_type_a_sentence_and_an_action() {
    let mut seen = 0;
    let mut bench = three();
    bench.activate();
    for code in 0..16_u8 {
        bench.truth.set_fault(Some(code));
        let status = bench.for_ms(50);
        assert_eq!(status.fault, three_finger_fault(code));
        assert_eq!(status.fault.code(), code);
        assert!(!status.fault.sentence().is_empty() && !status.fault.action().is_empty());
        println!("3-Finger {code:02X}: {}", status.fault);
        seen += 1;
        bench.truth.set_fault(None);
        if code >= 0x0D {
            bench.activate();
        }
    }
    for model in [Model::TwoFinger85, Model::TwoFinger140, Model::HandE] {
        let mut bench = two(model);
        bench.activate();
        for code in 0..16_u8 {
            bench.truth.set_fault(Some(code));
            let status = bench.for_ms(50);
            assert_eq!(status.fault, two_finger_fault(code), "{}", model.name());
            println!("{} {code:02X}: {}", model.name(), status.fault);
            seen += 1;
            bench.truth.set_fault(None);
            if code >= 0x0A {
                bench.activate();
            }
        }
    }
    println!("{seen} fault numbers through the drivers");
    assert_eq!(seen, 64);
}

#[test]
fn nothing_is_written_while_a_major_fault_lasts_and_activation_clears_it() {
    let mut bench = three();
    bench.activate();
    bench.truth.set_fault(Some(0x0E));
    bench.for_ms(50);
    let writes = bench.truth.writes();
    for _ in 0..20 {
        let motion = Motion {
            position: [200; 4],
            speed: [255; 4],
            force: [255; 4],
        };
        bench.driver.set_motion(Some(motion), bench.clock.now());
        assert_eq!(bench.cycle().fault, Fault::InterferenceLasting);
    }
    assert_eq!(bench.truth.writes(), writes);
    bench.driver.set_motion(None, bench.clock.now());
    // rACT 1 → 0 → 1, on request.
    assert_eq!(bench.activate().fault, Fault::None);
}

#[test]
fn the_two_finger_grippers_activate_move_release_and_come_back() {
    for model in [Model::TwoFinger85, Model::TwoFinger140, Model::HandE] {
        let mut bench = two(model);
        for _ in 0..20 {
            let motion = Motion {
                position: [200],
                speed: [255],
                force: [255],
            };
            bench.driver.set_motion(Some(motion), bench.clock.now());
            bench.cycle();
        }
        assert_eq!((bench.truth.writes(), bench.truth.motions()), (0, 0));
        bench.activate();
        for target in [120, 30, 200] {
            let status = bench.go([target]);
            assert!(
                status.position[0].abs_diff(target) <= 1,
                "{} {status:?}",
                model.name()
            );
        }
        bench.truth.set_object(0, Some(220.0));
        let status = bench.go([255]);
        assert_eq!(status.contact, [Contact::ContactClosing]);
        assert_eq!(status.hold(), [255]);
        bench.truth.set_object(0, None);
        for (direction, expected) in [(Release::Opening, 0.0_f32), (Release::Closing, 255.0)] {
            bench.driver.set_motion(None, bench.clock.now());
            bench.driver.release_towards(direction);
            assert_eq!(bench.run_task(40_000).fault, Fault::Released);
            let there = bench.truth.positions()[0];
            assert!(
                (there - expected).abs() < 35.0,
                "{} {direction:?} ends at {there}",
                model.name()
            );
            bench.activate();
        }
    }
}

#[test]
fn a_gripper_that_never_finishes_its_activation_is_given_up() {
    // A gripper that acknowledges rACT and never gets on: fault 0D held by the test comes with it.
    let mut bench = three();
    bench.truth.set_fault(Some(0x0D));
    bench.driver.activate();
    let started = bench.clock.now();
    let outcome = loop {
        match bench
            .next(Duration::from_millis(100))
            .expect("every wait ends")
        {
            Ok(_) => bench.truth.set_fault(Some(0x0D)),
            Err(error) => break error,
        }
    };
    assert!(matches!(
        outcome,
        Error::Task {
            task: Task::Activate,
            why: Failure::Fault(Fault::Activation) | Failure::Deadline
        }
    ));
    assert!(bench.clock.now() <= started + gripper::timing::ACTIVATION + gripper::timing::TICK);
}
