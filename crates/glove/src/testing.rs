//! What the tests of several modules share: a scripted serial port on a virtual clock.

extern crate std;

use crate::Instant;
use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::rc::Rc;
use std::vec::Vec;

/// One exchange of a script: the serial write that must come, and what answers it.
#[derive(Debug, Clone)]
pub struct Exchange {
    pub expect: Vec<u8>,
    /// Bytes and how many microseconds after the write they arrive.
    pub answer: Vec<(u64, Vec<u8>)>,
}

/// An exchange answered at once (1 ms after the write).
pub fn exchange(expect: &[u8], answer: &[u8]) -> Exchange {
    Exchange {
        expect: expect.to_vec(),
        answer: std::vec![(1_000, answer.to_vec())],
    }
}

/// A port that checks what is written against a script and answers from it.
#[derive(Debug, Clone, Default)]
pub struct Port(Rc<Inner>);

#[derive(Debug, Default)]
struct Inner {
    now: Cell<u64>,
    script: RefCell<VecDeque<Exchange>>,
    arriving: RefCell<Vec<(u64, u8)>>,
    broken: Cell<bool>,
    bauds: RefCell<Vec<u32>>,
}

impl Port {
    pub fn new(script: impl IntoIterator<Item = Exchange>) -> Self {
        let port = Self::default();
        port.expect(script);
        port
    }

    pub fn expect(&self, script: impl IntoIterator<Item = Exchange>) {
        self.0.script.borrow_mut().extend(script);
    }

    pub fn now(&self) -> Instant {
        Instant::from_ticks(self.0.now.get())
    }

    /// Moves time to `due`, or to the next byte's arrival if that is earlier.
    pub fn wait(&self, due: Option<Instant>) -> Instant {
        let byte = self
            .0
            .arriving
            .borrow()
            .iter()
            .map(|(at, _)| *at)
            .filter(|at| *at > self.0.now.get())
            .min();
        let due = due.map(|d| d.as_ticks());
        let next = match (byte, due) {
            (Some(a), Some(b)) => a.min(b),
            (Some(a), None) => a,
            (None, Some(b)) => b,
            (None, None) => self.0.now.get() + 1_000,
        };
        self.0.now.set(self.0.now.get().max(next));
        self.now()
    }

    /// Bytes that arrive `delay` microseconds from now, asked for or not.
    pub fn inject(&self, delay: u64, bytes: &[u8]) {
        let at = self.0.now.get() + delay;
        self.0
            .arriving
            .borrow_mut()
            .extend(bytes.iter().map(|b| (at, *b)));
    }

    pub fn break_line(&self, broken: bool) {
        self.0.broken.set(broken);
    }

    /// Exchanges not yet made.
    pub fn left(&self) -> usize {
        self.0.script.borrow().len()
    }

    /// The speeds it was set to, in order.
    pub fn bauds(&self) -> Vec<u32> {
        self.0.bauds.borrow().clone()
    }

    fn arrived(&self) -> bool {
        let now = self.0.now.get();
        self.0.arriving.borrow().iter().any(|(at, _)| *at <= now)
    }
}

impl crate::sc18im::SetBaud for Port {
    fn set_baud(&mut self, baud: u32) -> Result<(), crate::sc18im::BaudRefused> {
        self.0.bauds.borrow_mut().push(baud);
        Ok(())
    }
}

impl embedded_io::ErrorType for Port {
    type Error = embedded_io::ErrorKind;
}

impl embedded_io::ReadReady for Port {
    fn read_ready(&mut self) -> Result<bool, Self::Error> {
        if self.0.broken.get() {
            return Err(embedded_io::ErrorKind::BrokenPipe);
        }
        Ok(self.arrived())
    }
}

impl embedded_io::Read for Port {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Self::Error> {
        assert!(self.arrived(), "a read that would block");
        let now = self.0.now.get();
        let mut arriving = self.0.arriving.borrow_mut();
        let mut count = 0;
        while count < buffer.len() {
            let Some(index) = arriving.iter().position(|(at, _)| *at <= now) else {
                break;
            };
            buffer[count] = arriving.remove(index).1;
            count += 1;
        }
        Ok(count)
    }
}

impl embedded_io::Write for Port {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
        if self.0.broken.get() {
            return Err(embedded_io::ErrorKind::BrokenPipe);
        }
        assert!(bytes.len() <= 64, "longer than a port's queue");
        let next = self.0.script.borrow_mut().pop_front();
        let Some(next) = next else {
            panic!("not in the script: {bytes:02X?}")
        };
        assert_eq!(
            bytes, next.expect,
            "{bytes:02X?}, expected {:02X?}",
            next.expect
        );
        for (delay, answer) in next.answer {
            self.inject(delay, &answer);
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Self::Error> {
        panic!("flush would wait")
    }
}
