//! A trace replayed call by call.

use super::code::Damage;
use super::difference::{Difference, What, what};
use super::entry::{Call, Entry, Reader};
use super::order::Order;
use super::port::{Failed, PORTS, Source};
use super::seen::Seen;
use crate::Instant;
use core::cell::RefCell;
use glove::sc18im::BaudRefused;

#[derive(Debug)]
struct Place<'t> {
    reader: Reader<'t>,
    /// Bytes of the entry at this place that were read already.
    taken: usize,
    /// When, and what.
    difference: Option<(u64, Difference)>,
    /// Bytes written as in the trace, by port.
    written: [u64; PORTS],
    /// Frames and states as in the trace.
    seen: u64,
    turns: u64,
    damage: Option<Damage>,
    gap: bool,
}

/// A trace that gives each call of the bridge what the same call was given when it was taken, and looks whether the bridge
/// makes that call.
#[derive(Debug)]
pub struct Strict<'t>(RefCell<Place<'t>>);

impl<'t> Strict<'t> {
    /// Replays `trace` from its beginning.
    pub const fn new(trace: &'t [u8]) -> Self {
        Self(RefCell::new(Place {
            reader: Reader::new(trace),
            taken: 0,
            difference: None,
            written: [0; PORTS],
            seen: 0,
            turns: 0,
            damage: None,
            gap: false,
        }))
    }

    /// The first difference and its time in the trace, µs.
    pub fn difference(&self) -> Option<(u64, Difference)> {
        self.0.borrow().difference
    }

    /// Bytes that were written to `port` as in the trace.
    pub fn written(&self, port: u8) -> u64 {
        let written = self.0.borrow().written;
        written.get(usize::from(port)).copied().unwrap_or(0)
    }

    /// Frames and changes of state that were as in the trace.
    pub fn seen_alike(&self) -> u64 {
        self.0.borrow().seen
    }

    /// Turns of the loop so far.
    pub fn turns(&self) -> u64 {
        self.0.borrow().turns
    }

    /// Time in the trace, µs.
    pub fn at(&self) -> u64 {
        self.0.borrow().reader.at()
    }

    /// How many bytes of the trace are replayed.
    pub fn offset(&self) -> usize {
        self.0.borrow().reader.offset()
    }

    /// Why the trace cannot be read to its end.
    pub fn damage(&self) -> Option<Damage> {
        self.0.borrow().damage
    }

    /// Whether the trace has a gap here: bytes that found no room.
    pub fn has_gap(&self) -> bool {
        self.0.borrow().gap
    }
}

