//! What the glove asks of an I²C bus: start a few transactions, ask later how they went.
//!
//! [`crate::sc18im::Sc18im`] is such a bus behind a serial line. [`Direct`] makes one of any blocking `embedded-hal`
//! `I2c` (a `/dev/i2c` port, a microcontroller's peripheral, a mock).

use crate::Instant;
use embedded_hal::i2c::{ErrorKind, I2c, NoAcknowledgeSource};
use heapless::Vec;

/// Most data bytes one message may carry: the SC18IM's buffer.
pub const MESSAGE_MAX: usize = 16;

/// Most transactions in one batch.
pub const BATCH_MAX: usize = 3;

/// Why a bus did not do what it was asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Error {
    /// No device acknowledged the address.
    NackAddress,
    /// The device acknowledged its address but not a data byte.
    NackData,
    /// The bus hung: the clock or data line was held down too long.
    BusTimeout,
    /// The bus did its work, but bytes of the reply were lost on the way.
    Lost {
        /// Bytes that should have come.
        expected: u8,
        /// Bytes that came.
        received: u8,
    },
    /// The reply was read only after its deadline, for the caller stood still: it says nothing about now and was thrown away.
    Stalled,
    /// A status that should not be: one the serial bridge's data sheet does not have, a selection that reads back otherwise, or
    /// what a sensor in UART mode refuses with.
    Status(u8),
    /// The serial bridge does not answer; it is being resynchronised.
    NoAnswer,
    /// The serial port failed: unplugged, or its output queue is full.
    Port,
    /// A transaction is under way.
    Busy,
    /// A message is longer than [`MESSAGE_MAX`], a batch than [`BATCH_MAX`], or its bytes than one serial write.
    TooLong {
        /// Length asked for.
        length: usize,
        /// Longest possible.
        limit: usize,
    },
    /// A transaction that neither writes nor reads, an address above 0x7F, or a sequence of messages that the SC18IM
    /// cannot make (it can write, read, or write and then read).
    Unsupported,
    /// The clock of a blocking call stood still.
    ClockStopped,
    /// Any other failure of a blocking bus, or of a channel selector.
    Other,
}

impl core::fmt::Display for Error {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Error::NackAddress => f.write_str("no device acknowledged the address"),
            Error::NackData => f.write_str("the device refused a data byte"),
            Error::BusTimeout => f.write_str("the I2C bus hung (SDA or SCL held low)"),
            Error::Lost { expected, received } => {
                write!(f, "{received} of {expected} reply bytes arrived")
            }
            Error::Stalled => f.write_str("the reply lay unread past its deadline"),
            Error::Status(code) => write!(f, "unexpected status {code:#04X}"),
            Error::NoAnswer => f.write_str("the serial bridge does not answer"),
            Error::Port => f.write_str("the serial port failed"),
            Error::Busy => f.write_str("a transaction is under way"),
            Error::TooLong { length, limit } => write!(f, "{length} bytes where {limit} fit"),
            Error::Unsupported => f.write_str("a transaction the bus cannot make"),
            Error::ClockStopped => f.write_str("the clock stood still"),
            Error::Other => f.write_str("the bus failed"),
        }
    }
}

impl core::error::Error for Error {}

impl embedded_hal::i2c::Error for Error {
    fn kind(&self) -> ErrorKind {
        match self {
            Error::NackAddress => ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address),
            Error::NackData => ErrorKind::NoAcknowledge(NoAcknowledgeSource::Data),
            Error::BusTimeout => ErrorKind::Bus,
            Error::Lost { .. } => ErrorKind::Overrun,
            _ => ErrorKind::Other,
        }
    }
}

impl Error {
    /// From a blocking bus's kind of error.
    fn from_kind(kind: ErrorKind) -> Self {
        match kind {
            ErrorKind::NoAcknowledge(NoAcknowledgeSource::Data) => Error::NackData,
            ErrorKind::NoAcknowledge(_) => Error::NackAddress,
            ErrorKind::Bus | ErrorKind::ArbitrationLoss => Error::BusTimeout,
            _ => Error::Other,
        }
    }

    /// Whether the fault lies with the addressed device rather than with the way to it.
    pub fn is_nack(self) -> bool {
        matches!(self, Error::NackAddress | Error::NackData)
    }
}

/// One I²C transaction: write, read, or write and read with a repeated start between; a STOP after it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Transaction {
    address: u8,
    write: Vec<u8, MESSAGE_MAX>,
    read: u8,
}

impl Transaction {
    /// Writes `bytes` to the 7-bit `address`.
    ///
    /// # Errors
    /// [`Error::TooLong`] above 16 bytes; [`Error::Unsupported`] for none, or an address above 0x7F.
    pub fn write(address: u8, bytes: &[u8]) -> Result<Self, Error> {
        Self::write_read(address, bytes, 0)
    }

    /// Reads `count` bytes from the 7-bit `address`.
    ///
    /// # Errors
    /// As [`Transaction::write`].
    pub fn read(address: u8, count: usize) -> Result<Self, Error> {
        Self::write_read(address, &[], count)
    }

