//! Lines that spoil what passes over them, and servers that answer oddly.

use std::collections::VecDeque;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use rig::{Device, Instant};

/// What becomes of one reply: pieces, each after a pause.
pub type Pieces = Vec<(Duration, Vec<u8>)>;

/// A line that gives each reply of the device behind it another shape.
pub struct Shaped<D, F> {
    device: D,
    shape: F,
    frame: Vec<u8>,
    /// Pieces under way, and when each may start.
    due: VecDeque<(Instant, Vec<u8>)>,
}

impl<D: Device, F: FnMut(Vec<u8>) -> Pieces + Send> Shaped<D, F> {
    pub fn new(device: D, shape: F) -> Self {
        Self {
            device,
            shape,
            frame: Vec::new(),
            due: VecDeque::new(),
        }
    }

    fn take(&mut self, now: Instant) {
        let mut chunk = [0; 64];
        loop {
            let count = self.device.transmit(now, &mut chunk);
            if count == 0 {
                return;
            }
            self.frame.extend_from_slice(&chunk[..count]);
            let Some(length) = reply_length(&self.frame).filter(|n| *n <= self.frame.len()) else {
                continue;
            };
            let frame = self.frame.drain(..length).collect();
            let mut at = now;
            for (pause, bytes) in (self.shape)(frame) {
                at += rig::Duration::from_micros(pause.as_micros().try_into().unwrap());
                self.due.push_back((at, bytes));
            }
        }
    }
}

/// Bytes of the reply that begins like this.
fn reply_length(frame: &[u8]) -> Option<usize> {
    let [_, function, third, ..] = *frame else {
        return None;
    };
    Some(match function {
        3 | 4 | 23 => 5 + usize::from(third),
        code if code & 0x80 != 0 => 5,
        _ => 8,
    })
}

impl<D: Device, F: FnMut(Vec<u8>) -> Pieces + Send> Device for Shaped<D, F> {
    fn receive(&mut self, bytes: &[u8], now: Instant) {
        self.device.receive(bytes, now);
    }

    fn transmit(&mut self, now: Instant, out: &mut [u8]) -> usize {
        self.take(now);
        let mut given = 0;
        while let Some((at, bytes)) = self.due.front_mut() {
            if *at > now || given == out.len() {
                break;
            }
            let count = bytes.len().min(out.len() - given);
            out[given..given + count].copy_from_slice(&bytes[..count]);
            bytes.drain(..count);
            given += count;
            if bytes.is_empty() {
                self.due.pop_front();
            }
        }
        given
    }

    fn next_due(&self) -> Option<Instant> {
        let mine = self.due.front().map(|(at, _)| *at);
        [mine, self.device.next_due()].into_iter().flatten().min()
    }

    fn baud(&self) -> u32 {
        self.device.baud()
    }

    fn baud_seen(&mut self, client_baud: u32) {
        self.device.baud_seen(client_baud);
    }
}

/// Two devices on one bus: both hear everything, both may speak.
pub struct Both<A, B>(pub A, pub B);

impl<A: Device, B: Device> Device for Both<A, B> {
    fn receive(&mut self, bytes: &[u8], now: Instant) {
        self.0.receive(bytes, now);
        self.1.receive(bytes, now);
    }

    fn transmit(&mut self, now: Instant, out: &mut [u8]) -> usize {
        let first = self.0.transmit(now, out);
        first + self.1.transmit(now, &mut out[first..])
    }

    fn next_due(&self) -> Option<Instant> {
        [self.0.next_due(), self.1.next_due()]
            .into_iter()
            .flatten()
            .min()
    }

    fn baud(&self) -> u32 {
        self.0.baud()
    }
}

/// A device that never falls silent: `bytes` again and again, one piece in every `pause`, whatever is said to it.
pub struct Babble {
    pub bytes: Vec<u8>,
    pub pause: Duration,
    pub next: Instant,
    /// Pieces so far.
    pub said: Arc<AtomicU64>,
}

impl Babble {
    pub fn new(bytes: &[u8], pause: Duration) -> Self {
        Self {
            bytes: bytes.to_vec(),
            pause,
            next: Instant::from_ticks(0),
            said: Arc::default(),
        }
    }
}

impl Device for Babble {
    fn receive(&mut self, _: &[u8], _: Instant) {}

    fn transmit(&mut self, now: Instant, out: &mut [u8]) -> usize {
        if now < self.next {
            return 0;
        }
        self.next = now + rig::Duration::from_micros(self.pause.as_micros().try_into().unwrap());
        self.said.fetch_add(1, Ordering::Relaxed);
        let count = self.bytes.len().min(out.len());
        out[..count].copy_from_slice(&self.bytes[..count]);
        count
    }

    fn next_due(&self) -> Option<Instant> {
        Some(self.next)
    }

    fn baud(&self) -> u32 {
        115_200
    }
}

/// A Modbus TCP server on the loopback; `serve` has each connection, with its number from 0, for itself.
pub fn network(serve: impl Fn(usize, TcpStream) + Send + Sync + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let serve = std::sync::Arc::new(serve);
    std::thread::spawn(move || {
        for (number, stream) in listener.incoming().enumerate() {
            let (serve, stream) = (serve.clone(), stream.unwrap());
            stream.set_nodelay(true).unwrap();
            std::thread::spawn(move || serve(number, stream));
        }
    });
    format!("tcp:{address}")
}

/// Answers each read of a connection with what `answer` makes of it, for as long as it lasts.
pub fn answering(mut stream: TcpStream, answer: impl Fn(&[u8; 12]) -> Pieces) {
    let mut request = [0; 12];
    while stream.read_exact(&mut request).is_ok() {
        for (pause, bytes) in answer(&request) {
            std::thread::sleep(pause);
            if stream.write_all(&bytes).is_err() {
                return;
            }
        }
    }
}

/// The right answer to a read of the status block: an active gripper without a fault.
pub fn right_answer(request: &[u8; 12]) -> Vec<u8> {
    let mut reply = request[..4].to_vec();
    reply.extend([0, 19, request[6], request[7], 16]);
    reply.extend([0xF9, 0xFF, 0, 7, 7, 0, 6, 6, 0, 6, 6, 0, 137, 137, 0, 0]);
    reply
}

/// At once, in one piece.
pub fn at_once(bytes: Vec<u8>) -> Pieces {
    vec![(Duration::ZERO, bytes)]
}
