//! The same loop with a gripper of one axis: the map's number of outputs follows the gripper's axes.

use bridge::{App, Board, Config, Epoch, Instant, Platform, State};
use glove::hand::LIMITS;
use glove::scan::Scanner;
use gripper::Gripper;
use gripper::driver::TwoFinger;
use gripper::registers::two_finger::Model;
use hae::image::{JointOrder, Meta, Parameters, encode, encoded_len};
use loop_tests::bench::{Devices, empty_store};
use loop_tests::images;
use loop_tests::nor_slot::NorSlot;
use rig::glove::VirtualGlove;
use rig::gripper::{Family, VirtualGripper};
use rig::{Clock, MemoryWire};
use trainer::hand::Space;
use trainer::hand::motion::Generator;

const SEED: u64 = 1;

/// The index finger's proximal flexion.
const JOINT: usize = 5;
/// Counts of the virtual grippers fully open and fully closed.
const OPEN: f32 = 13.0;
const CLOSED: f32 = 230.0;
/// The heartbeat of the clutch, microseconds.
const HEARTBEAT: u64 = 100_000;

struct Machine(Clock);

impl Platform for Machine {
    fn now(&mut self) -> Instant {
        self.0.now()
    }

    fn wait_until(&mut self, due: Instant) {
        let soonest = Instant::from_ticks(self.0.now().as_ticks() + 1);
        self.0.wait_until(due.max(soonest));
    }
}

impl Board<1> for Machine {
    type Glove = glove::sc18im::Sc18im<MemoryWire>;
    type Gripper = TwoFinger<MemoryWire>;
    type Flash = NorSlot;
}

/// A map with `outputs` outputs, each of which closes with the index finger.
fn image(outputs: usize) -> Vec<u8> {
    const HIDDEN: usize = bridge::HIDDEN;
    let (mut w1, b1) = (vec![0.0; HIDDEN * 25], vec![0.0; HIDDEN]);
    w1[JOINT] = 1.0;
    let (mut w2, b2) = (vec![0.0; outputs * HIDDEN], vec![0.0; outputs]);
    w2.iter_mut()
        .step_by(HIDDEN)
        .for_each(|weight| *weight = 255.0);
    let parameters = Parameters {
        inputs: 25,
        hidden: HIDDEN,
        outputs,
        w1: &w1,
        b1: &b1,
        w2: &w2,
        b2: &b2,
    };
    let meta = Meta {
        model_id: 1,
        version: 1,
        joint_order: JointOrder::Hand25,
    };
    let mut bytes = vec![0; encoded_len(25, HIDDEN, outputs)];
    encode(&parameters, &meta, &mut bytes).expect("a sound image");
    bytes
}

fn hand(closed: f32) -> [f32; 25] {
    core::array::from_fn(|joint| if joint == JOINT { closed } else { 0.0 })
}

/// A hand, a gripper of one axis and the loop between them, its clutch closed and kept closed.
struct Session {
    clock: Clock,
    glove: VirtualGlove,
    gripper: VirtualGripper,
    app: App<Machine, 1>,
    epoch: Epoch,
    beat: u64,
}

impl Session {
    /// Nothing has moved yet; the sensors sit straight, and the map is that of `image`.
    fn start(
        image: &[u8],
        model: Model,
        family: Family,
        pose: impl Fn(f64) -> [f32; 25] + Send + 'static,
    ) -> Self {
        let Devices {
            clock,
            glove,
            glove_wire,
            gripper,
            gripper_wire,
        } = Devices::with(pose, family);
        gripper.preset_active();
        let mut store = empty_store(1);
        store.begin(image.len()).expect("room");
        store.chunk(0, image).expect("bytes");
        store.commit().expect("an image of one output");
        let mut app: App<_, 1> = App::new(
            Machine(clock.clone()),
            Scanner::new(glove_wire, glove::scan::Config::default()),
            TwoFinger::new(gripper_wire, model, gripper::driver::Config::default()),
            store,
            Config::default(),
        );
        app.set_calibration(glove::hand::Calibration::identity());
        Self {
            clock,
            glove,
            gripper,
            epoch: app.engage(),
            app,
            beat: HEARTBEAT,
        }
    }

