//! One TCP connection, and one question on it at a time. Every wait has an end that no bytes put off.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use super::frames::{Came, Judged, judge, question};
use crate::diagnose::answer;
use crate::interrupt::Interrupt;
use crate::lines::tcp::{Address, CONNECT, Error};

/// Silence that ends an answer.
const QUIET: Duration = Duration::from_millis(20);
/// Silence after bytes that are no whole answer, after which none is expected.
const GIVEN_UP: Duration = Duration::from_millis(300);
/// Longest wait between two looks.
const LOOK: Duration = Duration::from_millis(2);
/// More bytes than this are no answer.
const MOST: usize = 1_024;
/// The number before the first question's.
const FIRST: u16 = 0x4711;
/// Between the numbers of two questions: a server that counts by itself has others.
const STEP: u16 = 0x0111;

/// A connection.
pub struct Wire {
    stream: TcpStream,
    number: u16,
    ended: bool,
}

/// A question, and what came after it.
pub struct Exchange {
    pub came: Came,
    /// The transaction number of the question.
    pub asked_number: u16,
    /// That of the answer.
    pub number: u16,
    /// The answer's unit.
    pub unit: u8,
    /// Bytes after the answer.
    pub rest: Vec<u8>,
    /// From the question to the answer's last byte.
    pub after: Duration,
}

impl Wire {
    /// Connects within [`CONNECT`].
    pub fn connect(address: &Address, interrupt: &Interrupt) -> Result<Self, Error> {
        let end = Instant::now() + CONNECT;
        let targets = resolve(address, end, interrupt)?;
        let mut error = Error::Name(address.host.clone());
        for target in targets {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(Error::Unreachable);
            }
            match TcpStream::connect_timeout(&target, left).and_then(prepared) {
                Ok(stream) => {
                    return Ok(Self {
                        stream,
                        number: FIRST,
                        ended: false,
                    });
                }
                Err(cause) => error = named(&cause),
            }
        }
        Err(error)
    }

    /// Whether the other side ended the connection.
    pub fn has_ended(&self) -> bool {
        self.ended
    }

    /// Reads the status block of `unit` by `function`.
    pub fn ask(
        &mut self,
        unit: u8,
        function: u8,
        wait: Duration,
        interrupt: &Interrupt,
    ) -> Exchange {
        self.number = self.number.wrapping_add(STEP);
        let sent = question(self.number, unit, function);
        let is_done = |bytes: &[u8]| {
            let came = judge(function, bytes, false).came;
            !matches!(came, Came::Silence | Came::Cut(_))
        };
        let (heard, after) = self.exchange(&sent, wait, interrupt, is_done);
        let Judged {
            came,
            number,
            unit,
            rest,
        } = judge(function, &heard, self.ended);
        let came = if came.is_answer() && self.was_asked_before(number) {
            Came::Late
        } else {
            came
        };
        Exchange {
            came,
            asked_number: self.number,
            number,
            unit,
            rest,
            after,
        }
    }

    /// Whether a question before the newest one had this number.
    fn was_asked_before(&self, number: u16) -> bool {
        let back = self.number.wrapping_sub(number);
        back != 0 && back.is_multiple_of(STEP) && back <= self.number.wrapping_sub(FIRST + STEP)
    }

    /// Whether Modbus RTU's question, as a serial line has it, is answered.
    pub fn answers_rtu(&mut self, unit: u8, wait: Duration, interrupt: &Interrupt) -> bool {
        let sent = answer::emit(unit, 1);
        let is_answer = |bytes: &[u8]| {
            matches!(
                answer::judge(unit, 1, &sent, bytes),
                answer::Came::Answer(_)
            )
        };
        let (heard, _) = self.exchange(&sent, wait, interrupt, is_answer);
        is_answer(&heard)
    }

    fn exchange(
        &mut self,
        sent: &[u8],
        wait: Duration,
        interrupt: &Interrupt,
        is_done: impl Fn(&[u8]) -> bool,
    ) -> (Vec<u8>, Duration) {
        let (mut heard, mut after) = (Vec::new(), Duration::ZERO);
        if self.stream.write_all(sent).is_err() {
            self.ended = true;
        }
        let start = Instant::now();
        let (mut last, mut done) = (start, false);
        while !self.ended && start.elapsed() < wait && heard.len() < MOST && !interrupt.asked() {
            let mut chunk = [0; 256];
            match self.stream.read(&mut chunk) {
                Ok(0) => self.ended = true,
                Ok(count) => {
                    heard.extend_from_slice(&chunk[..count]);
                    last = Instant::now();
                    if !done {
                        after = start.elapsed();
                    }
                    done = is_done(&heard);
                }
                Err(error) if is_pause(error.kind()) => {
                    let quiet = last.elapsed();
                    if done && quiet >= QUIET || !heard.is_empty() && quiet >= GIVEN_UP {
                        break;
                    }
                }
                Err(_) => self.ended = true,
            }
        }
        (heard, after)
    }
}

fn is_pause(kind: ErrorKind) -> bool {
    matches!(
        kind,
        ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
    )
}

fn prepared(stream: TcpStream) -> std::io::Result<TcpStream> {
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(LOOK))?;
    stream.set_write_timeout(Some(CONNECT))?;
    Ok(stream)
}

/// The name's addresses. A name server that does not answer is not waited for.
fn resolve(
    address: &Address,
    end: Instant,
    interrupt: &Interrupt,
) -> Result<Vec<SocketAddr>, Error> {
    let (back, found) = channel();
    let target = (address.host.clone(), address.port);
    let asked = std::thread::Builder::new()
        .name("resolve".to_owned())
        .spawn(move || {
            let found = target.to_socket_addrs().map(Iterator::collect::<Vec<_>>);
            // Nobody may be waiting any more.
            let _ = back.send(found);
        });
    asked.map_err(|cause| Error::System(cause.to_string()))?;
    loop {
        match found.recv_timeout(LOOK) {
            Ok(Ok(targets)) if !targets.is_empty() => return Ok(targets),
            Ok(_) => return Err(Error::Name(address.host.clone())),
            Err(_) if Instant::now() >= end || interrupt.asked() => {
                return Err(Error::Name(address.host.clone()));
            }
            Err(_) => {}
        }
    }
}

fn named(cause: &std::io::Error) -> Error {
    match cause.kind() {
        ErrorKind::ConnectionRefused => Error::Refused,
        ErrorKind::TimedOut | ErrorKind::WouldBlock => Error::Unreachable,
        ErrorKind::ConnectionReset | ErrorKind::ConnectionAborted => Error::Closed,
        _ => Error::System(cause.to_string()),
    }
}
