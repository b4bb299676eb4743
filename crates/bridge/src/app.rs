//! The loop: scanner, posture, map, supervisor, gripper, store, tied together.
//!
//! [`App::step`] does what is due and returns when the next thing is; it never waits. Every device is polled at most twice
//! a step and does a bounded amount of work, so a step's time does not depend on what a device does: dead, babbling or fast.
//!
//! **When the supervisor steps.** On a grid of 10 ms, and besides in the very step that takes a new frame, so that a fresh
//! frame is answered at once instead of up to 10 ms later. The supervisor takes time as an argument and its rate limit
//! counts elapsed time, so the additional steps change no limit. The grid does not move with them.
//!
//! **What `latency` measures.** From the stamp of the oldest sample used (when its request was sent) to the moment the
//! driver handed the request that carries the command to its port: seen by the link's count of requests going up in a poll
//! while the command is set. The 29 bytes of the request then take 2.5 ms at 115200 baud.

use crate::config::Config;
use crate::event::{self, Event, Kind, Request};
use crate::platform::{Platform, Slot};
use crate::posture::{self, Posture};
use crate::store::{Expected, WeightsStore};
use crate::supervisor::{Hand, Inputs, Output, State, Supervisor, Weights};
use crate::telemetry::{Sent, Telemetry, bump};
use crate::{Duration, HIDDEN, HoldReason, Instant, timing};
use embedded_io::{Read, ReadReady, Write};
use glove::hand::{Calibration, JOINT_COUNT, SEGMENT_COUNT};
use glove::scan::{Frame, Scanner};
use gripper::registers::Fault;
use gripper::{Gripper, Status};
use hae::image::JointOrder;

/// What an image must be for a bridge whose gripper has `axes` axes.
pub const fn expected(axes: usize) -> Expected {
    Expected {
        shape: [JOINT_COUNT, HIDDEN, axes],
        joint_order: JointOrder::Hand25,
    }
}

/// The bridge: `P` the machine, `G` the glove's port, `R` the gripper, `F` a flash slot, `X` the gripper's number of axes.
#[derive(Debug)]
pub struct App<P, G, R, F, const X: usize>
where
    P: Platform,
    G: Read + ReadReady + Write,
    R: Gripper<X>,
    F: Slot,
{
    platform: P,
    scanner: Scanner<G>,
    gripper: R,
    store: WeightsStore<F>,
    supervisor: Supervisor<X>,
    posture: Posture,
    hand: Option<Hand<X>>,
    heartbeat: Option<Instant>,
    /// Next step of the supervisor on its grid.
    due: Option<Instant>,
    /// What the driver was told last; `at` is when it was decided until it leaves.
    order: Option<Sent<X>>,
    stashed: Option<Result<Status<X>, R::Error>>,
    gripper_error: Option<R::Error>,
    sensors: Sensors,
    calibration_until: Option<Instant>,
    weights: Option<(usize, u32)>,
    frame_at: Option<Instant>,
    telemetry: Telemetry<X>,
    events: heapless::Deque<Event, { event::CAPACITY }>,
}

/// What is known of each sensor.
#[derive(Debug, Clone, Copy, Default)]
struct Sensors {
    /// Newest frame with a good sample of it.
    good: [Option<Instant>; SEGMENT_COUNT],
    /// Told to be lost (bit k: segment k).
    lost: u16,
    /// How often each had been started when the calibration was made; `None` without one.
    starts: Option<[u16; SEGMENT_COUNT]>,
}

