//! The hand's side of the supervisor: which map outputs are used, and how many came in a row.

use super::{HoldReason, limits};
use crate::{Duration, Instant, filter::OneEuro, timing};

/// One frame of the glove, as the supervisor sees it: what the map made of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hand<const X: usize> {
    /// Distinguishes frames: a new one has a new number.
    pub sequence: u32,
    /// Stamp of the oldest sample used.
    pub stamp: Instant,
    /// The map's output in counts, or why there is none.
    pub output: Result<[f32; X], HoldReason>,
}

/// An output further than this outside 0 to 255, in counts, is not believed: a whole stroke.
const OVERSHOOT: f32 = 255.0;

/// What is kept of the frames so far.
#[derive(Debug, Clone)]
pub(super) struct Follower<const X: usize> {
    filters: [OneEuro; X],
    sequence: Option<u32>,
    used: Option<Used<X>>,
    refused: Option<HoldReason>,
    run: u8,
}

/// The newest frame that was used.
#[derive(Debug, Clone, Copy)]
pub(super) struct Used<const X: usize> {
    /// Stamp of its oldest sample.
    pub stamp: Instant,
    /// Filtered, inside the configuration space.
    pub target: [f32; X],
}

impl<const X: usize> Follower<X> {
    pub fn new(settings: crate::filter::Settings) -> Self {
        Self {
            filters: [OneEuro::new(settings); X],
            sequence: None,
            used: None,
            refused: None,
            run: 0,
        }
    }

    /// Starts anew: nothing that was seen before counts.
    pub fn forget(&mut self) {
        for filter in &mut self.filters {
            filter.reset();
        }
        self.used = None;
        self.run = 0;
    }

    /// Takes the newest frame, if it is new.
    pub fn accept(&mut self, now: Instant, hand: &Hand<X>) {
        if self.sequence == Some(hand.sequence) {
            return;
        }
        self.sequence = Some(hand.sequence);
        match checked(hand) {
            Ok(output) => self.use_frame(now, hand.stamp, output),
            Err(reason) => {
                self.refused = Some(reason);
                self.run = 0;
            }
        }
    }

    fn use_frame(&mut self, now: Instant, stamp: Instant, output: [f32; X]) {
        if !timing::is_fresh(now, stamp) {
            self.run = 0;
            return;
        }
        let dt = match self.used {
            Some(before) => match stamp.checked_duration_since(before.stamp) {
                Some(dt) if dt <= timing::MAX_AGE => dt,
                Some(_) => {
                    self.forget();
                    Duration::from_ticks(0)
                }
                // Older than what was used already: not a fresh frame.
                None => return,
            },
            None => Duration::from_ticks(0),
        };
        let mut target = output;
        for (x, filter) in target.iter_mut().zip(&mut self.filters) {
            *x = filter.step(*x, dt).unwrap_or(*x);
        }
        self.used = Some(Used {
            stamp,
            target: limits::project(target),
        });
        self.refused = None;
        self.run = self.run.saturating_add(1);
    }

    /// The frame to follow, or why there is none. `wanted` fresh frames in a row are needed, none when already moving.
    pub fn follow(&mut self, now: Instant, wanted: u8) -> Result<Used<X>, HoldReason> {
        if let Some(reason) = self.refused
            && stops_at_once(reason)
        {
            self.run = 0;
            return Err(reason);
        }
        match self.used {
            Some(used) if timing::is_fresh(now, used.stamp) => {
                if self.run >= wanted {
                    Ok(used)
                } else {
                    Err(HoldReason::Settling)
                }
            }
            _ => {
                self.run = 0;
                Err(self.refused.unwrap_or(HoldReason::SamplesStale))
            }
        }
    }

    /// The newest target, fresh or not: for display.
    pub fn target(&self) -> Option<[f32; X]> {
        self.used.map(|used| used.target)
    }
}

/// A lost sensor may be one bad read: the last frame serves until it is too old. What the map refuses is no such thing.
fn stops_at_once(reason: HoldReason) -> bool {
    !matches!(reason, HoldReason::SensorsLost(_))
}

/// The map's output, if it can be believed.
fn checked<const X: usize>(hand: &Hand<X>) -> Result<[f32; X], HoldReason> {
    let output = hand.output?;
    if output
        .iter()
        .all(|x| (-OVERSHOOT..=255.0 + OVERSHOOT).contains(x))
    {
        Ok(output)
    } else {
        Err(HoldReason::OutputRefused)
    }
}
