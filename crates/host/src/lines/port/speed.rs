//! The speed of an open port, changed without reopening it and without waiting.

use std::sync::atomic::Ordering;

use rustix::termios::{OptionalActions, QueueSelector, tcflush, tcgetattr, tcsetattr};

use super::Port;

impl Port {
    /// Sets the port's speed and throws away what waits at the old one; false where the system refuses it. A port that is
    /// away comes back at this speed.
    pub fn set_baud(&mut self, baud: u32) -> bool {
        self.shared.baud.store(baud, Ordering::Relaxed);
        let Ok(descriptor) = self.descriptor() else {
            return true;
        };
        let set = tcgetattr(descriptor).and_then(|mut settings| {
            settings.set_speed(baud)?;
            tcsetattr(descriptor, OptionalActions::Now, &settings)?;
            tcflush(descriptor, QueueSelector::IFlush)
        });
        set.is_ok()
    }
}
