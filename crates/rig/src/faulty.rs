//! A port that loses, flips, doubles and delays bytes.

use embedded_io::{ErrorType, Read, ReadReady, Write};

/// Any port with faults put on top.
#[derive(Debug)]
pub struct Faulty<P> {
    port: P,
}

impl<P: ErrorType> ErrorType for Faulty<P> {
    type Error = P::Error;
}

impl<P: Read> Read for Faulty<P> {
    fn read(&mut self, buf: &mut [u8]) -> Result<usize, P::Error> {
        self.port.read(buf)
    }
}

impl<P: ReadReady> ReadReady for Faulty<P> {
    fn read_ready(&mut self) -> Result<bool, P::Error> {
        self.port.read_ready()
    }
}

impl<P: Write> Write for Faulty<P> {
    fn write(&mut self, buf: &[u8]) -> Result<usize, P::Error> {
        self.port.write(buf)
    }
    fn flush(&mut self) -> Result<(), P::Error> {
        self.port.flush()
    }
}
