//! What a link is told, and what it tells.

use crate::{Duration, rtu, timing};
use embedded_io::ErrorKind;

/// Longest request the link sends, bytes.
pub const MAX_REQUEST: usize = 64;
/// What a link needs to know about its line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// The slave's address.
    pub unit: u8,
    /// Speed, baud.
    pub baud: u32,
    /// From the end of a request to the start of its reply, at most.
    pub response: Duration,
    /// Silence between frames.
    pub silence: Duration,
    /// Longest reply any request of the user has, bytes: the quarantine after a timeout.
    pub longest_reply: usize,
    /// By how much later than that a reply may start, and end: for a serial tunnel that keeps bytes
    /// back. Usually nothing.
    pub patience: Duration,
}

impl Config {
    /// The usual times for a line of `baud` (see [`timing`]).
    #[must_use]
    pub const fn new(unit: u8, baud: u32) -> Self {
        let (response, silence) = (timing::RESPONSE, timing::silence(baud));
        Self {
            unit,
            baud,
            response,
            silence,
            longest_reply: 21,
            patience: Duration::from_ticks(0),
        }
    }

    /// From a request of `request` bytes to the latest start of its reply.
    #[must_use]
    pub const fn start_of_reply(&self, request: usize) -> Duration {
        let start = timing::first_byte(self.baud, request, self.response);
        Duration::from_ticks(start.as_ticks().saturating_add(self.patience.as_ticks()))
    }

    /// From there to the latest end of a reply of `reply` bytes.
    #[must_use]
    pub const fn end_of_reply(&self, reply: usize) -> Duration {
        let end = timing::last_byte(self.baud, reply);
        Duration::from_ticks(end.as_ticks().saturating_add(self.patience.as_ticks()))
    }

    /// The longest an exchange can take: the link's deadline.
    #[must_use]
    pub const fn longest_exchange(&self) -> Duration {
        let start = self.start_of_reply(MAX_REQUEST).as_ticks();
        let end = self.end_of_reply(self.longest_reply).as_ticks();
        Duration::from_ticks(start.saturating_add(end))
    }
}

/// Most bytes before a reply with which it is recognised, and named, as [`Error::Shifted`].
pub const MOST_SHIFTED: u8 = 3;

/// The check a valid reply failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Field {
    /// Another slave's address.
    Unit,
    /// Another function code.
    Function,
    /// Another byte count.
    ByteCount,
    /// A bit that is always 0 is set.
    Reserved,
    /// A write's address, quantity or value is not what was sent.
    WriteReply,
    /// The gripper echoes a position request (gPRx) that nobody made.
    RequestEcho,
}

/// What failed at the port itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PortFault {
    /// Reading.
    Read(ErrorKind),
    /// Writing.
    Write(ErrorKind),
    /// The other side is gone: a read or a write of no bytes.
    Closed,
}

/// Why a transaction has no answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// As many bytes as the reply has, with a wrong CRC.
    Crc,
    /// The reply, whole and right, after so many bytes that nobody sent (1 to [`MOST_SHIFTED`]). Not
    /// taken: a bus that makes bytes up makes others up too.
    Shifted(u8),
    /// The late reply to an earlier request.
    Stale,
    /// A whole frame with a right CRC that does not answer the request.
    Shape(Field),
    /// No whole reply in time.
    Timeout {
        /// Bytes that did arrive.
        received: usize,
    },
    /// The device understood and said no.
    Exception(rtu::Exception),
    /// The line does not fall silent: so many bytes that belong to nothing.
    Noise(u32),
    /// The port failed.
    Port(PortFault),
}

impl core::fmt::Display for Error {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match *self {
            Self::Crc => write!(
                f,
                "the reply's CRC is wrong: check cable, ground and termination"
            ),
            Self::Shifted(by) => write!(
                f,
                "a whole good reply stands {by} extra byte{} late: the bus lacks bias or termination \
                 (RS-485: A up, B down, 120 ohms at both ends)",
                if by == 1 { "" } else { "s" }
            ),
            Self::Stale => write!(
                f,
                "the late reply to an earlier request came: the line is slower than configured"
            ),
            Self::Shape(field) => {
                let what = match field {
                    Field::Unit => {
                        "it comes from another slave: two masters, or another unit number"
                    }
                    Field::Function => "another function code",
                    Field::ByteCount => "another byte count",
                    Field::Reserved => "a reserved bit is set",
                    Field::WriteReply | Field::RequestEcho => {
                        "it repeats something that was not sent"
                    }
                };
                write!(f, "a valid frame does not answer the request: {what}")
            }
            Self::Timeout { received: 0 } => {
                write!(
                    f,
                    "no answer: check power, cable, baud rate and unit number"
                )
            }
            Self::Timeout { received } => {
                write!(
                    f,
                    "no whole answer, {received} bytes came: check baud rate and cable"
                )
            }
            Self::Exception(code) => {
                write!(
                    f,
                    "the device refuses with exception {:02X}, {}",
                    code.0,
                    code.meaning()
                )
            }
            Self::Noise(n) => {
                write!(
                    f,
                    "the line does not fall silent, {n} bytes nobody asked for: check baud rate and wiring"
                )
            }
            Self::Port(fault) => write!(
                f,
                "the serial port failed ({fault:?}): unplugged? reopen it"
            ),
        }
    }
}

impl core::error::Error for Error {}

/// Why a request was not sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refused {
    /// A transaction, a drain or a silence is under way; ask again at [`next_due`](super::Link::next_due).
    Busy,
    /// A late reply could be taken for the answer: send one whose reply has another signature, or wait.
    Ambiguous,
    /// A write, while it is not known whether the adapter echoes: read once first.
    LocalEchoUnknown,
    /// The request or its reply is longer than the link's buffers, or cannot be put into bytes.
    Length,
    /// The port failed.
    Port(PortFault),
}

/// Whether an RS-485 adapter sends back what it is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LocalEcho {
    /// No read has been answered yet.
    Unknown,
    /// It does not.
    Off,
    /// It does: every reply comes after a copy of its request.
    On,
}
