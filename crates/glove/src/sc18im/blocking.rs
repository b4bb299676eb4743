//! A blocking `embedded-hal` `I2c` over the split-phase machine, for tools and other people's drivers.

use super::{Sc18im, SerialPort};
use crate::Instant;
use crate::bus::{Batch, Bus, Error, MESSAGE_MAX, Transaction};
use embedded_hal::i2c::{ErrorType, I2c, Operation, SevenBitAddress};
use heapless::Vec;

/// How often the clock may answer the same time in a row before it counts as stopped.
const STOPPED_AFTER: u32 = 10_000_000;

/// How often a transaction is made whose reply is read too late each time, on a machine that stands still now and then.
const STALLS_MAX: u8 = 3;

/// Blocks until a transaction is done. Never used by the scanner.
///
/// `clock` is the platform's: given when something is due (`None`: when a byte arrives), it may sleep until then or
/// until the port is readable, and returns the time. Every transaction ends by the machine's own deadlines
/// ([`crate::timing::reply`]); one that meets a link being resynchronised fails at once with [`Error::NoAnswer`].
#[derive(Debug)]
pub struct Blocking<'a, S, C> {
    machine: &'a mut Sc18im<S>,
    clock: C,
}

impl<'a, S: SerialPort, C: FnMut(Option<Instant>) -> Instant> Blocking<'a, S, C> {
    /// Wraps `machine`.
    pub fn new(machine: &'a mut Sc18im<S>, clock: C) -> Self {
        Self { machine, clock }
    }

    /// Waits until the serial bridge answers: one round of resynchronisation at most, about
    /// [`crate::timing::RESYNC_TRIES`] × 0.7 s.
    ///
    /// # Errors
    /// [`Error::NoAnswer`] when it does not.
    pub fn connect(&mut self) -> Result<(), Error> {
        let mut stopped = Stopped::default();
        loop {
            let now = (self.clock)(self.machine.next_due());
            let _ = self.machine.poll(now);
            if self.machine.is_up() {
                return Ok(());
            }
            if self.machine.is_dead() {
                return Err(Error::NoAnswer);
            }
            stopped.check(now)?;
        }
    }

    fn run(&mut self, transaction: Transaction) -> Result<crate::bus::Reply, Error> {
        let mut batch = Batch::new();
        batch.push(transaction).map_err(|_| Error::Unsupported)?;
        if !self.machine.is_up() {
            self.connect()?;
        }
        for _ in 1..STALLS_MAX {
            match self.run_once(&batch) {
                Err(Error::Stalled) => {}
                other => return other,
            }
        }
        self.run_once(&batch)
    }

    fn run_once(&mut self, batch: &Batch) -> Result<crate::bus::Reply, Error> {
        let now = (self.clock)(Some(Instant::from_ticks(0)));
        self.machine.start(batch, now)?;
        let mut stopped = Stopped::default();
        loop {
            let now = (self.clock)(self.machine.next_due());
            if let Some(result) = self.machine.poll(now) {
                return result;
            }
            stopped.check(now)?;
        }
    }
}

/// Ends a wait whose clock does not move.
#[derive(Default)]
struct Stopped {
    last: Option<Instant>,
    same: u32,
}

impl Stopped {
    fn check(&mut self, now: Instant) -> Result<(), Error> {
        self.same = if self.last == Some(now) {
            self.same + 1
        } else {
            0
        };
        self.last = Some(now);
        if self.same > STOPPED_AFTER {
            Err(Error::ClockStopped)
        } else {
            Ok(())
        }
    }
}

impl<S, C> ErrorType for Blocking<'_, S, C> {
    type Error = Error;
}

impl<S: SerialPort, C: FnMut(Option<Instant>) -> Instant> I2c for Blocking<'_, S, C> {
    fn transaction(
        &mut self,
        address: SevenBitAddress,
        operations: &mut [Operation<'_>],
    ) -> Result<(), Error> {
        let (write, count) = flatten(operations)?;
        let reply = self.run(Transaction::write_read(address, &write, count)?)?;
        let mut rest = reply.as_slice();
        for operation in operations {
            if let Operation::Read(buffer) = operation {
                let (part, tail) = rest
                    .split_at_checked(buffer.len())
                    .ok_or(Error::Unsupported)?;
                buffer.copy_from_slice(part);
                rest = tail;
            }
        }
        Ok(())
    }
}

/// Writes joined, then reads joined; the SC18IM knows no other order.
fn flatten(operations: &[Operation<'_>]) -> Result<(Vec<u8, MESSAGE_MAX>, usize), Error> {
    let mut write = Vec::new();
    let mut count = 0usize;
    for operation in operations {
        match operation {
            Operation::Write(_) if count > 0 => return Err(Error::Unsupported),
            Operation::Write(bytes) => {
                let length = write.len() + bytes.len();
                write.extend_from_slice(bytes).map_err(|_| Error::TooLong {
                    length,
                    limit: MESSAGE_MAX,
                })?;
            }
            Operation::Read(buffer) => count = count.saturating_add(buffer.len()),
        }
    }
    Ok((write, count))
}
