//! The whole loop on rig's virtual devices and clock: glove bytes in, gripper bytes out.

use super::{FIST, Flash, hand_image};
use bridge::app::expected;
use bridge::event::{Event, Kind};
use bridge::{App, Board, Config, Epoch, Instant, Platform, Settings, State, WeightsStore};
use glove::scan::Scanner;
use gripper::driver::ThreeFinger;
use rig::flash::Power;
use rig::glove::VirtualGlove;
use rig::gripper::VirtualGripper;
use rig::{Clock, MemoryWire};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

pub const MS: u64 = 1_000;
pub const S: u64 = 1_000_000;

/// Time moves to the next event; a step of the loop costs 50 µs.
pub struct Virtual {
    /// The wires' and the devices' time.
    clock: Clock,
    /// By how much the bridge's time is ahead of it, µs: its clock went on while the machine slept.
    ahead: Arc<AtomicU64>,
}

impl Platform for Virtual {
    fn now(&mut self) -> Instant {
        let ahead = self.ahead.load(Ordering::Relaxed);
        Instant::from_ticks(self.clock.now().as_ticks() + ahead)
    }

    fn wait_until(&mut self, due: Instant) {
        self.clock.advance(rig::Duration::from_micros(50));
        if due > self.now() {
            let ahead = self.ahead.load(Ordering::Relaxed);
            self.clock
                .wait_until(Instant::from_ticks(due.as_ticks() - ahead));
        }
    }
}

impl Board<4> for Virtual {
    type Glove = glove::sc18im::Sc18im<MemoryWire>;
    type Gripper = ThreeFinger<MemoryWire>;
    type Flash = Flash;
}

pub type Loop = App<Virtual, 4>;

/// The loop and what it is connected to.
pub struct Bench {
    pub clock: Clock,
    ahead: Arc<AtomicU64>,
    pub glove: VirtualGlove,
    pub glove_wire: MemoryWire,
    pub gripper: VirtualGripper,
    pub gripper_wire: MemoryWire,
    pub pose: Arc<Mutex<[f32; 25]>>,
    pub app: Loop,
    /// The person's hand on the clutch.
    pub clutch: bool,
    /// No heartbeat comes, and nobody touches the clutch: the test does.
    pub silent: bool,
    pub events: Vec<Event>,
    epoch: Option<Epoch>,
    beat: u64,
}

/// A hand that goes to `pose` as fast as a brisk one does: every joint at 10 rad/s.
fn moving(pose: Arc<Mutex<[f32; 25]>>) -> impl Fn(f64) -> [f32; 25] + Send {
    let shown = Mutex::new((0.0_f64, [0.0_f32; 25]));
    move |time_s: f64| {
        let target = *pose.lock().expect("not poisoned");
        let mut shown = shown.lock().expect("not poisoned");
        let most = 10.0 * (time_s - shown.0).max(0.0) as f32;
        for (now, target) in shown.1.iter_mut().zip(target) {
            *now = target.clamp(*now - most, *now + most);
        }
        shown.0 = shown.0.max(time_s);
        shown.1
    }
}

impl Bench {
    pub fn new(settings: Settings<4>) -> Self {
        Self::with(
            settings,
            Some(hand_image(1)),
            rig::gripper::Config::default(),
        )
    }

    pub fn with(
        settings: Settings<4>,
        image: Option<Vec<u8>>,
        config: rig::gripper::Config,
    ) -> Self {
        Self::on(settings, image, config, gripper::driver::Config::default())
    }

    /// With a gripper's driver of this kind.
    pub fn on(
        settings: Settings<4>,
        image: Option<Vec<u8>>,
        config: rig::gripper::Config,
        driver: gripper::driver::Config,
    ) -> Self {
        let pose = Arc::new(Mutex::new([0.0; 25]));
        let glove = VirtualGlove::new(
            Box::new(moving(pose.clone())),
            rig::glove::Config::at_baud(115_200),
        );
        let keeps_baud = |scanner| scanner;
        Self::wearing(glove, keeps_baud, pose, settings, image, config, driver)
    }

