//! A trace replayed by its times: for a bridge that does something else than the one it was taken of.

use super::entry::{Entry, Reader};
use super::order::Order;
use super::port::{Failed, PORTS, Source};
use super::seen::Seen;
use crate::Instant;
use core::cell::RefCell;
use glove::sc18im::BaudRefused;

/// What a step costs where a trace has no turns, µs.
const STEP: u64 = 50;
/// The loop goes on for so long after the last bytes of such a trace, µs.
const AFTERGLOW: u64 = 300_000;

/// Where a port reads.
#[derive(Debug, Clone, Copy)]
struct Line<'t> {
    /// Behind the entry that is being read.
    reader: Reader<'t>,
    /// What is left of that entry.
    rest: &'t [u8],
    /// Where its last entry of this turn ends: looking further would be work for nothing.
    limit: usize,
}

#[derive(Debug)]
struct Times<'t> {
    now: u64,
    /// At the entry that begins the next turn; in a trace without turns at the first one that has not come yet.
    ahead: Reader<'t>,
    ports: [Line<'t>; PORTS],
    orders: Reader<'t>,
    /// The trace's turns are the loop's; else its bytes only have times.
    turns: bool,
    end: u64,
    over: bool,
}

/// A trace whose bytes come when they came, in the turns in which they came, whatever the bridge asks or writes. A trace
/// without turns, such as virtual devices write, has times of bytes only; a step takes 50 µs then.
///
/// The lines do not answer to what is written: a gripper in it goes where it went.
#[derive(Debug)]
pub struct Loose<'t>(RefCell<Times<'t>>);

impl<'t> Loose<'t> {
    /// Replays `trace` from its beginning.
    pub fn new(trace: &'t [u8]) -> Self {
        let start = Reader::new(trace);
        let (mut reader, mut turns) = (start, false);
        while let Ok(Some(entry)) = reader.read() {
            turns |= matches!(entry, Entry::Clock { turn: true, .. });
            if matches!(entry, Entry::Lost { .. }) {
                break;
            }
        }
        let times = Times {
            now: 0,
            ahead: start,
            ports: [Line {
                reader: start,
                rest: &[],
                limit: 0,
            }; PORTS],
            orders: start,
            turns,
            end: reader.at(),
            over: false,
        };
        let loose = Self(RefCell::new(times));
        if turns {
            loose.0.borrow_mut().next_turn();
        }
        loose
    }

    /// Time in the trace, µs.
    pub fn at(&self) -> u64 {
        self.0.borrow().now
    }

    /// Its last time, µs.
    pub fn end(&self) -> u64 {
        self.0.borrow().end
    }
}

impl<'t> Times<'t> {
    /// To the beginning of the next turn, with `ahead` at the one after it.
    fn next_turn(&mut self) {
        let mut begun = false;
        loop {
            let before = self.ahead;
            match self.ahead.read() {
                Ok(Some(Entry::Clock { turn: true, at })) if !begun => {
                    self.now = at;
                    begun = true;
                }
                Ok(Some(Entry::Clock { turn: true, .. })) => {
                    self.ahead = before;
                    return;
                }
                Ok(Some(Entry::Lost { .. }) | None) | Err(_) => {
                    self.over |= !begun;
                    return;
                }
                Ok(Some(Entry::Read { port, .. })) => {
                    if let Some(line) = self.ports.get_mut(usize::from(port)) {
                        line.limit = self.ahead.offset();
                    }
                }
                Ok(Some(_)) => {}
            }
        }
    }

    /// Time goes on to what is due or to the next bytes, whichever is first.
    fn next_bytes(&mut self, due: u64) {
        let now = self.now.saturating_add(STEP);
        let mut until = due;
        loop {
            let before = self.ahead;
            match self.ahead.read() {
                Ok(Some(Entry::Clock { at, .. })) if at > now => {
                    self.ahead = before;
                    until = until.min(at);
                    break;
                }
                Ok(Some(_)) => {}
                Ok(None) | Err(_) => break,
            }
        }
        self.now = now.max(until);
        self.over = self.now > self.end.saturating_add(AFTERGLOW);
    }

    /// The entry at `reader` that has come, for a cursor that looks for its own.
    fn come(&self, reader: &mut Reader<'t>) -> Option<Entry<'t>> {
        let before = *reader;
        let entry = reader.read().ok().flatten();
        let come = match self.turns {
            true => before.offset() < self.ahead.offset(),
            false => reader.at() <= self.now,
        };
        if entry.is_none() || !come {
            *reader = before;
            return None;
        }
        entry
    }

    /// What has come for `port` and was not taken.
    fn waiting(&mut self, port: u8) -> &'t [u8] {
        let Some(place) = self.ports.get(usize::from(port)) else {
            return &[];
        };
        if !place.rest.is_empty() {
            return place.rest;
        }
        let mut line = *place;
        while line.rest.is_empty() {
            if self.turns && line.reader.offset() >= line.limit {
                break;
            }
            match self.come(&mut line.reader) {
                None => break,
                Some(Entry::Read { port: of, bytes }) if of == port => line.rest = bytes,
                Some(_) => {}
            }
        }
        if let Some(place) = self.ports.get_mut(usize::from(port)) {
            *place = line;
        }
        line.rest
    }
}

impl Source for Loose<'_> {
    fn now(&self) -> Instant {
        Instant::from_ticks(self.0.borrow().now)
    }

    fn wait_until(&self, due: Instant) {
        let mut times = self.0.borrow_mut();
        match times.turns {
            true => times.next_turn(),
            false => times.next_bytes(due.as_ticks()),
        }
    }

    fn ready(&self, port: u8) -> Result<bool, Failed> {
        Ok(!self.0.borrow_mut().waiting(port).is_empty())
    }

    fn read(&self, port: u8, buffer: &mut [u8]) -> Result<usize, Failed> {
        let mut times = self.0.borrow_mut();
        let waiting = times.waiting(port);
        for (to, from) in buffer.iter_mut().zip(waiting) {
            *to = *from;
        }
        let count = waiting.len().min(buffer.len());
        if let Some(line) = times.ports.get_mut(usize::from(port)) {
            line.rest = waiting.get(count..).unwrap_or_default();
        }
        Ok(count)
    }

    fn write(&self, _: u8, bytes: &[u8]) -> Result<usize, Failed> {
        Ok(bytes.len())
    }

    fn set_baud(&self, _: u8, _: u32) -> Result<(), BaudRefused> {
        Ok(())
    }

    fn order(&self) -> Option<Order<'_>> {
        let mut times = self.0.borrow_mut();
        loop {
            let mut orders = times.orders;
            let entry = times.come(&mut orders);
            times.orders = orders;
            match entry {
                Some(Entry::Order(order)) => return Some(order),
                Some(_) => {}
                None => return None,
            }
        }
    }

    fn see(&self, _: Seen) {}

    fn is_over(&self) -> bool {
        self.0.borrow().over
    }
}
