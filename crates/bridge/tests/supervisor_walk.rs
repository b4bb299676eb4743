//! Seeded random walks over everything the supervisor can be told: dropouts, NaN, jumps, faults, pushed fingers, clocks that
//! stall, jump and run backwards. After every step an independent checker looks at the rules.

use bridge::supervisor::{Hand, Inputs, Output, Supervisor, Weights};
use bridge::{Clutch, Config, HoldReason, Instant, SafeAction, Settings, State};
use gripper::registers::Fault;
use gripper::{Activation, Contact, Motion, Status};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const STEPS: usize = 60_000;

/// What happens by chance, in steps of 1/1000 per supervisor step.
struct Dice(ChaCha8Rng);

impl Dice {
    fn below(&mut self, bound: u64) -> u64 {
        self.0.next_u64() % bound
    }

    fn permille(&mut self, chance: u64) -> bool {
        self.below(1000) < chance
    }

    fn byte(&mut self) -> u8 {
        self.below(256) as u8
    }

    /// −60 to 315 counts, and sometimes nonsense.
    fn count(&mut self) -> f32 {
        match self.below(400) {
            0 => f32::NAN,
            1 => f32::INFINITY,
            2 => -1e30,
            3 => f32::MIN_POSITIVE / 2.0,
            _ => self.below(375) as f32 - 60.0 + self.below(100) as f32 / 100.0,
        }
    }
}

/// The world around the supervisor.
struct World {
    dice: Dice,
    now: u64,
    /// Where the gripper truly is.
    position: [f32; 4],
    echo: [u8; 4],
    contact: [Contact; 4],
    activation: Activation,
    fault: Fault,
    going_to: bool,
    /// Counts in 10 ms.
    speed: f32,
    /// Somebody pushes this axis there.
    pushed: Option<(usize, f32)>,
    clutch: bool,
    glove: bool,
    gripper: bool,
    wanted: [f32; 4],
    inputs: Inputs<4>,
}

/// A clutch whose newest heartbeat came at `beat`.
fn closed(beat: Instant) -> Clutch {
    Clutch::Closed { epoch: 0, beat }
}

fn at(us: u64) -> Instant {
    Instant::from_ticks(us)
}

impl World {
    fn new(seed: u64, start: u64) -> Self {
        let mut dice = Dice(ChaCha8Rng::seed_from_u64(seed));
        let position: [u8; 4] = core::array::from_fn(|_| dice.byte());
        Self {
            now: start,
            position: position.map(f32::from),
            echo: core::array::from_fn(|_| dice.byte()),
            dice,
            contact: [Contact::AtPosition; 4],
            activation: Activation::Ready,
            fault: Fault::None,
            going_to: false,
            speed: 1.8,
            pushed: None,
            clutch: false,
            glove: true,
            gripper: true,
            wanted: [100.0; 4],
            inputs: Inputs {
                clutch: Clutch::Open,
                hand: None,
                status: None,
                weights: Weights::Ready,
            },
        }
    }

    fn turn(&mut self) {
        let before = self.now;
        self.clock();
        self.plant(self.now.saturating_sub(before));
        self.person();
        self.frames();
        self.statuses();
    }

    fn clock(&mut self) {
        let us = match self.dice.below(1000) {
            0 => 0,
            1 => 400_000,
            2..20 => 25_000,
            20..25 => 100_000,
            25..200 => 1 + self.dice.below(9_999),
            _ => 9_500 + self.dice.below(1_000),
        };
        self.now = if self.dice.permille(1) {
            self.now.saturating_sub(self.dice.below(1_000_000))
        } else {
            self.now.saturating_add(us)
        };
    }

