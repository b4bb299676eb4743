//! The thread's side of a session on a chip: orders become requests, answers and samples become what is said at the hub.

use std::sync::mpsc::SyncSender;
use std::time::{Duration, Instant};

use bridge::Epoch;
use bridge::HoldReason;
use bridge::calibration::{CalibrationState, Refusal, Try};
use bridge::clutch::{HeartbeatRefusal, Position};
use bridge::protocol;
use bridge::protocol::message::{Counters, Sample, Status};

use super::axes::Axes;
use super::chip_devices::Told;
use super::chip_kept::Kept;
use super::chip_stop::{Known, renew, stop};
use super::hub::Hub;
use super::orders::{Order, Queue};
use super::snapshot::Snapshot;
use super::stopped::Stopped;
use super::totals::Totals;
use crate::chip::link::{Error, Heartbeat, HostLink};

/// Pause between two looks at the orders, spent listening.
const LISTEN: Duration = Duration::from_millis(10);
/// Pause between two heartbeats: what else is asked is answered in it or not at all.
const HEARTBEAT: Duration = Duration::from_millis(100);
/// Pause between two questions for the status without heartbeats; a session ends after 2 s.
const STATUS_EVERY: Duration = Duration::from_millis(500);
/// The same while a calibration is tried.
const TRY_EVERY: Duration = Duration::from_millis(100);
/// Pause between two looks at the counters.
const COUNT_EVERY: Duration = Duration::from_secs(1);
/// Questions for the status without an answer, in a row, after which one is asked as often as it takes.
const MISSED_STATUSES: u32 = 3;
/// Heartbeats without an answer, in a row, after which nobody is there: 2 s.
const MISSED_BEATS: u32 = 20;
/// Frames between two looks at the counters that say something of the glove.
const LEAST_FRAMES: u32 = 5;

/// A calibration that is tried as often as it takes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Trying {
    pub(super) until: Instant,
    /// Sensors that sit straight; else the headings by the profile.
    pub(super) is_straight: bool,
    /// Tries that had ended when the newest began.
    pub(super) ended: u16,
}

/// What a conversation leaves.
#[derive(Debug)]
pub(super) struct Left {
    /// How the gripper was left; untouched where this session never closed the clutch.
    pub stopped: Stopped,
    /// What ended it.
    pub fault: Option<Error>,
}

/// The thread.
#[derive(Debug)]
pub(super) struct Worker {
    pub(super) link: HostLink,
    orders: Queue,
    pub(super) hub: Hub,
    samples: Option<SyncSender<Sample>>,
    kept: Option<Kept>,
    /// Of the closing that is kept.
    epoch: Option<Epoch>,
    /// The clutch was closed, or the gripper told to activate, by this session.
    touched: bool,
    /// The gripper was told to activate by this session, and has not followed the hand since.
    activation_asked: bool,
    clutch: Position,
    /// Heartbeats or, under an open clutch, questions for the status that no answer came to, in a row.
    missed: u32,
    status: Status,
    /// When its answer came; `None` where it is asked for at once.
    asked_status: Option<Instant>,
    sample: Option<Sample>,
    devices: Told,
    pub(super) calibration: CalibrationState,
    /// The bridge has said so.
    pub(super) calibration_known: bool,
    pub(super) trying: Option<Trying>,
    counted: (Instant, Counters),
    useless: bool,
}

impl Worker {
    pub fn new(
        link: HostLink,
        orders: Queue,
        hub: Hub,
        samples: Option<SyncSender<Sample>>,
        kept: Option<Kept>,
        (status, counters): (Status, Counters),
    ) -> Self {
        let now = Instant::now();
        hub.lock().totals = Totals::on_chip(&counters, now);
        Self {
            link,
            orders,
            hub,
            samples,
            kept,
            epoch: None,
            touched: false,
            activation_asked: false,
            clutch: Position::Open,
            missed: 0,
            devices: Told::new(&status),
            status,
            asked_status: Some(now),
            sample: None,
            calibration: CalibrationState::default(),
            calibration_known: false,
            trying: None,
            counted: (now, counters),
            useless: false,
        }
    }

    /// The bridge has said whether its glove is calibrated.
    pub fn knows(&mut self, is_calibrated: bool) {
        (self.calibration.is_calibrated, self.calibration_known) = (is_calibrated, true);
    }

    pub fn run(mut self) -> Left {
        let fault = loop {
            match self.round() {
                Ok(true) => {}
                Ok(false) => break None,
                Err(error) => match self.go_on_after(error) {
                    Ok(()) => {}
                    Err(error) => break Some(error),
                },
            }
        };
        let known = self.known();
        // Where another host has the bridge, the clutch of this session has opened by itself and the one that is closed is theirs.
        let theirs = matches!(
            fault,
            Some(Error::Refused(protocol::message::Refusal::Busy { .. }))
        );
        let stopped = match self.touched && !theirs {
            true => stop(&mut self.link, known),
            // Somebody else may drive it.
            false => Stopped::Untouched,
        };
        if let Ok(counters) = self.link.counters() {
            self.take_counters(counters);
        }
        // Nobody listens any more, whether the bridge hears it or not.
        let _ = self.link.telemetry(0);
        Left { stopped, fault }
    }

