//! A gripper of another family than it is taken for is found out by reading: not one byte is written to it.
#![allow(clippy::unwrap_used)]

mod bench;
mod support;

use bench::{Three, Two, wire};
use gripper::driver::{Config, Error, ThreeFinger, TwoFinger};
use gripper::registers::{Kind, two_finger::Model};
use gripper::rtu::{Request, function};
use gripper::{Activation, Gripper, Motion};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rig::gripper::{Config as Virtual, Family};
use support::{Line, Slave, at, run_gripper};

const MODELS: [(Model, Family); 3] = [
    (Model::TwoFinger85, Family::TwoFinger85),
    (Model::TwoFinger140, Family::TwoFinger140),
    (Model::HandE, Family::HandE),
];

/// A 2-Finger driver on a 3-Finger gripper.
fn two_on_three(model: Model, active: bool) -> Two {
    let (clock, wire, truth) = wire(Virtual::default());
    if active {
        truth.preset_active();
    }
    let driver = TwoFinger::new(wire.clone(), model, Config::default());
    Two {
        clock,
        driver,
        wire,
        truth,
    }
}

/// A 3-Finger driver on one of the others.
fn three_on_two(family: Family, active: bool) -> Three {
    let (clock, wire, truth) = wire(Virtual::of(family));
    if active {
        truth.preset_active();
    }
    let driver = ThreeFinger::new(wire.clone(), Config::default());
    Three {
        clock,
        driver,
        wire,
        truth,
    }
}

/// Somewhere, slowly.
fn somewhere<const X: usize>() -> Option<Motion<X>> {
    Some(Motion {
        position: [99; X],
        speed: [1; X],
        force: [1; X],
    })
}

/// What is asked of a driver that has the wrong gripper.
type Order<D> = fn(&mut D, gripper::Instant);

/// Gives the order for two seconds; how often the gripper was told to be of that family.
macro_rules! told_in_two_seconds {
    ($bench:expr, $order:expr, $kind:expr) => {{
        let end = $bench.clock.now() + gripper::Duration::from_secs(2);
        let mut told = 0;
        while $bench.clock.now() < end {
            let now = $bench.clock.now();
            if $bench.driver.task().is_none() {
                $order(&mut $bench.driver, now);
            }
            let heard = $bench.next(gripper::Duration::from_millis(20));
            told += u32::from(heard == Some(Err(Error::OtherGripper($kind))));
        }
        told
    }};
}

#[test]
fn a_two_finger_driver_writes_nothing_to_a_three_finger_gripper_whatever_it_is_asked() {
    type Driver = TwoFinger<rig::MemoryWire>;
    let orders: [(&str, Order<Driver>); 5] = [
        ("a motion", |driver, now| {
            driver.set_motion(somewhere(), now);
        }),
        ("an activation", |driver, _| driver.activate()),
        ("a reset", |driver, _| driver.reset()),
        ("a release", |driver, _| driver.automatic_release()),
        ("which it is", |driver, _| driver.identify()),
    ];
    let mut cases = 0;
    for (model, _) in MODELS {
        for active in [false, true] {
            for (what, order) in orders {
                let mut bench = two_on_three(model, active);
                let told = told_in_two_seconds!(bench, order, Kind::ThreeFinger);
                assert_eq!(bench.truth.writes(), 0, "{what}, {model:?}");
                assert_eq!(bench.truth.motions(), 0, "{what}, {model:?}");
                // What a status already answers needs no write, and no proof.
                let writes = match what {
                    "a motion" | "a release" => active,
                    "an activation" => !active,
                    _ => true,
                };
                assert!(told > 0 || !writes, "{what}");
                assert!(!bench.driver.is_identified());
                cases += 1;
            }
        }
    }
    println!("{cases} orders of a 2-Finger driver to a 3-Finger gripper: 0 writes");
}

#[test]
fn a_three_finger_driver_writes_nothing_to_the_others_and_says_what_they_are() {
    type Driver = ThreeFinger<rig::MemoryWire>;
    let orders: [Order<Driver>; 3] = [
        |driver, now| {
            driver.set_motion(somewhere(), now);
        },
        |driver, _| driver.reset(),
        |driver, _| driver.automatic_release(),
    ];
    let mut cases = 0;
    for (_, family) in MODELS {
        for active in [false, true] {
            for order in orders {
                let mut bench = three_on_two(family, active);
                let told = told_in_two_seconds!(bench, order, Kind::TwoFinger);
                assert_eq!((bench.truth.writes(), bench.truth.motions()), (0, 0));
                assert!(told > 0, "{family:?}");
                cases += 1;
            }
        }
    }
    println!("{cases} orders of the 3-Finger driver to the others: 0 writes");
}

