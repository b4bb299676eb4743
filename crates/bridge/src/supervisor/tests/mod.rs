//! One fact of the rules a test, with hand-made times.

extern crate std;

use super::*;
use crate::clutch::Clutch;
use crate::config::{SafeAction, Settings};
use gripper::Contact;
use std::vec::Vec;

mod age;
mod doubt;
mod faults;
mod start;
mod targets;

const MS: u64 = 1_000;

/// A supervisor with a gripper that does what it is told, at a finite speed, and a hand that stands still.
struct Bench {
    now: u64,
    supervisor: Supervisor<4>,
    inputs: Inputs<4>,
    /// The heartbeat comes, frames come, the gripper answers, it obeys.
    beating: bool,
    frames: bool,
    answering: bool,
    output: [f32; 4],
    /// Counts per 10 ms.
    speed: u8,
    sent: Vec<(u64, [u8; 4])>,
    last: Option<Output<4>>,
}

/// A clutch whose newest heartbeat came at `beat`.
fn closed(beat: Instant) -> Clutch {
    Clutch::Closed { epoch: 0, beat }
}

fn at(us: u64) -> Instant {
    Instant::from_ticks(us)
}

fn status(position: [u8; 4]) -> Status<4> {
    Status {
        stamp: at(0),
        activation: Activation::Ready,
        going_to: true,
        contact: [Contact::AtPosition; 4],
        echo: position,
        position,
        current: [0; 4],
        fault: Fault::None,
    }
}

impl Bench {
    fn new(settings: Settings<4>) -> Self {
        Self {
            now: 1_000 * MS,
            supervisor: Supervisor::new(Config::new(settings).unwrap()),
            inputs: Inputs {
                clutch: Clutch::Open,
                hand: None,
                status: Some(status([10, 20, 30, 137])),
                weights: Weights::Ready,
            },
            beating: false,
            frames: true,
            answering: true,
            output: [200.0, 150.0, 100.0, 100.0],
            speed: 2,
            sent: Vec::new(),
            last: None,
        }
    }

    fn status(&mut self) -> &mut Status<4> {
        self.inputs.status.as_mut().unwrap()
    }

    /// 10 ms: the gripper moves, devices answer, the supervisor steps.
    fn tick(&mut self) -> Output<4> {
        self.now += 10 * MS;
        let now = self.now;
        if self.answering {
            self.answer(now);
        }
        if self.frames && (now / (10 * MS)).is_multiple_of(3) {
            self.frame(Ok(self.output), now - 5 * MS);
        }
        if self.beating {
            self.inputs.clutch = closed(at(now));
        }
        self.step()
    }

    fn step(&mut self) -> Output<4> {
        let output = self.supervisor.step(at(self.now), &self.inputs);
        if let Some(motion) = output.motion {
            self.sent.push((self.now, motion.position));
            if self.answering {
                self.status().echo = motion.position;
                self.status().going_to = true;
            }
        }
        self.last = Some(output);
        output
    }

    fn answer(&mut self, now: u64) {
        let speed = self.speed;
        let status = self.status();
        status.stamp = at(now);
        for axis in 0..4 {
            if status.contact[axis] == Contact::AtPosition {
                let (here, goal) = (status.position[axis], status.echo[axis]);
                status.position[axis] =
                    goal.clamp(here.saturating_sub(speed), here.saturating_add(speed));
            }
        }
    }

    fn frame(&mut self, output: Result<[f32; 4], HoldReason>, stamp: u64) {
        let sequence = self.inputs.hand.map_or(0, |hand| hand.sequence + 1);
        self.inputs.hand = Some(Hand {
            sequence,
            stamp: at(stamp),
            output,
        });
    }

    fn ticks(&mut self, count: usize) -> Output<4> {
        for _ in 0..count {
            self.tick();
        }
        self.last.unwrap()
    }

    /// Ticks until `state`; panics after 5 s.
    fn until(&mut self, state: impl Fn(State) -> bool) -> Output<4> {
        for _ in 0..500 {
            let output = self.tick();
            if state(output.state) {
                return output;
            }
        }
        panic!("still {:?} after 5 s", self.supervisor.state());
    }

    fn following(settings: Settings<4>) -> Self {
        let mut bench = Self::new(settings);
        bench.beating = true;
        bench.until(|state| state == State::Following);
        bench
    }
}

fn following() -> Bench {
    Bench::following(Settings::default())
}
