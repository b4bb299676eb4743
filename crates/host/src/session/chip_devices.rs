//! What a bridge on a chip tells of its sensors, its gripper's axes and their line, and how old that is.

use std::time::{Duration, Instant};

use bridge::calibration::ProfileState;
use bridge::protocol::message::{Devices, GripperStatus, Headings, Replies, Sample, Status};
use glove::scan::Health;
use gripper::{Contact, link};

use super::axes::Axes;
use super::snapshot::{self, More, Sensors};
use crate::chip::link::{Error, HostLink};

/// Pause between two questions.
const EVERY: Duration = Duration::from_millis(250);
/// Pause between two questions for the headings, which change slowly.
const HEADINGS_EVERY: Duration = Duration::from_secs(1);
/// The same to a bridge that never answered this one: its firmware is from before it.
const RARELY: Duration = Duration::from_secs(5);
/// Questions without an answer after which it is taken for one, and what one that answered before said is not known any more.
const MISSED: u32 = 4;
/// What is no older than this goes on coming: its age stays what it was told to be, ms.
const FRESH_MS: u32 = 200;

/// The newest answer, and what the bridge said of its gripper.
#[derive(Debug)]
pub(super) struct Told {
    told: Option<Devices>,
    headings: Option<Headings>,
    asked_headings: Option<Instant>,
    missed_headings: u32,
    /// It has answered before.
    answers: bool,
    asked: Instant,
    missed: u32,
    /// The newest that the gripper said, with the bridge's time of it, µs; it stays when the gripper falls silent.
    gripper: Option<(GripperStatus, u64)>,
    /// Time of the newest status of the bridge, µs.
    status_us: Option<u64>,
    /// The bridge's newest time, µs, and when it came.
    clock: (u64, Instant),
}

impl Told {
    pub fn new(status: &Status) -> Self {
        let now = Instant::now();
        let mut known = Self {
            told: None,
            headings: None,
            asked_headings: None,
            missed_headings: 0,
            answers: false,
            asked: now.checked_sub(EVERY).unwrap_or(now),
            missed: 0,
            gripper: None,
            status_us: None,
            clock: (status.now_us, now),
        };
        known.status(status);
        known
    }

    /// Asks where it is time to, and the answer can come by `end`.
    pub fn ask(&mut self, link: &mut HostLink, end: Instant) -> Result<Option<&Devices>, Error> {
        let every = if !self.answers && self.missed >= MISSED {
            RARELY
        } else {
            EVERY
        };
        if self.asked.elapsed() < every {
            return Ok(None);
        }
        let Some(answer) = link.devices_by(end)? else {
            return Ok(None);
        };
        self.asked = Instant::now();
        Ok(self.take(answer))
    }

    /// Asks a bridge that answers such questions once a second where the answer can come by `end`.
    pub fn ask_headings(&mut self, link: &mut HostLink, end: Instant) -> Result<(), Error> {
        let every = match (&self.headings, self.missed_headings) {
            (None, MISSED..) => RARELY,
            _ => HEADINGS_EVERY,
        };
        let due = self.asked_headings.is_none_or(|at| at.elapsed() >= every);
        if !self.answers || !due {
            return Ok(());
        }
        if let Some(answer) = link.headings_by(end)? {
            self.asked_headings = Some(Instant::now());
            match answer {
                Some(headings) => {
                    (self.headings, self.missed_headings) = (Some(headings), 0);
                }
                None => {
                    self.missed_headings = self.missed_headings.saturating_add(1);
                    if self.missed_headings >= MISSED {
                        self.headings = None;
                    }
                }
            }
        }
        Ok(())
    }

    /// Whether the glove's profile is there.
    pub fn profile(&self) -> Option<ProfileState> {
        self.headings.as_ref().map(|headings| headings.profile)
    }

    /// What is known of the headings.
    pub fn headings(&self) -> Option<snapshot::Headings> {
        let told = self.headings.as_ref();
        let told = told.filter(|told| told.profile.is_there)?;
        Some(snapshot::Headings {
            sigma: told.sigma,
            drift: told.drift,
            degraded: told.degraded,
            unknown: told.unknown,
            poses: told.poses,
            pose: told.pose,
        })
    }

    /// What came of a question.
    fn take(&mut self, answer: Option<Devices>) -> Option<&Devices> {
        let Some(devices) = answer else {
            self.missed = self.missed.saturating_add(1);
            if self.missed >= MISSED {
                self.told = None;
            }
            return None;
        };
        self.hear(devices.now_us);
        (self.missed, self.answers) = (0, true);
        Some(self.told.insert(devices))
    }