    fn run_until(&mut self, second: u64) {
        let end = Instant::from_ticks(second * 1_000_000);
        while self.clock.now() < end {
            if self.clock.now().as_ticks() >= self.beat {
                assert_eq!(self.app.heartbeat(self.epoch), Ok(()));
                self.beat += HEARTBEAT;
            }
            let due = self.app.step();
            self.app.platform_mut().wait_until(due.min(end));
        }
    }

    /// Where the gripper is, counts, once it follows.
    fn followed(&self) -> f32 {
        assert_eq!(self.app.telemetry().state, State::Following);
        assert_eq!(self.app.telemetry().stands, None);
        self.gripper.positions()[0]
    }
}

#[test]
fn a_glove_closes_every_two_finger_gripper_by_a_map_of_one_output() {
    for (model, family) in [
        (Model::TwoFinger85, Family::TwoFinger85),
        (Model::TwoFinger140, Family::TwoFinger140),
        (Model::HandE, Family::HandE),
    ] {
        let mut session = Session::start(&image(1), model, family, |_| hand(0.1));
        session.run_until(5);
        let open = session.followed();
        assert!((open - 25.5).abs() < 3.0, "{family:?} {open}");
        session.glove.set_pose(Box::new(|time_s: f64| {
            hand((0.1 + (time_s - 5.0).clamp(0.0, 1.0) * 0.6) as f32)
        }));
        session.run_until(10);
        let closed = session.followed();
        let counters = session.app.gripper_mut().counters();
        println!("{family:?}: {open:.0} to {closed:.0} counts; {counters:?}");
        assert!((closed - 178.5).abs() < 3.0, "{family:?} {closed}");
        // The two reads that told its family.
        assert_eq!(counters.timeouts, 2);
    }
}

/// The gripper's cycles a second of a whole session by the map of `image`, and where the hand's two ends put it: open from the
/// start, a fist after `half` seconds.
fn open_and_fist(image: &[u8], model: Model, family: Family, half: u64) -> (Vec<u32>, [f32; 2]) {
    let generator = Generator::new(&LIMITS, SEED);
    let (open, fist) = (generator.flat_hand(), generator.fist());
    let pose = move |time_s: f64| -> [f32; 25] {
        let share = (time_s - half as f64).clamp(0.0, 1.0) as f32;
        core::array::from_fn(|joint| open[joint] + share * (fist[joint] - open[joint]))
    };
    let mut session = Session::start(image, model, family, pose);
    let (mut ends, mut cycles) = ([f32::NAN; 2], Vec::new());
    for second in 1..=2 * half {
        let before = session.app.telemetry().status_sequence;
        session.run_until(second);
        cycles.push(session.app.telemetry().status_sequence - before);
        if second % half == 0 {
            ends[(second / half) as usize - 1] = session.followed();
        }
    }
    (cycles, ends)
}

#[test]
fn an_open_hand_opens_a_two_finger_gripper_a_fist_closes_it_and_100_cycles_a_second_are_held() {
    let image = images::trained(Space::OneAxis, SEED);
    for (model, family, half) in [
        (Model::TwoFinger85, Family::TwoFinger85, 55),
        (Model::TwoFinger140, Family::TwoFinger140, 6),
        (Model::HandE, Family::HandE, 6),
    ] {
        let (cycles, [open, closed]) = open_and_fist(&image, model, family, half);
        println!("{family:?}: {open:.1} open, {closed:.1} closed, cycles {cycles:?}");
        assert!((open - OPEN).abs() <= 5.0, "{family:?}: {open}");
        assert!((closed - CLOSED).abs() <= 5.0, "{family:?}: {closed}");
        // The first two seconds bring the sensors up and find out the family.
        let held = &cycles[2..];
        assert!(held.iter().all(|count| *count >= 100), "{cycles:?}");
        let all: u32 = held.iter().sum();
        assert!(half < 55 || all >= 10_000, "{all} cycles");
    }
}

#[test]
fn an_image_of_another_number_of_outputs_is_refused() {
    for (axes, outputs) in [(1, 4), (4, 1)] {
        let mut store = empty_store(axes);
        let image = image(outputs);
        let begun = store.begin(image.len());
        let taken = begun.is_ok() && store.chunk(0, &image).is_ok() && store.commit().is_ok();
        assert!(!taken, "{outputs} outputs for {axes} axes");
    }
}
