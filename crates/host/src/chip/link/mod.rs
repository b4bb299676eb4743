//! The host's end of the host protocol (docs/protocol.md): one request at a time, every wait with a deadline.
//!
//! A request whose reply does not come is sent again with the same sequence number, so that the bridge never does it
//! twice; after [`ATTEMPTS`] the bridge counts as silent. Every frame starts with a zero, which ends whatever noise came
//! before it. [`flash`](HostLink::flash) opens a broken line again and goes on where the bridge says it was.

mod address;
mod clutch;
mod error;
mod flash;
mod hello;
mod line;
mod profile;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use bridge::Epoch;
use bridge::protocol::frame::{self, Decoder};
use bridge::protocol::message::{
    Answer, Call, Counters, FromBridge, Health, Hello, Reply, Request, Sample, Scan, Slots, Status,
};

pub use address::Address;
pub use clutch::Heartbeat;
pub use error::{Error, Heard, refusal_next, refusal_words};
pub use flash::Flashed;
use line::{Kept, Line};

/// Times a request is sent before the bridge counts as silent.
pub const ATTEMPTS: u32 = 5;
/// For a reply.
const REPLY_WAIT: Duration = Duration::from_millis(300);
/// For the replies to what makes motion possible. The last of them is sent 160 ms after the first: an act that reaches the bridge
/// later is no act any more. None waits in front of an order to open for longer than these together.
const ACT_WAITS: [Duration; 3] = [
    Duration::from_millis(80),
    Duration::from_millis(80),
    REPLY_WAIT,
];
/// For the reply to a chunk, which takes 46 ms of a line at 115200 baud. An emulator on a machine with much to do is ten times
/// slower; chunks that were sent again too early would pile up in front of it.
const CHUNK_WAIT: Duration = Duration::from_secs(1);
/// For a reply to what erases or checks flash; an erase block of a real chip takes up to 2 s.
const FLASH_WAIT: Duration = Duration::from_secs(3);
/// Samples kept until somebody takes them; older ones go first.
const SAMPLES: usize = 256;

/// The same of scans; their numbers show which are gone.
const SCANS: usize = 256;

/// A conversation with a bridge.
#[derive(Debug)]
pub struct HostLink {
    address: Address,
    line: Option<Line>,
    kept: Kept,
    decoder: Decoder,
    session: u32,
    sequence: u16,
    hello: Option<Hello>,
    samples: VecDeque<Sample>,
    scans: VecDeque<Scan>,
    repeats: u32,
    /// Since the newest request was first sent.
    heard: Heard,
    /// The newest request as it was sent, to know its echo by.
    asked: Vec<u8>,
}

impl HostLink {
    /// Opens the line and says hello.
    ///
    /// # Errors
    /// The line's fault, silence, or the bridge's refusal (another version, another host).
    pub fn connect(address: &Address) -> Result<Self, Error> {
        let mut link = Self {
            address: address.clone(),
            line: None,
            kept: Kept::default(),
            decoder: Decoder::new(),
            session: new_session(),
            sequence: 0,
            hello: None,
            samples: VecDeque::new(),
            scans: VecDeque::new(),
            repeats: 0,
            heard: Heard::default(),
            asked: Vec::new(),
        };
        link.reconnect()?;
        Ok(link)
    }

    /// Where it is.
    pub fn address(&self) -> &Address {
        &self.address
    }

    /// Requests that were sent again because no reply came.
    pub fn repeats(&self) -> u32 {
        self.repeats
    }

    /// What came back, beside its reply, since the newest request was sent.
    pub fn heard(&self) -> Heard {
        self.heard
    }

    /// Asks, and waits for the answer.
    ///
    /// # Errors
    /// The line's fault, silence after [`ATTEMPTS`], or the bridge's refusal.
    pub fn call(&mut self, call: &Call<'_>) -> Result<Answer, Error> {
        let wait = match call {
            // Said again while the act is new.
            Call::Engage | Call::Activate => return self.ask(call, &ACT_WAITS),
            Call::WeightsBegin { .. }
            | Call::WeightsCommit
            | Call::ProfileCommit { .. }
            | Call::ProfileErase
            | Call::SelectSlot { .. }
            | Call::Slots => FLASH_WAIT,
            Call::WeightsChunk { .. } | Call::ProfileChunk { .. } => CHUNK_WAIT,
            _ => REPLY_WAIT,
        };
        self.ask(call, &[wait; ATTEMPTS as usize])
    }

