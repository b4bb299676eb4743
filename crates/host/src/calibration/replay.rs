//! A recorded session run through: the calibration from its bytes, then the rest of it.

use glove::calibration::{Align, Outcome, Reads, Session, Step};
use glove::hand::{JOINT_COUNT, SEGMENT_COUNT};
use glove::headings::{Config, Headings, PoseReport, Reading};
use glove::scan::Frame;

use super::recorded::{Prompt, Recorded, Row};
use crate::failure::Failure;

/// A sensor that started anew.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Restart {
    /// As it is wired.
    pub sensor: usize,
    /// When it was back.
    pub at: glove::Instant,
}

/// A joint that was held while the hand was in use.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Held {
    /// Which.
    pub joint: usize,
    /// The first scan of it.
    pub from: glove::Instant,
    /// The first scan after it, or the last of the recording.
    pub until: glove::Instant,
}

/// What came of it.
#[derive(Debug, Clone)]
pub struct Replay {
    /// The calibration.
    pub outcome: Outcome,
    /// For each row of the recording: what it says, once the glove is calibrated.
    pub readings: Vec<Option<Reading>>,
    /// Sensors that started anew after their first start.
    pub restarts: Vec<Restart>,
    /// Joints that were held after the calibration.
    pub held: Vec<Held>,
    /// Flat poses taken after the calibration, and when.
    pub poses: Vec<(glove::Instant, PoseReport)>,
    /// Reads whose bit 15 was put back.
    pub repaired: u32,
    /// Reads that were not used.
    pub dropped: u32,
}

/// Runs a recording through.
///
/// # Errors
/// The calibration came to nothing; what is missing is named.
pub fn replay(recorded: &Recorded, config: Config) -> anyhow::Result<Replay> {
    let mut run = Run::new(config);
    let mut readings = Vec::with_capacity(recorded.rows.len());
    for row in &recorded.rows {
        let prompt = recorded
            .windows
            .iter()
            .filter(|window| window.holds(row.at))
            .map(|window| window.prompt)
            // A flat pose lies within the use.
            .min_by_key(|prompt| matches!(prompt, Prompt::Use | Prompt::Other));
        readings.push(run.take(row, prompt)?);
    }
    run.finish(readings)
}

struct Run {
    config: Config,
    reads: Reads,
    starts: [u16; SEGMENT_COUNT],
    align: Align,
    session: Session,
    at: glove::Instant,
    calibrated: Option<(Outcome, Headings)>,
    asked: bool,
    restarts: Vec<Restart>,
    poses: Vec<(glove::Instant, PoseReport)>,
}

impl Run {
    fn new(config: Config) -> Self {
        Self {
            config,
            reads: Reads::new(),
            starts: [0; SEGMENT_COUNT],
            align: Align::new(),
            session: Session::new(),
            at: glove::Instant::from_ticks(0),
            calibrated: None,
            asked: false,
            restarts: Vec::new(),
            poses: Vec::new(),
        }
    }

    fn take(&mut self, row: &Row, prompt: Option<Prompt>) -> anyhow::Result<Option<Reading>> {
        let reads = std::array::from_fn(|k| (row.reads[k], row.stamp(k)));
        let frame = self.reads.frame(&reads);
        self.see_restarts(&frame);
        let scan = self.align.take(&frame);
        self.at = scan.at;
        match prompt {
            Some(Prompt::Calibration(step)) if self.calibrated.is_none() => {
                if self.session.step() != Some(step) {
                    self.session.begin(step);
                }
                self.session.take(&scan);
                return Ok(None);
            }
            _ => self.end_step()?,
        }
        let Some((_, headings)) = &mut self.calibrated else {
            return Ok(None);
        };
        let asked = prompt == Some(Prompt::FlatInUse);
        if asked && !self.asked {
            headings.begin_flat();
        }
        let reading = headings.take(&scan);
        if self.asked && !asked {
            // Refused: the person did not lie flat, and it goes on with what it has.
            if let Ok(report) = headings.end_flat(scan.at) {
                self.poses.push((scan.at, report));
            }
        }
        self.asked = asked;
        self.poses
            .extend(reading.pose.map(|report| (scan.at, report)));
        Ok(Some(reading))
    }

    fn see_restarts(&mut self, frame: &Frame) {
        for k in 0..SEGMENT_COUNT {
            let (before, now) = (self.starts[k], self.reads.starts[k]);
            if before == now {
                continue;
            }
            self.starts[k] = now;
            if before == 0 {
                continue;
            }
            let at = frame.samples[k].stamp;
            self.restarts.push(Restart { sensor: k, at });
            self.align.forget(k);
            match &mut self.calibrated {
                Some((_, headings)) => headings.restarted(k, at),
                None => self.session.restarted(k),
            }
        }
    }

    /// Between two steps; after the last one the glove is calibrated.
    fn end_step(&mut self) -> anyhow::Result<()> {
        let last = self.session.step() == Some(Step::LastFlat);
        self.session.end();
        if last && self.calibrated.is_none() {
            let outcome = self.session.finish().map_err(|unfinished| {
                Failure::new(
                    format!("the calibration came to nothing: {unfinished}"),
                    "a session with all its steps: flat1, turn, flat2, one0 to one4, fist, thumb, free, flat3",
                )
            })?;
            let headings = Headings::start(&outcome, self.at, self.config);
            self.calibrated = Some((outcome, headings));
        }
        Ok(())
    }

    fn finish(mut self, readings: Vec<Option<Reading>>) -> anyhow::Result<Replay> {
        // The recording may end with the last flat pose.
        self.end_step()?;
        let Some((outcome, _)) = self.calibrated else {
            return Err(Failure::new(
                "the recording has no flat3, with which a calibration ends",
                "look at prompts.csv",
            )
            .into());
        };
        Ok(Replay {
            outcome,
            held: held(&readings),
            readings,
            restarts: self.restarts,
            poses: self.poses,
            repaired: self.reads.repaired,
            dropped: self.reads.dropped,
        })
    }
}

/// Each stretch of scans in which a joint was held.
fn held(readings: &[Option<Reading>]) -> Vec<Held> {
    let mut all: Vec<Held> = Vec::new();
    for joint in 0..JOINT_COUNT {
        let mut from = None;
        for reading in readings.iter().flatten() {
            let is_held = reading.held >> joint & 1 == 1;
            match (from, is_held) {
                (None, true) => from = Some(reading.at),
                (Some(begun), false) => {
                    all.push(Held {
                        joint,
                        from: begun,
                        until: reading.at,
                    });
                    from = None;
                }
                _ => {}
            }
        }
        if let (Some(from), Some(last)) = (from, readings.iter().flatten().last()) {
            all.push(Held {
                joint,
                from,
                until: last.at,
            });
        }
    }
    all.sort_by_key(|held| held.from);
    all
}
