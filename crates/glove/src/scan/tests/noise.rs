//! Anything at all in place of replies.

use crate::Instant;
use crate::bus::{self, Batch, Bus, Reply};
use crate::scan::{BusScanner, Config, Scanner};

/// A generator of bits; the crate has no random numbers of its own.
struct Bits(u64);

impl Bits {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    /// A byte, as often one that a chip would send as a wild one, so that every state is reached.
    fn byte(&mut self) -> u8 {
        const LIKELY: [u8; 8] = [0xA0, 0x00, 0x05, 0x08, 0x01, 0x40, 0xF0, 0xF1];
        let bits = self.next();
        if bits & 1 == 0 {
            LIKELY[(bits >> 1) as usize % LIKELY.len()]
        } else {
            (bits >> 8) as u8
        }
    }
}

/// A serial port that takes everything and answers with anything, or fails.
struct NoisePort(Bits);

impl embedded_io::ErrorType for NoisePort {
    type Error = embedded_io::ErrorKind;
}

impl embedded_io::ReadReady for NoisePort {
    fn read_ready(&mut self) -> Result<bool, Self::Error> {
        match self.0.next() % 500 {
            0 => Err(embedded_io::ErrorKind::Other),
            n => Ok(n % 5 == 0),
        }
    }
}

impl embedded_io::Read for NoisePort {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Self::Error> {
        let count = (self.0.next() as usize % 12).min(buffer.len());
        buffer[..count].fill_with(|| self.0.byte());
        Ok(count)
    }
}

impl embedded_io::Write for NoisePort {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
        match self.0.next() % 300 {
            0 => Ok(0),
            n => Ok(bytes.len().min(1 + n as usize % 20)),
        }
    }

    fn flush(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

#[test]
fn random_bytes_on_the_line_never_panic_and_never_make_an_orientation_that_is_not_unit() {
    let mut frames = 0;
    for seed in 1..60 {
        let mut scanner = Scanner::new(NoisePort(Bits(seed * 0x9E37_79B9)), Config::default());
        let mut now = 0;
        for _ in 0..20_000 {
            now += scanner.serial_mut().0.next() % 30_000;
            if let Some(frame) = scanner.poll(Instant::from_ticks(now)) {
                frames += 1;
                assert!(
                    frame
                        .samples
                        .iter()
                        .all(|s| (s.orientation.norm() - 1.0).abs() < 1e-5)
                );
            }
            let _ = (scanner.next_due(), scanner.state(), scanner.health());
        }
    }
    // Noise cannot know the selections that are read back.
    assert_eq!(frames, 0);
}

#[test]
fn random_replies_never_panic_and_never_make_an_orientation_that_is_not_unit() {
    struct Noise(Bits, bool);
    impl Bus for Noise {
        fn start(&mut self, _: &Batch, _: Instant) -> Result<(), bus::Error> {
            if self.0.next().is_multiple_of(50) {
                Err(bus::Error::NoAnswer)
            } else {
                Ok(())
            }
        }
        fn poll(&mut self, _: Instant) -> Option<Result<Reply, bus::Error>> {
            let length = self.0.next() as usize % 20;
            match self.0.next() % 8 {
                0 => None,
                1 => Some(Err(bus::Error::NackAddress)),
                2 => Some(Err(bus::Error::Lost {
                    expected: 8,
                    received: 1,
                })),
                _ => Some(Ok((0..length).map(|_| self.0.byte()).collect())),
            }
        }
        fn next_due(&self) -> Option<Instant> {
            None
        }
        fn is_up(&self) -> bool {
            self.1 || !self.0.0.is_multiple_of(16)
        }
        fn is_dead(&self) -> bool {
            false
        }
    }
    for seed in 1..40 {
        let mut scanner = BusScanner::on(
            Noise(Bits(seed * 0x9E37_79B9), seed % 2 == 0),
            Config::default(),
        );
        for step in 0..20_000 {
            if let Some(frame) = scanner.poll(Instant::from_ticks(step * 700)) {
                assert!(
                    frame
                        .samples
                        .iter()
                        .all(|s| (s.orientation.norm() - 1.0).abs() < 1e-5)
                );
            }
        }
    }
}
