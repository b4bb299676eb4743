//! Where a replay first does something else than its trace.

use super::entry::{Call, Entry};
use super::port::port_name;
use super::seen::{Seen, state_name};

/// One kind of thing at a place of a trace.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum What {
    /// The clock was read.
    Clock,
    /// A port was read.
    Read(u8),
    /// A port said that there is something to read, and it was not read.
    Ready(u8),
    /// A port was written to.
    Write(u8),
    /// A port was told another speed.
    Speed(u8),
    /// An order.
    Order,
    /// A frame or a change of state.
    Seen,
    /// What the bridge is made of.
    Part,
    /// The trace has a gap.
    Gap,
}

impl core::fmt::Display for What {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let (what, port) = match self {
            Self::Clock => ("a look at the clock", None),
            Self::Read(port) => ("a read of the line to the", Some(port)),
            Self::Ready(port) => ("a question whether bytes came from the", Some(port)),
            Self::Write(port) => ("a write on the line to the", Some(port)),
            Self::Speed(port) => ("a change of the baud rate on the line to the", Some(port)),
            Self::Order => ("an order", None),
            Self::Seen => ("a new frame or state", None),
            Self::Part => ("the beginning of a trace", None),
            Self::Gap => ("a gap", None),
        };
        match port {
            Some(port) => write!(f, "{what} {}", port_name(*port)),
            None => f.write_str(what),
        }
    }
}

/// Where a replay first does something else than its trace.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Difference {
    /// A byte that is written is another one.
    Byte {
        /// The port.
        port: u8,
        /// Which byte of the write, from 0.
        byte: usize,
        /// In the trace.
        expected: u8,
        /// In the replay.
        got: u8,
    },
    /// Fewer bytes are written.
    Length {
        /// The port.
        port: u8,
        /// In the trace.
        expected: usize,
        /// In the replay.
        got: usize,
    },
    /// Another speed is set.
    Speed {
        /// The port.
        port: u8,
        /// In the trace.
        expected: u32,
        /// In the replay.
        got: u32,
    },
    /// The bridge does something else at all.
    Call {
        /// In the trace.
        expected: What,
        /// In the replay.
        got: What,
    },
    /// What the bridge made of a frame, or its state.
    Seen {
        /// In the trace.
        expected: Seen,
        /// In the replay.
        got: Seen,
    },
}

impl core::fmt::Display for Difference {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match *self {
            Self::Byte {
                port,
                byte,
                expected,
                got,
            } => write!(
                f,
                "byte {byte} of a write to the {}: {expected:#04x} in the log, {got:#04x} in the replay",
                port_name(port)
            ),
            Self::Length {
                port,
                expected,
                got,
            } => write!(
                f,
                "a write to the {}: {expected} bytes in the log, {got} in the replay",
                port_name(port)
            ),
            Self::Speed {
                port,
                expected,
                got,
            } => write!(
                f,
                "the baud rate on the line to the {}: {expected} in the log, {got} in the replay",
                port_name(port)
            ),
            Self::Call { expected, got } => {
                write!(f, "{expected} in the log, {got} in the replay")
            }
            Self::Seen { expected, got } if expected.state != got.state => write!(
                f,
                "the state: {} in the log, {} in the replay",
                state_name(expected.state),
                state_name(got.state)
            ),
            Self::Seen { expected, got } => write!(
                f,
                "the frame's angles, map output, target or command: checksum {:#010x} in the log, {:#010x} in the replay",
                expected.digest, got.digest
            ),
        }
    }
}

/// What an entry is.
pub(super) fn what(entry: &Entry<'_>) -> What {
    match *entry {
        Entry::Head { .. } | Entry::Part { .. } => What::Part,
        Entry::Clock { .. } => What::Clock,
        Entry::Read { port, .. } => What::Read(port),
        Entry::Write { port, .. } => What::Write(port),
        Entry::Ready { port } => What::Ready(port),
        Entry::Failed { port, call, .. } => match call {
            Call::Ready => What::Ready(port),
            Call::Read => What::Read(port),
            Call::Write => What::Write(port),
        },
        Entry::Speed { port, .. } => What::Speed(port),
        Entry::Order(_) => What::Order,
        Entry::Seen(_) => What::Seen,
        Entry::Lost { .. } => What::Gap,
    }
}