#[test]
fn the_right_driver_is_let_through_after_two_reads_that_stay_unanswered() {
    for (model, family) in MODELS {
        let (clock, wire, truth) = wire(Virtual::of(family));
        truth.preset_active();
        let driver = TwoFinger::new(wire.clone(), model, Config::default());
        let mut bench = Two {
            clock,
            driver,
            wire,
            truth,
        };
        let started = bench.clock.now();
        bench.go([120]);
        assert!(bench.driver.is_identified());
        assert_eq!(bench.driver.counters().timeouts, 2, "{family:?}");
        assert!(bench.truth.writes() > 0);
        assert!(bench.clock.now() > started);
    }
}

/// Runs a 2-Finger driver that wants to move something against a slave of the test's own: how many writes came, and
/// what it said last.
fn written(
    mut answer: impl FnMut(&mut Slave, &[u8]) -> Option<Vec<u8>>,
    slave: Slave,
) -> (u32, Option<Error>) {
    let line = Line::default();
    let mut gripper = TwoFinger::new(line.clone(), Model::TwoFinger85, Config::default());
    let mut slave = slave;
    let mut last = None;
    while line.now() < 3_000_000 {
        gripper.set_motion(somewhere(), at(line.now()));
        let heard = run_gripper(
            &line,
            &mut gripper,
            line.now() + 50_000,
            &mut |line, end, request| {
                if let Some(reply) = answer(&mut slave, request) {
                    line.send(end + slave.turnaround, support::CHARACTER, &reply);
                }
            },
        );
        last = heard.and_then(Result::err).or(last);
    }
    (slave.writes, last)
}

fn asked(request: &[u8]) -> (u8, u16) {
    match Request::parse(request).unwrap().1 {
        Request::ReadHolding { quantity, .. } => (function::READ_HOLDING, quantity),
        Request::ReadInput { quantity, .. } => (function::READ_INPUT, quantity),
        other => (other.function(), 0),
    }
}

#[test]
fn a_lost_reply_is_no_evidence() {
    // A 3-Finger gripper at rest that follows nothing looks like the others in three registers.
    let quiet = || {
        let mut slave = Slave::three_finger();
        (slave.status[0], slave.status[1]) = (0x31, 0);
        slave
    };
    for lost in 0..6 {
        let mut count = 0;
        let (writes, error) = written(
            |slave, request| {
                let (code, quantity) = asked(request);
                count += u32::from(quantity > 3);
                // It has no FC04; and some answers to the long reads are lost.
                let silent = code == function::READ_INPUT || quantity > 3 && count <= lost.min(2);
                (!silent).then(|| slave.answer(request))
            },
            quiet(),
        );
        assert_eq!(writes, 0, "{lost} lost");
        assert_eq!(error, Some(Error::OtherGripper(Kind::ThreeFinger)));
    }
}

#[test]
fn on_a_line_that_loses_every_fifth_reply_no_three_finger_gripper_is_taken_for_another() {
    const CONNECTIONS: u32 = 2_000;
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let mut writes = 0;
    for _ in 0..CONNECTIONS {
        let mut slave = Slave::three_finger();
        (slave.status[0], slave.status[1]) = (0x31, 0);
        let (written, error) = written(
            |slave, request| {
                let lost = rng.next_u64() % 5 == 0 || asked(request).0 == function::READ_INPUT;
                (!lost).then(|| slave.answer(request))
            },
            slave,
        );
        writes += written;
        assert!(
            matches!(
                error,
                Some(Error::OtherGripper(Kind::ThreeFinger) | Error::Link(_))
            ),
            "{error:?}"
        );
    }
    println!(
        "{CONNECTIONS} connections of a 2-Finger driver to a 3-Finger gripper, every fifth reply lost: {writes} writes"
    );
    assert_eq!(writes, 0);
}

#[test]
fn while_the_family_is_asked_for_every_wait_ends() {
    // Nobody answers; or only what every family has is answered.
    for answers in [false, true] {
        let line = Line::default();
        let mut gripper = TwoFinger::new(line.clone(), Model::HandE, Config::default());
        let mut slave = Slave::two_finger();
        gripper.identify();
        let mut longest = 0;
        while line.now() < 10_000_000 {
            let began = line.now();
            let heard = run_gripper(
                &line,
                &mut gripper,
                began + 2_000_000,
                &mut |line, end, request| {
                    if answers && asked(request) == (function::READ_HOLDING, 3) {
                        slave.serve(line, end, request);
                    }
                },
            );
            assert!(heard.is_some(), "a wait that does not end");
            longest = longest.max(line.now() - began);
        }
        // Nobody there: asked a few times a second. Else: two reads that stay unanswered and are not told.
        println!("answers: {answers}, the longest wait for an outcome {longest} µs");
        assert!(longest < if answers { 100_000 } else { 1_100_000 });
        assert_eq!(gripper.is_identified(), answers);
    }
}

