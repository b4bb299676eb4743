//! From a shown hand to a standing gripper, through every byte: the tool's training, the weights store, the virtual
//! sensors behind the serial bridge, the map, the supervisor, Modbus, the virtual gripper's own fingers.

use bridge::{App, Config, Instant, Platform, State};
use glove::hand::LIMITS;
use glove::scan::Scanner;
use gripper::driver::ThreeFinger;
use loop_tests::bench::{self, Devices, Machine};
use loop_tests::images;
use rig::Clock;
use rig::glove::VirtualGlove;
use rig::gripper::VirtualGripper;
use trainer::hand::Space;
use trainer::hand::motion::Generator;

const SEED: u64 = 1;
/// The heartbeat of the clutch, microseconds.
const HEARTBEAT: u64 = 100_000;
/// Long enough for the slowest way through: blend, filter, and a full stroke.
const SETTLE: u64 = 5_000_000;

/// A hand closes in this time, seconds.
const MOVE_S: f64 = 0.4;

type Bridge = App<Machine, 4>;

struct Bench {
    app: Bridge,
    clock: Clock,
    glove: VirtualGlove,
    gripper: VirtualGripper,
    pose: [f32; 25],
}

impl Bench {
    fn new(image: &[u8], pose: [f32; 25]) -> Self {
        let Devices {
            clock,
            glove,
            glove_wire,
            gripper,
            gripper_wire,
        } = Devices::new(move |_| pose);
        let mut app = App::new(
            Machine(clock.clone()),
            Scanner::new(glove_wire, glove::scan::Config::default()),
            ThreeFinger::new(gripper_wire, gripper::driver::Config::default()),
            bench::store(image),
            Config::default(),
        );
        // The sensors sit straight.
        app.set_calibration(glove::hand::Calibration::identity());
        Self {
            app,
            clock,
            glove,
            gripper,
            pose,
        }
    }

    /// Runs for `time` microseconds with the clutch open or closed.
    fn run(&mut self, time: u64, clutch: bool) {
        let end = self.clock.now().as_ticks() + time;
        let mut beat = 0;
        let mut epoch = None;
        while self.clock.now().as_ticks() < end {
            let now = self.clock.now().as_ticks();
            if clutch && now >= beat {
                match epoch {
                    None => epoch = Some(self.app.engage()),
                    Some(epoch) => assert_eq!(self.app.heartbeat(epoch), Ok(())),
                }
                beat = now + HEARTBEAT;
            }
            let due = self.app.step();
            self.app
                .platform_mut()
                .wait_until(due.min(Instant::from_ticks(end)));
        }
    }

    /// Goes to `pose` as fast as a brisk hand, then stays.
    fn show(&mut self, pose: [f32; 25]) {
        let (from, start) = (self.pose, self.clock.now().as_ticks() as f64 * 1e-6);
        self.glove.set_pose(Box::new(move |time_s: f64| {
            let share = ((time_s - start) / MOVE_S).clamp(0.0, 1.0) as f32;
            core::array::from_fn(|joint| from[joint] + share * (pose[joint] - from[joint]))
        }));
        self.pose = pose;
        self.run(SETTLE, true);
    }
}

#[test]
fn open_hand_ends_as_an_open_gripper_and_fist_as_a_closed_one() {
    let image = images::trained(Space::ThreeFinger, SEED);
    let hand = Generator::new(&LIMITS, SEED);

    let mut bench = Bench::new(&image, hand.flat_hand());
    bench.run(3_000_000, false);
    bench.app.activate();
    bench.run(15_000_000, false);
    let standing = bench.gripper.positions();
    assert_eq!(bench.app.telemetry().state, State::Idle);

    bench.show(hand.flat_hand());
    assert_eq!(bench.app.telemetry().state, State::Following);
    let open = bench.gripper.positions();
    println!("standing {standing:.0?}, flat hand {open:.0?}");
    assert!(
        open[..3].iter().all(|&finger| finger <= 30.0),
        "flat hand: {open:?}"
    );

    bench.show(hand.fist());
    let closed = bench.gripper.positions();
    println!("fist {closed:.0?}");
    assert!(
        closed[..3].iter().all(|&finger| finger >= 225.0),
        "fist: {closed:?}"
    );

    bench.show(hand.flat_hand());
    let open = bench.gripper.positions();
    assert!(
        open[..3].iter().all(|&finger| finger <= 30.0),
        "flat hand again: {open:?}"
    );

    let counters = bench.app.telemetry().counters;
    assert_eq!(counters.late_steps, 0);
    assert_eq!(counters.unusable_frames, 0);
    assert!(
        counters.following_frames - counters.answered_frames <= 1,
        "{counters:?}"
    );
    assert!(
        counters.answered_frames >= 20 * 3 * SETTLE as u32 / 1_000_000,
        "{counters:?}"
    );
}
