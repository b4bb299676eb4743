//! Every wait ends: grippers that never answer, never finish, answer one byte, answer for ever; and
//! grippers that lose their power.
#![allow(clippy::unwrap_used)]

mod support;

use gripper::driver::{Config, Error, Failure, Outcome, Task, ThreeFinger};
use gripper::{Activation, Gripper, Motion, link, timing};
use support::{CHARACTER, Line, Slave, at, run_gripper};

const HALF: Motion<4> = Motion {
    position: [128, 120, 110, 100],
    speed: [255; 4],
    force: [150; 4],
};

fn gripper() -> (Line, ThreeFinger<Line>) {
    let line = Line::default();
    let gripper = ThreeFinger::new(line.clone(), Config::default());
    (line, gripper)
}

/// The longest a cycle may take: quarantine at the start, request, reply in pieces, a tick.
fn one_cycle() -> u64 {
    let quarantine = timing::quarantine(115_200, 21, timing::silence(115_200));
    let first = timing::first_byte(115_200, 29, timing::RESPONSE);
    (quarantine + first + timing::last_byte(115_200, 21) + timing::TICK).as_ticks()
}

#[test]
fn a_gripper_that_never_answers_is_a_timeout_every_time() {
    let (line, mut gripper) = gripper();
    let mut sent = Vec::new();
    let mut errors = 0;
    while line.now() < 20_000_000 {
        gripper.set_motion(Some(HALF), at(line.now()));
        let began = line.now();
        let limit = began + timing::MEMORY.as_ticks();
        let outcome = run_gripper(&line, &mut gripper, limit, &mut |line, _, request| {
            sent.push((line.now(), request.to_vec()))
        });
        assert_eq!(
            outcome,
            Some(Err(Error::Link(link::Error::Timeout { received: 0 })))
        );
        errors += 1;
        let (asked, _) = sent.last().unwrap();
        assert!(line.now() <= asked + one_cycle());
    }
    // It is asked a few times a second, never written to, and no form of request twice within the memory.
    assert!((60..=100).contains(&errors), "{errors} in 20 s");
    assert!(sent.iter().all(|(_, request)| request[1] == 3));
    for (k, (time, request)) in sent.iter().enumerate() {
        let again = sent[k + 1..].iter().find(|(_, other)| other == request);
        assert!(again.is_none_or(|(other, _)| other - time >= timing::MEMORY.as_ticks()));
    }
}

#[test]
fn a_gripper_that_comes_back_is_found_within_half_a_second() {
    let (line, mut gripper) = gripper();
    let mut slave = Slave::three_finger();
    while line.now() < 5_000_000 {
        run_gripper(
            &line,
            &mut gripper,
            line.now() + 3_000_000,
            &mut |_, _, _| {},
        );
    }
    let back = line.now();
    let outcome = loop {
        let outcome = run_gripper(
            &line,
            &mut gripper,
            line.now() + 3_000_000,
            &mut |line, end, request| {
                slave.serve(line, end, request);
            },
        );
        if let Some(Ok(status)) = outcome {
            break status;
        }
    };
    assert_eq!(outcome.activation, Activation::Ready);
    println!("found again after {} ms", (line.now() - back) / 1_000);
    assert!(line.now() - back < 500_000);
}

#[test]
fn one_byte_is_a_timeout_and_bytes_for_ever_are_an_error_at_once() {
    let (line, mut driver) = gripper();
    let outcome = run_gripper(&line, &mut driver, 1_000_000, &mut |line, end, _| {
        line.send(end, CHARACTER, &[9])
    });
    assert_eq!(
        outcome,
        Some(Err(Error::Link(link::Error::Timeout { received: 1 })))
    );
    assert!(line.now() <= one_cycle());

    let (line, mut driver) = gripper();
    line.send(10_000, CHARACTER, &[0x5A; 40_000]);
    let (mut errors, mut last, mut longest) = (0, 0, 0);
    while line.now() < 3_000_000 {
        let outcome = run_gripper(
            &line,
            &mut driver,
            line.now() + 1_000_000,
            &mut |_, _, _| {},
        );
        assert!(matches!(outcome, Some(Err(_))), "{outcome:?}");
        longest = longest.max(line.now() - last);
        last = line.now();
        errors += 1;
    }
    assert!(
        errors > 50 && longest <= timing::babble(115_200).as_ticks() + 2_000,
        "{errors}, {longest} µs"
    );
}