    fn plant(&mut self, us: u64) {
        let way = |speed: f32| speed * us as f32 * 1e-4;
        for axis in 0..4 {
            let goal = f32::from(self.echo[axis]);
            let free = !matches!(
                self.contact[axis],
                Contact::ContactOpening | Contact::ContactClosing
            );
            let pushed = self.pushed.is_some_and(|(pushed, _)| pushed == axis);
            if free && !pushed && self.going_to && self.activation == Activation::Ready {
                self.position[axis] = goal.clamp(
                    self.position[axis] - way(self.speed),
                    self.position[axis] + way(self.speed),
                );
            }
            if self.dice.permille(3) {
                self.contact[axis] = match self.dice.below(4) {
                    0 => Contact::ContactOpening,
                    1 => Contact::ContactClosing,
                    2 => Contact::Moving,
                    _ => Contact::AtPosition,
                };
            }
            // Somebody pushes a finger, no faster than it could move.
            if self.dice.permille(1) {
                self.pushed = Some((axis, f32::from(self.dice.byte())));
            }
        }
        if let Some((axis, goal)) = self.pushed {
            let here = self.position[axis];
            self.position[axis] = goal.clamp(here - way(1.8), here + way(1.8));
            self.pushed = self.pushed.filter(|_| self.position[axis] != goal);
        }
        if self.dice.permille(5) {
            self.speed = self.dice.below(19) as f32 / 10.0;
        }
        // Another program set a far position once.
        if self.dice.permille(1) {
            self.echo = core::array::from_fn(|_| self.dice.byte());
        }
    }

    fn person(&mut self) {
        let toggle = if self.clutch { 4 } else { 40 };
        if self.dice.permille(toggle) {
            self.clutch = !self.clutch;
            if !self.clutch && self.dice.permille(500) {
                self.inputs.clutch = Clutch::Open;
            }
        }
        if self.clutch {
            self.inputs.clutch = closed(at(if self.dice.permille(2) {
                self.now + self.dice.below(1_000_000)
            } else {
                self.now - self.dice.below(80_000).min(self.now)
            }));
        }
        if self.dice.permille(20) {
            self.inputs.weights = match self.dice.below(20) {
                0 => Weights::Missing,
                1 => Weights::Busy,
                _ => Weights::Ready,
            };
        }
    }

    fn frames(&mut self) {
        let toggle = if self.glove { 6 } else { 60 };
        if self.dice.permille(toggle) {
            self.glove = !self.glove;
        }
        if self.dice.permille(10) {
            self.wanted = core::array::from_fn(|_| self.dice.count());
        }
        if !(self.glove && self.dice.permille(330)) {
            return;
        }
        let stamp = match self.dice.below(300) {
            0 => self.now + self.dice.below(200_000),
            1 => self.now.saturating_sub(self.dice.below(300_000)),
            _ => self.now.saturating_sub(self.dice.below(40_000)),
        };
        let output = match self.dice.below(200) {
            0 => Err(HoldReason::InputRefused),
            1..=3 => Err(HoldReason::SensorsLost(self.dice.below(65_536) as u16)),
            _ => Ok(self.wanted),
        };
        self.inputs.hand = Some(Hand {
            sequence: self
                .inputs
                .hand
                .map_or(0, |hand| hand.sequence.wrapping_add(1)),
            stamp: at(stamp),
            output,
        });
    }

    fn statuses(&mut self) {
        let toggle = if self.gripper { 3 } else { 60 };
        if self.dice.permille(toggle) {
            self.gripper = !self.gripper;
        }
        let ill = self.fault != Fault::None || self.activation != Activation::Ready;
        if self.dice.permille(if ill { 60 } else { 2 }) {
            (self.fault, self.activation) = if ill {
                (Fault::None, Activation::Ready)
            } else {
                match self.dice.below(20) {
                    0 => (Fault::None, Activation::Reset),
                    1 => (Fault::None, Activation::Activating),
                    2 => (Fault::None, Activation::ChangingMode),
                    code => (Fault::three_finger(code as u8), Activation::Ready),
                }
            };
        }
        if self.dice.permille(2) {
            self.going_to = false;
        }
        if self.gripper && self.dice.permille(900) {
            self.inputs.status = Some(Status {
                stamp: at(self.now),
                activation: self.activation,
                going_to: self.going_to,
                contact: self.contact,
                echo: self.echo,
                position: self.position.map(|x| x.round() as u8),
                current: [0; 4],
                fault: self.fault,
            });
        }
    }

    /// The command reaches the gripper, mostly.
    fn obey(&mut self, motion: Option<Motion<4>>) {
        if let Some(motion) = motion
            && self.gripper
            && self.dice.permille(950)
        {
            self.echo = motion.position;
            self.going_to = true;
        }
    }
}

/// Knows the rules, and nothing of how the supervisor keeps them.
struct Checker {
    settings: Settings<4>,
    before: Option<(u64, Output<4>, Status<4>)>,
    hand: Option<Hand<4>>,
    /// Fresh usable frames in a row, and the stamp of the newest.
    run: u32,
    newest: Option<u64>,
    moves: u32,
    holds: u32,
    states: std::collections::BTreeSet<String>,
}

