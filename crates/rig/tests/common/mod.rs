//! A virtual gripper on a wire in memory, asked with literal bytes.
#![allow(dead_code, clippy::unwrap_used)]

use embedded_io::{Read, ReadReady, Write};
use rig::gripper::{Config, VirtualGripper};
use rig::{Clock, Duration, MemoryWire};

/// CRC-16 of Modbus, bit by bit: not the codec's.
pub fn crc(bytes: &[u8]) -> [u8; 2] {
    let mut crc = 0xFFFFu16;
    for byte in bytes {
        crc ^= u16::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 {
                crc >> 1 ^ 0xA001
            } else {
                crc >> 1
            };
        }
    }
    crc.to_le_bytes()
}

/// `bytes` with their CRC.
pub fn framed(bytes: &[u8]) -> Vec<u8> {
    let mut frame = bytes.to_vec();
    frame.extend(crc(bytes));
    frame
}

/// Bytes from text like `09 03 07 D0`.
pub fn hex(text: &str) -> Vec<u8> {
    text.split_whitespace()
        .map(|b| u8::from_str_radix(b, 16).unwrap())
        .collect()
}

pub struct Bench {
    pub clock: Clock,
    pub gripper: VirtualGripper,
    pub wire: MemoryWire,
}

impl Bench {
    pub fn new(config: Config) -> Self {
        let clock = Clock::new();
        let baud = config.baud;
        let gripper = VirtualGripper::new(config);
        let wire = MemoryWire::new(&clock, gripper.clone(), baud);
        Self {
            clock,
            gripper,
            wire,
        }
    }

    pub fn wait_ms(&self, ms: u64) {
        self.clock.advance(Duration::from_millis(ms));
        self.gripper.run_until(self.clock.now());
    }

    pub fn drain(&mut self) -> Vec<u8> {
        let mut all = Vec::new();
        let mut chunk = [0; 64];
        while self.wire.read_ready().unwrap() {
            let count = self.wire.read(&mut chunk).unwrap();
            all.extend_from_slice(&chunk[..count]);
        }
        all
    }

    /// Sends raw bytes and gives what came back 20 ms later.
    pub fn ask(&mut self, frame: &[u8]) -> Vec<u8> {
        assert_eq!(self.wire.write(frame).unwrap(), frame.len());
        self.wait_ms(20);
        self.drain()
    }

    /// Writes the start of the command block with FC16.
    pub fn command(&mut self, bytes: &[u8]) {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(2), 0);
        let count = bytes.len() as u8;
        let mut request = vec![9, 0x10, 0x03, 0xE8, 0, count / 2, count];
        request.extend(bytes);
        let reply = self.ask(&framed(&request));
        assert_eq!(reply, framed(&[9, 0x10, 0x03, 0xE8, 0, count / 2]));
    }

    /// Reads `registers` status registers with FC03.
    pub fn status(&mut self, registers: u8) -> Vec<u8> {
        let reply = self.ask(&framed(&[9, 3, 0x07, 0xD0, 0, registers]));
        assert_eq!(reply.len(), 5 + 2 * usize::from(registers), "{reply:02X?}");
        assert_eq!(framed(&reply[..reply.len() - 2]), reply);
        reply[3..reply.len() - 2].to_vec()
    }

    /// Activates and waits for the end of it.
    pub fn activate(&mut self) {
        self.command(&[1, 0, 0, 0, 0, 0]);
        for _ in 0..500 {
            if self.status(1)[0] & 0x30 == 0x30 {
                return;
            }
        }
        panic!("never active");
    }

    /// Waits until nothing moves.
    pub fn settle(&mut self) {
        for _ in 0..2_000 {
            self.wait_ms(10);
            if !self.gripper.is_moving() {
                break;
            }
        }
        // The current of a squeeze ends a little after.
        self.wait_ms(200);
    }
}