    /// The bridge was heard at its time `now_us`.
    fn hear(&mut self, now_us: u64) {
        if now_us > self.clock.0 {
            self.clock = (now_us, Instant::now());
        }
    }

    /// The bridge's newest status; the same one may be given again.
    pub fn status(&mut self, status: &Status) {
        if self.status_us.replace(status.now_us) == Some(status.now_us) {
            return;
        }
        self.hear(status.now_us);
        if let Some(gripper) = &status.gripper {
            self.gripper = Some((gripper.clone(), status.now_us));
        }
    }

    /// A telemetry sample.
    pub fn sample(&mut self, sample: &Sample) {
        self.hear(sample.now_us);
        if let Some((gripper, at)) = &mut self.gripper
            && sample.now_us >= *at
            && !sample.position.is_empty()
        {
            gripper.position.clone_from(&sample.position);
            *at = sample.now_us;
        }
    }

    /// The bridge's time now, as far as this computer's clock tells: what nobody hears of grows old.
    pub fn now(&self) -> gripper::Instant {
        let passed = u64::try_from(self.clock.1.elapsed().as_micros()).unwrap_or(u64::MAX);
        gripper::Instant::from_ticks(self.clock.0.saturating_add(passed))
    }

    /// When what was heard at `heard_us` was asked for: `age_ms` is its age as told last.
    fn stamp(&self, age_ms: Option<u32>, heard_us: u64) -> gripper::Instant {
        let told_us = self.told.as_ref().map_or(heard_us, |told| told.now_us);
        let age_ms = age_ms.unwrap_or(0);
        let from = if age_ms <= FRESH_MS {
            heard_us
        } else {
            told_us
        };
        gripper::Instant::from_ticks(from.saturating_sub(1_000 * u64::from(age_ms)))
    }

    /// The gripper's newest status.
    pub fn gripper(&self) -> Option<snapshot::Status> {
        let (gripper, heard_us) = self.gripper.as_ref()?;
        let detail = self.told.as_ref().and_then(|told| told.gripper.as_ref());
        Some(snapshot::Status {
            stamp: self.stamp(detail.map(|detail| detail.age_ms), *heard_us),
            activation: gripper.activation,
            fault: gripper.fault,
            echo: Axes::new(&gripper.echo)?,
            position: Axes::new(&gripper.position)?,
            more: self.more(),
        })
    }

    /// What the gripper says of its axes.
    fn more(&self) -> Option<More> {
        let detail = self.told.as_ref()?.gripper.as_ref()?;
        let contact: Vec<_> = detail.axes.iter().map(|axis| axis.contact).collect();
        let current: Vec<_> = detail.axes.iter().map(|axis| axis.current).collect();
        Some(More {
            going_to: detail.going_to,
            contact: Axes::new(&contact)?,
            current: Axes::new(&current)?,
        })
    }

    /// Whether an axis says that something is in its way.
    pub fn is_blocked(&self, axis: usize) -> bool {
        let detail = self.told.as_ref().and_then(|told| told.gripper.as_ref());
        let contact = detail.and_then(|detail| detail.axes.get(axis));
        contact.is_some_and(|axis| {
            matches!(
                axis.contact,
                Contact::ContactOpening | Contact::ContactClosing
            )
        })
    }

    /// The glove's sensors.
    pub fn sensors(&self) -> Option<Sensors> {
        let told = self.told.as_ref()?;
        // Of many the first ones' faults are told; nobody asks for more of the others than that they are not good.
        let others = told.sensors.first().map_or(Health::Starting, |s| s.health);
        let health = core::array::from_fn(|segment| {
            let own = told
                .sensors
                .iter()
                .find(|sensor| usize::from(sensor.segment) == segment);
            match own {
                Some(sensor) => sensor.health,
                None if told.missing >> segment & 1 == 1 => others,
                None => Health::Good,
            }
        });
        let newest = match told.glove_age_ms {
            Some(age) => self.stamp(Some(age), self.clock.0),
            None => gripper::Instant::from_ticks(0),
        };
        Some(Sensors { health, newest })
    }

    pub fn distrusted(&self) -> u16 {
        self.told.as_ref().map_or(0, |told| told.distrusted)
    }

    pub fn impossible(&self) -> u16 {
        self.told.as_ref().map_or(0, |told| told.impossible)
    }

    pub fn stands(&self) -> Option<u8> {
        self.told.as_ref()?.stands
    }

    /// How the gripper's replies came.
    pub fn line(&self) -> Option<link::Counters> {
        self.told.as_ref().map(|told| counters(&told.replies))
    }
}

