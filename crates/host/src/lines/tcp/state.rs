//! What both sides of the queues know of a line: its times, its errors, how it fares.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Modbus unit of the 3-Finger gripper's TCP variant.
pub const UNIT: u8 = 2;
/// Modbus TCP's port.
pub const PORT: u16 = 502;
/// Bytes of a block.
pub const BLOCK: usize = gripper::registers::three_finger::BLOCK;

/// For one exchange: a block written, a block read.
pub const EXCHANGE: Duration = Duration::from_millis(200);
/// For the name's address and the connection.
pub const CONNECT: Duration = Duration::from_secs(2);
/// Pause before the first attempt to connect again; doubles up to [`RECONNECT_LAST`].
pub const RECONNECT_FIRST: Duration = Duration::from_millis(100);
/// Longest pause between two attempts.
pub const RECONNECT_LAST: Duration = Duration::from_secs(2);

/// What a Modbus TCP line cannot do.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// The name has no address.
    #[error("the name {0} has no address")]
    Name(String),
    /// Nobody listens there.
    #[error("the connection is refused: nothing listens on that port")]
    Refused,
    /// No connection in time.
    #[error("no connection within {} s", CONNECT.as_secs())]
    Unreachable,
    /// There is no connection at the moment.
    #[error("not connected")]
    NotConnected,
    /// No whole answer in time.
    #[error("connected, but no answer in time ({} ms and what --patience adds): it is slow, another unit, or serves one client only and another is connected", EXCHANGE.as_millis())]
    Timeout,
    /// The other side ended the connection.
    #[error("the other side closed the connection")]
    Closed,
    /// The other side ended the connection inside an answer.
    #[error("the other side ended the connection inside an answer")]
    Cut,
    /// What came is no Modbus TCP frame: its header or length is impossible.
    #[error("what came is no valid Modbus TCP frame ({0})")]
    Malformed(String),
    /// A valid frame that does not answer the request.
    #[error("a valid frame does not answer the request ({0})")]
    Mismatch(String),
    /// The answer bears another transaction number than the request.
    #[error(
        "the server keeps no transaction numbers: it answers request {asked} with number {answered}, and which answer is whose cannot be told"
    )]
    Unnumbered {
        /// The request's.
        asked: u16,
        /// The answer's.
        answered: u16,
    },
    /// The gripper, or a gateway before it, says no.
    #[error("the device refuses with exception {0:02X}")]
    Exception(u8),
    /// A request that is neither a status read nor a command block.
    #[error("only whole command and status blocks go over Modbus TCP")]
    Unsupported,
    /// The system's words.
    #[error("{0}")]
    System(String),
}

impl Error {
    /// What a person can do about it.
    pub fn next_step(&self) -> &'static str {
        match self {
            Self::Name(_) => "the gripper's IP address (192.168.1.11 as delivered)",
            Self::Refused => {
                "whether this is the gripper's address, and its Modbus TCP port (502 by default)"
            }
            Self::Unreachable | Self::System(_) => {
                "whether the gripper answers a ping; its power, the network cable, and that the PC has an address in the same network"
            }
            Self::Timeout => {
                "ending other programs that are connected to it; the same with --patience 500; --unit with another unit number (2 by default); the gripper's power"
            }
            Self::Unnumbered { .. } => {
                "a gateway that repeats transaction numbers, as Modbus TCP demands, or the gripper's serial port"
            }
            Self::NotConnected | Self::Closed | Self::Cut => {
                "ending other programs that are connected to the gripper, then again"
            }
            Self::Malformed(_) | Self::Mismatch(_) | Self::Unsupported => {
                "whether this address and port belong to the gripper"
            }
            Self::Exception(_) => "--unit, and whether this is a 3-Finger gripper",
        }
    }
}

impl embedded_io::Error for Error {
    fn kind(&self) -> embedded_io::ErrorKind {
        use embedded_io::ErrorKind;
        match self {
            Self::Name(_) | Self::NotConnected => ErrorKind::NotConnected,
            Self::Refused => ErrorKind::ConnectionRefused,
            Self::Unreachable | Self::Timeout => ErrorKind::TimedOut,
            Self::Closed | Self::Cut => ErrorKind::ConnectionReset,
            Self::Malformed(_) | Self::Mismatch(_) | Self::Unnumbered { .. } => {
                ErrorKind::InvalidData
            }
            Self::Unsupported => ErrorKind::Unsupported,
            Self::Exception(_) | Self::System(_) => ErrorKind::Other,
        }
    }
}

/// How a line fares, as far as both sides of the queues need to know.
#[derive(Debug, Default)]
pub(super) struct State {
    pub(super) connected: bool,
    /// The newest failure since the last good answer.
    pub(super) error: Option<Error>,
    pub(super) connections: u64,
}

pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Nothing panics while holding these; a poisoned lock still holds a valid value.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
