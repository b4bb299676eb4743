//! What the bridge needs from the machine it runs on.

use crate::Instant;
use embedded_storage::nor_flash::NorFlash;

/// The clock, and a way to sleep.
pub trait Platform {
    /// The time now. It never runs backwards; its origin is the platform's choice.
    fn now(&mut self) -> Instant;

    /// Sleeps until `due`, or until a port has bytes or room again, whichever comes first. Waking early is always right.
    fn wait_until(&mut self, due: Instant);
}

/// One of the two places a weights image can live in: flash of its own, which can also be read as memory.
///
/// `mapped` starts at an address that is a multiple of 64 and shows `capacity()` bytes; after `write` or `erase` returned
/// it shows what the flash holds. Erased bytes read 0xFF.
pub trait Slot: NorFlash {
    /// The whole slot as memory.
    fn mapped(&self) -> &[u8];
}