impl<P, G, R, F, const X: usize> App<P, G, R, F, X>
where
    P: Platform,
    G: Read + ReadReady + Write,
    R: Gripper<X>,
    F: Slot,
{
    /// Ties the parts together. Sends nothing; the newest whole image of the store is the map.
    pub fn new(
        mut platform: P,
        scanner: Scanner<G>,
        gripper: R,
        store: WeightsStore<F>,
        config: Config<X>,
    ) -> Self {
        let now = platform.now();
        let mut app = Self {
            platform,
            telemetry: Telemetry::new(now, scanner.state()),
            scanner,
            gripper,
            store,
            supervisor: Supervisor::new(config),
            posture: Posture::new(config.settings().side, Calibration::identity()),
            hand: None,
            heartbeat: None,
            due: None,
            order: None,
            stashed: None,
            gripper_error: None,
            sensors: Sensors::default(),
            calibration_until: None,
            weights: None,
            frame_at: None,
            events: heapless::Deque::new(),
        };
        if app.store.active().is_none() {
            app.tell(now, Kind::NoWeights);
        }
        app
    }

    /// Does what is due and returns when the next thing is. Never waits; at most 1 ms, whatever the devices do.
    pub fn step(&mut self) -> Instant {
        let now = self.platform.now();
        self.poll_gripper(now);
        let frame = self.scanner.poll(now);
        if let Some(frame) = &frame {
            self.take_frame(now, frame);
        }
        self.watch(now);
        if frame.is_some() || self.due.is_none_or(|due| now >= due) {
            self.supervise(now, frame.is_some());
            // The line may be free: then the command leaves now. What this poll finds is taken in the next step.
            if self.gripper.next_due() <= now {
                self.stashed = self.poll_and_see(now);
            }
        }
        self.telemetry.now = now;
        self.next_due(now)
    }

    /// Steps and waits until `until` says so; it is asked before every step and may look at everything.
    pub fn run(&mut self, mut until: impl FnMut(&mut Self) -> bool) {
        while !until(self) {
            let due = self.step();
            self.platform.wait_until(due);
        }
    }

    /// Closes the clutch, and keeps it closed for 250 ms: call it every 100 ms.
    pub fn engage(&mut self) {
        let now = self.platform.now();
        if self.heartbeat.replace(now).is_none() {
            self.due = Some(now);
        }
        self.lock();
    }

    /// Opens the clutch: the next step holds.
    pub fn release(&mut self) {
        self.heartbeat = None;
        self.due = Some(self.platform.now());
    }

    /// Asks the gripper to activate: **it moves**. Refused, with an event, while it follows the hand.
    pub fn activate(&mut self) {
        let now = self.platform.now();
        if self.supervisor.state().is_moving() {
            self.tell(now, Kind::Refused(Request::Activate));
        } else {
            self.gripper.activate();
            self.tell(now, Kind::ActivationRequested);
        }
    }

    /// Takes the next complete frame as the flat hand: every joint angle of it becomes zero. An event tells the end,
    /// after 2 s at the latest. Refused, with an event, while the clutch is closed.
    pub fn calibrate_flat_hand(&mut self) {
        let now = self.platform.now();
        if self.is_engaged() {
            self.tell(now, Kind::Refused(Request::Calibrate));
        } else {
            self.calibration_until = now.checked_add_duration(timing::CALIBRATION_WAIT);
        }
    }

    /// Takes a calibration that was made before. Refused, with an event, while the clutch is closed.
    pub fn set_calibration(&mut self, calibration: Calibration) {
        let now = self.platform.now();
        if self.is_engaged() {
            self.tell(now, Kind::Refused(Request::Calibrate));
        } else {
            self.calibrate(calibration);
        }
    }

    /// The calibration in use.
    pub fn calibration(&self) -> &Calibration {
        self.posture.calibration()
    }

    /// Takes another configuration.
    ///
    /// # Errors
    /// The configuration comes back while the clutch is closed: nothing changes then.
    pub fn set_config(&mut self, config: Config<X>) -> Result<(), Config<X>> {
        if self.is_engaged() {
            return Err(config);
        }
        if config.settings().side != self.config().settings().side {
            self.posture = Posture::new(config.settings().side, *self.posture.calibration());
        }
        self.supervisor = Supervisor::new(config);
        Ok(())
    }

    /// The configuration.
    pub fn config(&self) -> &Config<X> {
        self.supervisor.config()
    }

    /// Whether the clutch is closed, or motion under it has not ended.
    pub fn is_engaged(&self) -> bool {
        self.heartbeat.is_some() || self.supervisor.state() != State::Idle
    }

    /// What is known after the newest step.
    pub fn telemetry(&self) -> &Telemetry<X> {
        &self.telemetry
    }

    /// Why the newest failed cycle of the gripper failed.
    pub fn gripper_error(&self) -> Option<R::Error> {
        self.gripper_error
    }

    /// The oldest event that was not taken yet.
    pub fn next_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// The weights store. While the clutch is closed it refuses to write.
    pub fn store_mut(&mut self) -> &mut WeightsStore<F> {
        self.lock();
        &mut self.store
    }

    /// The weights store, to look at.
    pub fn store(&self) -> &WeightsStore<F> {
        &self.store
    }

    /// The glove's scanner: its counters, its port.
    pub fn scanner_mut(&mut self) -> &mut Scanner<G> {
        &mut self.scanner
    }

    /// The gripper. Setting motions past the bridge is the caller's responsibility; the next step sets its own.
    pub fn gripper_mut(&mut self) -> &mut R {
        &mut self.gripper
    }

    /// The platform.
    pub fn platform_mut(&mut self) -> &mut P {
        &mut self.platform
    }

    /// Gives everything back.
    pub fn into_parts(self) -> (P, Scanner<G>, R, WeightsStore<F>) {
        (self.platform, self.scanner, self.gripper, self.store)
    }
}

