//! What the scanner knows of one sensor, and how samples and failures change it.

mod stepping;

use super::suspect::{AGREE_WITHIN, Cause, Return, Suspect};
use super::{Counters, Health, Sample, Trouble};
use crate::bus;
use crate::hand::Quaternion;
use crate::imu::bringup::Step;
use crate::imu::{self, Error, Fault};
use crate::timing::{self, after, since};
use crate::{Duration, Instant};

/// Bad samples in a row after which the sensor is asked what it is doing.
const BAD_MAX: u8 = 3;

/// Rechecks in a row without a good sample after which it is brought up again.
const RECHECKS_MAX: u8 = 3;

/// A joint seldom turns more than three times as far as the one before it.
const LEAST_PART: f32 = 3.0;

/// A time at which nothing was asked.
const NEVER: Instant = Instant::from_ticks(0);

/// One sensor.
#[derive(Debug, Clone)]
pub(super) struct Sensor {
    /// The next step of its bring-up; `None`: it is sampled.
    pub step: Option<Step>,
    /// When that step is due.
    pub due: Instant,
    /// What to tell.
    pub health: Health,
    /// The raw bytes of the newest sample, if it was read.
    pub raw: Option<[u8; imu::SAMPLE_BYTES]>,
    /// The register pointer is known to stand at the quaternion.
    pub pointer_set: bool,
    /// Whether its first bring-up has ended, well or not.
    pub tried: bool,
    /// It is frozen, or was and has not changed since: not believed until its bytes change.
    pub distrusted: Option<([u8; imu::SAMPLE_BYTES], Fault)>,
    /// Another channel gives the same bits as this one's.
    pub is_twin: bool,
    /// It has just been believed again, far from where it was.
    pub returned: Option<Return>,
    /// What went wrong with it last.
    pub trouble: Option<Trouble>,
    /// Its unique id was read since it started over last: what is known of it is of this sensor.
    pub is_identified: bool,
    /// It is asked who it is, after a time in which another may have been put in its place.
    pub is_doubtful: bool,
    good: Option<(Quaternion, Instant)>,
    /// Nobody looked at any sensor for a while, and until then it was good: it was not away.
    unseen: bool,
    /// When it was last asked since it came up or was checked; zero before.
    asked: Instant,
    /// The longest gap between two questions since the last good sample, µs, where it was longer than a scan takes; zero without.
    gap_us: u32,
    suspect: Option<Suspect>,
    /// How far it turned in its newest gap, radians, and when it was asked after it.
    turned: Option<(f32, Instant)>,
    /// Good samples since it came up.
    fresh: bool,
    up_since: Instant,
    tries: u8,
    failures: u8,
    bad: u8,
    rechecks: u8,
    pointer_stays: bool,
}

impl Sensor {
    pub fn new() -> Self {
        Self {
            step: Some(Step::Identify),
            due: Instant::from_ticks(0),
            health: Health::Starting,
            raw: None,
            pointer_set: false,
            tried: false,
            distrusted: None,
            is_twin: false,
            returned: None,
            trouble: None,
            is_identified: false,
            is_doubtful: false,
            good: None,
            unseen: false,
            asked: NEVER,
            gap_us: 0,
            suspect: None,
            turned: None,
            fresh: false,
            up_since: Instant::from_ticks(0),
            tries: 0,
            failures: 0,
            bad: 0,
            rechecks: 0,
            pointer_stays: false,
        }
    }

    pub fn is_running(&self) -> bool {
        self.step.is_none()
    }

    /// Whether a step of its bring-up is due.
    pub fn is_due(&self, now: Instant) -> bool {
        self.step.is_some() && now >= self.due
    }

    /// Whether the next sample may be read without writing the register pointer.
    pub fn reads_plain(&self) -> bool {
        self.pointer_set && self.pointer_stays
    }

    pub fn sample(&self) -> Sample {
        let (orientation, stamp) = self
            .good
            .unwrap_or((Quaternion::identity(), Instant::from_ticks(0)));
        Sample {
            orientation,
            stamp,
            health: self.health,
        }
    }

    /// It is asked at `stamp`. More than `longest` since it was asked before: the scans have a gap.
    pub fn ask(&mut self, stamp: Instant, longest: Duration) {
        let before = core::mem::replace(&mut self.asked, stamp);
        let pause = since(stamp, before);
        if before != NEVER && pause > longest {
            let us = u32::try_from(pause.as_ticks()).unwrap_or(u32::MAX);
            self.gap_us = self.gap_us.max(us);
        }
    }

    /// How far it turned in its newest gap between scans, radians, and when it was asked after it: believed or not.
    pub fn turned_in_gap(&self) -> Option<(f32, Instant)> {
        self.turned
    }

