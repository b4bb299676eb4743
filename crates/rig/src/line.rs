//! One serial line with a device at its end: queues, byte times, and noise at a wrong baud.
//!
//! Used by the in-memory wire on a virtual clock and by the pseudo-terminal on the real one.

use std::collections::VecDeque;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::{Device, Instant};

/// Bits a character takes on the line: start, 8 data, stop.
const BITS_PER_CHARACTER: u64 = 10;
/// Bytes the client's side holds before it refuses more, as a kernel's buffer does.
const QUEUE: usize = 4096;
/// Two UARTs understand each other when their rates differ by less than this many per mille.
const BAUD_TOLERANCE: u64 = 30;
/// Rate of a character during which its sender changed its own.
const TORN: u32 = 0;
/// Out of four garbled characters, about one comes back as noise.
const NOISE_ONE_IN: u32 = 4;

/// A character in flight, with the moment (ns) its last bit has passed.
struct Flying {
    arrival: u64,
    byte: u8,
    /// Rate at which it was sent.
    baud: u32,
}

/// A device, the wire to it, and the client's UART at this end.
///
/// Times are kept in nanoseconds inside, so that 21.7 µs characters do not drift.
pub struct Line<D> {
    device: D,
    baud: u32,
    to_device: VecDeque<Flying>,
    to_client: VecDeque<Flying>,
    client_busy: u64,
    device_busy: u64,
    noise: ChaCha8Rng,
    sent: u64,
    received: u64,
    /// Characters that have passed, both ways.
    passed: u64,
    /// The wire is cut when this many have passed.
    cut_at: Option<u64>,
}

impl Flying {
    /// When its first bit began.
    fn began(&self) -> u64 {
        self.arrival.saturating_sub(character_ns(self.baud))
    }
}

/// The sender of `queue` changes its rate at `now`: what has not begun goes out at the new one, the character under way is
/// at no rate. Returns when the last bit leaves.
fn retime(queue: &mut VecDeque<Flying>, baud: u32, now: u64) -> u64 {
    let mut busy = now;
    for flying in queue.iter_mut().filter(|f| f.arrival > now) {
        if flying.began() < now {
            flying.baud = TORN;
        } else {
            flying.arrival = busy + character_ns(baud);
            flying.baud = baud;
        }
        busy = flying.arrival;
    }
    busy
}

/// Time of one character in ns at `baud`.
pub(crate) fn character_ns(baud: u32) -> u64 {
    BITS_PER_CHARACTER * 1_000_000_000 / u64::from(baud.max(1))
}

fn ns(t: Instant) -> u64 {
    t.as_ticks().saturating_mul(1_000)
}

/// The first whole microsecond at which something of `ns` has happened.
fn instant(ns: u64) -> Instant {
    Instant::from_ticks(ns.div_ceil(1_000))
}

fn same_rate(a: u32, b: u32) -> bool {
    u64::from(a.abs_diff(b)) * 1_000 <= BAUD_TOLERANCE * u64::from(a.max(b))
}

impl<D: Device> Line<D> {
    /// A line to `device`; the client's UART runs at `baud`.
    pub fn new(device: D, baud: u32) -> Self {
        Self {
            device,
            baud,
            to_device: VecDeque::new(),
            to_client: VecDeque::new(),
            client_busy: 0,
            device_busy: 0,
            noise: ChaCha8Rng::seed_from_u64(0x004E_4F49_5345),
            sent: 0,
            received: 0,
            passed: 0,
            cut_at: None,
        }
    }

    /// The client's rate, in baud.
    pub fn baud(&self) -> u32 {
        self.baud
    }

    /// Sets the client's rate at `now`, as a UART's: what was written and has not begun to leave goes out at the new rate, and
    /// the character under way is torn, each way. Time must have been run up to `now`.
    pub fn set_baud(&mut self, baud: u32, now: Instant) {
        let baud = baud.max(1);
        if baud == self.baud {
            return;
        }
        self.baud = baud;
        self.client_busy = retime(&mut self.to_device, baud, ns(now));
        for flying in self.to_client.iter_mut().filter(|f| f.arrival > ns(now)) {
            if flying.began() < ns(now) || !same_rate(flying.baud, baud) {
                let [garbled, ..] = self.noise.next_u32().to_le_bytes();
                flying.byte = garbled;
            }
        }
    }

    /// The device at the end.
    pub fn device(&self) -> &D {
        &self.device
    }

    /// The device at the end.
    pub fn device_mut(&mut self) -> &mut D {
        &mut self.device
    }

    /// Bytes the client has sent, and bytes that have come back to it.
    pub fn traffic(&self) -> (u64, u64) {
        (self.sent, self.received)
    }

    /// Characters that have passed, both ways together, each counted when it leaves its sender's hands: for the device's
    /// that is when it begins to answer.
    pub fn passed(&self) -> u64 {
        self.passed
    }

    /// Cuts the wire when `count` more characters have passed: those after them are lost, both ways, and nobody is told.
    pub fn cut_after(&mut self, count: u64) {
        self.cut_at = Some(self.passed.saturating_add(count));
    }

    /// Whether the wire has been cut.
    pub fn is_cut(&self) -> bool {
        self.cut_at.is_some_and(|at| self.passed >= at)
    }

    /// Counts one character; `false` where it is lost in a cut.
    fn pass(&mut self) -> bool {
        let passes = !self.is_cut();
        self.passed += u64::from(passes);
        passes
    }

