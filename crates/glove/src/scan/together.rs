//! What only the sensors together tell, at the end of each scan, and what of it is worth telling a person.

use super::sensor::Sensor;
use super::suspect::{Cause, Return};
use super::{BusScanner, FINDINGS_MAX, Finding};
use crate::hand::{self, SEGMENT_COUNT};
use crate::imu::Fault;
use crate::timing;
use crate::{Duration, Instant};

/// Sensors that are told together.
#[derive(Default)]
struct Together {
    /// Their segments (bit k: segment k).
    segments: u16,
    /// How far the farthest is off, radians.
    by: f32,
}

impl Together {
    fn add(&mut self, segment: usize, by: f32) {
        self.segments |= 1 << segment;
        self.by = if by > self.by { by } else { self.by };
    }
}

impl<B> BusScanner<B> {
    /// Withdraws the samples of this scan that one sensor alone could not be refused for.
    pub(super) fn judge_together(&mut self, now: Instant) {
        let twins = self.twins.check(&self.sensors, self.frozen.lively());
        if let Some(channels) = twins.new {
            self.tell(Finding::Twins { channels });
        }
        for (k, sensor) in self.sensors.iter_mut().enumerate() {
            sensor.is_twin = twins.sensors >> k & 1 == 1;
            if sensor.is_twin {
                sensor.withdraw(Fault::Twin, now, &mut self.counters);
            }
        }
        let found = self.frozen.check(&self.sensors, now);
        if found.all {
            self.tell(Finding::AllFrozen);
        }
        for k in 0..self.sensors.len() {
            let alone = found.frozen >> k & 1 == 1;
            let Some(sensor) = self.sensors.get_mut(k) else {
                continue;
            };
            if found.all {
                sensor.withdraw(Fault::AllFrozen, now, &mut self.counters);
            } else if alone && sensor.withdraw(Fault::Frozen, now, &mut self.counters) {
                self.tell(Finding::Frozen { segment: k as u8 });
            }
        }
        let longest = timing::scan_gap(self.config.baud, self.config.period);
        self.compare_neighbours(longest);
        self.tell_returns();
    }

    /// Where a segment and the one beside it turned in the same gap between scans, the hand moved, and neither sensor jumped.
    fn compare_neighbours(&mut self, longest: Duration) {
        let turned: [_; SEGMENT_COUNT] =
            core::array::from_fn(|k| self.sensors.get(k).and_then(Sensor::turned_in_gap));
        for k in 0..SEGMENT_COUNT {
            let Some(parent) = hand::parent(k) else {
                continue;
            };
            for (one, other) in [(k, parent), (parent, k)] {
                let along = turned.get(other).copied().flatten();
                if let (Some(along), Some(sensor)) = (along, self.sensors.get_mut(one)) {
                    sensor.went_along(along, longest);
                }
            }
        }
    }

    /// Those that jumped are told one by one; those that were away, and those of a gap, together.
    fn tell_returns(&mut self) {
        let (mut away, mut after) = (Together::default(), Together::default());
        let mut gap_us = 0;
        for k in 0..self.sensors.len() {
            let Some(Return { by, cause }) =
                self.sensors.get_mut(k).and_then(|s| s.returned.take())
            else {
                continue;
            };
            match cause {
                Cause::Away => away.add(k, by),
                Cause::Gap {
                    pause_us,
                    beyond,
                    joined,
                } if joined || !beyond => {
                    after.add(k, by);
                    gap_us = gap_us.max(pause_us);
                }
                Cause::Jump | Cause::Gap { .. } => {
                    self.counters.jumps = self.counters.jumps.wrapping_add(1);
                    self.tell(Finding::Jumped {
                        segment: k as u8,
                        by,
                    });
                }
            }
        }
        if let Together {
            segments: segments @ 1..,
            by,
        } = away
        {
            self.tell(Finding::Returned { segments, by });
        }
        if let Together {
            segments: segments @ 1..,
            by,
        } = after
        {
            let gap = Duration::from_ticks(gap_us.into());
            self.tell(Finding::AfterGap { segments, by, gap });
        }
    }

    /// Keeps a finding for whoever asks.
    pub(super) fn tell(&mut self, finding: Finding) {
        if self.findings.len() == FINDINGS_MAX {
            self.findings.pop_front();
            self.counters.findings_lost = self.counters.findings_lost.wrapping_add(1);
        }
        // There is room now.
        let _ = self.findings.push_back(finding);
    }
}
