//! One exchange on any bus of the glove.

use std::time::Duration;

use glove::bus::{Batch, Bus, Error, Reply};

use crate::clock::Clock;
use crate::interrupt::Interrupt;

/// Pause between two looks.
const LOOK: Duration = Duration::from_millis(1);
/// Looks for one answer: longer than the port's own deadline.
const LOOKS: u32 = 200;

/// Makes a batch and waits for its end.
pub(super) fn exchange(
    bus: &mut impl Bus,
    batch: &Batch,
    interrupt: &Interrupt,
) -> Result<Reply, Error> {
    let clock = Clock::start();
    let mut begun = false;
    for _ in 0..LOOKS {
        if !begun && bus.is_up() {
            bus.start(batch, clock.now())?;
            begun = true;
        }
        if let Some(result) = bus.poll(clock.now()).filter(|_| begun) {
            return result;
        }
        if interrupt.sleep(LOOK) {
            break;
        }
    }
    Err(Error::NoAnswer)
}
