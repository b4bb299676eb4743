//! A process that stands still: what lies in the port when it goes on was said before, and nothing is
//! commanded on it. While it stands somebody else moves the gripper.
#![allow(clippy::unwrap_used)]

mod bench;
mod support;

use bench::*;
use gripper::driver::{Config, Family, Outcome, Task, ThreeFinger};
use gripper::link::{self, LateReply, Link};
use gripper::registers::STATUS;
use gripper::registers::two_finger::Model;
use gripper::rtu::Request;
use gripper::{Duration, Event, Gripper, Motion, Status, timing};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use support::{CHARACTER, Line, Slave, at};

/// Most counts a command leads the status it was made from.
const LEAD: u8 = 40;

/// Leads every axis towards `target`, status after status.
struct Hand<const X: usize> {
    target: [u8; X],
    status: Option<Status<X>>,
    /// What the driver was last given.
    command: Option<[u8; X]>,
}

impl<const X: usize> Hand<X> {
    /// One poll at the time there is now; the command, if one left.
    fn step<F: Family<X>>(&mut self, bench: &mut Bench<F, X>) -> Option<[u8; X]> {
        let now = bench.clock.now();
        let before = bench.driver.counters().writes;
        let heard = bench.driver.poll(now);
        let left = bench.driver.counters().writes != before;
        let command = self.command.filter(|_| left);
        assert_eq!(left, heard == Some(Event::Sent), "told when it leaves");
        if let Some(Event::Status(status)) = heard {
            assert!(status.stamp < now, "a status is younger than its request");
            self.status = Some(status);
        }
        // As young as its caller says, whatever it was made from.
        if let Some(status) = &self.status {
            let position = core::array::from_fn(|axis| {
                let here = status.position[axis];
                self.target[axis].clamp(here.saturating_sub(LEAD), here.saturating_add(LEAD))
            });
            let motion = Motion {
                position,
                speed: [255; X],
                force: [100; X],
            };
            bench.driver.set_motion(Some(motion), now);
            self.command = Some(position);
        }
        command
    }

    fn run_until<F: Family<X>>(&mut self, bench: &mut Bench<F, X>, end: gripper::Instant) {
        while bench.clock.now() < end {
            self.step(bench);
            let soon = bench.clock.now() + Duration::from_micros(1);
            let due = bench.driver.next_due().max(soon);
            bench.clock.wait_until(due.min(end));
        }
    }
}

fn random(rng: &mut ChaCha8Rng, below: u64) -> u64 {
    rng.next_u64() % below
}

/// Stalls of 0.1 to 10 s at random moments in motion; how many first commands after one were farther
/// than the lead from where the gripper was, and the worst distance.
fn stalls<F: Family<X>, const X: usize>(mut bench: Bench<F, X>, count: u32, seed: u64) -> u32 {
    println!("seed {seed}");
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    bench.truth.preset_active();
    let mut hand = Hand {
        target: [200; X],
        status: None,
        command: None,
    };
    let (mut wrong, mut commands, mut worst) = (0, 0, 0.0f32);
    for _ in 0..count {
        hand.target = core::array::from_fn(|_| 20 + random(&mut rng, 150) as u8);
        let moment = Duration::from_micros(100_000 + random(&mut rng, 60_000));
        let end = bench.clock.now() + moment;
        hand.run_until(&mut bench, end);
        let stall = 100_000 + random(&mut rng, 9_900_000);
        bench.clock.advance(Duration::from_micros(stall));
        bench.truth.run_until(bench.clock.now());
        for axis in 0..X {
            let elsewhere = 20.0 + random(&mut rng, 150) as f32;
            bench.truth.set_position(axis, elsewhere);
        }
        // Goes on until the first command.
        let give_up = bench.clock.now() + Duration::from_millis(500);
        while bench.clock.now() < give_up {
            if let Some(command) = hand.step(&mut bench) {
                let far = (0..X)
                    .map(|axis| (f32::from(command[axis]) - bench.truth.positions()[axis]).abs())
                    .fold(0.0, f32::max);
                commands += 1;
                worst = worst.max(far);
                // The axes moved by a few counts since they were looked at.
                wrong += u32::from(far > f32::from(LEAD) + 12.0);
                break;
            }
            let soon = bench.clock.now() + Duration::from_micros(1);
            let due = bench.driver.next_due().max(soon);
            bench.clock.wait_until(due);
        }
    }
    println!(
        "{commands} first commands, {wrong} on what lay there, at most {worst:.0} counts away"
    );
    assert!(commands > count * 9 / 10);
    wrong
}