    /// A segment beside it turned by so much in a gap, until it was asked at so: where that was the same gap and no small part of
    /// what this one did, the hand moved.
    pub fn went_along(&mut self, (by, at): (f32, Instant), longest: Duration) {
        if let Some(suspect) = &mut self.suspect
            && let Cause::Gap { joined, .. } = &mut suspect.cause
        {
            let apart = since(at, suspect.since).max(since(suspect.since, at));
            *joined |= apart <= longest && by > suspect.by / LEAST_PART;
        }
    }

    /// Eight bytes arrived that were asked for at `stamp`.
    pub fn take(&mut self, raw: [u8; imu::SAMPLE_BYTES], stamp: Instant, counters: &mut Counters) {
        let (raw, mended) = imu::repair::repaired(raw);
        counters.repaired = counters.repaired.wrapping_add(u32::from(mended));
        self.raw = Some(raw);
        self.pointer_set = true;
        match self.judge(&raw, stamp) {
            Ok(orientation) => {
                let orientation = match self.good {
                    Some((previous, _)) => imu::continuous(orientation, &previous),
                    None => orientation,
                };
                self.good = Some((orientation, stamp));
                (self.fresh, self.unseen, self.gap_us) = (true, false, 0);
                self.distrusted = None;
                self.health = Health::Good;
                (self.bad, self.rechecks, self.failures, self.tries) = (0, 0, 0, 0);
                counters.good = counters.good.wrapping_add(1);
            }
            Err(fault) => self.reject(fault, stamp, counters),
        }
    }

    /// No sensor gave a sample from `then` until now.
    pub fn not_seen_since(&mut self, then: Instant) {
        self.unseen = self
            .good
            .is_some_and(|(_, at)| since(then, at) < timing::PEAK_SPEED);
    }

    fn judge(
        &mut self,
        raw: &[u8; imu::SAMPLE_BYTES],
        stamp: Instant,
    ) -> Result<Quaternion, Fault> {
        let orientation = imu::orientation(raw)?;
        if let Some((withdrawn, fault)) = self.distrusted
            && withdrawn == *raw
        {
            return Err(fault);
        }
        if self.is_twin {
            return Err(Fault::Twin);
        }
        let Some((good, at)) = self.good else {
            self.suspect = None;
            return Ok(orientation);
        };
        let by = imu::angle_between(&good, &orientation);
        if self.gap_us > 0 && self.suspect.is_none() {
            self.turned = Some((by, stamp));
        }
        if self.unseen && self.suspect.is_none() {
            // The hand may have done anything meanwhile.
            return Ok(orientation);
        }
        let Some(suspect) = self.suspect else {
            let Some(cause) = self.doubts(by, since(stamp, at)) else {
                return Ok(orientation);
            };
            let suspect = Suspect::at(orientation, cause, stamp, by);
            self.suspect = Some(suspect);
            return Err(suspect.fault());
        };
        if by <= AGREE_WITHIN {
            // A spike, and it is over.
            self.suspect = None;
            return Ok(orientation);
        }
        let next = suspect.followed_by(orientation);
        self.suspect = Some(next);
        if !next.is_believed() {
            return Err(next.fault());
        }
        self.suspect = None;
        let cause = next.cause;
        self.returned = Some(Return { by, cause });
        Ok(orientation)
    }

    /// Why a turn `by` radians in `elapsed` since the last good sample is not believed at once, if it is not.
    fn doubts(&self, by: f32, elapsed: Duration) -> Option<Cause> {
        let was_away = !self.fresh || elapsed >= timing::PEAK_SPEED;
        // A gap that takes most of the time explains it; a short one in a long absence does not.
        let most = self.fresh && u64::from(self.gap_us) > elapsed.as_ticks() / 2;
        if self.gap_us > 0 && (!was_away || most) {
            return (by > AGREE_WITHIN).then(|| Cause::Gap {
                pause_us: self.gap_us,
                beyond: by > imu::reach_alone(elapsed),
                joined: false,
            });
        }
        if was_away {
            return (by > AGREE_WITHIN).then_some(Cause::Away);
        }
        (by > imu::reach(elapsed)).then_some(Cause::Jump)
    }

    fn reject(&mut self, fault: Fault, now: Instant, counters: &mut Counters) {
        if fault == Fault::Zero && !self.fresh {
            self.await_first(now);
            return;
        }
        count(fault, counters);
        self.health = Health::Rejected(fault);
        self.note(Error::Rejected(fault), now);
        match fault {
            // Right bytes of the right register, only not to be believed: time mends these.
            Fault::TooFast | Fault::Away | Fault::AllFrozen | Fault::Twin => return,
            Fault::Frozen => {
                if since(now, self.up_since) >= timing::FROZEN_RESTART {
                    self.restart(Error::Rejected(fault), now);
                }
                return;
            }
            Fault::Zero | Fault::NotUnit | Fault::Restarted => {}
        }
        self.pointer_set = false;
        self.bad = self.bad.saturating_add(1);
        if fault == Fault::Restarted || self.bad >= BAD_MAX {
            self.recheck(Error::Rejected(fault), now);
        }
    }

