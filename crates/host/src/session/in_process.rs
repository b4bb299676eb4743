//! The bridge in this process: [`bridge::App`] on a thread of its own, over the glove's and the gripper's port.
//!
//! The thread ends in an orderly way: the clutch is opened, the bridge sends the hold, and only then is the gripper's port
//! closed.

use std::thread::JoinHandle;

use anyhow::Result;
use bridge::{App, Board, SafeAction};
use glove::calibration::Bound;
use glove::hand::Side;
use glove::imu::Mode;
use gripper::driver::{ThreeFinger, TwoFinger};

use super::hub::Hub;
use super::orders::{Order, Orders};
use super::record::Feed;
use super::slots::MemorySlot;
use super::stopped::Stopped;
use super::stored::stored;
use super::worker::{PcApp, Traced, Worker, traced};
use super::{Session, goes_on};
use crate::clock::Clock;
use crate::failure::{Failure, OrFail};
use crate::interrupt::Interrupt;
use crate::lines::glove::{GloveBus, GloveLine, Reading};
use crate::lines::port::Watch;
use crate::lines::{Line, Model, Pc, Settings};
use crate::realtime::{self, Scheduling};
use crate::trace::Home;

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
    /// The bridge's settings for a glove on this hand whose sensors run this fusion.
    pub fn settings<const X: usize>(&self, side: Side, mode: Mode) -> bridge::Settings<X> {
        self.over(bridge::Settings {
            side,
            heading_is_relative: mode == Mode::Imu,
            ..bridge::Settings::<X>::default()
        })
    }

    /// Those settings with what is said here.
    pub fn over<const X: usize>(&self, usual: bridge::Settings<X>) -> bridge::Settings<X> {
        bridge::Settings {
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
        driver: impl FnOnce(Traced, gripper::driver::Config) -> <Pc as Board<X>>::Gripper
        + Send
        + 'static,
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
        let trace = parts.feed.as_ref().map(Feed::trace).unwrap_or_default();
        let platform = Pc::new(clock, watches, interrupt.clone()).traced(trace.clone());
        let mut worker = Worker::new(queue, hub.clone(), parts.feed);
        let line = parts.gripper.driver_config(parts.line);
        let network = matches!(parts.gripper, Line::Tcp(_));
        let scan = parts.reading.config(&parts.glove);
        let home = Home::new(
            parts.model.option(),
            network,
            &line,
            &scan,
            parts.glove.way(),
        );
        trace.begin(
            &home,
            config.settings(),
            &parts.image,
            parts.profile.as_ref(),
        );
        let (glove, gripper, profile) = (parts.glove, parts.gripper, parts.profile);
        let bridge = std::thread::Builder::new().name("bridge".to_owned());
        let (tell_scheduling, scheduling) = std::sync::mpsc::sync_channel(1);
        let start = move || {
            bridge.spawn(move || {
                let scanner = glove.scanner(scan, trace.clone());
                let gripper = driver(traced(gripper, trace), line);
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
        goes_on(self.thread.as_ref())
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