    /// With this glove, and a scanner so set up; nobody moves it by `pose` who does not know it.
    pub fn wearing(
        glove: VirtualGlove,
        scanner: impl FnOnce(Scanner<MemoryWire>) -> Scanner<MemoryWire>,
        pose: Arc<Mutex<[f32; 25]>>,
        settings: Settings<4>,
        image: Option<Vec<u8>>,
        config: rig::gripper::Config,
        driver: gripper::driver::Config,
    ) -> Self {
        let clock = Clock::new();
        let ahead = Arc::new(AtomicU64::new(0));
        let glove_wire = MemoryWire::new(&clock, glove.clone(), 115_200);
        let gripper = VirtualGripper::new(config);
        let gripper_wire = MemoryWire::new(&clock, gripper.clone(), 115_200);
        let power = Power::new();
        let slots = [Flash::new(64 * 1024, &power), Flash::new(64 * 1024, &power)];
        let mut store = WeightsStore::new(slots, expected(4));
        if let Some(image) = image {
            store.begin(image.len()).expect("room");
            store.chunk(0, &image).expect("bytes");
            store.commit().expect("a sound image");
        }
        let app = App::new(
            Virtual {
                clock: clock.clone(),
                ahead: Arc::clone(&ahead),
            },
            scanner(Scanner::new(
                glove_wire.clone(),
                glove::scan::Config::default(),
            )),
            ThreeFinger::new(gripper_wire.clone(), driver),
            store,
            Config::new(settings).expect("in range"),
        );
        Self {
            clock,
            ahead,
            glove,
            glove_wire,
            gripper,
            gripper_wire,
            pose,
            app,
            clutch: false,
            silent: false,
            events: Vec::new(),
            epoch: None,
            beat: 0,
        }
    }

    pub fn now(&self) -> u64 {
        self.clock.now().as_ticks()
    }

    /// The machine sleeps for so long: its clock goes on, wires and devices keep what they had. Returns the bridge's time after it.
    pub fn sleep(&mut self, us: u64) -> Instant {
        self.ahead.fetch_add(us, Ordering::Relaxed);
        self.app.platform_mut().now()
    }

    pub fn set_pose(&self, pose: [f32; 25]) {
        *self.pose.lock().expect("not poisoned") = pose;
    }

    /// One step of the loop and the wait after it.
    pub fn step(&mut self) {
        if !self.clutch {
            self.epoch = None;
        } else if self.silent {
            // The test holds the clutch itself.
        } else if self.now() >= self.beat || self.epoch.is_none() {
            match self.epoch {
                None => self.epoch = Some(self.app.engage()),
                // A clutch that opened by itself stays open: the test says when a person closes it again.
                Some(epoch) => drop(self.app.heartbeat(epoch)),
            }
            self.beat = self.now() + 100 * MS;
        }
        let due = self.app.step();
        while let Some(event) = self.app.next_event() {
            self.events.push(event);
        }
        self.app.platform_mut().wait_until(due);
    }

    pub fn run(&mut self, us: u64) {
        let end = self.now() + us;
        while self.now() < end {
            self.step();
        }
    }

    /// Runs until `found`; panics after 20 s.
    pub fn until(&mut self, what: &str, mut found: impl FnMut(&Self) -> bool) {
        let end = self.now() + 20 * S;
        while !found(self) {
            assert!(
                self.now() < end,
                "never {what}: {:?}\n{:#?}",
                self.app.telemetry(),
                self.events
            );
            self.step();
        }
    }

    pub fn state(&self) -> State {
        self.app.telemetry().state
    }

    /// Both devices answer, the glove is calibrated as sensors are that sit straight, the gripper is activated.
    pub fn ready(&mut self) {
        self.app
            .set_calibration(glove::hand::Calibration::identity());
        self.app.activate();
        self.until("ready", |bench| {
            let telemetry = bench.app.telemetry();
            let activated = telemetry
                .status
                .is_some_and(|status| status.activation == gripper::Activation::Ready);
            activated && telemetry.frame_sequence > 0
        });
        self.events
            .retain(|event| !matches!(event.kind, Kind::Calibration(_)));
    }

    pub fn follow(&mut self) {
        self.clutch = true;
        self.until("following", |bench| bench.state() == State::Following);
    }

    /// Follows a hand that stays open, then one that becomes a fist.
    pub fn expect_open_then_closed(&mut self) {
        self.run(3 * S);
        let open = self.gripper.positions();
        assert!(open[..3].iter().all(|finger| *finger <= 30.0), "{open:?}");
        self.set_pose(FIST);
        self.run(4 * S);
        let closed = self.gripper.positions();
        assert!(
            closed[..3].iter().all(|finger| *finger >= 225.0),
            "{closed:?}"
        );
    }

    pub fn release(&mut self) {
        self.clutch = false;
        self.app.release();
    }

    pub fn told(&self, kind: Kind) -> bool {
        self.events.iter().any(|event| event.kind == kind)
    }
}