    fn known(&self) -> Known {
        let sampled = self.sample.as_ref().map_or(0, |sample| sample.now_us);
        Known {
            us: self.status.now_us.max(sampled),
            commands: self.counted.1.commands,
            activation_asked: self.activation_asked,
            activation: self.devices.gripper().map(|gripper| gripper.activation),
        }
    }

    /// Where this program stood still for so long that the bridge ended its session: a new one. The clutch has opened by itself.
    fn go_on_after(&mut self, error: Error) -> Result<(), Error> {
        if error != Error::Refused(protocol::message::Refusal::NoSession) {
            return Err(error);
        }
        renew(&mut self.link)?;
        let status = self.link.status()?;
        if status.now_us < self.known().us {
            // The bridge started anew meanwhile, and knows nothing of what was.
            return Err(error);
        }
        self.status = status;
        if self.epoch.take().is_some() {
            self.clutch = Position::Expired;
        }
        Ok(())
    }

    /// Returns whether to go on.
    fn round(&mut self) -> Result<bool, Error> {
        let begun = Instant::now();
        let mut quiet = self.epoch.is_none();
        if let Some(profile) = self.orders.profile() {
            self.set_profile(profile.as_ref())?;
        }
        while let Some(order) = self.orders.next() {
            if order == Order::Stop {
                return Ok(false);
            }
            self.obey(order)?;
            quiet |= order == Order::Heartbeat;
        }
        let every = self.trying.map_or(STATUS_EVERY, |_| TRY_EVERY);
        let mut answered = true;
        let due = self.asked_status.is_none_or(|at| at.elapsed() >= every);
        if self.epoch.is_none() && due {
            answered = self.ask_status(Instant::now() + HEARTBEAT)?;
        }
        if quiet {
            self.count(begun + HEARTBEAT)?;
            self.look_at_devices(begun + HEARTBEAT)?;
            self.devices
                .ask_headings(&mut self.link, begun + HEARTBEAT)?;
        }
        for sample in self.link.listen(LISTEN)? {
            let blocked = |axis| self.devices.is_blocked(axis);
            self.hub.lock().sample(&sample, self.clutch, blocked);
            self.devices.sample(&sample);
            if let Some(kept) = &self.kept {
                let valid = self.status.glove_answers && self.is_valid(&sample);
                kept.sample(&sample, valid, self.devices.headings());
            }
            if let Some(samples) = &self.samples {
                // Who keeps them and is slow, or gone, says so.
                let _ = samples.try_send(sample.clone());
            }
            self.sample = Some(sample);
        }
        // A clutch that is open now and a state from before do not go together.
        if answered {
            self.say();
        }
        Ok(true)
    }

    fn obey(&mut self, order: Order) -> Result<(), Error> {
        match order {
            Order::Engage => {
                self.epoch = None;
                let answer = self.link.engage();
                // Also where the answer is lost: the bridge may have closed it.
                self.touched |= !matches!(answer, Err(Error::Refused(_)));
                if let Err(Error::Silent { .. }) = answer {
                    self.orders.came_too_late();
                    return self.obey(Order::Release);
                }
                let (epoch, status) = answer?;
                (self.epoch, self.status) = (Some(epoch), status);
                (self.clutch, self.missed) = (Position::Closed, 0);
            }
            Order::Heartbeat => {
                if let Some(epoch) = self.epoch {
                    self.heartbeat(epoch)?;
                }
            }
            Order::Release => {
                (self.epoch, self.clutch) = (None, Position::Open);
                (self.status, self.missed) = (self.link.release()?, 0);
            }
            Order::Activate => {
                (self.touched, self.activation_asked) = (true, true);
                self.link.activate()?;
            }
            Order::FlatPose(_) | Order::CalibrateStraight(_) | Order::UndoCalibration
                if self.epoch.is_some() =>
            {
                self.calibrated(Try::Refused(Refusal::Engaged));
            }
            Order::FlatPose(wait) => self.begin_try(wait, false)?,
            Order::CalibrateStraight(wait) => self.begin_try(wait, true)?,
            Order::UndoCalibration => self.undo()?,
            Order::FindFlat(on) => self.link.find_flat(on)?,
            Order::Stop => {}
        }
        Ok(())
    }

    fn heartbeat(&mut self, epoch: Epoch) -> Result<(), Error> {
        match self.link.heartbeat(epoch)? {
            Heartbeat::Kept(status) => {
                self.missed = 0;
                self.status = status;
            }
            // Somebody else's release, or their closing, is an act: nothing went wrong.
            Heartbeat::Refused(why) => {
                (self.epoch, self.missed, self.asked_status) = (None, 0, None);
                self.clutch = match why {
                    HeartbeatRefusal::Expired => Position::Expired,
                    _ => Position::Open,
                };
            }
            Heartbeat::Unanswered => self.missed += 1,
        }
        if self.missed >= MISSED_BEATS {
            return Err(Error::Silent {
                address: self.link.address().clone(),
                attempts: self.missed,
                heard: self.link.heard(),
            });
        }
        Ok(())
    }

