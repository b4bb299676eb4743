//! A driver, the rig's virtual gripper and the wire between them, on one virtual clock.
#![allow(dead_code, unused_imports, clippy::unwrap_used)]

use gripper::driver::{Config, Control, Driver, Error, Failure, Family, Outcome, Task};
use gripper::driver::{ThreeFinger, TwoFinger};
use gripper::registers::three_finger::Mode;
use gripper::registers::two_finger::{Model, Release};
use gripper::{Activation, Contact, Duration, Event, Fault, Gripper, Instant, Motion, Status};
use rig::gripper::{Config as Virtual, Family as VirtualFamily, VirtualGripper};
use rig::{Clock, MemoryWire};

/// A driver, its wire and the gripper's true state, on one virtual clock.
pub struct Bench<F, const X: usize> {
    pub clock: Clock,
    pub driver: Driver<MemoryWire, F, X>,
    pub wire: MemoryWire,
    pub truth: VirtualGripper,
}

pub type Three = Bench<gripper::driver::ThreeFingerFamily, 4>;
pub type Two = Bench<gripper::driver::TwoFingerFamily, 1>;

pub fn wire(config: Virtual) -> (Clock, MemoryWire, VirtualGripper) {
    let clock = Clock::new();
    let truth = VirtualGripper::new(config);
    let wire = MemoryWire::new(&clock, truth.clone(), 115_200);
    (clock, wire, truth)
}

pub fn three() -> Three {
    let (clock, wire, truth) = wire(Virtual::default());
    let driver = ThreeFinger::new(wire.clone(), Config::default());
    Bench {
        clock,
        driver,
        wire,
        truth,
    }
}

pub fn two(model: Model) -> Two {
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
    pub fn next(&mut self, limit: Duration) -> Option<Result<Status<X>, Error>> {
        let end = self.clock.now() + limit;
        loop {
            let now = self.clock.now();
            if let Some(outcome) = self.driver.poll(now).and_then(Event::ended) {
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

    pub fn cycle(&mut self) -> Status<X> {
        self.next(Duration::from_millis(100))
            .expect("every wait ends")
            .unwrap()
    }

    /// Polls until `done` or the time is over; the last status.
    pub fn until(
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

    pub fn for_ms(&mut self, span: u64) -> Status<X> {
        let end = self.clock.now() + Duration::from_millis(span);
        self.until(span + 100, |bench, _| bench.clock.now() >= end)
    }

    /// Keeps a motion fresh until every axis stands.
    pub fn go(&mut self, position: [u8; X]) -> Status<X> {
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

    pub fn run_task(&mut self, limit_ms: u64) -> Status<X> {
        let status = self.until(limit_ms, |bench, _| bench.driver.task().is_none());
        assert!(
            matches!(self.driver.outcome(), Some((_, Outcome::Done))),
            "{:?}",
            self.driver.outcome()
        );
        status
    }

    pub fn activate(&mut self) -> Status<X> {
        self.driver.activate();
        self.run_task(20_000)
    }
}

/// A bench whose gripper holds an object by simplified control, as another program left it.
pub fn holding() -> Three {
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
