//! The bridge in this process: [`bridge::App`] on a thread of its own, over the glove's and the gripper's port.
//!
//! The thread ends in an orderly way: the clutch is opened, the bridge sends the hold, and only then is the gripper's port
//! closed.

use std::thread::JoinHandle;

use anyhow::Result;
use bridge::{App, Board, SafeAction, WeightsStore};
use glove::calibration::Bound;
use glove::hand::Side;
use glove::imu::Mode;
use gripper::driver::{ThreeFinger, TwoFinger};

use super::Session;
use super::hub::Hub;
use super::orders::{Order, Orders};
use super::record::Feed;
use super::slots::MemorySlot;
use super::stopped::Stopped;
use super::worker::{PcApp, Worker};
use crate::clock::Clock;
use crate::failure::{Failure, OrFail};
use crate::interrupt::Interrupt;
use crate::lines::glove::{GloveBus, GloveLine, Reading};
use crate::lines::port::Watch;
use crate::lines::{Line, Model, Pc, Settings};
use crate::next::{Command, advice};
use crate::realtime::{self, Scheduling};

/// What a session is made of.
#[derive(Debug)]
pub struct Parts {
    /// The way to the glove.
    pub glove: GloveLine,
    /// How it is read.
    pub reading: Reading,
    /// The gripper's line.
    pub gripper: Line,
    /// Which gripper it is.
    pub model: Model,
    /// Unit, speed and patience of that line.
    pub line: Settings,
    /// The weights image.
    pub image: Vec<u8>,
    /// Which hand wears the glove.
    pub side: Side,
    /// The glove's profile, if it has one.
    pub profile: Option<Bound>,
    /// How the gripper is driven.
    pub driving: Driving,
    /// Whom every frame, command, status and event is handed to.
    pub feed: Option<Feed>,
}

/// How the gripper is driven, where that is not as usual.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Driving {
    /// Speed of every axis: 0 slowest to 255 fastest.
    pub speed: Option<u8>,
    /// Force of every axis: 0 weakest, which is not none, to 255 strongest.
    pub force: Option<u8>,
    /// Fastest change of a commanded position, 10 to 2,000 counts a second.
    pub rate: Option<f32>,
    /// What a hold becomes after half a second.
    pub safe_action: Option<SafeAction>,
}

impl Driving {
    fn settings<const X: usize>(&self, side: Side, mode: Mode) -> bridge::Settings<X> {
        let usual = bridge::Settings::<X>::default();
        bridge::Settings {
            side,
            heading_is_relative: mode == Mode::Imu,
            speed: self.speed.map_or(usual.speed, |speed| [speed; X]),
            force: self.force.map_or(usual.force, |force| [force; X]),
            rate: self.rate.unwrap_or(usual.rate),
            safe_action: self.safe_action.unwrap_or(usual.safe_action),
            ..usual
        }
    }
}