    /// Takes what fits of `bytes` into the client's send queue at `now`; returns how many.
    pub fn write(&mut self, bytes: &[u8], now: Instant) -> usize {
        self.run_until(now);
        let count = bytes.len().min(self.room());
        for &byte in bytes.iter().take(count) {
            self.client_busy = self.client_busy.max(ns(now)) + character_ns(self.baud);
            self.to_device.push_back(Flying {
                arrival: self.client_busy,
                byte,
                baud: self.baud,
            });
        }
        self.sent += count as u64;
        count
    }

    /// How many bytes the client's send queue still takes.
    pub fn room(&self) -> usize {
        QUEUE.saturating_sub(self.to_device.len())
    }

    /// Whether bytes are on their way to the client.
    pub fn is_sending(&self) -> bool {
        !self.to_client.is_empty()
    }

    /// How many bytes have arrived at the client by `now`.
    pub fn available(&mut self, now: Instant) -> usize {
        self.run_until(now);
        self.to_client.partition_point(|f| f.arrival <= ns(now))
    }

    /// Moves bytes that have arrived by `now` into `out`; returns how many.
    pub fn read(&mut self, out: &mut [u8], now: Instant) -> usize {
        let count = self.available(now).min(out.len());
        for (slot, flying) in out.iter_mut().zip(self.to_client.drain(..count)) {
            *slot = flying.byte;
        }
        self.received += count as u64;
        count
    }

    /// Forgets everything in flight and unread, as a pulled plug does.
    pub fn clear(&mut self) {
        self.to_device.clear();
        self.to_client.clear();
    }

    /// The next moment after `after` worth waking for: the end of what is now on its way to the
    /// client, the end of what is on its way to the device, or the device's own next act.
    ///
    /// Bursts are not cut into single characters: whoever wakes finds all of them.
    pub fn next_event(&mut self, after: Instant) -> Option<Instant> {
        self.run_until(after);
        let queues = [self.to_client.back(), self.to_device.back()];
        let flights = queues.into_iter().flatten().map(|f| instant(f.arrival));
        flights
            .chain(self.device.next_due())
            .filter(|t| *t > after)
            .min()
    }

    /// Lets everything happen, in order, that happens by `now`.
    pub fn run_until(&mut self, now: Instant) {
        let mut idle_due = None;
        loop {
            let byte = self.to_device.front().map(|f| instant(f.arrival));
            let due = self.device.next_due().filter(|d| Some(*d) != idle_due);
            let byte_first = byte.is_some_and(|b| due.is_none_or(|d| b <= d));
            if byte_first {
                if byte.is_none_or(|b| b > now) {
                    return;
                }
                let Some(flying) = self.to_device.pop_front() else {
                    return;
                };
                let before = self.device.baud();
                self.deliver(&flying);
                if self.device.baud() != before {
                    self.device_retuned(flying.arrival);
                }
                self.collect(instant(flying.arrival));
                idle_due = None;
            } else if let Some(at) = due.filter(|d| *d <= now) {
                // A device that stays due without sending must not hold the line for ever.
                if self.collect(at) == 0 && self.device.next_due() == Some(at) {
                    idle_due = Some(at);
                }
            } else {
                return;
            }
        }
    }

    fn deliver(&mut self, flying: &Flying) {
        let at = instant(flying.arrival);
        if !self.pass() {
            return;
        }
        if same_rate(flying.baud, self.device.baud()) {
            self.device.receive(&[flying.byte], at);
            return;
        }
        if flying.baud != TORN {
            self.device.baud_seen(flying.baud);
        }
        let draw = self.noise.next_u32();
        let [garbled, noise, ..] = draw.to_le_bytes();
        self.device.receive(&[garbled], at);
        if (draw >> 16).is_multiple_of(NOISE_ONE_IN) {
            self.send_to_client(noise, at);
        }
    }

    /// The device took another rate at `at`: what it has not sent goes out at that, and its character under way is torn.
    fn device_retuned(&mut self, at: u64) {
        let (rate, client) = (self.device.baud(), self.baud);
        self.device_busy = retime(&mut self.to_client, rate, at);
        for flying in self.to_client.iter_mut().filter(|f| f.arrival > at) {
            if !same_rate(flying.baud, client) {
                let [garbled, ..] = self.noise.next_u32().to_le_bytes();
                flying.byte = garbled;
            }
        }
    }

    fn collect(&mut self, at: Instant) -> usize {
        let mut chunk = [0u8; 64];
        let mut total = 0;
        loop {
            let count = self.device.transmit(at, &mut chunk).min(chunk.len());
            for &byte in chunk.iter().take(count) {
                self.send_to_client(byte, at);
            }
            total += count;
            if count < chunk.len() {
                return total;
            }
        }
    }

    fn send_to_client(&mut self, byte: u8, at: Instant) {
        if !self.pass() {
            return;
        }
        let baud = self.device.baud();
        self.device_busy = self.device_busy.max(ns(at)) + character_ns(baud);
        let byte = if same_rate(baud, self.baud) {
            byte
        } else {
            let [garbled, ..] = self.noise.next_u32().to_le_bytes();
            garbled
        };
        if self.to_client.len() == QUEUE {
            self.to_client.pop_front();
        }
        self.to_client.push_back(Flying {
            arrival: self.device_busy,
            byte,
            baud,
        });
    }
}

#[cfg(test)]
mod tests;