    /// All-zero bytes before the first output are no fault, for a while.
    fn await_first(&mut self, now: Instant) {
        if since(now, self.up_since) < timing::FIRST_SAMPLE {
            self.health = Health::Starting;
        } else {
            self.restart(Error::NoSample, now);
        }
    }

    /// The scan found something wrong with it: its newest sample is withdrawn. True if it counted as good until now.
    pub fn withdraw(&mut self, fault: Fault, now: Instant, counters: &mut Counters) -> bool {
        let (Some(raw), Health::Good) = (self.raw, self.health) else {
            return false;
        };
        if fault != Fault::Twin {
            self.distrusted = Some((raw, fault));
            self.up_since = now;
        }
        self.health = Health::Rejected(fault);
        count(fault, counters);
        true
    }

    /// A sample did not come.
    pub fn miss(&mut self, error: Error, now: Instant, counters: &mut Counters) {
        self.note(error, now);
        counters.missed = counters.missed.wrapping_add(1);
        self.health = Health::Missing(error);
        self.raw = None;
        self.pointer_set = false;
        let (Error::Bus { cause, .. } | Error::Mux(cause)) = error else {
            return;
        };
        if !is_sensors(cause) {
            return;
        }
        self.bad = self.bad.saturating_add(1);
        if cause.is_nack() || self.bad >= BAD_MAX {
            self.recheck(error, now);
        }
    }

    /// Keeps what went wrong, for who wants to know.
    fn note(&mut self, error: Error, at: Instant) {
        let count = self
            .trouble
            .map_or(1, |before| before.count.saturating_add(1));
        self.trouble = Some(Trouble { error, at, count });
    }

    fn recheck(&mut self, error: Error, now: Instant) {
        self.asked = NEVER;
        self.bad = 0;
        self.rechecks = self.rechecks.saturating_add(1);
        if self.rechecks > RECHECKS_MAX {
            self.restart(error, now);
        } else {
            (self.step, self.due, self.tries) = (Some(Step::Recheck), now, 0);
        }
    }

    /// Another may be in its place: it is asked who it is before it is sampled again.
    pub fn ask_who(&mut self, now: Instant) {
        self.forget();
        self.health = Health::Starting;
        (self.step, self.due, self.tries) = (Some(Step::Recheck), now, 0);
        self.is_doubtful = true;
    }

    /// It may not be the sensor it was taken for: it starts over.
    pub fn doubt(&mut self, error: Error, now: Instant) {
        self.restart(error, now);
    }

    /// Starts over, at once the first time, later and later after that.
    fn restart(&mut self, error: Error, now: Instant) {
        self.health = match error {
            Error::Rejected(fault) => Health::Rejected(fault),
            other => Health::Missing(other),
        };
        let doubled = timing::BACKOFF_MIN.as_ticks() << self.failures.min(8);
        let wait = Duration::from_ticks(doubled.min(timing::BACKOFF_MAX.as_ticks()));
        self.failures = self.failures.saturating_add(1);
        (self.step, self.due) = (Some(Step::Identify), after(now, wait));
        (self.tries, self.bad, self.rechecks, self.tried) = (0, 0, 0, true);
        self.asked = NEVER;
        (self.is_identified, self.is_doubtful) = (false, false);
        self.forget();
    }

    /// Its register pointer is not known any more.
    pub fn forget(&mut self) {
        self.pointer_set = false;
        self.raw = None;
    }
}

/// Whether a bus error may be the sensor's (or the multiplexer's) doing, rather than the serial bridge's.
fn is_sensors(cause: bus::Error) -> bool {
    !matches!(
        cause,
        bus::Error::NoAnswer | bus::Error::Port | bus::Error::Busy
    )
}

fn count(fault: Fault, counters: &mut Counters) {
    let counter = match fault {
        Fault::Zero => &mut counters.zero,
        Fault::NotUnit => &mut counters.not_unit,
        Fault::Restarted => &mut counters.restarted,
        Fault::TooFast => &mut counters.too_fast,
        Fault::Away => &mut counters.away,
        Fault::Frozen | Fault::AllFrozen => &mut counters.frozen,
        Fault::Twin => &mut counters.twins,
    };
    *counter = counter.wrapping_add(1);
}