    /// Writes `bytes`, then reads `count` bytes after a repeated start. Either may be empty, not both.
    ///
    /// # Errors
    /// As [`Transaction::write`].
    pub fn write_read(address: u8, bytes: &[u8], count: usize) -> Result<Self, Error> {
        let length = bytes.len().max(count);
        let too_long = Error::TooLong {
            length,
            limit: MESSAGE_MAX,
        };
        if length > MESSAGE_MAX {
            return Err(too_long);
        }
        if length == 0 || address > 0x7F {
            return Err(Error::Unsupported);
        }
        let write = Vec::from_slice(bytes).map_err(|_| too_long)?;
        let read = u8::try_from(count).map_err(|_| too_long)?;
        Ok(Self {
            address,
            write,
            read,
        })
    }

    /// The 7-bit address.
    pub fn address(&self) -> u8 {
        self.address
    }

    /// Bytes to write, possibly none.
    pub fn bytes(&self) -> &[u8] {
        &self.write
    }

    /// Number of bytes to read, possibly 0.
    pub fn count(&self) -> usize {
        usize::from(self.read)
    }

    /// Bytes on the I²C bus, addresses included.
    pub fn i2c_bytes(&self) -> usize {
        let message = |bytes: usize| if bytes == 0 { 0 } else { bytes + 1 };
        message(self.write.len()) + message(self.count())
    }
}

/// Transactions that go out together, one after the other.
///
/// A transaction that fails does not keep the next from being made, and only the last one's acknowledgement is known: put
/// nothing behind a write whose failure would matter, unless what follows proves it (as a read-back does).
pub type Batch = Vec<Transaction, BATCH_MAX>;

/// What a batch read, all transactions' bytes one after the other.
pub type Reply = Vec<u8, { MESSAGE_MAX * BATCH_MAX }>;

/// An I²C bus that does not wait.
pub trait Bus {
    /// Starts a batch.
    ///
    /// # Errors
    /// [`Error::Busy`] while one is under way, [`Error::NoAnswer`] while the bus is down, [`Error::TooLong`],
    /// [`Error::Port`].
    fn start(&mut self, batch: &Batch, now: Instant) -> Result<(), Error>;

    /// Does what is due; returns the reply or the failure of the batch that was started, once.
    ///
    /// To be called also when nothing is under way: the bus may be mending itself.
    fn poll(&mut self, now: Instant) -> Option<Result<Reply, Error>>;

    /// When [`Bus::poll`] has something to do even if no byte arrives.
    fn next_due(&self) -> Option<Instant>;

    /// Speed of the serial line it hangs on, in baud; `None` where there is none.
    fn line_baud(&self) -> Option<u32> {
        None
    }

    /// Whether a batch could be started, or is under way.
    fn is_up(&self) -> bool;

    /// Whether the bus is down and was asked so often in vain that it is asked only now and then.
    fn is_dead(&self) -> bool;
}

/// A blocking `embedded-hal` I²C bus behind the [`Bus`] trait: `start` makes the whole batch.
///
/// One batch is at most three short messages; how long they take is the blocking driver's affair.
#[derive(Debug)]
pub struct Direct<I> {
    i2c: I,
    done: Option<Result<Reply, Error>>,
}

impl<I> Direct<I> {
    /// Takes the bus.
    pub fn new(i2c: I) -> Self {
        Self { i2c, done: None }
    }

    /// Gives the bus back.
    pub fn release(self) -> I {
        self.i2c
    }

    /// The bus.
    pub fn i2c_mut(&mut self) -> &mut I {
        &mut self.i2c
    }
}

impl<I: I2c> Direct<I> {
    fn run(&mut self, batch: &Batch) -> Result<Reply, Error> {
        let mut reply = Reply::new();
        for transaction in batch {
            let mut buffer = [0; MESSAGE_MAX];
            let read = buffer
                .get_mut(..transaction.count())
                .ok_or(Error::Unsupported)?;
            let address = transaction.address();
            let outcome = match (transaction.bytes(), read.is_empty()) {
                ([], _) => self.i2c.read(address, read),
                (bytes, true) => self.i2c.write(address, bytes),
                (bytes, false) => self.i2c.write_read(address, bytes, read),
            };
            outcome.map_err(|e| Error::from_kind(embedded_hal::i2c::Error::kind(&e)))?;
            reply
                .extend_from_slice(read)
                .map_err(|_| Error::Unsupported)?;
        }
        Ok(reply)
    }
}

impl<I: I2c> Bus for Direct<I> {
    fn start(&mut self, batch: &Batch, _now: Instant) -> Result<(), Error> {
        if self.done.is_some() {
            return Err(Error::Busy);
        }
        self.done = Some(self.run(batch));
        Ok(())
    }

    fn poll(&mut self, _now: Instant) -> Option<Result<Reply, Error>> {
        self.done.take()
    }

    fn next_due(&self) -> Option<Instant> {
        self.done.as_ref().map(|_| Instant::from_ticks(0))
    }

    fn is_up(&self) -> bool {
        true
    }

    fn is_dead(&self) -> bool {
        false
    }
}
