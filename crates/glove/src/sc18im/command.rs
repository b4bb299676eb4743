//! The SC18IM's ASCII commands as bytes. Lengths rule: 0x28 << 1 is `P` and 0x29 << 1 is `R`, so nothing here or in
//! the reader ever looks for a letter in data.

use crate::bus::{Batch, Error, Transaction};
use heapless::Vec;

/// START.
const START: u8 = b'S';
/// STOP.
const STOP: u8 = b'P';
/// Read internal registers.
const READ_REGISTER: u8 = b'R';
/// Write internal registers.
const WRITE_REGISTER: u8 = b'W';

/// Longest serial write: every port's queue takes it at once.
pub const COMMAND_MAX: usize = 64;

/// Registers of the SC18IM700/704.
pub mod register {
    /// Baud rate generator, low byte.
    pub const BRG0: u8 = 0x00;
    /// Baud rate generator, high byte; writing it makes both effective.
    pub const BRG1: u8 = 0x01;
    /// I²C clock, low time.
    pub const I2C_CLK_L: u8 = 0x07;
    /// I²C clock, high time (SC18IM700).
    pub const I2C_CLK_H: u8 = 0x08;
    /// I²C bus timeout: bits 7..1 × 4.44 ms, bit 0 enables.
    pub const I2C_TO: u8 = 0x09;
    /// How the last I²C transaction went.
    pub const I2C_STAT: u8 = 0x0A;
}

/// Bytes of one serial write.
pub type Command = Vec<u8, COMMAND_MAX>;

/// Asks for I2CStat: `R 0A P`, answered by one byte.
pub const STATUS: [u8; 3] = [READ_REGISTER, register::I2C_STAT, STOP];

/// I2CStat: all went well.
pub const STATUS_OK: u8 = 0xF0;
/// I2CStat: nobody acknowledged the address.
pub const STATUS_NACK_ADDRESS: u8 = 0xF1;
/// I2CStat: a data byte was not acknowledged.
pub const STATUS_NACK_DATA: u8 = 0xF2;
/// I2CStat: the bus timed out.
pub const STATUS_TIMEOUT: u8 = 0xF8;

/// Whether a byte can be an I2CStat.
pub fn is_status(byte: u8) -> bool {
    (STATUS_OK..=STATUS_TIMEOUT).contains(&byte)
}

/// Appends bytes, or says that they do not fit.
pub fn append(command: &mut Command, bytes: &[u8]) -> Result<(), Error> {
    let length = command.len() + bytes.len();
    command
        .extend_from_slice(bytes)
        .map_err(|_| Error::TooLong {
            length,
            limit: COMMAND_MAX,
        })
}

/// Appends one I²C transaction: `S a<<1 n d… P`, `S a<<1|1 n P`, or the first without `P` and then the second.
pub fn append_transaction(command: &mut Command, transaction: &Transaction) -> Result<(), Error> {
    let address = transaction.address() << 1;
    let bytes = transaction.bytes();
    if !bytes.is_empty() {
        append(command, &[START, address, bytes.len() as u8])?;
        append(command, bytes)?;
    }
    if transaction.count() > 0 {
        append(command, &[START, address | 1, transaction.count() as u8])?;
    }
    append(command, &[STOP])
}

/// The command of a batch; ends with a status request if its last transaction reads nothing, since a write is answered
/// by nothing at all, and where `check` asks for it after every read, too.
pub fn batch(batch: &Batch, check: bool) -> Result<(Command, Expected), Error> {
    let mut command = Command::new();
    let mut expected = Expected {
        bytes: 0,
        i2c: 0,
        status: false,
    };
    for transaction in batch {
        append_transaction(&mut command, transaction)?;
        expected.bytes += transaction.count();
        expected.i2c += transaction.i2c_bytes();
    }
    match batch.last() {
        None => return Err(Error::Unsupported),
        Some(last) if check || last.count() == 0 => {
            append(&mut command, &STATUS)?;
            expected.bytes += 1;
            expected.status = true;
        }
        Some(_) => {}
    }
    Ok((command, expected))
}

/// Writes internal registers: `W r v … P`. Nothing answers.
pub fn append_write_registers(command: &mut Command, values: &[(u8, u8)]) -> Result<(), Error> {
    append(command, &[WRITE_REGISTER])?;
    for (register, value) in values {
        append(command, &[*register, *value])?;
    }
    append(command, &[STOP])
}

/// Reads one internal register: `R r P`.
pub fn append_read_register(command: &mut Command, register: u8) -> Result<(), Error> {
    append(command, &[READ_REGISTER, register, STOP])
}

/// What answers a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Expected {
    /// Bytes that come back, the status included.
    pub bytes: usize,
    /// Bytes on the I²C bus.
    pub i2c: usize,
    /// Whether the last byte is an I2CStat.
    pub status: bool,
}

/// The baud rate generator's value for `baud`: 7372800 / baud − 16.
///
/// `None` if the chip cannot make it: above 460800, so low that 16 bits do not hold it, or off by more than 2 %.
pub fn baud_divisor(baud: u32) -> Option<u16> {
    const CRYSTAL: u32 = 7_372_800;
    if baud == 0 {
        return None;
    }
    let total = (CRYSTAL + baud / 2) / baud;
    let divisor = u16::try_from(total.checked_sub(16)?).ok()?;
    let made = CRYSTAL / total;
    (made.abs_diff(baud) <= baud / 50).then_some(divisor)
}
