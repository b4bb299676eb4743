//! Bring-up of one BNO055 through the `bno055` crate, without waiting.
//!
//! The crate's calls block: they make several transactions and pause between. Here a call runs against a replay
//! instead of a bus. The replay answers the transactions whose replies are known; at the first that is not, it notes
//! what is wanted and fails the call. The caller makes that transaction split-phase, adds its reply, and runs the call
//! from the start again. No call makes more than a dozen short transactions, so running them again costs microseconds.
//! The crate's delays return at once; the pauses are the caller's, as due times ([`Outcome::pause`]).
//!
//! What the crate does not do right is worked around: it caches the mode before it writes it, so every run
//! starts from a new driver and a mode that was read; it never writes UNIT_SEL and hides the system status, so
//! these are read and written here; and everything written is read back.

use super::{Config, Error, Mode, UniqueId, register};
use crate::Duration;
use crate::bus::{self, MESSAGE_MAX, Transaction};
use crate::timing;
use bno055::{BNO055_ID, BNO055OperationMode, BNO055PowerMode, Bno055};
use embedded_hal::delay::DelayNs;
use embedded_hal::i2c::{ErrorKind, ErrorType, I2c, Operation};
use heapless::Vec;

/// Most transactions in one step.
const LOG_MAX: usize = 16;

/// Units: acceleration m/s² (b0), rate °/s (b1), Euler angles ° (b2), temperature °C (b4), orientation convention Windows
/// (b7). Written because the data sheet contradicts itself on what stands there after a reset.
const UNITS: u8 = 0x00;

/// The next step may follow at once.
const NO_PAUSE: Duration = Duration::from_ticks(0);

/// SYS_STATUS: fusion running.
const FUSION_RUNNING: u8 = 5;

/// One step of a bring-up. Between steps the sensor needs time; within one it does not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// Chip id and unique id; nothing is changed before it is known whose they are.
    Identify,
    /// CONFIG mode (a reset is not taken in another one).
    Stop,
    /// Reset.
    Reset,
    /// Chip id again, power mode, clock source, units, read back; then the fusion mode.
    Configure,
    /// Mode read back, unique id once more (whoever was reset may have been exchanged meanwhile), fusion running; whether the
    /// register pointer stays.
    Verify,
    /// What a sensor that fell silent is doing, and whether it is the same one: mode read back, unique id. Another one may have
    /// been put in its place, or it restarted.
    Recheck,
}

/// What a finished step found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Outcome {
    /// The step to make next; `None`: the sensor can be sampled.
    pub next: Option<Step>,
    /// How long to leave the sensor alone before that.
    pub pause: Duration,
    /// Whether a plain read repeats from the last register written, as the data sheet has it; `None` where the step
    /// did not try.
    pub pointer_stays: Option<bool>,
    /// The sensor's unique id; `None` where the step did not read it, or it is none (the same byte 16 times).
    pub unique_id: Option<UniqueId>,
}

impl Step {
    /// Whether it asks a sensor for its unique id wherever it ends with the next step but one for that, or with none.
    pub fn reads_id(self) -> bool {
        matches!(self, Step::Identify | Step::Verify | Step::Recheck)
    }
}

impl Outcome {
    fn then(next: Option<Step>, pause: Duration) -> Self {
        Self {
            next,
            pause,
            pointer_stays: None,
            unique_id: None,
        }
    }
}

/// What a step needs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Next {
    /// This transaction; then [`BringUp::supply`].
    Transaction(Transaction),
    /// Nothing: it is done.
    Done(Outcome),
    /// It failed.
    Failed(Error),
}

/// One step of one sensor's bring-up, under way.
#[derive(Debug)]
pub struct BringUp {
    step: Step,
    address: u8,
    config: Config,
    log: Vec<Entry, LOG_MAX>,
    failed: Option<Error>,
}

/// The reply to one transaction.
type Entry = Vec<u8, MESSAGE_MAX>;

impl BringUp {
    /// Begins `step` of the sensor at `address` (0x28 or 0x29).
    pub fn new(step: Step, address: u8, config: Config) -> Self {
        Self {
            step,
            address,
            config,
            log: Vec::new(),
            failed: None,
        }
    }

    /// The step.
    pub fn step(&self) -> Step {
        self.step
    }

    /// What the step needs now. Asking again gives the same answer.
    pub fn next(&self) -> Next {
        if let Some(error) = self.failed {
            return Next::Failed(error);
        }
        let (result, replay) = self.run();
        match (result, replay.wanted) {
            (Ok(outcome), _) => Next::Done(outcome),
            (Err(Failure::Bus), Some(transaction)) => Next::Transaction(transaction),
            (Err(Failure::Bus), None) => Next::Failed(Error::Bus {
                register: replay.register,
                cause: bus::Error::Unsupported,
            }),
            (Err(Failure::Sensor(error)), _) => Next::Failed(error),
        }
    }

