//! A glove as the bridge on a chip reads it, scan by scan: what a guided calibration needs.
//!
//! Time is the chip's: a scan's stamps are as the chip gave them, and [`Scans::now`] goes on from the newest. What the line loses shows
//! in the scans' numbers and is counted. A bridge that ended the session, since it heard nothing for 2 s, is asked anew; one that
//! restarted is a failure, since its sensors' headings are others then.

use std::time::{Duration, Instant};

use bridge::protocol::message::{Refusal, Scan, Status};
use bridge::store::profile;
use glove::calibration::Bound;
use glove::hand::SEGMENT_COUNT;
use glove::imu::UniqueId;

use super::link::{Error, HostLink};
use crate::clock::{since, ticks};
use crate::interrupt::Interrupt;
use crate::scanning::Scanned;
use crate::stats::{Percentiles, Rate};

/// How often the bridge is asked what it is doing, which keeps the session.
const ASKED_EVERY: Duration = Duration::from_millis(500);
/// For that answer.
const ANSWER_WAIT: Duration = Duration::from_millis(200);
/// Without an answer and without a scan for so long, the bridge counts as silent.
const SILENT: Duration = Duration::from_secs(10);
/// How often a session may be begun anew.
const RENEWALS: u32 = 10;
/// All sensors, as a bit mask.
const ALL: u16 = u16::MAX;

/// The scans of one session.
#[derive(Debug)]
pub struct Scans {
    link: HostLink,
    ids: [Option<UniqueId>; SEGMENT_COUNT],
    /// A moment on the chip's clock, and when it was heard of.
    newest: (glove::Instant, Instant),
    /// When the bridge was asked last, and when anything came.
    asked: Instant,
    heard: Instant,
    renewals: u32,
    sequence: Option<u32>,
    last: Option<glove::Instant>,
    good: u16,
    lost: u64,
    rate: Rate,
    intervals: Percentiles,
}

/// What was counted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Counted {
    /// Scans.
    pub scans: u64,
    /// Scans that the line lost, or had no room for.
    pub lost: u64,
    /// Sensors with a good sample in the newest scan (bit k).
    pub good: u16,
    /// Scans a second, over the last second.
    pub rate: f64,
    /// Scans a second, from the first to the last.
    pub mean_rate: f64,
    /// From one scan to the next, µs: the median, what 99 of 100 stay within, the longest.
    pub interval_us: Option<[u64; 3]>,
}

impl Scans {
    /// Asks the bridge for scans.
    ///
    /// # Errors
    /// The clutch is closed; the bridge keeps no profiles; it is of before there were scans ([`Error::Lacks`]); the line's fault.
    pub fn start(mut link: HostLink) -> Result<Self, Error> {
        // A bridge of an older version is refused by name.
        link.health()?;
        let status = open(link.status()?)?;
        let ids = known(&mut link)?;
        match link.profile() {
            Err(error @ Error::Refused(Refusal::Profile(profile::Error::NoStore))) => {
                return Err(error);
            }
            // One that cannot be read is replaced.
            Ok(_) | Err(Error::Refused(_)) => {}
            Err(error) => return Err(error),
        }
        link.scans(true)?;
        let now = Instant::now();
        Ok(Self {
            link,
            ids,
            newest: (glove::Instant::from_ticks(status.now_us), now),
            asked: now,
            heard: now,
            renewals: 0,
            sequence: None,
            last: None,
            good: 0,
            lost: 0,
            rate: Rate::default(),
            intervals: Percentiles::default(),
        })
    }

    /// The sensors' unique ids, as they are wired.
    pub fn ids(&self) -> &[Option<UniqueId>; SEGMENT_COUNT] {
        &self.ids
    }

    /// The time on the chip's clock.
    pub fn now(&self) -> glove::Instant {
        let (at, heard) = self.newest;
        at.checked_add_duration(ticks(heard.elapsed()))
            .unwrap_or(at)
    }

    /// The next scan, waited for by `time` at most, or a little longer where the bridge is asked meanwhile.
    ///
    /// # Errors
    /// The clutch was closed, the bridge restarted or is silent for 10 s, the line broke.
    pub fn next(&mut self, time: Duration) -> Result<Option<Scanned>, Error> {
        let end = Instant::now() + time;
        if self.asked.elapsed() >= ASKED_EVERY {
            self.ask()?;
        }
        while let Some(scan) = self.link.next_scan(end)? {
            self.heard = Instant::now();
            if let Some(scanned) = self.take(&scan) {
                return Ok(Some(scanned));
            }
        }
        if self.heard.elapsed() > SILENT {
            return Err(Error::Silent {
                address: self.link.address().clone(),
                attempts: (SILENT.as_millis() / ASKED_EVERY.as_millis()) as u32,
                heard: self.link.heard(),
            });
        }
        Ok(None)
    }

