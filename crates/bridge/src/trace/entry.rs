//! The coding of a trace.

use super::code::{Damage, Head, Take};
use super::order::Order;
use super::seen::Seen;
use embedded_io::ErrorKind;
use glove::sc18im::BaudRefused;

const TAG_HEAD: u8 = 0x01;
const TAG_PART: u8 = 0x02;
const TAG_ORDER: u8 = 0x03;
const TAG_SEEN: u8 = 0x04;
const TAG_LOST: u8 = 0x05;
const TAG_READ: u8 = 0x10;
const TAG_WRITE: u8 = 0x20;
const TAG_READ_FAILED: u8 = 0x30;
const TAG_WRITE_FAILED: u8 = 0x40;
const TAG_READY: u8 = 0x50;
const TAG_READY_FAILED: u8 = 0x60;
const TAG_SPEED: u8 = 0x70;
const TAG_CLOCK: u8 = 0x80;
const CLOCK_TURN: u8 = 0x40;
const CLOCK_MORE: u8 = 0x20;

/// What a bridge is made of, as far as a replay needs it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The weights image.
    Image,
    /// The glove's profile, as [`glove::calibration::Bound::to_bytes`] gives it.
    Profile,
    /// The settings ([`super::configuration`]).
    Settings,
    /// What else the home says of itself, in a form of its own.
    Home,
}

impl Part {
    const ALL: [Self; 4] = [Self::Image, Self::Profile, Self::Settings, Self::Home];
}

/// Which call of a port failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Call {
    /// The question whether there is something to read.
    Ready,
    /// A read.
    Read,
    /// A write.
    Write,
}

/// One thing that happened.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Entry<'t> {
    /// The beginning: a bridge for a gripper with so many axes.
    Head {
        /// Axes of the gripper.
        axes: u8,
    },
    /// Something the bridge is made of.
    Part {
        /// What.
        part: Part,
        /// The bytes.
        bytes: &'t [u8],
    },
    /// The clock was read.
    Clock {
        /// Whether it is the first reading after a wait: a turn of the loop begins.
        turn: bool,
        /// Microseconds.
        at: u64,
    },
    /// A read of a port gave these bytes.
    Read {
        /// The port.
        port: u8,
        /// What came.
        bytes: &'t [u8],
    },
    /// A write to a port took these bytes.
    Write {
        /// The port.
        port: u8,
        /// What was taken.
        bytes: &'t [u8],
    },
    /// A port said that there is something to read, and it was not read.
    Ready {
        /// The port.
        port: u8,
    },
    /// A call of a port failed.
    Failed {
        /// The port.
        port: u8,
        /// Which call.
        call: Call,
        /// In which way.
        kind: ErrorKind,
    },
    /// A port was told another speed.
    Speed {
        /// The port.
        port: u8,
        /// Baud.
        baud: u32,
        /// Why it kept its own.
        refused: Option<BaudRefused>,
    },
    /// The bridge was told something.
    Order(Order<'t>),
    /// What the bridge made of all that.
    Seen(Seen),
    /// So many bytes of the trace found no room: nothing behind this can be replayed.
    Lost {
        /// How many.
        bytes: u64,
    },
}

