//! What a virtual device looks like from its serial side.

use crate::Instant;

/// A device at the far end of a serial wire: bytes go in, bytes come out, time is an argument.
///
/// A [`crate::Line`] calls it: [`Device::receive`] at the moment a byte's stop bit has passed, and
/// [`Device::transmit`] after that and whenever [`Device::next_due`] comes. The device hands out
/// only bytes that it starts to send by `now`; the line gives each its time on the wire. Calls come
/// with times that never go back. No input may make a device panic.
pub trait Device: Send {
    /// Takes bytes that have completely arrived at `now`.
    fn receive(&mut self, bytes: &[u8], now: Instant);

    /// Fills `out` with bytes the device starts to send by `now`; returns how many.
    fn transmit(&mut self, now: Instant, out: &mut [u8]) -> usize;

    /// When the device will next have something to do or to send by itself.
    fn next_due(&self) -> Option<Instant>;

    /// The rate at which it now listens and speaks, in baud (8N1).
    fn baud(&self) -> u32;

    /// Told once per garbled character when the other side speaks at `client_baud`, not at ours.
    fn baud_seen(&mut self, client_baud: u32) {
        let _ = client_baud;
    }

    /// Told when a client opens the port, which nobody had open.
    fn opened(&mut self) {}
}

impl<D: Device + ?Sized> Device for Box<D> {
    fn receive(&mut self, bytes: &[u8], now: Instant) {
        (**self).receive(bytes, now);
    }

    fn transmit(&mut self, now: Instant, out: &mut [u8]) -> usize {
        (**self).transmit(now, out)
    }

    fn next_due(&self) -> Option<Instant> {
        (**self).next_due()
    }

    fn baud(&self) -> u32 {
        (**self).baud()
    }

    fn baud_seen(&mut self, client_baud: u32) {
        (**self).baud_seen(client_baud);
    }

    fn opened(&mut self) {
        (**self).opened();
    }
}
