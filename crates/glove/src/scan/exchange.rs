//! A glove that did not answer for so long that another may be in its place is asked for its sensors' unique ids before they are
//! sampled again. One sensor that is exchanged while others answer is missed by itself: `imu::bringup::Step::Recheck`.

use super::BusScanner;
use super::sensor::Sensor;
use crate::Instant;
use crate::bus::Bus;
use crate::timing::{self, since};

impl<B: Bus> BusScanner<B> {
    /// Where nothing has answered for too long, has every sensor asked who it is. True where one is still to be asked: no scan begins
    /// before.
    pub(super) fn ask_who_is_there(&mut self, now: Instant) -> bool {
        let baud = self.bus.line_baud().unwrap_or(self.config.baud);
        let longest = timing::EXCHANGE.max(timing::scan_gap(baud, self.config.period));
        if since(now, self.answered) > longest {
            let running = self.sensors.iter_mut().filter(|sensor| sensor.is_running());
            running.for_each(|sensor| sensor.ask_who(now));
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