/// The bytes of an entry: its head, and what follows it. `since` is the newest reading of the clock before it.
pub(super) fn encode<'e>(entry: &Entry<'e>, since: u64) -> (Head, &'e [u8]) {
    let mut head = Head::default();
    let mut body: &[u8] = &[];
    match *entry {
        Entry::Head { axes } => {
            head.byte(TAG_HEAD);
            super::code::MAGIC.iter().for_each(|&byte| head.byte(byte));
            head.byte(super::code::VERSION);
            head.byte(axes);
        }
        Entry::Part { part, bytes } => {
            head.byte(TAG_PART);
            head.byte(part as u8);
            body = head.counted(bytes);
        }
        Entry::Clock { turn, at } => put_clock(&mut head, turn, at.saturating_sub(since)),
        Entry::Read { port, bytes } => {
            head.byte(TAG_READ | port & 0x0F);
            body = head.counted(bytes);
        }
        Entry::Write { port, bytes } => {
            head.byte(TAG_WRITE | port & 0x0F);
            body = head.counted(bytes);
        }
        Entry::Ready { port } => head.byte(TAG_READY | port & 0x0F),
        Entry::Failed { port, call, kind } => {
            let tag = match call {
                Call::Ready => TAG_READY_FAILED,
                Call::Read => TAG_READ_FAILED,
                Call::Write => TAG_WRITE_FAILED,
            };
            head.byte(tag | port & 0x0F);
            head.byte(code_of(kind));
        }
        Entry::Speed {
            port,
            baud,
            refused,
        } => {
            head.byte(TAG_SPEED | port & 0x0F);
            head.number(u64::from(baud));
            head.byte(match refused {
                None => 0,
                Some(BaudRefused::Fixed) => 1,
                Some(BaudRefused::Unsupported(_)) => 2,
            });
        }
        Entry::Order(ref order) => {
            head.byte(TAG_ORDER);
            body = order.encode(&mut head);
        }
        Entry::Seen(Seen { state, digest }) => {
            head.byte(TAG_SEEN);
            head.byte(state);
            digest.to_le_bytes().iter().for_each(|&b| head.byte(b));
        }
        Entry::Lost { bytes } => {
            head.byte(TAG_LOST);
            head.number(bytes);
        }
    }
    (head, body)
}

/// Reads a trace entry by entry. A copy reads on from the same place.
#[derive(Debug, Clone, Copy)]
pub struct Reader<'t> {
    bytes: &'t [u8],
    offset: usize,
    at: u64,
}

impl<'t> Reader<'t> {
    /// At the beginning of `bytes`.
    pub const fn new(bytes: &'t [u8]) -> Self {
        Self {
            bytes,
            offset: 0,
            at: 0,
        }
    }

    /// At the beginning of a part of a trace before which the clock read `at` µs.
    pub const fn since(bytes: &'t [u8], at: u64) -> Self {
        Self {
            bytes,
            offset: 0,
            at,
        }
    }

    /// Where the next entry begins.
    pub const fn offset(&self) -> usize {
        self.offset
    }

    /// The newest reading of the clock so far, µs.
    pub const fn at(&self) -> u64 {
        self.at
    }

    /// The next entry; `None` at the end. After damage the reader stays where it is.
    ///
    /// # Errors
    /// What is wrong with the bytes.
    pub fn read(&mut self) -> Result<Option<Entry<'t>>, Damage> {
        let Some(rest) = self.bytes.get(self.offset..) else {
            return Ok(None);
        };
        if rest.is_empty() {
            return Ok(None);
        }
        let mut take = Take { rest };
        let entry = take.entry(self.at)?;
        self.offset = self.bytes.len() - take.rest.len();
        if let Entry::Clock { at, .. } = entry {
            self.at = at;
        }
        Ok(Some(entry))
    }

    /// The next entry, which is read again.
    pub fn peek(&self) -> Option<Entry<'t>> {
        let mut ahead = *self;
        ahead.read().ok().flatten()
    }
}

/// Five bits of the time passed lie in the tag.
fn put_clock(head: &mut Head, turn: bool, passed: u64) {
    let turn = if turn { CLOCK_TURN } else { 0 };
    let more = if passed > 0x1F { CLOCK_MORE } else { 0 };
    head.byte(TAG_CLOCK | turn | more | (passed as u8 & 0x1F));
    if more != 0 {
        head.number(passed >> 5);
    }
}

