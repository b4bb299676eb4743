//! The drivers against the rig's virtual grippers, which were written from the documents by other
//! hands with a register table of their own.
#![allow(clippy::unwrap_used)]

use gripper::driver::{Config, Control, Driver, Error, Failure, Family, Outcome, Task};
use gripper::driver::{ThreeFinger, TwoFinger};
use gripper::registers::three_finger::Mode;
use gripper::registers::two_finger::{Model, Release};
use gripper::{Activation, Contact, Duration, Fault, Gripper, Instant, Motion, Status};
use rig::gripper::{Config as Virtual, Family as VirtualFamily, VirtualGripper};
use rig::{Clock, MemoryWire};

/// A driver, its wire and the gripper's true state, on one virtual clock.
struct Bench<F, const X: usize> {
    clock: Clock,
    driver: Driver<MemoryWire, F, X>,
    wire: MemoryWire,
    truth: VirtualGripper,
}

type Three = Bench<gripper::driver::ThreeFingerFamily, 4>;
type Two = Bench<gripper::driver::TwoFingerFamily, 1>;

fn wire(config: Virtual) -> (Clock, MemoryWire, VirtualGripper) {
    let clock = Clock::new();
    let truth = VirtualGripper::new(config);
    let wire = MemoryWire::new(&clock, truth.clone(), 115_200);
    (clock, wire, truth)
}

fn three() -> Three {
    let (clock, wire, truth) = wire(Virtual::default());
    let driver = ThreeFinger::new(wire.clone(), Config::default());
    Bench {
        clock,
        driver,
        wire,
        truth,
    }
}

fn two(model: Model) -> Two {
    let family = match model {
        Model::TwoFinger85 => VirtualFamily::TwoFinger85,
        Model::TwoFinger140 => VirtualFamily::TwoFinger140,
        Model::HandE => VirtualFamily::HandE,
    };
    let (clock, wire, truth) = wire(Virtual::of(family));
    let driver = TwoFinger::new(wire.clone(), model, Config::default());
    Bench {
        clock,
        driver,
        wire,
        truth,
    }
}

impl<F: Family<X>, const X: usize> Bench<F, X> {
    /// The next outcome, or `None` when `limit` has passed.
    fn next(&mut self, limit: Duration) -> Option<Result<Status<X>, Error>> {
        let end = self.clock.now() + limit;
        loop {
            let now = self.clock.now();
            if let Some(outcome) = self.driver.poll(now) {
                return Some(outcome);
            }
            if now >= end {
                return None;
            }
            // A due time that has passed means "poll again": a tick later at the earliest.
            let due = self.driver.next_due().max(now + Duration::from_micros(1));
            self.clock.wait_until(due.min(end));
        }
    }

    fn cycle(&mut self) -> Status<X> {
        self.next(Duration::from_millis(100))
            .expect("every wait ends")
            .unwrap()
    }

    /// Polls until `done` or the time is over; the last status.
    fn until(
        &mut self,
        limit_ms: u64,
        mut done: impl FnMut(&Self, &Status<X>) -> bool,
    ) -> Status<X> {
        let end = self.clock.now() + Duration::from_millis(limit_ms);
        loop {
            let status = self.cycle();
            if done(self, &status) {
                return status;
            }
            assert!(
                self.clock.now() < end,
                "not within {limit_ms} ms: {status:?}"
            );
        }
    }

    fn for_ms(&mut self, span: u64) -> Status<X> {
        let end = self.clock.now() + Duration::from_millis(span);
        self.until(span + 100, |bench, _| bench.clock.now() >= end)
    }

    /// Keeps a motion fresh until every axis stands.
    fn go(&mut self, position: [u8; X]) -> Status<X> {
        let end = self.clock.now() + Duration::from_millis(8_000);
        loop {
            let motion = Motion {
                position,
                speed: [255; X],
                force: [100; X],
            };
            self.driver.set_motion(Some(motion), self.clock.now());
            let status = self.cycle();
            if self.driver.accepted() && !status.contact.contains(&Contact::Moving) {
                return status;
            }
            assert!(self.clock.now() < end, "never stood: {status:?}");
        }
    }