#[test]
fn after_a_stall_nothing_is_commanded_on_bytes_that_lay_there() {
    let (seed, wide) = (21, Config::for_pc());
    for (name, config) in [("chip", Config::default()), ("PC", wide)] {
        let mut bench = three();
        bench.driver = ThreeFinger::new(bench.wire.clone(), config);
        assert_eq!(stalls(bench, 1_000, seed), 0, "{name}");
    }
    assert_eq!(stalls(two(Model::TwoFinger85), 300, seed), 0);
}

#[test]
fn an_activation_over_which_the_process_stood_still_is_told_as_done() {
    let mut bench = three();
    bench.driver.activate();
    bench.until(5_000, |bench, _| bench.truth.is_moving());
    bench.clock.advance(Duration::from_secs(60));
    bench.truth.run_until(bench.clock.now());
    let end = bench.clock.now() + Duration::from_secs(2);
    while bench.driver.outcome().is_none() && bench.clock.now() < end {
        let _ = bench.next(Duration::from_millis(100));
    }
    assert_eq!(
        bench.driver.outcome(),
        Some((Task::Activate, Outcome::Done))
    );
}

const READ: Request<'static> = Request::ReadHolding {
    address: STATUS,
    quantity: 8,
};

#[test]
fn a_whole_reply_found_after_the_deadline_is_late() {
    let line = Line::default();
    let mut link = Link::new(line.clone(), link::Config::new(9, 115_200));
    let mut slave = Slave::three_finger();
    support::settle(&line, &mut link);
    let sent = line.now();
    link.start(&READ, &[], at(sent)).unwrap();
    let (_, request) = line.take_written().pop().unwrap();
    let reply = slave.answer(&request);
    // It answers at once; nobody looks for a second.
    line.send(sent + 3_000, CHARACTER, &reply);
    line.set_now(sent + 1_000_000);
    let heard = link.poll(at(line.now())).map(|heard| heard.map(drop));
    assert_eq!(heard, Some(Err(link::Error::Timeout { received: 0 })));
    support::settle(&line, &mut link);
    assert_eq!(link.counters().stale, 1, "and it is known for what it is");
    // Half of it was seen in time, the rest was not.
    let sent = line.now();
    link.start(&READ, &[], at(sent)).unwrap();
    line.take_written();
    line.send(sent + 3_000, CHARACTER, &reply);
    line.set_now(sent + 4_000);
    assert!(link.poll(at(line.now())).is_none());
    line.set_now(sent + 1_000_000);
    let heard = link.poll(at(line.now())).map(|heard| heard.map(drop));
    assert!(
        matches!(heard, Some(Err(link::Error::Timeout { received })) if received > 0),
        "{heard:?}"
    );
}

#[test]
fn a_reply_that_an_adapter_kept_back_over_a_stall_answers_nothing_after_it() {
    let line = Line::default();
    let mut link = Link::new(line.clone(), link::Config::new(9, 115_200));
    support::settle(&line, &mut link);
    link.start(&READ, &[], at(line.now())).unwrap();
    line.set_now(line.now() + 10_000_000);
    assert!(matches!(
        link.poll(at(line.now())),
        Some(Err(link::Error::Timeout { .. }))
    ));
    // The late reply counts from now on, not from before the stall.
    line.set_now(line.now() + 1_900_000);
    assert_eq!(link.late_reply(&READ, at(line.now())), LateReply::Possible);
    line.set_now(line.now() + 9_000_000);
    link.resume(at(line.now()));
    assert_eq!(link.late_reply(&READ, at(line.now())), LateReply::Possible);
    // And a line at rest is drained before it is used again.
    assert!(!link.is_free(at(line.now())));
    line.set_now(line.now() + timing::MEMORY.as_ticks());
    assert_eq!(link.late_reply(&READ, at(line.now())), LateReply::None);
}