    /// Runs the step as far as the replies go.
    fn run(&self) -> (Result<Outcome, Failure>, Replay<'_>) {
        let mut replay = Replay {
            log: &self.log,
            cursor: 0,
            wanted: None,
            register: register::CHIP_ID,
        };
        let result = run(self.step, &mut replay, self.address, &self.config);
        (result, replay)
    }

    /// The answer to the transaction that [`BringUp::next`] named.
    pub fn supply(&mut self, answer: Result<&[u8], bus::Error>) {
        let cause = match answer.map(Entry::from_slice) {
            Ok(Ok(entry)) => match self.log.push(entry) {
                Ok(()) => return,
                Err(_) => bus::Error::Unsupported,
            },
            Ok(Err(_)) => bus::Error::Unsupported,
            Err(cause) => cause,
        };
        let (_, replay) = self.run();
        let register = replay.register;
        self.failed = Some(Error::Bus { register, cause });
    }
}

/// Why a run ended early.
enum Failure {
    /// The replay has no answer yet.
    Bus,
    /// The sensor is not as it should be.
    Sensor(Error),
}

impl From<bno055::Error<Unanswered>> for Failure {
    fn from(error: bno055::Error<Unanswered>) -> Self {
        match error {
            bno055::Error::InvalidChipId(id) => Failure::Sensor(Error::ChipId(id)),
            _ => Failure::Bus,
        }
    }
}

impl From<Unanswered> for Failure {
    fn from(_: Unanswered) -> Self {
        Failure::Bus
    }
}

/// The calls of one step.
fn run(step: Step, i2c: &mut Replay<'_>, address: u8, config: &Config) -> Result<Outcome, Failure> {
    let mut no_delay = NoDelay;
    let mut sensor = driver(&mut *i2c, address);
    let then = |step, pause| Ok(Outcome::then(Some(step), pause));
    match step {
        Step::Identify => {
            check_id(sensor.id()?)?;
            Ok(Outcome {
                unique_id: unique_id(i2c, address)?,
                ..Outcome::then(Some(Step::Stop), NO_PAUSE)
            })
        }
        Step::Stop => {
            // The crate writes a mode only if it differs from the one it believes in: let it believe the chip.
            sensor.get_mode()?;
            sensor.set_mode(BNO055OperationMode::CONFIG_MODE, &mut no_delay)?;
            then(Step::Reset, timing::MODE_TO_CONFIG)
        }
        Step::Reset => {
            sensor.soft_reset(&mut no_delay)?;
            then(Step::Configure, timing::RESET)
        }
        Step::Configure => {
            check_id(sensor.id()?)?;
            sensor.set_power_mode(BNO055PowerMode::NORMAL)?;
            sensor.set_external_crystal(config.external_crystal, &mut no_delay)?;
            check(
                register::PWR_MODE,
                BNO055PowerMode::NORMAL.bits(),
                sensor.power_mode()?.bits(),
            )?;
            i2c.write(address, &[register::UNIT_SEL, UNITS])?;
            check(
                register::UNIT_SEL,
                UNITS,
                read(i2c, address, register::UNIT_SEL)?,
            )?;
            // A new driver believes in CONFIG, which the chip is in: the mode is written.
            driver(i2c, address).set_mode(operation_mode(config.mode), &mut no_delay)?;
            then(Step::Verify, timing::CONFIG_TO_MODE)
        }
        Step::Verify => {
            let mode = sensor.get_mode()?.bits();
            check(register::OPR_MODE, config.mode.code(), mode)?;
            let unique_id = unique_id(i2c, address)?;
            let mut status = [0; 2];
            i2c.write_read(address, &[register::SYS_STATUS], &mut status)?;
            let [code, error] = status;
            if code != FUSION_RUNNING {
                return Err(Failure::Sensor(Error::NotRunning {
                    status: code,
                    error,
                }));
            }
            let mut again = [0; 2];
            i2c.read(address, &mut again)?;
            Ok(Outcome {
                pointer_stays: Some(again == status),
                unique_id,
                ..Outcome::then(None, NO_PAUSE)
            })
        }
        Step::Recheck => {
            let mode = sensor.get_mode()?;
            let next = if mode.bits() == config.mode.code() {
                None
            } else if mode == BNO055OperationMode::CONFIG_MODE {
                // It restarted by itself, or its supply failed: it is as after a reset.
                Some(Step::Configure)
            } else {
                return then(Step::Identify, NO_PAUSE);
            };
            Ok(Outcome {
                unique_id: unique_id(i2c, address)?,
                ..Outcome::then(next, NO_PAUSE)
            })
        }
    }
}

