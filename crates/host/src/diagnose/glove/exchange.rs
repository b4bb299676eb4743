//! One exchange on any bus of the glove.

use std::time::Duration;

use glove::bus::{Batch, Bus, Error, Reply};

use crate::clock::Clock;
use crate::interrupt::Interrupt;

/// Pause between two looks.
const LOOK: Duration = Duration::from_millis(1);
/// Looks for one answer: longer than the port's own deadline.
const LOOKS: u32 = 200;

/// Makes a batch and waits for its end. `clock`: the one by which the bus was driven before, whose deadlines it has. What is
/// still under way there is waited for, and lost.
pub(super) fn exchange(
    bus: &mut impl Bus,
    batch: &Batch,
    clock: Clock,
    interrupt: &Interrupt,
) -> Result<Reply, Error> {
    let mut begun = false;
    for _ in 0..LOOKS {
        if !begun && bus.is_up() {
            match bus.start(batch, clock.now()) {
                Ok(()) => begun = true,
                Err(Error::Busy) => {}
                Err(error) => return Err(error),
            }
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
