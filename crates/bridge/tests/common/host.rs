//! A host at the bridge's line, written on postcard, cobs and a CRC of its own.

use super::bench::Bench;
use bridge::protocol::message::{
    Answer, CHUNK, Call, Counters, FromBridge, Refusal, Reply, Request, VERSION,
};
use bridge::protocol::{Outcome, Server};
use embedded_io::{ErrorType, Read, ReadReady, Write};
use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::rc::Rc;

/// Both directions of a line between host and bridge, no bytes lost.
#[derive(Clone, Default)]
pub struct Line {
    blocked: Rc<Cell<bool>>,
    to_bridge: Rc<RefCell<VecDeque<u8>>>,
    to_host: Rc<RefCell<VecDeque<u8>>>,
}

impl Line {
    /// Whether the host takes no bytes.
    pub fn block(&self, blocked: bool) {
        self.blocked.set(blocked);
    }
}

impl ErrorType for Line {
    type Error = core::convert::Infallible;
}

impl ReadReady for Line {
    fn read_ready(&mut self) -> Result<bool, Self::Error> {
        Ok(!self.to_bridge.borrow().is_empty())
    }
}

impl Read for Line {
    fn read(&mut self, out: &mut [u8]) -> Result<usize, Self::Error> {
        let mut bytes = self.to_bridge.borrow_mut();
        let count = out.len().min(bytes.len());
        for (place, byte) in out.iter_mut().zip(bytes.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }
}

impl Write for Line {
    /// Seven bytes at a time: a port that takes frames in pieces.
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
        if self.blocked.get() {
            return Ok(0);
        }
        let count = bytes.len().min(7);
        self.to_host.borrow_mut().extend(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

/// Bitwise CRC-32/ISO-HDLC, independent of the crate the bridge uses.
pub fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| {
            if crc & 1 == 1 {
                (crc >> 1) ^ 0xEDB8_8320
            } else {
                crc >> 1
            }
        })
    })
}

pub fn framed(message: &[u8]) -> Vec<u8> {
    let mut body = message.to_vec();
    body.extend(crc32(message).to_le_bytes());
    let mut out = vec![0; body.len() + body.len() / 254 + 1];
    let length = cobs::encode(&body, &mut out);
    out.truncate(length);
    out.push(0);
    out
}

pub struct Host {
    pub bench: Bench,
    pub line: Line,
    pub server: Server<Line>,
    pub sequence: u16,
    heard: Vec<u8>,
    pub outcome: Outcome,
}

impl Host {
    pub fn new(bench: Bench) -> Self {
        let line = Line::default();
        Self {
            server: Server::new(line.clone()),
            bench,
            line,
            sequence: 0,
            heard: Vec::new(),
            outcome: Outcome::Continue,
        }
    }

    pub fn turn(&mut self) {
        self.bench.step();
        let now = self.bench.clock.now();
        self.outcome = self.server.poll(now, &mut self.bench.app);
    }

    pub fn run(&mut self, us: u64) {
        let end = self.bench.now() + us;
        while self.bench.now() < end {
            self.turn();
        }
    }

    pub fn say(&mut self, bytes: &[u8]) {
        self.line.to_bridge.borrow_mut().extend(bytes);
    }

    pub fn hear(&mut self) -> Option<FromBridge> {
        while let Some(byte) = { self.line.to_host.borrow_mut().pop_front() } {
            if byte != 0 {
                self.heard.push(byte);
                continue;
            }
            let mut bytes = core::mem::take(&mut self.heard);
            let length = cobs::decode_in_place(&mut bytes).expect("COBS");
            let (message, crc) = bytes[..length].split_last_chunk::<4>().expect("a CRC");
            assert_eq!(crc32(message), u32::from_le_bytes(*crc));
            return Some(postcard::from_bytes(message).expect("a message"));
        }
        None
    }

    pub fn send(&mut self, session: u32, sequence: u16, call: Call<'_>) {
        let mut buffer = [0; 1024];
        let request = Request {
            session,
            sequence,
            call,
        };
        let message = postcard::to_slice(&request, &mut buffer).expect("room");
        let frame = framed(message);
        self.say(&frame);
    }

    pub fn reply(&mut self) -> Reply {
        for _ in 0..20_000 {
            self.turn();
            if let Some(FromBridge::Reply(reply)) = self.hear() {
                return reply;
            }
        }
        panic!("no reply");
    }

    pub fn ask_as(&mut self, session: u32, call: Call<'_>) -> Result<Answer, Refusal> {
        self.sequence += 1;
        self.send(session, self.sequence, call);
        let reply = self.reply();
        assert_eq!((reply.session, reply.sequence), (session, self.sequence));
        reply.answer
    }

    pub fn ask(&mut self, call: Call<'_>) -> Result<Answer, Refusal> {
        self.ask_as(7, call)
    }

    pub fn hello(mut self) -> Self {
        let answer = self.ask(Call::Hello { version: VERSION });
        assert!(matches!(answer, Ok(Answer::Hello(_))), "{answer:?}");
        self
    }

    pub fn begin(&mut self, image: &[u8]) -> u32 {
        let length = image.len() as u32;
        match self.ask(Call::WeightsBegin {
            length,
            crc: crc32(image),
        }) {
            Ok(Answer::Received { bytes }) => bytes,
            other => panic!("{other:?}"),
        }
    }

    pub fn chunks(&mut self, image: &[u8], from: usize, to: usize) {
        for (index, bytes) in image[from..to].chunks(CHUNK).enumerate() {
            let offset = (from + index * CHUNK) as u32;
            let answer = self.ask(Call::WeightsChunk { offset, bytes });
            assert_eq!(
                answer,
                Ok(Answer::Received {
                    bytes: offset + bytes.len() as u32
                })
            );
        }
    }

    pub fn flash(&mut self, image: &[u8]) -> Result<Answer, Refusal> {
        assert_eq!(self.begin(image), 0);
        self.chunks(image, 0, image.len());
        self.ask(Call::WeightsCommit)
    }

    pub fn counters(&mut self) -> Counters {
        match self.ask(Call::Counters) {
            Ok(Answer::Counters(counters)) => counters,
            other => panic!("{other:?}"),
        }
    }
}