impl Checker {
    fn new(settings: Settings<4>) -> Self {
        Self {
            settings,
            before: None,
            hand: None,
            run: 0,
            newest: None,
            moves: 0,
            holds: 0,
            states: std::collections::BTreeSet::new(),
        }
    }

    fn look(&mut self, world: &World, output: &Output<4>) {
        self.states.insert(output.state.name().to_string());
        self.count_frames(world);
        if let Some(target) = output.target {
            assert!(gripper::space::contains(&target), "{target:?}");
        }
        let moving = output.state.is_moving();
        if moving {
            let Clutch::Closed { beat, .. } = world.inputs.clutch else {
                panic!("no motion without the clutch");
            };
            let beat = beat.as_ticks();
            assert!(
                world.now >= beat && world.now - beat < 250_000,
                "heartbeat {beat}"
            );
            assert_eq!(world.inputs.weights, Weights::Ready);
        }
        if moving && !output.before.is_moving() {
            assert!(
                self.run >= u32::from(self.settings.fresh_frames),
                "only {} frames in a row",
                self.run
            );
        }
        let Some(motion) = output.motion else {
            self.before = world
                .inputs
                .status
                .map(|status| (world.now, *output, status));
            return;
        };
        let status = world.inputs.status.expect("no command without a status");
        self.ages(world, output, &status);
        assert_eq!(
            (motion.speed, motion.force),
            (self.settings.speed, self.settings.force)
        );
        assert_eq!(status.activation, Activation::Ready);
        // A second step at the very instant of the first repeats it.
        let again = self.before.is_some_and(|(then, before, _)| {
            then == world.now && !before.before.is_moving() && before.motion == Some(motion)
        });
        match output.state {
            State::Blending | State::Following if output.before.is_moving() && !again => {
                self.moves += 1;
                self.led(&motion, &status);
                self.inside(&motion, &status);
                self.rate(world, output, &motion, &status);
            }
            // The first command repeats.
            State::Blending | State::Following => assert_eq!(motion.position, status.hold()),
            State::SafeAction(_)
                if self.settings.safe_action == SafeAction::OpenSlowly
                    && motion.position != status.hold() =>
            {
                self.led(&motion, &status);
                self.inside(&motion, &status);
            }
            _ => self.held(output, &motion, &status),
        }
        self.before = Some((world.now, *output, status));
    }

    fn ages(&self, world: &World, output: &Output<4>, status: &Status<4>) {
        let stamp = output.stamp.as_ticks();
        assert!(
            stamp <= world.now && world.now - stamp <= 100_000,
            "{stamp} at {}",
            world.now
        );
        assert!(output.stamp <= status.stamp);
        if output.state.is_moving() {
            assert!(stamp <= self.newest.expect("no motion without a frame"));
        }
    }

    /// Frames as the rules count them.
    fn count_frames(&mut self, world: &World) {
        let new = world.inputs.hand.filter(|hand| {
            self.hand
                .is_none_or(|before| before.sequence != hand.sequence)
        });
        self.hand = world.inputs.hand;
        if let Some(hand) = new {
            let stamp = hand.stamp.as_ticks();
            let fresh = stamp <= world.now && world.now - stamp <= 100_000;
            match hand.output {
                Ok(x)
                    if x.iter()
                        .all(|x| x.is_finite() && (-255.0..=510.0).contains(x))
                        && fresh =>
                {
                    self.run += 1;
                    self.newest = Some(self.newest.map_or(stamp, |newest| newest.max(stamp)));
                }
                _ => self.run = 0,
            }
        }
    }

    fn led(&self, motion: &Motion<4>, status: &Status<4>) {
        for axis in 0..4 {
            let lead = motion.position[axis].abs_diff(status.position[axis]);
            assert!(lead <= 40, "axis {axis}: {motion:?} {status:?}");
        }
    }

    /// Inside, whatever order the axes arrive in; from outside no axis closes.
    fn inside(&self, motion: &Motion<4>, status: &Status<4>) {
        let contains = |x: [u8; 4]| gripper::space::contains(&x.map(f32::from));
        let corner = core::array::from_fn(|axis| motion.position[axis].max(status.position[axis]));
        assert!(
            contains(corner) || (!contains(status.position) && corner == status.position),
            "{:?} from {:?}",
            motion.position,
            status.position
        );
        assert!(contains(motion.position) || !contains(status.position));
    }