    fn run_task(&mut self, limit_ms: u64) -> Status<X> {
        let status = self.until(limit_ms, |bench, _| bench.driver.task().is_none());
        assert!(
            matches!(self.driver.outcome(), Some((_, Outcome::Done))),
            "{:?}",
            self.driver.outcome()
        );
        status
    }

    fn activate(&mut self) -> Status<X> {
        self.driver.activate();
        self.run_task(20_000)
    }
}

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

/// A bench whose gripper holds an object by simplified control, as another program left it.
fn holding() -> Three {
    let mut bench = three();
    bench.activate();
    for (axis, at) in [(0, 188.0), (1, 193.0), (2, 189.0)] {
        bench.truth.set_object(axis, Some(at));
    }
    bench.driver.set_control(Control::SIMPLIFIED);
    let status = bench.go([255, 0, 0, 0]);
    assert_eq!(status.contact[..3], [Contact::ContactClosing; 3]);
    // A new program connects to the same gripper.
    bench.driver = ThreeFinger::new(bench.wire.clone(), Config::default());
    bench
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

#[test]
fn every_fault_number_becomes_a_type_a_sentence_and_an_action() {
    let mut seen = 0;
    let mut bench = three();
    bench.activate();
    for code in 0..16_u8 {
        bench.truth.set_fault(Some(code));
        let status = bench.for_ms(50);
        assert_eq!(status.fault, Fault::three_finger(code));
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
            assert_eq!(status.fault, Fault::two_finger(code), "{}", model.name());
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

#[test]
fn a_hundred_hertz_is_held_for_a_hundred_thousand_cycles() {
    let mut bench = three();
    bench.activate();
    let period = Duration::from_millis(10);
    bench.driver = ThreeFinger::new(
        bench.wire.clone(),
        Config {
            cycle: period,
            ..Config::default()
        },
    );
    let motion = |count: u32| Motion {
        position: [100 + (count / 50 % 40) as u8; 4],
        speed: [255; 4],
        force: [100; 4],
    };
    bench.cycle();
    let (start, writes) = (bench.clock.now(), bench.truth.writes());
    for count in 0..100_000 {
        bench
            .driver
            .set_motion(Some(motion(count)), bench.clock.now());
        bench.cycle();
    }
    let span = (bench.clock.now() - start).as_micros();
    let counters = bench.driver.counters();
    println!(
        "100000 cycles in {span} µs, {} commands, {counters:?}",
        bench.truth.writes() - writes
    );
    assert!(span <= 100_000 * 10_000 + 10_000);
    assert_eq!(bench.truth.writes() - writes, 100_000);
    assert_eq!((counters.timeouts, counters.crc, counters.noise), (0, 0, 0));
}

#[test]
fn the_cycle_takes_what_bytes_silences_and_the_five_millisecond_rule_allow() {
    for (name, silence) in [
        ("1.75 ms", gripper::timing::silence(115_200)),
        ("3.5 characters", gripper::timing::short_silence(115_200)),
    ] {
        let (clock, wire, truth) = wire(Virtual {
            frame_gap: silence,
            ..Virtual::default()
        });
        let config = Config {
            silence: Some(silence),
            ..Config::default()
        };
        let mut bench: Three = Bench {
            driver: ThreeFinger::new(wire.clone(), config),
            clock,
            wire,
            truth,
        };
        bench.activate();
        let motion = Motion {
            position: [100; 4],
            speed: [255; 4],
            force: [100; 4],
        };
        let mut start = Instant::from_ticks(0);
        for cycle in 0..1_100 {
            if cycle == 100 {
                start = bench.clock.now();
            }
            bench.driver.set_motion(Some(motion), bench.clock.now());
            bench.cycle();
        }
        let took = (bench.clock.now() - start).as_micros() / 1_000;
        // 29 + 21 characters and two silences, or 5 ms.
        let allowed = ((50.0 * 10e6 / 115_200.0) as u64 + 2 * silence.as_micros()).max(5_000);
        println!(
            "silences of {name}: a cycle takes {took} µs of {allowed} µs allowed, {} Hz",
            1_000_000 / took
        );
        assert!(
            took * 95 <= allowed * 100,
            "{took} µs where {allowed} µs are allowed"
        );
    }
}

#[test]
fn a_dropped_reply_costs_one_cycle() {
    let mut bench = three();
    bench.activate();
    let motion = Motion {
        position: [100; 4],
        speed: [255; 4],
        force: [100; 4],
    };
    let (mut last, mut gaps) = (bench.clock.now(), Vec::new());
    for cycle in 0..400 {
        if cycle % 40 == 39 {
            bench.truth.mute(1);
        }
        bench.driver.set_motion(Some(motion), bench.clock.now());
        if bench.next(Duration::from_millis(100)).unwrap().is_ok() {
            gaps.push((bench.clock.now() - last).as_micros());
            last = bench.clock.now();
        }
    }
    gaps.sort_unstable();
    let (usual, worst) = (gaps[200], *gaps.last().unwrap());
    println!("status every {usual} µs; {worst} µs around a dropped reply");
    // One cycle of 10 ms is lost, and the next one reads.
    assert!(worst <= 22_000);
    assert_eq!(bench.driver.counters().timeouts, 10);
}

#[test]
fn a_gripper_that_was_late_for_a_while_is_back_as_soon_as_it_answers_in_time() {
    let mut worst = 0;
    for delay in [5, 8, 10, 12, 15, 20, 30, 50, 100, 300] {
        for span in [1, 10, 45, 100, 500, 3_000] {
            let mut bench = three();
            bench.activate();
            let motion = Motion {
                position: [100; 4],
                speed: [255; 4],
                force: [100; 4],
            };
            let end = bench.clock.now() + Duration::from_millis(span);
            bench.truth.set_reply_delay(Duration::from_millis(delay));
            while bench.clock.now() < end {
                bench.driver.set_motion(Some(motion), bench.clock.now());
                let _ = bench.next(end - bench.clock.now());
            }
            bench.truth.set_reply_delay(Duration::from_millis(0));
            let (back, writes) = (bench.clock.now(), bench.truth.writes());
            while bench.truth.writes() == writes {
                bench.driver.set_motion(Some(motion), bench.clock.now());
                let _ = bench.next(Duration::from_millis(10));
                assert!(
                    bench.clock.now() < back + Duration::from_millis(1_000),
                    "{delay} ms late for {span} ms"
                );
            }
            worst = worst.max((bench.clock.now() - back).as_millis());
        }
    }
    println!("60 spells of lateness: commanded again at most {worst} ms after the end");
    assert!(worst <= 400);
}

#[test]
fn cutting_the_wire_at_every_byte_leaves_no_axis_more_than_forty_counts_further() {
    let mut worst = 0.0_f32;
    let mut cuts = 0;
    // Every byte of a full stroke is one of some 4,000; every 7th start, each byte of its cycle.
    for cut_at in (0..4_200_u64).step_by(7) {
        let mut bench = three();
        bench.activate();
        bench.go([10, 10, 10, 100]);
        let from = bench.wire.traffic();
        let sent =
            |bench: &Three| bench.wire.traffic().0 + bench.wire.traffic().1 - from.0 - from.1;
        let mut status = bench.cycle();
        // Towards 250, never asking for more than 40 counts past the measured position.
        while sent(&bench) < cut_at && bench.clock.now().as_ticks() < 60_000_000 {
            let position = status
                .position
                .map(|count| count.saturating_add(40).min(250));
            let motion = Motion {
                position: [position[0], position[1], position[2], 100],
                speed: [255; 4],
                force: [100; 4],
            };
            bench.driver.set_motion(Some(motion), bench.clock.now());
            let now = bench.clock.now();
            match bench.driver.poll(now) {
                Some(Ok(fresh)) => status = fresh,
                Some(Err(error)) => panic!("{error}"),
                None => bench
                    .clock
                    .wait_until(bench.driver.next_due().max(now + Duration::from_micros(1))),
            }
        }
        bench.wire.unplug(true);
        let at_cut = bench.truth.positions();
        bench.clock.advance(Duration::from_millis(5_000));
        bench.truth.run_until(bench.clock.now());
        for (axis, (before, after)) in at_cut.iter().zip(bench.truth.positions()).enumerate() {
            worst = worst.max(after - before);
            assert!(
                after - before <= 40.5,
                "cut after {cut_at} bytes: axis {axis} went on {before} → {after}"
            );
        }
        cuts += 1;
    }
    println!("{cuts} cuts: the furthest an axis went on is {worst:.1} counts");
}
