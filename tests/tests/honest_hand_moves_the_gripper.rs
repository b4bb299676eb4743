//! From the hand of a virtual person in an honest glove to a standing gripper, through every byte: the calibration's profile, one flat
//! pose, and then an open hand opens the gripper and a fist closes it, however the hand is held.

use std::sync::{Arc, Mutex};

use bridge::calibration::Try;
use bridge::{App, Config, Instant, Platform, State};
use gauntlet::wearer::Wearer;
use glove::hand::LIMITS;
use glove::scan::Scanner;
use gripper::Activation;
use gripper::driver::ThreeFinger;
use host::interrupt::Interrupt;
use loop_tests::bench::{self, Devices, Machine};
use loop_tests::images;
use rig::gripper::{Family, VirtualGripper};
use rig::person::{Attitude, Person, Task};
use rig::{Clock, PoseSource};
use trainer::hand::Space;
use trainer::hand::motion::Generator;

const SEED: u64 = 1;
/// The heartbeat of the clutch, microseconds.
const HEARTBEAT: u64 = 100_000;
/// Long enough for the latest person and the slowest way through: lateness, move, filter, and a full stroke.
const SETTLE: u64 = 4_500_000;
const S: u64 = 1_000_000;

/// How the hand is held: roll about the forearm and pitch, degrees from palm down.
const ATTITUDES: [(&str, f64, f64); 5] = [
    ("palm down", 0.0, 0.0),
    ("thumb up", 90.0, 0.0),
    ("palm up", 180.0, 0.0),
    ("fingers up", 0.0, 80.0),
    ("fingers down", 0.0, -80.0),
];

/// The person, whom the test asks.
#[derive(Clone)]
struct Asked(Arc<Mutex<Person>>);

impl PoseSource for Asked {
    fn pose_at(&mut self, time_s: f64) -> [f32; 25] {
        self.0.lock().expect("not poisoned").pose_at(time_s)
    }

    fn attitude_at(&mut self, time_s: f64) -> Option<[f64; 4]> {
        self.0.lock().expect("not poisoned").attitude_at(time_s)
    }
}

struct Bench {
    app: App<Machine, 4>,
    clock: Clock,
    gripper: VirtualGripper,
    person: Asked,
    epoch: Option<bridge::Epoch>,
    beat: u64,
}

impl Bench {
    /// Calibrated on another day, powered on, activated, its hand flat for a moment, and the clutch closed.
    fn new(image: &[u8], seed: u64) -> Self {
        let wearer = Wearer::new(seed);
        let never = Interrupt::never().expect("an interrupt");
        let calibrated = wearer.calibrated(&never).expect("calibrated");
        let mut person = Person::new(wearer.traits());
        person.ask(Task::Flat, 0.0);
        let person = Asked(Arc::new(Mutex::new(person)));
        let devices = Devices::wearing(wearer.glove(Box::new(person.clone())), Family::ThreeFinger);
        let scanner = Scanner::new(devices.glove_wire, glove::scan::Config::default());
        let app = App::new(
            Machine(devices.clock.clone()),
            scanner.with_set_baud(),
            ThreeFinger::new(devices.gripper_wire, gripper::driver::Config::default()),
            bench::store(image),
            Config::default(),
        );
        let mut bench = Self {
            app,
            clock: devices.clock,
            gripper: devices.gripper,
            person,
            epoch: None,
            beat: 0,
        };
        bench
            .app
            .set_profile(Some(calibrated.bound()))
            .expect("the clutch is open");
        bench.app.activate();
        bench.until("frames", |app| app.telemetry().frame_sequence > 30);
        let before = bench.app.telemetry().calibration.ended;
        bench.app.calibrate_flat_hand();
        bench.until("a flat pose", |app| {
            app.telemetry().calibration.ended != before
        });
        assert_eq!(
            bench.app.telemetry().calibration.newest,
            Try::Taken,
            "seed {seed}"
        );
        bench.until("an active gripper", |app| {
            let status = app.telemetry().status;
            status.is_some_and(|status| status.activation == Activation::Ready)
        });
        bench.epoch = Some(bench.app.engage());
        bench
    }

    fn now(&self) -> u64 {
        self.clock.now().as_ticks()
    }

    fn step(&mut self, end: u64) {
        if let Some(epoch) = self.epoch.filter(|_| self.now() >= self.beat) {
            assert_eq!(self.app.heartbeat(epoch), Ok(()));
            self.beat = self.now() + HEARTBEAT;
        }
        let due = self.app.step().min(Instant::from_ticks(end));
        self.app.platform_mut().wait_until(due);
    }

    fn until(&mut self, what: &str, found: impl Fn(&App<Machine, 4>) -> bool) {
        let end = self.now() + 30 * S;
        while !found(&self.app) {
            assert!(self.now() < end, "never {what}: {:?}", self.app.telemetry());
            self.step(end);
        }
    }

    /// Asks the person for `pose`, and gives where the gripper then stands.
    fn show(&mut self, pose: [f32; 25], attitude: Attitude) -> [f32; 4] {
        let now = self.now();
        let task = Task::Held(pose.map(f64::from), attitude);
        let mut person = self.person.0.lock().expect("not poisoned");
        person.ask(task, now as f64 * 1e-6);
        drop(person);
        while self.now() < now + SETTLE {
            self.step(now + SETTLE);
        }
        self.gripper.positions()
    }
}

fn open_and_closed(seeds: impl Iterator<Item = u64>) {
    let image = images::trained(Space::ThreeFinger, SEED);
    let hand = Generator::new(&LIMITS, SEED);
    let mut wrong = Vec::new();
    for seed in seeds {
        let mut bench = Bench::new(&image, seed);
        for (name, roll, pitch) in ATTITUDES {
            let attitude = Attitude::Steady { roll, pitch };
            let open = bench.show(hand.flat_hand(), attitude);
            let closed = bench.show(hand.fist(), attitude);
            println!("seed {seed}, {name}: open hand {open:.0?}, fist {closed:.0?}");
            assert_eq!(
                bench.app.telemetry().state,
                State::Following,
                "seed {seed}, {name}"
            );
            if open[..3].iter().any(|finger| *finger > 30.0) {
                wrong.push(format!("seed {seed}, {name}: open hand {open:.0?}"));
            }
            if closed[..3].iter().any(|finger| *finger < 225.0) {
                wrong.push(format!("seed {seed}, {name}: fist {closed:.0?}"));
            }
        }
        assert_eq!(bench.app.telemetry().counters.late_steps, 0);
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn an_open_hand_opens_the_gripper_and_a_fist_closes_it_in_five_attitudes() {
    open_and_closed(1..=2);
}

#[test]
#[ignore = "ten persons: cargo xtask campaign glove"]
fn an_open_hand_opens_the_gripper_and_a_fist_closes_it_for_ten_persons() {
    open_and_closed(1..=10);
}
