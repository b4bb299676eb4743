//! What only the sensors together tell, at the end of each scan, and what of it is worth telling a person.

use super::sensor::Return;
use super::{BusScanner, FINDINGS_MAX, Finding};
use crate::Instant;
use crate::imu::Fault;

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
        self.tell_returns();
    }

    /// Those that jumped are told one by one; those that were away together.
    fn tell_returns(&mut self) {
        let (mut segments, mut farthest) = (0, 0.0);
        for k in 0..self.sensors.len() {
            let Some(Return { by, was_away }) =
                self.sensors.get_mut(k).and_then(|s| s.returned.take())
            else {
                continue;
            };
            if was_away {
                segments |= 1 << k;
                farthest = if by > farthest { by } else { farthest };
            } else {
                self.counters.jumps = self.counters.jumps.wrapping_add(1);
                self.tell(Finding::Jumped {
                    segment: k as u8,
                    by,
                });
            }
        }
        if segments != 0 {
            self.tell(Finding::Returned {
                segments,
                by: farthest,
            });
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
