//! Next day: the glove sits as before, and one flat pose of 2 s gives the headings, and shows whether a sensor has slipped since.

use glove::calibration::{Align, Profile, checks};
use glove::hand::{SEGMENT_COUNT, SEGMENT_NAMES};
use glove::headings::{Config, FLAT_FOR, Headings, NotFlat, PoseReport};
use glove::scan::Frame;
use glove::{Duration, Instant};

use super::Remark;
use super::judged::Finding;
use super::limits::{FLAT_SCANS, STILL};
use super::watch::Watch;
use crate::calibration::report::word;
use crate::clock::since;

/// From when it is asked for until it counts: time to lay the hand down.
const SETTLES: Duration = Duration::from_ticks(2_000_000);

/// One flat pose with a profile.
#[derive(Debug, Clone)]
pub struct FlatPose {
    align: Align,
    headings: Headings,
    starts: Option<[u16; SEGMENT_COUNT]>,
    watch: Watch,
    began: Instant,
    counting: bool,
    ended: Option<PoseEnd>,
}

/// How it ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PoseEnd {
    /// Taken.
    Taken(PoseReport),
    /// The hand did not lie still, or too little of it was seen.
    Moved(Remark),
    /// A segment was not flat, or its sensor was away.
    NotFlat(NotFlat),
}

impl FlatPose {
    /// Asks for it now.
    pub fn new(profile: &Profile, now: Instant) -> Self {
        let config = Config {
            finds_flat: false,
            ..Config::default()
        };
        Self {
            align: Align::new(),
            headings: Headings::new(profile, config),
            starts: None,
            watch: Watch::new(),
            began: now,
            counting: false,
            ended: None,
        }
    }

    /// Time until it counts, then until it is over.
    pub fn left(&self, now: Instant) -> (bool, Duration) {
        let from = self.began + SETTLES;
        if now < from {
            (false, since(from, now))
        } else {
            (true, since(from + FLAT_FOR, now))
        }
    }

    /// Takes a scan.
    pub fn take(&mut self, frame: &Frame, starts: &[u16; SEGMENT_COUNT]) {
        let before = self.starts.replace(*starts).unwrap_or(*starts);
        for k in (0..SEGMENT_COUNT).filter(|&k| before[k] != starts[k]) {
            self.align.forget(k);
        }
        let scan = self.align.take(frame);
        let from = self.began + SETTLES;
        let counts = scan.at >= from && scan.at < from + FLAT_FOR && self.ended.is_none();
        if counts && !self.counting {
            self.counting = true;
            self.headings.begin_flat();
        }
        self.watch.take(&scan, counts);
        if counts || !self.counting {
            self.headings.take(&scan);
        }
    }

    /// What is seen now.
    pub fn remark(&self) -> Option<Remark> {
        self.watch.moving().map(Remark::Moves)
    }

    /// Lets the time go on; says how it ended once it has.
    pub fn pass(&mut self, now: Instant) -> Option<PoseEnd> {
        if self.ended.is_none() && now >= self.began + SETTLES + FLAT_FOR {
            self.ended = Some(self.end(now));
        }
        self.ended
    }

    fn end(&mut self, now: Instant) -> PoseEnd {
        if self.watch.scans < FLAT_SCANS {
            return PoseEnd::Moved(Remark::FewScans(self.watch.scans));
        }
        if let Some(k) = self.watch.unsteady(STILL) {
            return PoseEnd::Moved(Remark::Strayed(k, self.watch.strayed[k]));
        }
        match self.headings.end_flat(now) {
            Ok(report) => PoseEnd::Taken(report),
            Err(not_flat) => PoseEnd::NotFlat(not_flat),
        }
    }
}

/// What a flat pose shows of the sensors: those that lie otherwise than when the glove was calibrated.
pub fn slipped(report: &PoseReport) -> Vec<Finding> {
    let limit = |k: usize| checks::tilt_limit(k);
    let tilted = (0..SEGMENT_COUNT).filter(|&k| report.tilt[k] > limit(k));
    tilted
        .map(|k| Finding {
            verdict: word(glove::calibration::Verdict::Bad),
            segment: Some(SEGMENT_NAMES[k]),
            what: format!(
                "{} lies {:.0}° tilted against how it was calibrated ({:.0}° is the most)",
                SEGMENT_NAMES[k],
                report.tilt[k].to_degrees(),
                limit(k).to_degrees()
            ),
            todo: "the flat pose again with that finger straight; if it stays, its sensor slipped: press it on and calibrate anew"
                .to_owned(),
        })
        .collect()
}
