//! The speed of an open port, changed without reopening it and without waiting.

use std::sync::atomic::Ordering;

use glove::sc18im::{BaudRefused, SetBaud};
use rustix::termios::{OptionalActions, QueueSelector, tcflush, tcgetattr, tcsetattr};

use super::Port;

/// A UART understands another whose speed differs by less than this many per mille.
const TOLERANCE: u64 = 30;

impl SetBaud for Port {
    /// Throws away what waits at the old speed. A port that is away comes back at this one.
    fn set_baud(&mut self, baud: u32) -> Result<(), BaudRefused> {
        let refused = BaudRefused::Unsupported(baud);
        if let Ok(descriptor) = self.descriptor() {
            let before = tcgetattr(descriptor).map_err(|_| refused)?;
            let mut settings = before.clone();
            settings.set_speed(baud).map_err(|_| refused)?;
            let now = OptionalActions::Now;
            tcsetattr(descriptor, now, &settings).map_err(|_| refused)?;
            // A driver may take the nearest it can make, and says so.
            let made = tcgetattr(descriptor).map_or(baud, |made| made.output_speed());
            if u64::from(made.abs_diff(baud)) * 1_000 > TOLERANCE * u64::from(baud) {
                let _ = tcsetattr(descriptor, now, &before);
                return Err(refused);
            }
            let _ = tcflush(descriptor, QueueSelector::IFlush);
        }
        self.shared.baud.store(baud, Ordering::Relaxed);
        Ok(())
    }
}
