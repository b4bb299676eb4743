//! Who did not answer for so long that another may be in its place is asked for its unique id before it is sampled again: a whole
//! glove behind a port that was away, or one sensor.

use super::BusScanner;
use super::sensor::Sensor;
use crate::Instant;
use crate::bus::Bus;
use crate::timing;

impl<B: Bus> BusScanner<B> {
    /// Has every sensor that was silent for too long asked who it is. True where one is still to be asked: no scan begins before.
    pub(super) fn ask_who_is_there(&mut self, now: Instant) -> bool {
        let baud = self.bus.line_baud().unwrap_or(self.config.baud);
        let longest = timing::EXCHANGE.max(timing::scan_gap(baud, self.config.period));
        for sensor in &mut self.sensors {
            if sensor.is_silent(now, longest) {
                sensor.ask_who(now);
            }
        }
        self.is_in_doubt()
    }

    /// Whether one is to be asked who it is, and was not yet.
    pub(super) fn is_in_doubt(&self) -> bool {
        self.sensors
            .iter()
            .any(|sensor: &Sensor| sensor.is_doubtful)
    }
}