#[test]
fn an_activation_that_never_ends_is_given_up_at_its_deadline() {
    for (busy, name, why) in [
        (0x11, "for ever activating", Failure::Deadline),
        (0x01, "never starting", Failure::Deadline),
        (0x00, "never accepting", Failure::NotTaken),
    ] {
        let (line, mut gripper) = gripper();
        let mut slave = Slave::three_finger();
        slave.status[0] = 0;
        gripper.activate();
        let error = loop {
            let outcome = run_gripper(
                &line,
                &mut gripper,
                line.now() + 1_000_000,
                &mut |line, end, request| {
                    slave.serve(line, end, request);
                    slave.status[0] = if slave.command[0] & 1 == 1 { busy } else { 0 };
                },
            );
            if let Err(error) = outcome.expect("every wait ends") {
                break error;
            }
        };
        let task = Task::Activate;
        assert_eq!(error, Error::Task { task, why }, "{name}");
        assert_eq!(gripper.outcome(), Some((task, Outcome::Failed(why))));
        let limit = match why {
            // A register that reads back otherwise is told within two seconds.
            Failure::NotTaken => 2_000_000,
            _ => (timing::ACTIVATION + timing::TICK).as_ticks(),
        };
        assert!(line.now() <= limit, "{name}: {}", line.now());
    }
    // And one that is not there at all.
    let (line, mut gripper) = gripper();
    gripper.activate();
    let mut outcome = Ok(());
    while outcome
        != Err(Error::Task {
            task: Task::Activate,
            why: Failure::Deadline,
        })
    {
        outcome = run_gripper(
            &line,
            &mut gripper,
            line.now() + 3_000_000,
            &mut |_, _, _| {},
        )
        .unwrap()
        .map(drop);
        assert!(line.now() <= (timing::ACTIVATION + timing::TICK).as_ticks());
    }
}

#[test]
fn a_gripper_that_lost_its_power_is_not_activated_by_the_next_motion() {
    // It is away for one request, three, ten; when it is back, it is in reset.
    for away in [1, 3, 10] {
        let (line, mut gripper) = gripper();
        let mut slave = Slave::three_finger();
        let mut requests = 0;
        for _ in 0..60 {
            gripper.set_motion(Some(HALF), at(line.now()));
            run_gripper(
                &line,
                &mut gripper,
                line.now() + 2_000_000,
                &mut |line, end, request| {
                    requests += 1;
                    match requests {
                        0..=20 => slave.serve(line, end, request),
                        n if n <= 20 + away => {
                            (slave.status, slave.command) = ([0; 16], [0; 16]);
                        }
                        _ => slave.serve(line, end, request),
                    }
                },
            );
        }
        assert!(requests > 40);
        assert_eq!(slave.command, [0; 16], "away for {away}: it was written to");
    }
}

#[test]
fn a_gripper_that_is_switched_off_while_it_activates_is_not_activated_again_unasked() {
    let (line, mut gripper) = gripper();
    let mut slave = Slave::three_finger();
    slave.status[0] = 0;
    gripper.activate();
    let mut requests = 0;
    let mut ended = None;
    for _ in 0..60 {
        let outcome = run_gripper(
            &line,
            &mut gripper,
            line.now() + 2_000_000,
            &mut |line, end, request| {
                requests += 1;
                match requests {
                    // Activating: gACT set, gIMC 1.
                    0..=20 => {
                        slave.serve(line, end, request);
                        slave.status[0] = if slave.command[0] & 1 == 1 { 0x11 } else { 0 };
                    }
                    // Switched off for ten requests; then in reset.
                    21..=30 => (slave.status, slave.command) = ([0; 16], [0; 16]),
                    _ => slave.serve(line, end, request),
                }
            },
        );
        if let Some(Err(error @ Error::Task { .. })) = outcome {
            ended = Some(error);
        }
    }
    assert!(requests > 40);
    assert_eq!(
        ended,
        Some(Error::Task {
            task: Task::Activate,
            why: Failure::NotReady(Activation::Reset)
        })
    );
    assert_eq!(slave.command, [0; 16], "it was written to");
}