    /// Sends it once for each of `waits`, and waits that long for its reply.
    fn ask(&mut self, call: &Call<'_>, waits: &[Duration]) -> Result<Answer, Error> {
        self.sequence = self.sequence.wrapping_add(1);
        let request = Request {
            session: self.session,
            sequence: self.sequence,
            call: call.clone(),
        };
        let bytes = framed(&request)?;
        self.heard = Heard::default();
        self.asked.clone_from(&bytes);
        let damaged_before = self.damaged();
        let mut attempts = 0;
        for wait in waits {
            self.repeats += u32::from(attempts > 0);
            attempts += 1;
            let deadline = Instant::now() + *wait;
            self.send(&bytes, deadline)?;
            while let Some(reply) = self.receive(deadline)? {
                if reply.session == self.session && reply.sequence == self.sequence {
                    return reply.answer.map_err(Error::Refused);
                }
                self.heard.foreign += 1;
            }
        }
        self.heard.damaged = self.damaged().wrapping_sub(damaged_before);
        Err(Error::Silent {
            address: self.address.clone(),
            attempts,
            heard: self.heard,
        })
    }

    /// Damaged frames since the line was opened.
    fn damaged(&self) -> u32 {
        let counters = self.decoder.counters();
        counters.crc + counters.coding + counters.oversized
    }

    fn send(&mut self, bytes: &[u8], deadline: Instant) -> Result<(), Error> {
        let line = self.line.as_mut().ok_or(Error::Lost)?;
        line.write(bytes, deadline).map_err(|_| self.lose())
    }

    fn lose(&mut self) -> Error {
        self.line = None;
        Error::Lost
    }

    /// The next reply by `deadline`, which no stream of bytes puts off; samples on the way are kept.
    fn receive(&mut self, deadline: Instant) -> Result<Option<Reply>, Error> {
        self.receive_until(deadline, |_| false)
    }

    /// The same, or less where `enough` has come; `None` then.
    fn receive_until(
        &mut self,
        deadline: Instant,
        enough: impl Fn(&Self) -> bool,
    ) -> Result<Option<Reply>, Error> {
        while !enough(self) && Instant::now() < deadline {
            let line = self.line.as_mut().ok_or(Error::Lost)?;
            let byte = match line.byte(deadline) {
                Ok(None) => return Ok(None),
                Ok(Some(byte)) => byte,
                Err(_) => return Err(self.lose()),
            };
            self.heard.bytes = self.heard.bytes.saturating_add(1);
            let message = self.decoder.push(byte, |message| {
                postcard::from_bytes(message).map_err(|_| framed_bytes(message).ok())
            });
            match message {
                None => {}
                Some(Err(Some(own))) if own == self.asked => self.heard.echoes += 1,
                Some(Err(_)) => self.heard.unknown += 1,
                Some(Ok(FromBridge::Reply(reply))) => return Ok(Some(reply)),
                Some(Ok(FromBridge::Sample(sample))) => {
                    self.heard.samples += 1;
                    if self.samples.len() == SAMPLES {
                        self.samples.pop_front();
                    }
                    self.samples.push_back(sample);
                }
                Some(Ok(FromBridge::Scan(scan))) => {
                    self.heard.samples += 1;
                    if self.scans.len() == SCANS {
                        self.scans.pop_front();
                    }
                    self.scans.push_back(scan);
                }
            }
        }
        Ok(None)
    }

    /// Telemetry samples that have come, after listening for `time`.
    ///
    /// # Errors
    /// The line's fault.
    pub fn listen(&mut self, time: Duration) -> Result<Vec<Sample>, Error> {
        let deadline = Instant::now() + time;
        // Replies that come now answer requests given up before.
        while self.receive(deadline)?.is_some() {}
        Ok(self.samples.drain(..).collect())
    }

    /// What the bridge is doing.
    ///
    /// # Errors
    /// As [`HostLink::call`].
    pub fn status(&mut self) -> Result<Status, Error> {
        as_status(self.call(&Call::Status)?)
    }

    /// What keeps it from moving, beside its devices.
    ///
    /// # Errors
    /// As [`HostLink::call`], and [`Error::Older`] from a bridge of an older version.
    pub fn health(&mut self) -> Result<Health, Error> {
        self.require_own_version("calibration")?;
        as_health(self.call(&Call::Health)?)
    }

    /// Takes the headings of the profile's sensors from the hand, flat and still; [`HostLink::health`] tells how it ended.
    ///
    /// # Errors
    /// As [`HostLink::health`].
    pub fn calibrate_flat_hand(&mut self) -> Result<(), Error> {
        self.require_own_version("calibration")?;
        self.done(&Call::CalibrateFlatHand)
    }

