//! The link's dealings with the port: never more than what is ready, never a wait.

use super::{Error, Event, Link, POLL_BYTES, PortFault, Refused, State};
use crate::rtu::{EXCEPTION_FRAME, function};
use crate::{Instant, timing};
use embedded_io::{Error as _, Read, ReadReady, Write};

impl<S: Read + ReadReady + Write> Link<S> {
    /// Puts the first `length` bytes of the request into the port's queue.
    pub(super) fn send(&mut self, length: usize, now: Instant) -> Result<(), Refused> {
        let mut rest = self.request.get(..length).unwrap_or(&[]);
        // Every pass takes at least one byte or ends.
        while !rest.is_empty() {
            let fault = match self.serial.write(rest) {
                Ok(0) => PortFault::Closed,
                Ok(taken) => {
                    rest = rest.get(taken..).unwrap_or(&[]);
                    continue;
                }
                Err(error) => PortFault::Write(error.kind()),
            };
            self.length = 0;
            return Err(Refused::Port(self.fail_port(fault, now)));
        }
        self.counters.requests = self.counters.requests.wrapping_add(1);
        let bytes = self.request.get(..length).unwrap_or(&[]);
        if !matches!(
            bytes.get(1),
            Some(&(function::READ_HOLDING | function::READ_INPUT))
        ) {
            self.counters.writes = self.counters.writes.wrapping_add(1);
        }
        self.trace.note(now, Event::Sent, bytes);
        Ok(())
    }

    /// Adds what is ready to the bytes received, as far as there is room.
    pub(super) fn receive(&mut self) -> Result<(), PortFault> {
        while let Some(room @ [_, ..]) = self.received.get_mut(self.length..) {
            match read_some(&mut self.serial, room)? {
                0 => break,
                read => self.length += read,
            }
        }
        Ok(())
    }

    /// Looks for bytes nobody asked for while no request is out.
    pub(super) fn hear_idle(&mut self, now: Instant) -> Result<(), PortFault> {
        if !matches!(self.state, State::Idle { .. }) {
            return Ok(());
        }
        self.length = 0;
        if let Err(fault) = self.receive() {
            return Err(self.fail_port(fault, now));
        }
        if self.length > 0 {
            // Kept for the drain: they may be the start of a late reply.
            let (length, late) = (self.length, self.recognise_late(now));
            let noise = (length - late) as u32;
            self.counters.noise = self.counters.noise.wrapping_add(noise);
            self.drain_from(now, now, noise);
        }
        Ok(())
    }

    /// Throws bytes away until the line has rested; an error when it never does.
    pub(super) fn drain(&mut self, now: Instant) -> Option<Error> {
        let State::Draining {
            until,
            mut heard,
            mut noisy,
            mut thrown,
        } = self.state
        else {
            return None;
        };
        let (count, late) = match self.hear_draining(now) {
            Ok(counts) => counts,
            Err(fault) => {
                self.length = 0;
                return Some(Error::Port(self.fail_port(fault, now)));
            }
        };
        if count > 0 {
            if now >= timing::after(heard, self.config.silence) {
                (noisy, thrown) = (now, 0);
            }
            heard = now;
            thrown = thrown.saturating_add(count);
            self.counters.noise = self.counters.noise.wrapping_add(count).wrapping_sub(late);
        } else if now >= until && now >= timing::after(heard, self.config.silence) {
            if self.length > 0 {
                self.trace.note(
                    now,
                    Event::Drained,
                    self.received.get(..self.length).unwrap_or(&[]),
                );
                self.length = 0;
            }
            self.state = State::Idle { free_at: now };
            return None;
        }
        let mut error = None;
        if now >= timing::after(noisy, timing::babble(self.config.baud)) && heard == now {
            error = Some(Error::Noise(thrown));
            self.trace.note(
                now,
                Event::Failed(Error::Noise(thrown)),
                self.received.get(..self.length).unwrap_or(&[]),
            );
            (self.length, thrown) = (0, 0);
            noisy = now;
        }
        self.state = State::Draining {
            until,
            heard,
            noisy,
            thrown,
        };
        error
    }

    /// Reads what is ready: the first bytes are kept, to recognise a late reply; returns how many
    /// were read, and how many turned out to be a late reply.
    fn hear_draining(&mut self, now: Instant) -> Result<(u32, u32), PortFault> {
        let before = self.length;
        self.receive()?;
        let mut count = self.length - before;
        let mut scratch = [0; 64];
        while self.length == self.received.len() && count < POLL_BYTES {
            match read_some(&mut self.serial, &mut scratch)? {
                0 => break,
                read => count += read,
            }
        }
        Ok((count as u32, self.recognise_late(now) as u32))
    }

    /// Notes the outstanding reply, or its refusal, at the front of the drained bytes; returns its
    /// length, or 0.
    fn recognise_late(&mut self, now: Instant) -> usize {
        let bytes = self.received.get(..self.length).unwrap_or(&[]);
        let (reply, length) = match self.outstanding.late_exception(bytes) {
            Some(reply) => (reply, EXCEPTION_FRAME),
            None => match self.outstanding.matching(bytes, None) {
                Some(reply) => (reply, reply.length),
                None => return 0,
            },
        };
        let Some(frame) = bytes.get(..length) else {
            return 0;
        };
        if crate::rtu::Frame::new_checked(frame).is_err() {
            return 0;
        }
        self.trace.note(now, Event::Late, frame);
        self.counters.count(Error::Stale);
        self.note_late(reply, now);
        self.drop_front(length);
        length
    }

    /// Counts and traces `count` bytes at the end of what was received.
    pub(super) fn throw_away(&mut self, count: usize, now: Instant) {
        self.counters.noise = self.counters.noise.wrapping_add(count as u32);
        let from = self.length.saturating_sub(count);
        self.trace.note(
            now,
            Event::Drained,
            self.received.get(from..self.length).unwrap_or(&[]),
        );
    }
}

/// Reads once, only if bytes are ready; 0 when none are.
fn read_some<S: Read + ReadReady>(serial: &mut S, room: &mut [u8]) -> Result<usize, PortFault> {
    if !serial
        .read_ready()
        .map_err(|error| PortFault::Read(error.kind()))?
    {
        return Ok(0);
    }
    match serial.read(room) {
        Ok(0) => Err(PortFault::Closed),
        Ok(read) => Ok(read.min(room.len())),
        Err(error) => Err(PortFault::Read(error.kind())),
    }
}