    /// Asks under an open clutch where the answer comes by `end`: what was lost is asked for again in the next round, since an
    /// order to close the clutch grows too old behind one that is waited for. Returns whether it came.
    fn ask_status(&mut self, end: Instant) -> Result<bool, Error> {
        let status = match self.missed {
            MISSED_STATUSES.. => Some(self.link.status()?),
            _ => self.link.status_by(end)?,
        };
        let Some(status) = status else {
            self.missed += 1;
            return Ok(false);
        };
        (self.status, self.missed, self.asked_status) = (status, 0, Some(Instant::now()));
        self.look_at_calibration(end)?;
        Ok(true)
    }

    /// Once a second, and when a run began, where the answer comes by `end`, when the next heartbeat is due.
    fn count(&mut self, end: Instant) -> Result<(), Error> {
        if self.counted.0.elapsed() < COUNT_EVERY && !self.hub.lock().totals.awaits() {
            return Ok(());
        }
        if let Some(counters) = self.link.counters_by(end)? {
            self.take_counters(counters);
        }
        Ok(())
    }

    /// Four times a second, where the answer comes by `end`.
    fn look_at_devices(&mut self, end: Instant) -> Result<(), Error> {
        if self.devices.ask(&mut self.link, end)?.is_none() {
            return Ok(());
        }
        let mut said = self.hub.lock();
        if let Some(line) = self.devices.line() {
            said.totals.line(&line);
        }
        // With every answer: a run that begins forgets what was told before.
        if let Some(axis) = self.devices.stands() {
            said.numbers.obeyed.stands(axis);
        }
        Ok(())
    }

    fn take_counters(&mut self, counters: Counters) {
        let now = Instant::now();
        let (at, before) = std::mem::replace(&mut self.counted, (now, counters));
        let grown = counters.since(&before);
        let all = grown.frames >= LEAST_FRAMES && grown.unusable_frames >= grown.frames;
        // What else makes frames useless is told as what it is.
        let told = match self.status.state.hold_reason() {
            Some(HoldReason::NotCalibrated | HoldReason::NoWeights) => true,
            _ => self.epoch.is_none() && !self.calibration.is_calibrated,
        };
        self.useless = all && !told && self.status.active_slot.is_some();
        let mut said = self.hub.lock();
        said.numbers.chip(&grown, now.duration_since(at));
        said.totals.count(&counters, now);
    }

    /// Whether a sample's angles are the hand's. A bridge from before samples said it is believed but for what its
    /// counters show.
    fn is_valid(&self, sample: &Sample) -> bool {
        let is_calibrated = self.calibration.is_calibrated || !self.calibration_known;
        sample.is_valid().unwrap_or(!self.useless && is_calibrated)
    }

    pub fn say(&mut self) {
        self.devices.status(&self.status);
        let status = &self.status;
        let newest = self.sample.as_ref();
        let sample = newest.filter(|sample| sample.now_us >= status.now_us);
        let state = sample.map_or(status.state, |sample| sample.state);
        if let Some(kept) = &mut self.kept {
            kept.status(state, status.now_us, self.devices.gripper());
        }
        // An activation that has ended is over, whatever the gripper does later: none other is moved.
        self.activation_asked &= !state.is_moving();
        let mut calibration = self.calibration;
        // The newest word: under a closed clutch nothing else is asked.
        calibration.is_calibrated &= state.hold_reason() != Some(HoldReason::NotCalibrated);
        let seen = Snapshot {
            now: self.devices.now(),
            state,
            clutch: self.clutch,
            calibration,
            calibration_known: self.calibration_known,
            profile: self.devices.profile(),
            headings: self.devices.headings(),
            ids: [None; glove::hand::SEGMENT_COUNT],
            glove_baud: None,
            frame_sequence: newest.map_or(0, |sample| sample.frame_sequence),
            on_chip: true,
            frame: None,
            sensors: self.devices.sensors(),
            angles: newest.map_or([0.0; glove::hand::JOINT_COUNT], |sample| sample.angles),
            angles_valid: status.glove_answers && newest.is_some_and(|seen| self.is_valid(seen)),
            distrusted: self.devices.distrusted(),
            impossible: self.devices.impossible(),
            command: newest.and_then(|sample| Axes::new(&sample.command)),
            sent: None,
            gripper_answers: status.gripper.is_some(),
            status: self.devices.gripper(),
            stands: self.devices.stands(),
            glove_answers: status.glove_answers,
            line: self.devices.line(),
            late_steps: self.counted.1.late_steps,
        };
        self.hub.lock().say(seen, self.useless);
    }
}