/// A bridge in this process.
#[derive(Debug)]
pub struct InProcess {
    thread: Option<JoinHandle<Stopped>>,
    orders: Orders,
    hub: Hub,
    ports: [(&'static str, Watch); 2],
    scheduling: Scheduling,
}

impl InProcess {
    /// Starts the bridge. Nothing moves: the clutch is open, and the gripper is only read.
    ///
    /// # Errors
    /// A failure where the image is not one for this gripper, or the system gives no thread.
    pub fn start(parts: Parts, clock: Clock, interrupt: &Interrupt) -> Result<Self> {
        match parts.model.two_finger() {
            None => Self::with::<4>(parts, clock, interrupt, ThreeFinger::new),
            Some(model) => {
                let driver = move |line, config| TwoFinger::new(line, model, config);
                Self::with::<1>(parts, clock, interrupt, driver)
            }
        }
    }

    fn with<const X: usize>(
        parts: Parts,
        clock: Clock,
        interrupt: &Interrupt,
        driver: impl FnOnce(Line, gripper::driver::Config) -> <Pc as Board<X>>::Gripper + Send + 'static,
    ) -> Result<Self>
    where
        Pc: Board<X, Glove = GloveBus, Flash = MemorySlot>,
    {
        let store = stored(&parts.image, parts.model)?;
        let settings = parts.driving.settings::<X>(parts.side, parts.reading.mode);
        let config = bridge::Config::new(settings)
            .or_fail(|| "the bridge's settings".to_owned(), "others")?;
        let (orders, queue) = Orders::queue(clock);
        let hub = Hub::default();
        let ports = [
            ("glove", parts.glove.watch()),
            ("gripper", parts.gripper.watch()),
        ];
        let watches = ports.clone().map(|(_, watch)| watch);
        let platform = Pc::new(clock, watches, interrupt.clone());
        let mut worker = Worker::new(queue, hub.clone(), parts.feed);
        let line = parts.gripper.driver_config(parts.line);
        let (glove, gripper, profile) = (parts.glove, parts.gripper, parts.profile);
        let reading = parts.reading;
        let bridge = std::thread::Builder::new().name("bridge".to_owned());
        let (tell_scheduling, scheduling) = std::sync::mpsc::sync_channel(1);
        let start = move || {
            bridge.spawn(move || {
                let scanner = glove.scanner(reading);
                let gripper = driver(gripper, line);
                let mut app: PcApp<X> = App::new(platform, scanner, gripper, store, config);
                if let Some(profile) = &profile {
                    // The clutch is open.
                    let _ = app.set_profile(Some(profile));
                }
                worker.scheduling = scheduling.recv().unwrap_or(Scheduling::Shared);
                worker.run(&mut app)
            })
        };
        let refused = || "the bridge cannot start".to_owned();
        let next = "ending other programs";
        let (thread, scheduling) = realtime::starting(start).or_fail(refused, next)?;
        let thread = thread.or_fail(refused, next)?;
        // Its place is free.
        let _ = tell_scheduling.send(scheduling);
        Ok(Self {
            thread: Some(thread),
            orders,
            hub,
            ports,
            scheduling,
        })
    }
}

impl Session for InProcess {
    fn orders(&self) -> &Orders {
        &self.orders
    }

    fn hub(&self) -> &Hub {
        &self.hub
    }

    fn ports(&self) -> &[(&'static str, Watch)] {
        &self.ports
    }

    fn running(&self) -> bool {
        let thread = self.thread.as_ref();
        thread.is_some_and(|thread| !thread.is_finished())
    }

    fn scheduling(&self) -> Option<Scheduling> {
        Some(self.scheduling)
    }

    fn ended(&mut self) -> anyhow::Error {
        match self.stop() {
            Ok(_) => anyhow::anyhow!("the bridge ended"),
            Err(error) => error,
        }
    }

    fn stop(&mut self) -> Result<Stopped> {
        self.orders.give(Order::Stop);
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(stopped)) => Ok(stopped),
            Some(Err(_)) | None => Err(Failure::new(
                "the bridge stopped on a fault of its own: the gripper was not held",
                "look at the gripper; then the same again with --log, and report what it says",
            )
            .into()),
        }
    }
}

impl Drop for InProcess {
    fn drop(&mut self) {
        if self.thread.is_some() {
            let _ = self.stop();
        }
    }
}

/// Whether a weights image gives as many positions as the gripper has axes.
///
/// # Errors
/// A failure that says how many it gives, and what to do.
pub fn check_image(image: &[u8], model: Model) -> Result<()> {
    // The header's number of outputs (docs/weights-image.md); whatever else is wrong with it, the store says.
    let outputs = image.get(32..36).and_then(|bytes| bytes.try_into().ok());
    match outputs.map(|bytes| u32::from_le_bytes(bytes) as usize) {
        Some(outputs) if image.starts_with(&hae::image::MAGIC) && outputs != model.axes() => {
            Err(other_shape(outputs, model).into())
        }
        _ => Ok(()),
    }
}

fn other_shape(outputs: usize, model: Model) -> Failure {
    let other = match outputs {
        1 => {
            "the same with --gripper-model 2f85, 2f140 or hande, if it is one of these; else a map for it: "
        }
        4 => "the same with --gripper-model 3f, if it is the 3-Finger; else a map for it: ",
        _ => "a map for this gripper: ",
    };
    let next = advice(other).then(Command::gauntlet("help train"));
    Failure::new(
        format!(
            "the map gives {outputs} position{}, and the {} has {} ax{}s",
            if outputs == 1 { "" } else { "s" },
            model.name(),
            model.axes(),
            if model.axes() == 1 { "i" } else { "e" },
        ),
        next,
    )
}

/// A store that holds the image, put there the way it comes over a line: begun, in chunks, committed last.
fn stored(image: &[u8], model: Model) -> Result<WeightsStore<MemorySlot>> {
    check_image(image, model)?;
    let expected = bridge::app::expected(model.axes());
    let mut store = WeightsStore::new([MemorySlot::new(), MemorySlot::new()], expected);
    let refused = || "the weights image was refused".to_owned();
    let next = "training the model again";
    store.begin(image.len()).or_fail(refused, next)?;
    for (index, chunk) in image.chunks(bridge::store::PAGE).enumerate() {
        store
            .chunk(index * bridge::store::PAGE, chunk)
            .or_fail(refused, next)?;
    }
    store.commit().or_fail(refused, next)?;
    Ok(store)
}

#[cfg(test)]
mod driving_tests {
    use super::*;

    #[test]
    fn what_is_not_said_of_driving_is_as_usual_and_what_is_said_counts_for_every_axis() {
        let usual = Driving::default().settings::<4>(Side::Left, Mode::Imu);
        let expected = bridge::Settings {
            side: Side::Left,
            ..bridge::Settings::<4>::default()
        };
        assert_eq!(usual, expected);
        let driving = Driving {
            speed: Some(90),
            force: Some(0),
            rate: Some(100.0),
            safe_action: Some(SafeAction::OpenSlowly),
        };
        let settings = driving.settings::<4>(Side::Right, Mode::Ndof);
        assert_eq!((settings.speed, settings.force), ([90; 4], [0; 4]));
        assert_eq!(settings.safe_action, SafeAction::OpenSlowly);
        assert!(!settings.heading_is_relative, "a compass has one heading");
        assert!(bridge::Config::new(settings).is_ok());
    }
}