    /// Waits until all sensors give samples, by `time` at most, and less where the end is asked for. Those that do (bit k).
    ///
    /// # Errors
    /// As [`Scans::next`].
    pub fn wait(&mut self, time: Duration, interrupt: &Interrupt) -> Result<u16, Error> {
        let end = Instant::now() + time;
        while self.good != ALL && Instant::now() < end && !interrupt.asked() {
            self.next(ASKED_EVERY)?;
        }
        if self.good == ALL {
            // Sensors that came up last were read last.
            self.ids = self.link.sensor_ids()?;
        }
        Ok(self.good)
    }

    /// `None` where no sensor gave anything, or the scan is older than the newest.
    fn take(&mut self, scan: &Scan) -> Option<Scanned> {
        let gone = match self.sequence {
            Some(before) => scan.sequence.wrapping_sub(before).wrapping_sub(1),
            None => 0,
        };
        if gone > u32::MAX / 2 {
            return None;
        }
        self.sequence = Some(scan.sequence);
        self.lost += u64::from(gone);
        self.good = scan.good;
        let frame = scan.frame();
        let good = frame.samples.iter().filter(|s| s.health.is_good());
        let at = good.map(|sample| sample.stamp).max()?;
        self.newest = (at, self.heard);
        self.rate.add(at.as_ticks());
        if let Some(before) = self.last.replace(at) {
            self.intervals.add(since(at, before).as_ticks());
        }
        Some(Scanned {
            frame,
            at,
            starts: scan.starts,
            ids: self.ids,
        })
    }

    /// Keeps the session, and looks whether the clutch is open still.
    fn ask(&mut self) -> Result<(), Error> {
        self.asked = Instant::now();
        match self.link.status_by(self.asked + ANSWER_WAIT) {
            Ok(None) => return Ok(()),
            Ok(Some(status)) => open(status).map(drop)?,
            Err(Error::Refused(Refusal::NoSession)) if self.renewals < RENEWALS => {
                self.renewals += 1;
                self.link.renew()?;
                let status = open(self.link.status()?)?;
                let (newest, _) = self.newest;
                if status.now_us < newest.as_ticks() {
                    return Err(Error::Restarted);
                }
                self.link.scans(true)?;
            }
            Err(error) => return Err(error),
        }
        self.heard = Instant::now();
        Ok(())
    }

    /// Forgets what was counted, and the scans that wait.
    ///
    /// # Errors
    /// As [`Scans::next`].
    pub fn begin(&mut self) -> Result<(), Error> {
        self.link.listen_for_scans(Duration::ZERO)?;
        (self.sequence, self.last, self.lost) = (None, None, 0);
        self.rate = Rate::default();
        self.intervals = Percentiles::default();
        Ok(())
    }

    /// What was counted since.
    pub fn counted(&self) -> Counted {
        let [median, most, longest] = [
            self.intervals.at(0.5),
            self.intervals.at(0.99),
            self.intervals.longest(),
        ];
        Counted {
            scans: self.rate.count(),
            lost: self.lost,
            good: self.good,
            rate: self.rate.clone().now(self.now().as_ticks()),
            mean_rate: self.rate.mean(),
            interval_us: median.zip(most).zip(longest).map(|((a, b), c)| [a, b, c]),
        }
    }

    /// The profile that the bridge keeps; `None` where it keeps none.
    ///
    /// # Errors
    /// As [`HostLink::profile`].
    pub fn profile(&mut self) -> Result<Option<Bound>, Error> {
        self.link.profile()
    }

    /// Ends the scans, and gives the line back.
    ///
    /// # Errors
    /// The line's fault.
    pub fn stop(mut self) -> Result<HostLink, Error> {
        match self.link.scans(false) {
            // Then they have ended, and whoever uses the line next begins a session.
            Ok(()) => {}
            Err(Error::Refused(Refusal::NoSession)) => self.link.renew()?,
            Err(error) => return Err(error),
        }
        Ok(self.link)
    }
}

/// A status, where the clutch is open.
fn open(status: Status) -> Result<Status, Error> {
    match status.engaged {
        true => Err(Error::Refused(Refusal::Engaged)),
        false => Ok(status),
    }
}

/// Who the sensors are. Firmware of before there were scans knows neither, and gives no answer to what it does not know.
fn known(link: &mut HostLink) -> Result<[Option<UniqueId>; SEGMENT_COUNT], Error> {
    match link.sensor_ids() {
        Err(error @ Error::Silent { .. }) => match link.status() {
            Ok(_) | Err(Error::Refused(_)) => Err(Error::Lacks {
                what: "a glove's scans",
            }),
            Err(_) => Err(error),
        },
        ids => ids,
    }
}