    /// Takes the hand, flat and still, as all joints at zero, for sensors that sit straight and share a heading;
    /// [`HostLink::health`] tells how it ended.
    ///
    /// # Errors
    /// As [`HostLink::health`].
    pub fn calibrate_straight(&mut self) -> Result<(), Error> {
        self.require_own_version("calibration")?;
        self.done(&Call::CalibrateStraight)
    }

    /// Takes the newest calibration back.
    ///
    /// # Errors
    /// As [`HostLink::health`].
    pub fn undo_calibration(&mut self) -> Result<(), Error> {
        self.require_own_version("calibration")?;
        self.done(&Call::CalibrateUndo)
    }

    /// What it has counted.
    ///
    /// # Errors
    /// As [`HostLink::call`].
    pub fn counters(&mut self) -> Result<Counters, Error> {
        match self.call(&Call::Counters)? {
            Answer::Counters(counters) => Ok(counters),
            other => Err(confused(&other)),
        }
    }

    /// What its slots hold.
    ///
    /// # Errors
    /// As [`HostLink::call`].
    pub fn slots(&mut self) -> Result<Slots, Error> {
        as_slots(self.call(&Call::Slots)?)
    }

    /// Makes the image in `slot` the active one.
    ///
    /// # Errors
    /// As [`HostLink::call`].
    pub fn select(&mut self, slot: u8) -> Result<Slots, Error> {
        as_slots(self.call(&Call::SelectSlot { slot })?)
    }

    /// Samples every `period_ms` milliseconds from now on; 0 ends them.
    ///
    /// # Errors
    /// As [`HostLink::call`].
    pub fn telemetry(&mut self, period_ms: u16) -> Result<(), Error> {
        self.done(&Call::Telemetry { period_ms })
    }

    /// Activates the gripper, which **moves**.
    ///
    /// # Errors
    /// As [`HostLink::call`].
    pub fn activate(&mut self) -> Result<(), Error> {
        self.done(&Call::Activate)
    }

    /// Restarts the bridge.
    ///
    /// # Errors
    /// As [`HostLink::call`].
    pub fn reboot(&mut self) -> Result<(), Error> {
        self.done(&Call::Reboot)
    }

    fn done(&mut self, call: &Call<'_>) -> Result<(), Error> {
        match self.call(call)? {
            Answer::Done => Ok(()),
            other => Err(confused(&other)),
        }
    }
}

fn as_status(answer: Answer) -> Result<Status, Error> {
    match answer {
        Answer::Status(status) => Ok(status),
        other => Err(confused(&other)),
    }
}

fn as_health(answer: Answer) -> Result<Health, Error> {
    match answer {
        Answer::Health(health) => Ok(health),
        other => Err(confused(&other)),
    }
}

fn as_slots(answer: Answer) -> Result<Slots, Error> {
    match answer {
        Answer::Slots(slots) => Ok(slots),
        other => Err(confused(&other)),
    }
}

fn confused(answer: &Answer) -> Error {
    let text = format!("{answer:?}");
    let name = text.split([' ', '(']).next().unwrap_or_default();
    Error::Confused(name.to_owned())
}

/// A number that two hosts hardly choose both.
fn new_session() -> u32 {
    let time = std::time::SystemTime::now()
        .duration_since(std::time::UNIX_EPOCH)
        .map_or(0, |time| time.subsec_nanos() ^ time.as_secs() as u32);
    time ^ std::process::id().rotate_left(16)
}

/// A zero, which ends whatever came before, and the request's frame.
fn framed(request: &Request<'_>) -> Result<Vec<u8>, Error> {
    let mut room = [0; frame::MAX_MESSAGE];
    let message = postcard::to_slice(request, &mut room).map_err(|_| Error::TooLong)?;
    framed_bytes(message)
}

/// The same of a message's bytes.
fn framed_bytes(message: &[u8]) -> Result<Vec<u8>, Error> {
    let mut scratch = [0; frame::SCRATCH];
    scratch
        .get_mut(..message.len())
        .ok_or(Error::TooLong)?
        .copy_from_slice(message);
    let mut out = [0; frame::MAX_FRAME];
    let coded = frame::encode(&mut scratch, message.len(), &mut out).map_err(|_| Error::TooLong)?;
    let mut bytes = vec![0];
    bytes.extend_from_slice(coded);
    Ok(bytes)
}