#[test]
fn the_others_are_let_through_however_they_say_that_they_have_three_registers() {
    let refused = |request: &[u8]| {
        let mut reply = vec![9, request[1] | 0x80, 2];
        reply.extend(gripper::rtu::crc16(&reply).to_le_bytes());
        reply
    };
    // By an exception; by zeros; by silence, without FC04; by exceptions of which the first is lost.
    for way in 0..4 {
        let mut first = true;
        let (writes, _) = written(
            |slave, request| {
                let (code, quantity) = asked(request);
                match way {
                    3 if quantity > 3 && std::mem::take(&mut first) => None,
                    0 | 3 if quantity > 3 => Some(refused(request)),
                    2 if quantity > 3 || code == function::READ_INPUT => None,
                    _ => Some(slave.answer(request)),
                }
            },
            Slave::two_finger(),
        );
        assert!(writes > 10, "way {way}");
    }
}

#[test]
fn another_gripper_in_the_place_of_the_first_is_found_out() {
    let line = Line::default();
    let mut gripper = TwoFinger::new(line.clone(), Model::TwoFinger85, Config::default());
    let (mut first, mut second) = (Slave::two_finger(), Slave::three_finger());
    (second.status[0], second.status[1]) = (0x31, 0);
    let mut last = None;
    while line.now() < 6_000_000 {
        gripper.set_motion(somewhere(), at(line.now()));
        let heard = run_gripper(
            &line,
            &mut gripper,
            line.now() + 50_000,
            &mut |line, end, request| {
                match line.now() {
                    0..1_000_000 => first.serve(line, end, request),
                    // The first is taken off, the second put on.
                    1_000_000..3_000_000 => {}
                    _ if asked(request).0 != function::READ_INPUT => {
                        second.serve(line, end, request)
                    }
                    _ => {}
                }
            },
        );
        last = heard.and_then(Result::err).or(last);
    }
    assert!(first.writes > 10);
    assert_eq!(second.writes, 0);
    assert_eq!(last, Some(Error::OtherGripper(Kind::ThreeFinger)));
}

#[test]
fn the_check_can_be_turned_off() {
    let config = Config {
        check_family: false,
        ..Config::default()
    };
    let (clock, wire, truth) = wire(Virtual::default());
    truth.preset_active();
    let driver = TwoFinger::new(wire.clone(), Model::TwoFinger85, config);
    let mut bench = Two {
        clock,
        driver,
        wire,
        truth,
    };
    assert!(bench.driver.is_identified());
    bench.driver.reset();
    let status = bench.for_ms(200);
    assert_eq!(status.activation, Activation::Reset);
    assert!(bench.truth.writes() > 0);
}

#[test]
fn one_of_the_others_that_answers_eight_registers_is_found_out_once_it_is_ready() {
    let line = Line::default();
    let mut gripper = ThreeFinger::new(line.clone(), Config::default());
    // Behind its three registers it reads 0.
    let mut slave = Slave::two_finger();
    let mut told = 0;
    for _ in 0..50 {
        gripper.set_motion(somewhere(), at(line.now()));
        let heard = run_gripper(
            &line,
            &mut gripper,
            line.now() + 50_000,
            &mut |line, end, request| slave.serve(line, end, request),
        );
        told += u32::from(heard == Some(Err(Error::OtherGripper(Kind::TwoFinger))));
    }
    assert_eq!((slave.writes, told), (0, 50));
}

#[test]
fn a_three_finger_gripper_that_sets_a_reserved_bit_is_one_all_the_same() {
    // At rest, so that only its axes tell; the bit stands where the others have the controller's fault.
    let odd = || {
        let mut slave = Slave::three_finger();
        (slave.status[0], slave.status[1], slave.status[2]) = (0x31, 0, 0x10);
        slave
    };
    let (writes, error) = written(
        |slave, request| {
            let known = asked(request).0 != function::READ_INPUT;
            known.then(|| slave.answer(request))
        },
        odd(),
    );
    assert_eq!(writes, 0);
    assert_eq!(error, Some(Error::OtherGripper(Kind::ThreeFinger)));
    // Its own driver, told of such firmware, works with it.
    let (line, mut slave) = (Line::default(), odd());
    let config = Config {
        check_reserved: false,
        ..Config::default()
    };
    let mut gripper = ThreeFinger::new(line.clone(), config);
    for _ in 0..50 {
        gripper.set_motion(somewhere(), at(line.now()));
        run_gripper(
            &line,
            &mut gripper,
            line.now() + 50_000,
            &mut |line, end, request| slave.serve(line, end, request),
        );
    }
    assert!(slave.writes > 10);
}
