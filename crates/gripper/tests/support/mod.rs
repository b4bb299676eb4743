//! A line under the test's control: what is written lands in a log, what is to be read has a time.
//! Time is virtual; [`run`] moves it from one event to the next.
#![allow(dead_code, clippy::unwrap_used)]

pub mod ask;
pub mod fuzz;

use embedded_io::{ErrorKind, ErrorType, Read, ReadReady, Write};
use gripper::link::Link;
use gripper::registers::{COMMAND, STATUS};
use gripper::rtu::{Registers, Request, Response};
use gripper::{Duration, Event, Gripper, Instant, Status};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

/// One character at 115200 baud, rounded up, µs.
pub const CHARACTER: u64 = 87;

pub fn at(us: u64) -> Instant {
    Instant::from_ticks(us)
}

pub fn ms(count: u64) -> Duration {
    Duration::from_millis(count)
}

#[derive(Default)]
struct Inner {
    now: u64,
    to_master: VecDeque<(u64, u8)>,
    written: Vec<(u64, Vec<u8>)>,
    broken: bool,
}

/// The master's end of the line; clones share it.
#[derive(Clone, Default)]
pub struct Line(Rc<RefCell<Inner>>);

impl std::fmt::Debug for Line {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Line")
    }
}

impl Line {
    pub fn now(&self) -> u64 {
        self.0.borrow().now
    }

    pub fn set_now(&self, now: u64) {
        self.0.borrow_mut().now = now;
    }

    /// Bytes that arrive from `at` on, one every `spacing` µs; kept in order of time.
    pub fn send(&self, at: u64, spacing: u64, bytes: &[u8]) {
        let mut inner = self.0.borrow_mut();
        for (k, &byte) in bytes.iter().enumerate() {
            let due = at + (k as u64 + 1) * spacing;
            let place = inner.to_master.partition_point(|&(other, _)| other <= due);
            inner.to_master.insert(place, (due, byte));
        }
    }

    pub fn next_byte(&self) -> Option<u64> {
        self.0.borrow().to_master.front().map(|&(due, _)| due)
    }

    /// Everything written since the last call.
    pub fn take_written(&self) -> Vec<(u64, Vec<u8>)> {
        std::mem::take(&mut self.0.borrow_mut().written)
    }

    pub fn break_port(&self, broken: bool) {
        self.0.borrow_mut().broken = broken;
    }
}

impl ErrorType for Line {
    type Error = ErrorKind;
}

impl ReadReady for Line {
    fn read_ready(&mut self) -> Result<bool, ErrorKind> {
        let inner = self.0.borrow();
        if inner.broken {
            return Err(ErrorKind::BrokenPipe);
        }
        Ok(inner
            .to_master
            .front()
            .is_some_and(|&(due, _)| due <= inner.now))
    }
}

impl Read for Line {
    fn read(&mut self, out: &mut [u8]) -> Result<usize, ErrorKind> {
        let mut inner = self.0.borrow_mut();
        let mut count = 0;
        while count < out.len() {
            match inner.to_master.front() {
                Some(&(due, byte)) if due <= inner.now => {
                    out[count] = byte;
                    count += 1;
                    inner.to_master.pop_front();
                }
                _ => break,
            }
        }
        Ok(count)
    }
}

impl Write for Line {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        let mut inner = self.0.borrow_mut();
        if inner.broken {
            return Err(ErrorKind::BrokenPipe);
        }
        let now = inner.now;
        inner.written.push((now, bytes.to_vec()));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), ErrorKind> {
        Ok(())
    }
}

/// Runs `step` (a poll and when it is due next) from event to event until it yields or `until`
/// has come. `device` gets every request written, with the time its last byte is on the line.
///
/// A machine that asks to be polled again and again at one instant fails the test.
pub fn run<T>(
    line: &Line,
    until: u64,
    device: &mut dyn FnMut(&Line, u64, &[u8]),
    step: &mut dyn FnMut(Instant) -> (Option<T>, Instant),
) -> Option<T> {
    let mut spins = 0;
    loop {
        let now = line.now();
        let (outcome, due) = step(at(now));
        for (sent, bytes) in line.take_written() {
            device(line, sent + bytes.len() as u64 * CHARACTER, &bytes);
        }
        if outcome.is_some() {
            return outcome;
        }
        if now >= until {
            return None;
        }
        let next = line
            .next_byte()
            .map_or(due.as_ticks(), |byte| byte.min(due.as_ticks()))
            .min(until);
        spins = if next > now { 0 } else { spins + 1 };
        assert!(
            spins < 8,
            "polled {spins} times at {now} µs without getting on"
        );
        line.set_now(next.max(now));
    }
}

