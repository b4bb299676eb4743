//! A glove's I²C side for the scanner's tests: few registers, faults on demand.

use crate::Instant;
use crate::bus::{self, Batch, Bus, Reply};
use crate::hand::Quaternion;

extern crate std;
use std::boxed::Box;
use std::vec;
use std::vec::Vec;

/// A sensor as the scanner's tests need it: a few registers, a boot time, and faults on demand.
pub struct Chip {
    pub mode: u8,
    pub pointer: u8,
    pub boot_until: u64,
    pub units: u8,
    pub present: bool,
    pub resets: u32,
    /// Bytes to give instead of the quaternion, for so many reads.
    pub instead: Option<([u8; 8], u32)>,
    pub frozen: Option<[u8; 8]>,
    pub fusion_from: u64,
    /// Its register pointer runs on after a read.
    pub runs_on: bool,
    pub unique_id: [u8; 16],
}

/// The bus, the multiplexer and 16 chips; a batch takes 1 ms, a read that fails 30 ms, as behind the serial bridge.
pub struct Fake {
    pub chips: Vec<Chip>,
    pub channels: u8,
    pub mux_deaf: bool,
    pub up: bool,
    pub pose: Box<dyn FnMut(u64, usize) -> Quaternion>,
    pub due: Option<(u64, Result<Reply, bus::Error>)>,
    pub batches: u32,
}

impl Fake {
    pub fn new(pose: impl FnMut(u64, usize) -> Quaternion + 'static) -> Self {
        let chip = |k: u8| Chip {
            mode: 0x0C,
            pointer: 0,
            boot_until: 0,
            units: 0x80,
            present: true,
            resets: 0,
            instead: None,
            frozen: None,
            fusion_from: 0,
            runs_on: false,
            unique_id: core::array::from_fn(|i| k + 1 + 7 * i as u8),
        };
        Self {
            chips: (0..16).map(chip).collect(),
            channels: 0,
            mux_deaf: false,
            up: true,
            pose: Box::new(pose),
            due: None,
            batches: 0,
        }
    }

    pub fn run(&mut self, batch: &Batch, now: u64) -> Result<Reply, bus::Error> {
        let mut reply = Reply::new();
        for t in batch {
            if t.address() == 0x70 {
                if let ([channels], false) = (t.bytes(), self.mux_deaf) {
                    self.channels = *channels;
                }
                if t.count() == 1 {
                    reply.push(self.channels).unwrap();
                }
                continue;
            }
            assert_eq!(
                self.channels.count_ones(),
                1,
                "two channels at a time, or none"
            );
            let k = 2 * self.channels.trailing_zeros() as usize + usize::from(t.address() - 0x28);
            let quaternion = (self.pose)(now, k);
            let chip = &mut self.chips[k];
            if !chip.present || now < chip.boot_until {
                return Err(bus::Error::NackAddress);
            }
            if let [register, values @ ..] = t.bytes() {
                chip.pointer = *register;
                for value in values {
                    chip.write(*register, *value, now);
                }
            }
            if t.count() > 0 {
                reply
                    .extend_from_slice(&chip.read(t.count(), &quaternion, now))
                    .unwrap();
            }
        }
        Ok(reply)
    }
}

impl Chip {
    pub fn write(&mut self, register: u8, value: u8, now: u64) {
        match (register, self.mode) {
            (0x3D, _) => {
                self.mode = value;
                self.fusion_from = now + 20_000;
            }
            (0x3F, 0) if value & 0x20 != 0 => self.reset(now),
            (0x3B, 0) => self.units = value,
            _ => {}
        }
    }

    pub fn reset(&mut self, now: u64) {
        self.resets += 1;
        (self.mode, self.pointer, self.boot_until) = (0, 0, now + 650_000);
    }

    pub fn read(&mut self, count: usize, q: &Quaternion, now: u64) -> Vec<u8> {
        let pointer = self.pointer;
        if self.runs_on {
            self.pointer += count as u8;
        }
        match pointer {
            0x07 => vec![0],
            0x00 => [0xA0, 0xFB, 0x32, 0x0F, 0x11, 0x03, 0x15, 0x00][..count].to_vec(),
            0x20 if self.mode == 0 || now < self.fusion_from => vec![0; 8],
            0x20 => {
                if let Some((bytes, left)) = self.instead.take() {
                    self.instead = (left > 1).then_some((bytes, left - 1));
                    return bytes.to_vec();
                }
                let bytes = registers(q);
                self.frozen.unwrap_or(bytes).to_vec()
            }
            0x39 => vec![if self.mode == 0 { 0 } else { 5 }, 0],
            0x3B => vec![self.units; count],
            0x3D => vec![self.mode],
            0x3E => vec![0],
            0x50 => self.unique_id[..count].to_vec(),
            other => panic!("register {other:#04X} read"),
        }
    }
}

pub fn registers(q: &Quaternion) -> [u8; 8] {
    let mut bytes = [0; 8];
    for (pair, v) in bytes.chunks_mut(2).zip([q.w, q.i, q.j, q.k]) {
        pair.copy_from_slice(&(libm::roundf(v * 16_384.0) as i16).to_le_bytes());
    }
    bytes
}

impl Bus for Fake {
    fn start(&mut self, batch: &Batch, now: Instant) -> Result<(), bus::Error> {
        assert!(self.due.is_none(), "one at a time");
        let result = self.run(batch, now.as_ticks());
        let blind = batch.last().is_some_and(|t| t.count() > 0);
        let takes = if result.is_err() && blind {
            30_000
        } else {
            1_000
        };
        self.batches += 1;
        self.due = Some((now.as_ticks() + takes, result));
        Ok(())
    }

    fn poll(&mut self, now: Instant) -> Option<Result<Reply, bus::Error>> {
        if !self.up {
            return self.due.take().map(|_| Err(bus::Error::NoAnswer));
        }
        self.due
            .take_if(|(at, _)| now.as_ticks() >= *at)
            .map(|(_, result)| result)
    }

    fn next_due(&self) -> Option<Instant> {
        self.due.as_ref().map(|(at, _)| Instant::from_ticks(*at))
    }

    fn is_up(&self) -> bool {
        self.up
    }

    fn is_dead(&self) -> bool {
        false
    }
}