/// The same as the counters of a line in this process.
fn counters(replies: &Replies) -> link::Counters {
    link::Counters {
        requests: replies.requests,
        replies: replies.right,
        timeouts: replies.missed,
        stale: replies.late,
        exceptions: replies.refused,
        shape: replies.foreign,
        crc: replies.corrupt,
        ..link::Counters::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bridge::State;
    use bridge::protocol::message::{AxisDetail, GripperDetail, UnusedSensor};
    use glove::imu::Fault;
    use gripper::{Activation, Fault as GripperFault};

    fn status(now_us: u64, answers: bool) -> Status {
        let gripper = GripperStatus {
            activation: Activation::Ready,
            fault: GripperFault::None,
            echo: [9; 4].into_iter().collect(),
            position: [7; 4].into_iter().collect(),
        };
        Status {
            now_us,
            state: State::Idle,
            engaged: false,
            heartbeat: false,
            glove_answers: true,
            gripper: answers.then_some(gripper),
            active_slot: Some(0),
            transfer: None,
        }
    }

    fn devices(now_us: u64, age_ms: u32) -> Devices {
        let axis = AxisDetail {
            contact: Contact::ContactClosing,
            current: 3,
        };
        let unused = UnusedSensor {
            segment: 5,
            health: Health::Rejected(Fault::Frozen),
        };
        Devices {
            now_us,
            glove_age_ms: Some(age_ms),
            missing: 0xC020,
            sensors: [unused].into_iter().collect(),
            distrusted: 1 << 4,
            impossible: 0,
            gripper: Some(GripperDetail {
                age_ms,
                going_to: true,
                axes: [axis; 4].into_iter().collect(),
            }),
            stands: Some(2),
            replies: Replies::default(),
        }
    }

    /// Told at the bridge's time 10 s.
    fn known(age_ms: u32, answers: bool) -> Told {
        let mut known = Told::new(&status(9_000_000, true));
        known.told = Some(devices(9_900_000, age_ms));
        known.status(&status(10_000_000, answers));
        known
    }

    fn age_ms(stamp: gripper::Instant) -> u64 {
        (10_000_000_u64).saturating_sub(stamp.as_ticks()) / 1_000
    }

    #[test]
    fn what_goes_on_coming_stays_as_old_as_told_and_what_stopped_grows_old() {
        let fresh = known(8, true);
        assert_eq!(age_ms(fresh.gripper().unwrap().stamp), 8);
        assert_eq!(age_ms(fresh.sensors().unwrap().newest), 8);
        let old = known(700, false);
        assert_eq!(age_ms(old.gripper().unwrap().stamp), 800);
        assert_eq!(age_ms(old.sensors().unwrap().newest), 800);
        // Nothing of it was heard since.
        let gone = known(8, false);
        assert_eq!(age_ms(gone.gripper().unwrap().stamp), 1_008);
    }

    #[test]
    fn a_bridge_that_is_not_heard_any_more_grows_old_by_this_computers_clock() {
        let mut known = known(8, true);
        let ago = Instant::now().checked_sub(Duration::from_secs(3)).unwrap();
        known.clock = (10_000_000, ago);
        let gripper = known.gripper().unwrap();
        let age = known.now().checked_duration_since(gripper.stamp).unwrap();
        assert!(age.as_millis() >= 3_008);
    }

    #[test]
    fn a_sensor_that_is_not_used_is_named_with_its_fault() {
        let health = known(8, true).sensors().unwrap().health;
        assert_eq!(health[5], Health::Rejected(Fault::Frozen));
        let good = health.iter().filter(|health| health.is_good()).count();
        assert_eq!(good, 13);
    }

    #[test]
    fn what_was_told_is_not_known_any_more_once_no_answer_comes() {
        let mut known = known(8, true);
        for _ in 1..MISSED {
            assert!(known.take(None).is_none());
        }
        assert_eq!(known.stands(), Some(2), "one may be lost");
        known.take(None);
        assert!(known.sensors().is_none() && known.line().is_none());
        assert_eq!((known.stands(), known.distrusted()), (None, 0));
        assert!(!known.is_blocked(0));
        assert!(known.take(Some(devices(9_900_000, 8))).is_some());
        assert_eq!(known.stands(), Some(2));
    }

    #[test]
    fn an_old_firmware_tells_no_sensors_and_no_line() {
        let known = Told::new(&status(10_000_000, true));
        assert!(known.sensors().is_none() && known.line().is_none());
        assert_eq!(known.gripper().unwrap().more, None);
        assert!(!known.is_blocked(0));
    }
}
