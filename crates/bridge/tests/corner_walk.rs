//! The way through the configuration space, seen from the gripper's true position: statuses come 8 to 59 ms late, commands
//! take their time, the axes are unequally fast and end a count beyond their command, and the targets lie about the
//! forbidden corner.

use bridge::supervisor::{Hand, Inputs, Supervisor, Weights};
use bridge::{Clutch, Config, Instant, Settings};
use gripper::registers::Fault;
use gripper::{Activation, Contact, Status, space};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::VecDeque;

const MS: u64 = 1_000;
/// Counts an axis may end beyond its command.
const OVERSHOOT: f32 = 1.0;

struct World {
    rng: ChaCha8Rng,
    now: u64,
    position: [f32; 4],
    /// Counts a millisecond, axis by axis: up to the 181 counts/s of the 3-Finger gripper.
    speed: [f32; 4],
    /// What the gripper goes to.
    goal: [u8; 4],
    /// Commands on the line: when they take effect.
    commands: VecDeque<(u64, [u8; 4])>,
    /// Statuses on the line: when they are there.
    statuses: VecDeque<(u64, Status<4>)>,
    /// Positions as the registers show them, refreshed every 5 ms.
    registers: [u8; 4],
    next_request: u64,
}

impl World {
    fn below(&mut self, bound: u64) -> u64 {
        self.rng.next_u64() % bound
    }

    /// A millisecond of the gripper's life.
    fn live(&mut self) {
        self.now += MS;
        while let Some(&(due, goal)) = self.commands.front()
            && due <= self.now
        {
            self.goal = goal;
            self.commands.pop_front();
        }
        for axis in 0..4 {
            let goal = f32::from(self.goal[axis]);
            let here = self.position[axis];
            // It closes past its command by a count, as a heavy finger does.
            let goal = if goal > here { goal + OVERSHOOT } else { goal };
            self.position[axis] = goal.clamp(here - self.speed[axis], here + self.speed[axis]);
        }
        if self.now.is_multiple_of(5 * MS) {
            self.registers = self.position.map(|x| x.round().clamp(0.0, 255.0) as u8);
        }
    }

    /// One FC23: the command goes out, the status comes back late.
    fn request(&mut self, command: Option<[u8; 4]>) {
        if self.now < self.next_request {
            return;
        }
        let delay = (8 + self.below(52)) * MS;
        self.next_request = self.now + 8 * MS;
        if let Some(command) = command {
            self.commands.push_back((self.now + 3 * MS, command));
        }
        let status = Status {
            stamp: Instant::from_ticks(self.now),
            activation: Activation::Ready,
            going_to: true,
            contact: [Contact::Moving; 4],
            echo: command.unwrap_or(self.goal),
            position: self.registers,
            current: [0; 4],
            fault: Fault::None,
        };
        let last = self.statuses.back().map_or(0, |(due, _)| *due);
        self.statuses
            .push_back(((self.now + delay).max(last), status));
    }

    fn arrived(&mut self) -> Option<Status<4>> {
        let mut newest = None;
        while let Some((due, status)) = self.statuses.front()
            && *due <= self.now
        {
            newest = Some(*status);
            self.statuses.pop_front();
        }
        newest
    }
}

/// A target about the edge of what is forbidden: from any side of it to any other.
fn target(world: &mut World) -> [f32; 4] {
    let mut low = |least: u64, span: u64| (least + world.below(span)) as f32;
    [low(90, 166), low(90, 166), low(90, 166), low(120, 136)]
}

/// What a walk came to: how far outside the gripper was at worst, how far from its targets at their ends, steps in motion.
struct Walked {
    outside: f32,
    missed: f32,
    moved: u32,
}

/// A minute of targets, each kept for so many milliseconds.
fn walk(seed: u64, kept: u64) -> Walked {
    let mut world = World {
        rng: ChaCha8Rng::seed_from_u64(seed),
        now: 0,
        position: [100.0, 100.0, 100.0, 100.0],
        speed: [0.2; 4],
        goal: [100; 4],
        commands: VecDeque::new(),
        statuses: VecDeque::new(),
        registers: [100; 4],
        next_request: 0,
    };
    // The fastest a user may set, so that limits do not hide what the corner must keep.
    let settings = Settings {
        rate: 2_000.0,
        blend_ms: 100,
        ..Settings::default()
    };
    let mut supervisor = Supervisor::new(Config::new(settings).expect("in range"));
    let mut inputs = Inputs {
        clutch: Clutch::Open,
        hand: None,
        status: None,
        weights: Weights::Ready,
    };
    let (mut wanted, mut aim) = ([100.0; 4], None);
    let mut walked = Walked {
        outside: 0.0,
        missed: 0.0,
        moved: 0,
    };
    for tick in 0..60_000_u64 {
        if tick.is_multiple_of(kept) {
            if let Some(aim) = aim {
                walked.missed = walked.missed.max(distance(&world.position, &aim));
            }
            wanted = target(&mut world);
            world.speed = core::array::from_fn(|_| (2 + world.below(17)) as f32 / 100.0);
        }
        world.live();
        if let Some(status) = world.arrived() {
            inputs.status = Some(status);
        }
        if !tick.is_multiple_of(10) {
            continue;
        }
        let now = Instant::from_ticks(world.now);
        inputs.clutch = Clutch::Closed {
            epoch: 1,
            beat: now,
        };
        inputs.hand = Some(Hand {
            sequence: tick as u32,
            stamp: now,
            output: Ok(wanted),
        });
        let output = supervisor.step(now, &inputs);
        aim = output.target;
        walked.moved += u32::from(output.state.is_moving());
        world.request(output.motion.map(|motion| motion.position));
        walked.outside = walked.outside.max(outside(&world.position));
    }
    walked
}

/// The farthest of the axes, counts.
fn distance(a: &[f32; 4], b: &[f32; 4]) -> f32 {
    let each = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    each.fold(0.0, f32::max)
}

/// How far a position is beyond the edge, counts: how much every axis must open for it to be allowed.
fn outside(position: &[f32; 4]) -> f32 {
    let mut by = 0.0;
    while !space::contains(&position.map(|x| (x - by).clamp(0.0, 255.0))) {
        by += 0.1;
    }
    by
}

#[test]
fn the_true_position_stays_inside_however_late_the_statuses_are() {
    for seed in 0..12 {
        let Walked { outside, moved, .. } = walk(seed, 300);
        println!("seed {seed}: {outside:.1} counts outside at worst, {moved} steps in motion");
        assert!(moved > 4_000, "seed {seed}: {moved} steps in motion");
        assert!(outside == 0.0, "seed {seed}: {outside} counts outside");
    }
}

#[test]
fn a_hand_that_stands_still_is_reached_from_every_side_of_the_corner() {
    for seed in 100..106 {
        // The slowest axis needs 7 s for the whole of these targets' range.
        let Walked {
            outside, missed, ..
        } = walk(seed, 10_000);
        println!("seed {seed}: {missed:.1} counts from the targets at most");
        assert!(outside == 0.0, "seed {seed}: {outside} counts outside");
        assert!(missed <= 2.0, "seed {seed}: {missed} counts from a target");
    }
}
