//! The fuzz target as a plain function: any bytes in, a panic only when something is wrong. Run by `tests/fuzz.rs` on
//! stable; a coverage-guided fuzzer calls the same function.

use embedded_io::{ErrorKind, ErrorType, Read, ReadReady, Write};
use glove::Instant;
use glove::bus::{Batch, Bus, Transaction};
use glove::sc18im::{BaudRefused, Config, Sc18im, SetBaud};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

/// What a machine has been through, for a test that wants to know whether the fuzzing reaches deep.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seen {
    pub replies: u32,
    pub failures: u32,
    pub resyncs: u32,
}

/// Longest time from a question to its reply or failure, µs: a wait, its reasons asked, a line that does not become quiet.
const ENDS_WITHIN: u64 = 1_000_000;
/// Most bytes that a poll and a start take from a line that babbles.
const TAKEN_AT_ONCE: usize = 8_192;

#[derive(Debug, Default)]
struct Inner {
    to_host: VecDeque<u8>,
    /// What the newest command asks for.
    asked: Vec<u8>,
    /// The chip's I²C clock registers.
    clock: [u8; 2],
    babbles: bool,
    broken: bool,
    taken: usize,
}

/// The chip's end of the line; clones share it.
#[derive(Clone, Debug, Default)]
struct Line(Rc<RefCell<Inner>>);

impl ErrorType for Line {
    type Error = ErrorKind;
}

impl SetBaud for Line {
    fn set_baud(&mut self, baud: u32) -> Result<(), BaudRefused> {
        match baud {
            230_400 => Err(BaudRefused::Unsupported(baud)),
            _ => Ok(()),
        }
    }
}

impl ReadReady for Line {
    fn read_ready(&mut self) -> Result<bool, ErrorKind> {
        let line = self.0.borrow();
        if line.broken {
            return Err(ErrorKind::BrokenPipe);
        }
        Ok(line.babbles || !line.to_host.is_empty())
    }
}

impl Read for Line {
    fn read(&mut self, out: &mut [u8]) -> Result<usize, ErrorKind> {
        let mut line = self.0.borrow_mut();
        let babbles = line.babbles;
        let mut count = 0;
        for place in out {
            match line.to_host.pop_front() {
                Some(byte) => *place = byte,
                None if babbles => *place = 0x55,
                None => break,
            }
            count += 1;
        }
        line.taken += count;
        Ok(count)
    }
}

impl Write for Line {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        let mut line = self.0.borrow_mut();
        if line.broken {
            return Err(ErrorKind::BrokenPipe);
        }
        line.asked = line.answer(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), ErrorKind> {
        Ok(())
    }
}

impl Inner {
    /// What a chip in good order answers to a command, by the data sheet's lengths.
    fn answer(&mut self, command: &[u8]) -> Vec<u8> {
        let mut answer = Vec::new();
        let mut rest = command.iter().copied();
        while let Some(letter) = rest.next() {
            match letter {
                b'S' => {
                    let (address, count) = (rest.next().unwrap(), rest.next().unwrap());
                    let data = |i: u8| i.wrapping_mul(37) ^ address;
                    if address & 1 == 1 {
                        answer.extend((0..count).map(data));
                    } else {
                        rest.by_ref().take(usize::from(count)).for_each(drop);
                    }
                }
                b'R' => {
                    for register in rest.by_ref().take_while(|&byte| byte != b'P') {
                        answer.push(match register {
                            0x0A => 0xF0,
                            0x07 | 0x08 => self.clock[usize::from(register - 7)],
                            _ => 0,
                        });
                    }
                }
                b'W' => {
                    while let Some(register) = rest.next().filter(|&byte| byte != b'P') {
                        let value = rest.next().unwrap();
                        if let 0x07 | 0x08 = register {
                            self.clock[usize::from(register - 7)] = value;
                        }
                    }
                }
                b'P' => {}
                other => panic!("{other:02X} in {command:02X?}"),
            }
        }
        answer
    }
}

/// A transaction made of bytes, and how many it reads.
fn transaction(address: u8, lengths: u8) -> (Batch, usize) {
    let mut batch = Batch::new();
    let (write, read) = (usize::from(lengths % 17), usize::from(lengths / 16));
    let bytes = [address ^ 0x3C; 16];
    let mut count = 0;
    for _ in 0..=address % 3 {
        if let Ok(one) = Transaction::write_read(address & 0x7F, &bytes[..write], read) {
            count += one.count();
            batch.push(one).unwrap();
        }
    }
    (batch, count)
}

/// The machine under a list of operations: bytes of any kind at any time, answers in good order, a line that babbles or
/// breaks. Whatever comes, a transaction ends in time and gives as many bytes as were asked for; a poll takes a bounded
/// number of bytes; and with a chip in good order again the machine is up again. On a port of one speed, and on one that is
/// to be raised.
pub fn sc18im(data: &[u8]) -> Seen {
    let line = Line::default();
    let fixed = Sc18im::new(line.clone(), Config::default());
    let seen = under(data, line, fixed);
    let line = Line::default();
    let config = Config {
        raise_to: Some(460_800),
        ..Config::default()
    };
    let raised = Sc18im::new(line.clone(), config).with_set_baud();
    let also = under(data, line, raised);
    Seen {
        replies: seen.replies + also.replies,
        failures: seen.failures + also.failures,
        resyncs: seen.resyncs + also.resyncs,
    }
}