/// [`run`] for a bare link.
pub fn run_link(
    line: &Line,
    link: &mut Link<Line>,
    until: u64,
    device: &mut dyn FnMut(&Line, u64, &[u8]),
) -> Option<Result<Vec<u8>, gripper::link::Error>> {
    run(line, until, device, &mut |now| {
        let outcome = link
            .poll(now)
            .map(|outcome| outcome.map(|response| frame_of(&response)));
        // A free link has nothing due: it waits for its user.
        let due = if link.is_free(now) {
            at(u64::MAX)
        } else {
            link.next_due()
        };
        (outcome, due)
    })
}

/// [`run`] for a gripper.
pub fn run_gripper<G: Gripper<X>, const X: usize>(
    line: &Line,
    gripper: &mut G,
    until: u64,
    device: &mut dyn FnMut(&Line, u64, &[u8]),
) -> Option<Result<Status<X>, G::Error>> {
    run(line, until, device, &mut |now| {
        let ended = gripper.poll(now).and_then(Event::ended);
        (ended, gripper.next_due())
    })
}

/// Polls an idle link until it may send.
pub fn settle(line: &Line, link: &mut Link<Line>) {
    for _ in 0..1_000 {
        let now = at(line.now());
        let _ = link.poll(now);
        if link.is_free(now) {
            return;
        }
        let due = link.next_due().as_ticks();
        let next = line.next_byte().map_or(due, |byte| byte.min(due));
        line.set_now(next.max(line.now()));
    }
    panic!("the line never became free");
}

/// A reply's frame, from slave 9.
pub fn frame_of(response: &Response<'_>) -> Vec<u8> {
    let mut bytes = vec![0; response.buffer_len()];
    response.emit(9, &mut bytes).unwrap();
    bytes
}

/// A plain slave with a command and a status block, for tests of the line. It has no mechanics: its
/// status is what the test puts there, and echoes follow commands at once.
pub struct Slave {
    pub command: [u8; 16],
    pub status: [u8; 16],
    /// From the end of a request to the start of the reply, µs.
    pub turnaround: u64,
    /// Status bytes that repeat command bytes: pairs of status byte, command byte.
    pub echoes: Vec<(usize, usize)>,
    pub requests: u32,
    pub writes: u32,
}

impl Slave {
    /// A 3-Finger gripper that is ready, open, at rest.
    pub fn three_finger() -> Self {
        let status = [0xF1, 0xFF, 0, 0, 6, 0, 0, 6, 0, 0, 6, 0, 0, 0x89, 0, 0];
        let echoes = vec![(3, 3), (6, 6), (9, 9), (12, 12)];
        Self {
            command: [0; 16],
            status,
            turnaround: 1_750,
            echoes,
            requests: 0,
            writes: 0,
        }
    }

    /// A 2F-85 that is ready, open, at rest.
    pub fn two_finger() -> Self {
        let mut status = [0; 16];
        status[..6].copy_from_slice(&[0xF1, 0, 0, 0, 13, 0]);
        Self {
            command: [0; 16],
            status,
            turnaround: 1_750,
            echoes: vec![(3, 3)],
            requests: 0,
            writes: 0,
        }
    }

    fn write(&mut self, address: u16, values: Registers<'_>) {
        let from = 2 * usize::from(address - COMMAND);
        self.command[from..from + values.bytes().len()].copy_from_slice(values.bytes());
        self.writes += 1;
        // rGTO's echo and the positions; the rest of byte 0 is the test's.
        self.status[0] = self.status[0] & !0x08 | self.command[0] & 0x08;
        for &(status, command) in &self.echoes {
            self.status[status] = self.command[command];
        }
    }

    /// The reply to a request, as a frame.
    pub fn answer(&mut self, request: &[u8]) -> Vec<u8> {
        let (unit, request) = Request::parse(request).unwrap();
        assert_eq!(unit, 9);
        self.requests += 1;
        let quantity = match request {
            Request::ReadHolding { address, quantity }
            | Request::ReadInput { address, quantity } => {
                assert_eq!(address, STATUS);
                quantity
            }
            Request::ReadWrite {
                read_address,
                read_quantity,
                write_address,
                values,
            } => {
                assert_eq!(read_address, STATUS);
                self.write(write_address, values);
                read_quantity
            }
            Request::WriteMultiple { address, values } => {
                self.write(address, values);
                return frame_of(&Response::WriteMultiple {
                    address,
                    quantity: values.len() as u16,
                });
            }
            Request::WriteSingle { address, value } => {
                return frame_of(&Response::WriteSingle { address, value });
            }
        };
        let values = Registers::from_bytes(&self.status[..2 * usize::from(quantity)]).unwrap();
        frame_of(&match request {
            Request::ReadHolding { .. } => Response::ReadHolding(values),
            Request::ReadInput { .. } => Response::ReadInput(values),
            _ => Response::ReadWrite(values),
        })
    }

    /// Answers in good time.
    pub fn serve(&mut self, line: &Line, end: u64, request: &[u8]) {
        let reply = self.answer(request);
        line.send(end + self.turnaround, CHARACTER, &reply);
    }
}