    fn rate(&self, world: &World, output: &Output<4>, motion: &Motion<4>, status: &Status<4>) {
        let Some((
            then,
            Output {
                motion: Some(before),
                state,
                ..
            },
            _,
        )) = &self.before
        else {
            return;
        };
        if !(state.is_moving() && output.before.is_moving()) {
            return;
        }
        let allowed = self.settings.rate * (world.now - then).min(20_000) as f32 * 1e-6 + 1.0;
        for axis in 0..4 {
            let (old, new, here) = (
                before.position[axis],
                motion.position[axis],
                status.position[axis],
            );
            let change = f32::from(new.abs_diff(old));
            let towards_gripper = new.abs_diff(here) < old.abs_diff(here);
            assert!(
                change <= allowed || towards_gripper,
                "axis {axis}: {old} to {new}, gripper at {here}, {allowed}"
            );
        }
    }

    /// A hold repeats: at its beginning what the status says; later the same, unless an axis touches or is pushed away.
    fn held(&mut self, output: &Output<4>, motion: &Motion<4>, status: &Status<4>) {
        self.holds += 1;
        let entry = output.before.is_moving();
        let repeated = match &self.before {
            Some((
                _,
                Output {
                    motion: Some(before),
                    state,
                    ..
                },
                _,
            )) if !entry && !state.is_moving() => Some(before.position),
            _ => None,
        };
        for axis in 0..4 {
            let new = motion.position[axis];
            let touches = matches!(
                status.contact[axis],
                Contact::ContactOpening | Contact::ContactClosing
            );
            let here = status.position[axis];
            if touches {
                assert_eq!(new, status.echo[axis]);
            } else if entry {
                assert_eq!(new, here);
            } else {
                let same = repeated.is_some_and(|old| old[axis] == new);
                assert!(
                    same || new == here || new.abs_diff(here) == self.settings.lead,
                    "axis {axis}: {repeated:?} {motion:?} {status:?}"
                );
                assert!(new.abs_diff(here) <= 40);
            }
        }
    }
}

fn walk(seed: u64, start: u64, settings: Settings<4>) {
    let mut world = World::new(seed, start);
    let mut checker = Checker::new(settings);
    let mut supervisor = Supervisor::new(Config::new(settings).expect("in range"));
    let mut first = true;
    for _ in 0..STEPS {
        world.turn();
        let output = supervisor.step(at(world.now), &world.inputs);
        if let (true, Some(motion)) = (first, output.motion) {
            first = false;
            assert_eq!(
                motion.position,
                world
                    .inputs
                    .status
                    .expect("no command without a status")
                    .hold(),
                "the first command repeats"
            );
        }
        checker.look(&world, &output);
        world.obey(output.motion);
    }
    assert!(
        checker.moves > 2_000 && checker.holds > 2_000,
        "{} {}",
        checker.moves,
        checker.holds
    );
    assert_eq!(checker.states.len(), 6, "{:?}", checker.states);
}

#[test]
fn the_rules_hold_at_every_step_of_random_walks() {
    for seed in 0..4 {
        walk(seed, seed * 77, Settings::default());
    }
}

#[test]
fn the_rules_hold_with_every_setting_at_its_edge() {
    let edge = Settings {
        fresh_frames: 1,
        blend_ms: 100,
        rate: 2_000.0,
        open_rate: 100.0,
        safe_action: SafeAction::OpenSlowly,
        ..Settings::default()
    };
    walk(11, 1 << 50, edge);
    let other = Settings {
        rate: 10.0,
        lead: 5,
        filter: bridge::filter::Settings {
            min_cutoff: 20.0,
            beta: 1.0,
            derivative_cutoff: 20.0,
        },
        safe_action: SafeAction::OpenSlowly,
        ..Settings::default()
    };
    walk(12, 0, other);
}

#[test]
fn the_same_walk_gives_the_same_commands() {
    let run = || {
        let mut world = World::new(5, 0);
        let mut supervisor = Supervisor::<4>::new(Config::default());
        let mut sum = 0u64;
        for _ in 0..20_000 {
            world.turn();
            let output = supervisor.step(at(world.now), &world.inputs);
            for byte in output.motion.map_or([0; 4], |motion| motion.position) {
                sum = sum.wrapping_mul(31).wrapping_add(u64::from(byte));
            }
            world.obey(output.motion);
        }
        sum
    };
    assert_eq!(run(), run());
}