/// A new driver, which believes nothing.
fn driver<'a, 'b>(i2c: &'a mut Replay<'b>, address: u8) -> Bno055<&'a mut Replay<'b>> {
    let driver = Bno055::new(i2c);
    if address == super::ADDRESS_LOW {
        driver.with_alternative_address()
    } else {
        driver
    }
}

fn operation_mode(mode: Mode) -> BNO055OperationMode {
    match mode {
        Mode::Imu => BNO055OperationMode::IMU,
        Mode::Ndof => BNO055OperationMode::NDOF,
    }
}

fn read(i2c: &mut Replay<'_>, address: u8, register: u8) -> Result<u8, Unanswered> {
    let mut byte = [0];
    i2c.write_read(address, &[register], &mut byte)?;
    Ok(byte[0])
}

/// Reads the unique id twice from page 1, so that a flipped bit is not taken for another sensor; and whether it is back on page 0, as what
/// is read there next would be other registers.
fn unique_id(i2c: &mut Replay<'_>, address: u8) -> Result<Option<UniqueId>, Failure> {
    let (mut id, mut again): (UniqueId, UniqueId) = ([0; 16], [0; 16]);
    i2c.write(address, &[register::PAGE_ID, 1])?;
    i2c.write_read(address, &[register::UNIQUE_ID], &mut id)?;
    i2c.write_read(address, &[register::UNIQUE_ID], &mut again)?;
    i2c.write(address, &[register::PAGE_ID, 0])?;
    check(register::PAGE_ID, 0, read(i2c, address, register::PAGE_ID)?)?;
    let [wrote, ..] = id;
    if let Some((_, read)) = id.iter().zip(again).find(|(a, b)| **a != *b) {
        return Err(Failure::Sensor(Error::ReadBack {
            register: register::UNIQUE_ID,
            wrote,
            read,
        }));
    }
    Ok(id.iter().any(|byte| *byte != wrote).then_some(id))
}

fn check_id(id: u8) -> Result<(), Failure> {
    if id == BNO055_ID {
        Ok(())
    } else {
        Err(Failure::Sensor(Error::ChipId(id)))
    }
}

fn check(register: u8, wrote: u8, read: u8) -> Result<(), Failure> {
    if wrote == read {
        Ok(())
    } else {
        Err(Failure::Sensor(Error::ReadBack {
            register,
            wrote,
            read,
        }))
    }
}

/// An I²C bus that knows the replies so far.
struct Replay<'a> {
    log: &'a [Entry],
    cursor: usize,
    wanted: Option<Transaction>,
    /// The register addressed last; a plain read goes on there.
    register: u8,
}

/// The replay's only error: the reply is not known yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Unanswered;

impl embedded_hal::i2c::Error for Unanswered {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

impl ErrorType for Replay<'_> {
    type Error = Unanswered;
}

impl I2c for Replay<'_> {
    fn transaction(
        &mut self,
        address: u8,
        operations: &mut [Operation<'_>],
    ) -> Result<(), Unanswered> {
        if let Some(Operation::Write([register, ..])) = operations.first() {
            self.register = *register;
        }
        let Some(reply) = self.log.get(self.cursor) else {
            self.wanted = describe(address, operations);
            return Err(Unanswered);
        };
        self.cursor += 1;
        let mut rest = reply.as_slice();
        for operation in operations {
            if let Operation::Read(buffer) = operation {
                let (part, tail) = rest.split_at_checked(buffer.len()).ok_or(Unanswered)?;
                buffer.copy_from_slice(part);
                rest = tail;
            }
        }
        Ok(())
    }
}

/// The operations of one call (a write, a read, or both) as one transaction; `None` for anything else.
fn describe(address: u8, operations: &[Operation<'_>]) -> Option<Transaction> {
    match operations {
        [Operation::Write(bytes)] => Transaction::write(address, bytes).ok(),
        [Operation::Read(buffer)] => Transaction::read(address, buffer.len()).ok(),
        [Operation::Write(bytes), Operation::Read(buffer)] => {
            Transaction::write_read(address, bytes, buffer.len()).ok()
        }
        _ => None,
    }
}

/// A delay that returns at once.
struct NoDelay;

impl DelayNs for NoDelay {
    fn delay_ns(&mut self, _: u32) {}
}
