//! What the bridge needs from its home: a microcontroller's board, a PC, or a test's virtual clock.

use crate::Instant;
use embedded_storage::nor_flash::NorFlash;
use glove::bus::Bus;
use gripper::Gripper;

/// The clock, and a way to sleep.
pub trait Platform {
    /// The time now. It never runs backwards; its origin is the platform's choice.
    fn now(&mut self) -> Instant;

    /// Sleeps until `due`, or until a port has bytes or room again, whichever comes first. Waking early is always right.
    fn wait_until(&mut self, due: Instant);
}

/// A home of the bridge: its clock, and the kind of each device that is connected to it. `X` is the gripper's number of
/// axes; a machine can be a board for several.
///
/// A board is one value with the clock ([`Platform`]); the devices themselves are handed to [`crate::App::new`], which
/// owns them from then on.
pub trait Board<const X: usize>: Platform {
    /// The bus of the glove's sensors: [`glove::sc18im::Sc18im`] on a serial port, or another way to them. It never waits.
    type Glove: Bus;
    /// The gripper, whatever line it is on.
    type Gripper: Gripper<X>;
    /// A slot of the weights store.
    type Flash: Slot;
}

/// One of the two places a weights image can live in: flash of its own, which can also be read as memory.
///
/// `mapped` starts at an address that is a multiple of 64 and shows `capacity()` bytes; after `write` or `erase` returned
/// it shows what the flash holds. Erased bytes read 0xFF.
pub trait Slot: NorFlash {
    /// The whole slot as memory.
    fn mapped(&self) -> &[u8];
}
