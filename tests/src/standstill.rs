//! A bridge whose process stands still in motion, on the PC and in QEMU, while somebody else moves the gripper: where the
//! first command after it is.

use std::time::{Duration, Instant};

use rig::Clock;
use rig::gripper::VirtualGripper;
use rustix::process::{Pid, Signal, kill_process};

use crate::random;

/// How far the first command may lie from the gripper, counts: what it moves between a status and the next command, and
/// the time this process takes to look.
pub const BETWEEN: f32 = 8.0;
/// How fast somebody else moves the fingers, counts a second: slower than the gripper could, or the positions would be doubted.
const PUSHED: f32 = 150.0;
/// How far at most: a gripper found more than 20 counts from where it was left waits for a person.
const FARTHEST: f32 = 16.0;
/// What a stopped process wrote last has arrived by then.
const ARRIVED: Duration = Duration::from_millis(30);
/// By then a process that goes on has written, if it does.
const GOES_ON: Duration = Duration::from_millis(600);

/// 0.1 to 3 s, by the seed.
pub fn length(seed: u64) -> Duration {
    Duration::from_millis(100 + random(seed) % 2_901)
}

/// Stops a process for so long, moves the fingers meanwhile, and lets it go on. How far its first command lies from where
/// the gripper is then, counts; `None` where none came.
///
/// # Panics
/// There is no such process.
pub fn stop(process: u32, time: Duration, gripper: &VirtualGripper, clock: &Clock) -> Option<f32> {
    let process = i32::try_from(process).ok().and_then(Pid::from_raw);
    let process = process.expect("a process");
    kill_process(process, Signal::STOP).expect("a process");
    std::thread::sleep(ARRIVED);
    let writes = gripper.writes();
    std::thread::sleep(time / 2);
    gripper.run_until(clock.now());
    let moved = (PUSHED * time.as_secs_f32()).min(FARTHEST);
    for axis in 0..3 {
        let here = gripper.positions()[axis];
        let there = if here > 128.0 {
            here - moved
        } else {
            here + moved
        };
        gripper.set_position(axis, there);
    }
    std::thread::sleep(time.saturating_sub(time / 2 + ARRIVED));
    kill_process(process, Signal::CONT).expect("a process");
    let end = Instant::now() + GOES_ON;
    while gripper.writes() == writes {
        if Instant::now() >= end {
            return None;
        }
        std::thread::sleep(Duration::from_micros(200));
    }
    let told = gripper.command_block();
    let here = gripper.positions();
    (0..3)
        .map(|axis| (f32::from(told[3 + 3 * axis]) - here[axis]).abs())
        .max_by(f32::total_cmp)
}

/// What many stalls came to.
#[derive(Debug, Clone, Copy, Default)]
pub struct Stalls {
    /// Stalls.
    pub count: u32,
    /// First commands after them.
    pub commands: u32,
    /// The farthest of them from the gripper, counts.
    pub farthest: f32,
}

impl Stalls {
    /// Counts one.
    ///
    /// # Panics
    /// Its first command rests on an answer from before it.
    pub fn add(&mut self, time: Duration, off: Option<f32>) {
        self.count += 1;
        if let Some(off) = off {
            self.commands += 1;
            self.farthest = self.farthest.max(off);
            assert!(off <= BETWEEN, "{time:?}: {off} counts from the gripper");
        }
    }
}
