//! A pseudo-terminal as a port that never blocks, in real time.
#![allow(dead_code, clippy::unwrap_used)]

use embedded_io::{ErrorKind, ErrorType, Read, ReadReady, Write};
use gripper::Instant;
use std::collections::VecDeque;
use tokio_serial::SerialStream;

/// Our end of the pseudo-terminal as a port that never blocks.
pub struct Port {
    stream: SerialStream,
    read: VecDeque<u8>,
}

impl Port {
    pub fn new(stream: SerialStream) -> Self {
        Self {
            stream,
            read: VecDeque::new(),
        }
    }
}

fn other(error: &std::io::Error) -> ErrorKind {
    println!("port: {error}");
    ErrorKind::Other
}

impl ErrorType for Port {
    type Error = ErrorKind;
}

impl ReadReady for Port {
    fn read_ready(&mut self) -> Result<bool, ErrorKind> {
        let mut bytes = [0; 64];
        match self.stream.try_read(&mut bytes) {
            Ok(count) => self.read.extend(&bytes[..count]),
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {}
            Err(error) => return Err(other(&error)),
        }
        Ok(!self.read.is_empty())
    }
}

impl Read for Port {
    fn read(&mut self, out: &mut [u8]) -> Result<usize, ErrorKind> {
        let count = out.len().min(self.read.len());
        for (slot, byte) in out.iter_mut().zip(self.read.drain(..count)) {
            *slot = byte;
        }
        Ok(count)
    }
}

impl Write for Port {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        self.stream.try_write(bytes).map_err(|error| other(&error))
    }

    fn flush(&mut self) -> Result<(), ErrorKind> {
        Ok(())
    }
}

/// Real time since a start.
pub struct Timer(std::time::Instant);

impl Timer {
    pub fn start() -> Self {
        Self(std::time::Instant::now())
    }

    pub fn now(&self) -> Instant {
        Instant::from_ticks(self.0.elapsed().as_micros() as u64)
    }

    pub async fn rest(&self) {
        tokio::time::sleep(std::time::Duration::from_millis(1)).await;
    }
}