impl<'t> Place<'t> {
    /// The entry at this place; `None` at the end of the trace, behind a difference and at a gap.
    fn peek(&mut self) -> Option<Entry<'t>> {
        if self.difference.is_some() || self.gap {
            return None;
        }
        loop {
            let mut ahead = self.reader;
            match ahead.read() {
                // Whoever made the bridge has read those.
                Ok(Some(Entry::Head { .. } | Entry::Part { .. })) => self.reader = ahead,
                Ok(Some(Entry::Lost { .. })) => {
                    self.gap = true;
                    return None;
                }
                Ok(entry) => return entry,
                Err(damage) => {
                    self.damage = Some(damage);
                    return None;
                }
            }
        }
    }

    fn advance(&mut self) {
        self.taken = 0;
        // It was read once already.
        let _ = self.reader.read();
    }

    fn differ(&mut self, difference: Difference) {
        let at = self.reader.at();
        self.difference.get_or_insert((at, difference));
    }

    fn wrong(&mut self, entry: Entry<'_>, got: What) {
        let expected = what(&entry);
        self.differ(Difference::Call { expected, got });
    }

    fn count(&mut self, port: u8, bytes: usize) {
        if let Some(written) = self.written.get_mut(usize::from(port)) {
            *written += bytes as u64;
        }
    }

    fn write(&mut self, port: u8, bytes: &[u8]) -> Result<usize, Failed> {
        match self.peek() {
            None => Ok(bytes.len()),
            Some(Entry::Write {
                port: to,
                bytes: expected,
            }) if to == port => {
                let pairs = expected.iter().zip(bytes).enumerate();
                let other = pairs.clone().find(|(_, (expected, got))| expected != got);
                if let Some((byte, (&expected, &got))) = other {
                    self.differ(Difference::Byte {
                        port,
                        byte,
                        expected,
                        got,
                    });
                } else if bytes.len() < expected.len() {
                    self.differ(Difference::Length {
                        port,
                        expected: expected.len(),
                        got: bytes.len(),
                    });
                } else {
                    self.count(port, expected.len());
                }
                self.advance();
                Ok(expected.len().min(bytes.len()))
            }
            Some(Entry::Failed {
                port: to,
                call: Call::Write,
                kind,
            }) if to == port => {
                self.advance();
                Err(Failed(kind))
            }
            Some(entry) => {
                self.wrong(entry, What::Write(port));
                Ok(bytes.len())
            }
        }
    }

    fn read(&mut self, port: u8, buffer: &mut [u8]) -> Result<usize, Failed> {
        match self.peek() {
            Some(Entry::Read { port: from, bytes }) if from == port => {
                let rest = bytes.get(self.taken..).unwrap_or_default();
                let count = rest.len().min(buffer.len());
                for (to, from) in buffer.iter_mut().zip(rest) {
                    *to = *from;
                }
                if count == rest.len() {
                    self.advance();
                } else {
                    // Another bridge asks for fewer bytes at a time; what comes of that is compared.
                    self.taken += count;
                }
                Ok(count)
            }
            Some(Entry::Failed {
                port: from,
                call: Call::Read,
                kind,
            }) if from == port => {
                self.advance();
                Err(Failed(kind))
            }
            Some(entry) => {
                self.wrong(entry, What::Read(port));
                Ok(0)
            }
            None => Ok(0),
        }
    }

    fn ready(&mut self, port: u8) -> Result<bool, Failed> {
        match self.peek() {
            Some(Entry::Read { port: from, .. }) if from == port => Ok(true),
            Some(Entry::Failed {
                port: from,
                call: Call::Read,
                ..
            }) if from == port => Ok(true),
            Some(Entry::Ready { port: from }) if from == port => {
                self.advance();
                Ok(true)
            }
            Some(Entry::Failed {
                port: from,
                call: Call::Ready,
                kind,
            }) if from == port => {
                self.advance();
                Err(Failed(kind))
            }
            // Nothing had come: that leaves no entry.
            _ => Ok(false),
        }
    }
}

impl Source for Strict<'_> {
    fn now(&self) -> Instant {
        let mut place = self.0.borrow_mut();
        match place.peek() {
            Some(Entry::Clock { turn, .. }) => {
                place.turns += u64::from(turn);
                place.advance();
            }
            Some(entry) => place.wrong(entry, What::Clock),
            None => {}
        }
        Instant::from_ticks(place.reader.at())
    }

    /// The next reading of the clock tells how long it was.
    fn wait_until(&self, _: Instant) {}

    fn ready(&self, port: u8) -> Result<bool, Failed> {
        self.0.borrow_mut().ready(port)
    }

    fn read(&self, port: u8, buffer: &mut [u8]) -> Result<usize, Failed> {
        self.0.borrow_mut().read(port, buffer)
    }

    fn write(&self, port: u8, bytes: &[u8]) -> Result<usize, Failed> {
        self.0.borrow_mut().write(port, bytes)
    }

    fn set_baud(&self, port: u8, baud: u32) -> Result<(), BaudRefused> {
        let mut place = self.0.borrow_mut();
        match place.peek() {
            Some(Entry::Speed {
                port: of,
                baud: expected,
                refused,
            }) if of == port => {
                if expected != baud {
                    place.differ(Difference::Speed {
                        port,
                        expected,
                        got: baud,
                    });
                }
                place.advance();
                refused.map_or(Ok(()), Err)
            }
            Some(entry) => {
                place.wrong(entry, What::Speed(port));
                Ok(())
            }
            None => Ok(()),
        }
    }

    fn order(&self) -> Option<Order<'_>> {
        let mut place = self.0.borrow_mut();
        match place.peek() {
            Some(Entry::Order(order)) => {
                place.advance();
                Some(order)
            }
            _ => None,
        }
    }

    fn see(&self, got: Seen) {
        let mut place = self.0.borrow_mut();
        match place.peek() {
            Some(Entry::Seen(expected)) => {
                if expected == got {
                    place.seen += 1;
                } else {
                    place.differ(Difference::Seen { expected, got });
                }
                place.advance();
            }
            Some(entry) => place.wrong(entry, What::Seen),
            None => {}
        }
    }

    /// At its end, at a gap, where it is damaged, and behind the first difference.
    fn is_over(&self) -> bool {
        self.0.borrow_mut().peek().is_none()
    }
}