impl<'t> Take<'t> {
    fn entry(&mut self, since: u64) -> Result<Entry<'t>, Damage> {
        let tag = self.byte()?;
        if tag & TAG_CLOCK != 0 {
            return self.clock(tag, since);
        }
        let port = tag & 0x0F;
        Ok(match (tag & 0xF0, tag) {
            (0, TAG_HEAD) => self.head()?,
            (0, TAG_PART) => {
                let code = usize::from(self.byte()?);
                let part = *Part::ALL.get(code).ok_or(Damage::Value)?;
                let bytes = self.counted()?;
                Entry::Part { part, bytes }
            }
            (0, TAG_ORDER) => Entry::Order(Order::decode(self)?),
            (0, TAG_SEEN) => {
                let state = self.byte()?;
                let digest = self.bytes(4)?.try_into().map_err(|_| Damage::Cut)?;
                let digest = u32::from_le_bytes(digest);
                Entry::Seen(Seen { state, digest })
            }
            (0, TAG_LOST) => Entry::Lost {
                bytes: self.number()?,
            },
            (TAG_READ, _) => Entry::Read {
                port,
                bytes: self.counted()?,
            },
            (TAG_WRITE, _) => Entry::Write {
                port,
                bytes: self.counted()?,
            },
            (TAG_READY, _) => Entry::Ready { port },
            (TAG_READY_FAILED, _) => self.failed(port, Call::Ready)?,
            (TAG_READ_FAILED, _) => self.failed(port, Call::Read)?,
            (TAG_WRITE_FAILED, _) => self.failed(port, Call::Write)?,
            (TAG_SPEED, _) => self.speed(port)?,
            _ => return Err(Damage::Tag(tag)),
        })
    }

    fn head(&mut self) -> Result<Entry<'t>, Damage> {
        if self.bytes(super::code::MAGIC.len())? != super::code::MAGIC {
            return Err(Damage::Value);
        }
        match self.byte()? {
            super::code::VERSION => Ok(Entry::Head { axes: self.byte()? }),
            other => Err(Damage::Version(other)),
        }
    }

    fn clock(&mut self, tag: u8, since: u64) -> Result<Entry<'t>, Damage> {
        let mut passed = u64::from(tag & 0x1F);
        if tag & CLOCK_MORE != 0 {
            let high = self.number()?;
            if high.leading_zeros() < 5 {
                return Err(Damage::Value);
            }
            passed |= high << 5;
        }
        let at = since.checked_add(passed).ok_or(Damage::Value)?;
        let turn = tag & CLOCK_TURN != 0;
        Ok(Entry::Clock { turn, at })
    }

    fn failed(&mut self, port: u8, call: Call) -> Result<Entry<'t>, Damage> {
        let kind = *KINDS.get(usize::from(self.byte()?)).ok_or(Damage::Value)?;
        Ok(Entry::Failed { port, call, kind })
    }

    fn speed(&mut self, port: u8) -> Result<Entry<'t>, Damage> {
        let baud = u32::try_from(self.number()?).map_err(|_| Damage::Value)?;
        let refused = match self.byte()? {
            0 => None,
            1 => Some(BaudRefused::Fixed),
            2 => Some(BaudRefused::Unsupported(baud)),
            _ => return Err(Damage::Value),
        };
        Ok(Entry::Speed {
            port,
            baud,
            refused,
        })
    }
}

/// The kinds of a port's errors by their code. A kind that is not here is [`ErrorKind::Other`].
const KINDS: [ErrorKind; 18] = [
    ErrorKind::Other,
    ErrorKind::NotFound,
    ErrorKind::PermissionDenied,
    ErrorKind::ConnectionRefused,
    ErrorKind::ConnectionReset,
    ErrorKind::ConnectionAborted,
    ErrorKind::NotConnected,
    ErrorKind::AddrInUse,
    ErrorKind::AddrNotAvailable,
    ErrorKind::BrokenPipe,
    ErrorKind::AlreadyExists,
    ErrorKind::InvalidInput,
    ErrorKind::InvalidData,
    ErrorKind::TimedOut,
    ErrorKind::Interrupted,
    ErrorKind::Unsupported,
    ErrorKind::OutOfMemory,
    ErrorKind::WriteZero,
];

fn code_of(kind: ErrorKind) -> u8 {
    let code = KINDS.iter().position(|known| *known == kind);
    code.unwrap_or(0) as u8
}