impl<P, G, R, F, const X: usize> App<P, G, R, F, X>
where
    P: Platform,
    G: Read + ReadReady + Write,
    R: Gripper<X>,
    F: Slot,
{
    /// Polls the gripper and sees whether a command left.
    fn poll_and_see(&mut self, now: Instant) -> Option<Result<Status<X>, R::Error>> {
        let before = self.gripper.counters().requests;
        let result = self.gripper.poll(now);
        let sent = self.gripper.counters().requests != before;
        if sent
            && let Some(order) = self
                .order
                .filter(|order| age(now, order.stamp) <= timing::MAX_AGE)
        {
            self.telemetry.take_sent(Sent { at: now, ..order });
        }
        result
    }

    fn poll_gripper(&mut self, now: Instant) {
        let result = match self.stashed.take() {
            Some(result) => Some(result),
            None => self.poll_and_see(now),
        };
        match result {
            None => {}
            Some(Ok(status)) => self.take_status(now, status),
            Some(Err(error)) => {
                self.gripper_error = Some(error);
                bump(&mut self.telemetry.counters.gripper_errors);
            }
        }
    }

    fn take_status(&mut self, now: Instant, status: Status<X>) {
        let before = self.telemetry.take_status(status);
        if before.map_or(Fault::None, |before| before.fault) != status.fault {
            self.tell(now, Kind::GripperFault(status.fault));
        }
        if !self.telemetry.gripper_answers {
            self.telemetry.gripper_answers = true;
            self.tell(now, Kind::Gripper { answers: true });
        }
    }

    fn take_frame(&mut self, now: Instant, frame: &Frame) {
        if !self.telemetry.glove_answers {
            self.telemetry.glove_answers = true;
            self.tell(now, Kind::Glove { answers: true });
        }
        self.frame_at = Some(now);
        self.telemetry.take_frame(frame);
        self.watch_sensors(now, frame);
        self.try_calibration(now, frame);
        let reading = self.posture.read(frame);
        self.telemetry.take_reading(&reading);
        let output = reading.and_then(|reading| {
            let map = self
                .store
                .map::<JOINT_COUNT, HIDDEN, X>()
                .ok_or(HoldReason::NoWeights)?;
            map.eval(&reading.angles)
                .map_err(|_| HoldReason::InputRefused)
        });
        self.telemetry.map_output = output.ok();
        if output.is_err() {
            bump(&mut self.telemetry.counters.unusable_frames);
        }
        self.hand = Some(Hand {
            sequence: self.telemetry.frame_sequence,
            stamp: reading.map_or(now, |reading| reading.stamp),
            output,
        });
    }

    /// Tells which sensors are lost, back, or restarted.
    fn watch_sensors(&mut self, now: Instant, frame: &Frame) {
        let missing = posture::missing(frame);
        let starts = self.scanner.counters().starts;
        for segment in 0..SEGMENT_COUNT {
            let bit = 1u16 << segment;
            let seen = self.sensors.good[segment].get_or_insert(now);
            if missing & bit == 0 {
                *seen = now;
                if self.sensors.lost & bit != 0 {
                    self.sensors.lost &= !bit;
                    self.tell(now, Kind::SensorBack { segment });
                }
            } else if self.sensors.lost & bit == 0 && age(now, *seen) > timing::MAX_AGE {
                self.sensors.lost |= bit;
                self.tell(now, Kind::SensorLost { segment });
            }
            let restarted = self
                .sensors
                .starts
                .is_some_and(|then| starts[segment] > then[segment]);
            if restarted
                && self.config().settings().heading_is_relative
                && self.posture.distrust(segment)
            {
                self.tell(now, Kind::SensorRestarted { segment });
            }
        }
    }

    fn try_calibration(&mut self, now: Instant, frame: &Frame) {
        if self.calibration_until.is_none() || posture::missing(frame) != 0 {
            return;
        }
        self.calibration_until = None;
        if self.is_engaged() {
            self.tell(now, Kind::Refused(Request::Calibrate));
            return;
        }
        let orientations = frame.samples.map(|sample| sample.orientation);
        self.calibrate(Calibration::from_flat_hand(&orientations));
        self.tell(now, Kind::Calibrated);
    }

    /// A calibration belongs to the headings the sensors have now; at least their first start has happened or will.
    fn calibrate(&mut self, calibration: Calibration) {
        self.posture.calibrate(calibration);
        self.sensors.starts = Some(self.scanner.counters().starts.map(|starts| starts.max(1)));
    }

    /// What is told when nothing happens.
    fn watch(&mut self, now: Instant) {
        let stale =
            |stamp: Option<Instant>| stamp.is_none_or(|stamp| age(now, stamp) > timing::SILENT);
        if self.telemetry.gripper_answers && stale(self.telemetry.status.map(|status| status.stamp))
        {
            self.telemetry.gripper_answers = false;
            self.tell(now, Kind::Gripper { answers: false });
        }
        if self.telemetry.glove_answers && stale(self.frame_at) {
            self.telemetry.glove_answers = false;
            self.tell(now, Kind::Glove { answers: false });
        }
        if self.calibration_until.is_some_and(|until| now >= until) {
            self.calibration_until = None;
            let missing = match &self.telemetry.frame {
                Some(frame) if self.telemetry.glove_answers => posture::missing(frame),
                _ => u16::MAX,
            };
            self.tell(now, Kind::CalibrationFailed { missing });
        }
        let weights = self
            .store
            .active()
            .map(|(slot, image)| (slot, image.sequence));
        if weights != self.weights {
            self.weights = weights;
            if let Some((slot, image)) = self.store.active() {
                let meta = image.checked.meta;
                let (model_id, version) = (meta.model_id, meta.version);
                self.tell(
                    now,
                    Kind::Weights {
                        slot,
                        model_id,
                        version,
                    },
                );
            }
        }
    }

    fn supervise(&mut self, now: Instant, fresh: bool) {
        let inputs = Inputs {
            heartbeat: self.heartbeat,
            hand: self.hand,
            status: self.telemetry.status,
            weights: match (self.store.progress(), self.store.active()) {
                (Some(_), _) => Weights::Busy,
                (None, Some(_)) => Weights::Ready,
                (None, None) => Weights::Missing,
            },
        };
        let output = self.supervisor.step(now, &inputs);
        self.order = output.motion.map(|motion| Sent {
            motion,
            stamp: output.stamp,
            decided: now,
            at: now,
            follows: output.state.is_moving(),
        });
        self.gripper.set_motion(output.motion, output.stamp);
        if self.due.is_none_or(|due| now >= due) {
            self.due = Some(next_on_grid(self.due, now));
        }
        self.report(now, &output, fresh);
        self.lock();
    }

    fn report(&mut self, now: Instant, output: &Output<X>, fresh: bool) {
        self.telemetry.state = output.state;
        self.telemetry.command = output.motion;
        self.telemetry.target = output.target;
        self.telemetry.glove_state = self.scanner.state();
        let counters = &mut self.telemetry.counters;
        counters.glove = *self.scanner.counters();
        counters.gripper = self.gripper.counters();
        bump(&mut counters.steps);
        if fresh && self.order.is_some_and(|order| order.follows) {
            bump(&mut counters.answered_frames);
        }
        if let Some(late) = output.late {
            bump(&mut counters.late_steps);
            let us = u32::try_from(late.as_micros()).unwrap_or(u32::MAX);
            counters.worst_late_us = counters.worst_late_us.max(us);
        }
        if output.before.is_moving() && !output.state.is_moving() {
            match output.state {
                State::Faulted(_) => bump(&mut counters.faults),
                _ => bump(&mut counters.holds),
            }
        }
        if output.before != output.state {
            self.tell(
                now,
                Kind::State {
                    from: output.before,
                    to: output.state,
                },
            );
        }
        if let Some(by) = output.late {
            self.tell(now, Kind::Late { by });
        }
    }

    fn lock(&mut self) {
        // An image that was begun before the clutch closed may be finished: the supervisor holds until then.
        let locked = self.is_engaged() && self.store.progress().is_none();
        self.store.set_locked(locked);
    }

    fn next_due(&self, now: Instant) -> Instant {
        if self.stashed.is_some() {
            return now;
        }
        let mut next = self.gripper.next_due();
        for due in [self.due, self.scanner.next_due()].into_iter().flatten() {
            next = next.min(due);
        }
        next
    }

    fn tell(&mut self, at: Instant, kind: Kind) {
        let event = Event { at, kind };
        if let Err(event) = self.events.push_back(event) {
            let _ = self.events.pop_front();
            let _ = self.events.push_back(event);
            bump(&mut self.telemetry.counters.events_lost);
        }
    }
}

/// The next point of the 10 ms grid after `now`; a grid that fell behind by a period or more starts anew.
fn next_on_grid(due: Option<Instant>, now: Instant) -> Instant {
    let after = |start: Instant| start.checked_add_duration(timing::PERIOD).unwrap_or(now);
    match due.map(after) {
        Some(next) if next > now => next,
        _ => after(now),
    }
}

fn age(now: Instant, stamp: Instant) -> Duration {
    now.checked_duration_since(stamp)
        .unwrap_or(Duration::from_ticks(0))
}