fn under(data: &[u8], line: Line, machine: Sc18im<Line>) -> Seen {
    let mut bench = Bench {
        machine,
        line,
        now: 0,
        asked: None,
        seen: Seen::default(),
    };
    let mut script = data.iter().copied();
    while let Some(operation) = script.next() {
        let mut byte = || script.next().unwrap_or(0);
        match operation % 10 {
            0 => bench.now += u64::from(byte()) * 8,
            1 => bench.now += u64::from(byte()) * 4_096,
            2 | 3 => bench.until_due(),
            4 => {
                let count = byte() % 64;
                let bytes: Vec<u8> = (0..count).map(|_| byte()).collect();
                bench.line.0.borrow_mut().to_host.extend(bytes);
            }
            5 | 6 => bench.answer(usize::from(operation / 10)),
            7 | 8 => bench.start(byte(), byte()),
            _ => {
                let mut line = bench.line.0.borrow_mut();
                line.babbles = operation & 0x40 != 0;
                line.broken = operation & 0x20 != 0;
            }
        }
        bench.poll();
    }
    bench.mend();
    bench.seen.resyncs = bench.machine.counters().resyncs;
    bench.seen
}

struct Bench {
    line: Line,
    machine: Sc18im<Line>,
    now: u64,
    /// When the transaction under way was started, and how many bytes it reads.
    asked: Option<(u64, usize)>,
    seen: Seen,
}

impl Bench {
    fn until_due(&mut self) {
        if let Some(due) = self.machine.next_due() {
            self.now = self.now.max(due.as_ticks());
        }
    }

    /// The chip answers, less its last `short` bytes.
    fn answer(&mut self, short: usize) {
        let mut line = self.line.0.borrow_mut();
        let mut answer = std::mem::take(&mut line.asked);
        answer.truncate(answer.len().saturating_sub(short / 8));
        line.to_host.extend(answer);
    }

    fn start(&mut self, address: u8, lengths: u8) {
        let (batch, count) = transaction(address, lengths);
        self.line.0.borrow_mut().taken = 0;
        let started = self.machine.start(&batch, Instant::from_ticks(self.now));
        if started.is_ok() {
            assert!(self.asked.is_none(), "two transactions at once");
            self.asked = Some((self.now, count));
        }
    }

    fn poll(&mut self) {
        let outcome = self.machine.poll(Instant::from_ticks(self.now));
        let taken = std::mem::take(&mut self.line.0.borrow_mut().taken);
        assert!(taken <= TAKEN_AT_ONCE, "{taken} bytes in one poll");
        match (outcome, self.asked) {
            (None, _) => {}
            (Some(outcome), Some((_, count))) => {
                self.asked = None;
                match outcome {
                    Ok(reply) => {
                        assert_eq!(reply.len(), count, "another number of bytes");
                        self.seen.replies += 1;
                    }
                    Err(_) => self.seen.failures += 1,
                }
            }
            (Some(outcome), None) => panic!("nothing was asked: {outcome:?}"),
        }
    }

    /// Polls at each due time until `done`, and not longer than `most` µs.
    fn run(&mut self, what: &str, most: u64, answers: bool, done: impl Fn(&Self) -> bool) {
        let end = self.now + most;
        while !done(self) {
            if answers {
                self.answer(0);
            }
            self.poll();
            // A byte's time, where the machine wants none of its own.
            let due = self.machine.next_due().map_or(0, |due| due.as_ticks());
            self.now = due.clamp(self.now + 87, self.now + 5_000);
            assert!(
                self.now < end,
                "not {what} within {most} µs: {:?}",
                self.machine
            );
        }
    }

    /// What is under way ends by itself; then the chip is in good order and the machine finds it so.
    fn mend(&mut self) {
        if let Some((started, _)) = self.asked {
            let left = (started + ENDS_WITHIN)
                .saturating_sub(self.now)
                .max(100_000);
            self.run("ended", left, false, |bench| bench.asked.is_none());
        }
        {
            let mut line = self.line.0.borrow_mut();
            (line.babbles, line.broken) = (false, false);
            line.asked.clear();
        }
        self.run("up", 10_000_000, true, |bench| bench.machine.is_up());
        self.run("idle", ENDS_WITHIN, true, |bench| {
            bench.machine.next_due().is_none()
        });
        self.start(0x28, 0x81);
        assert!(self.asked.is_some(), "{:?}", self.machine);
        let replies = self.seen.replies;
        self.run("answered", ENDS_WITHIN, true, |bench| bench.asked.is_none());
        assert_eq!(self.seen.replies, replies + 1);
    }
}
