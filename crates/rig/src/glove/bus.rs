//! The I2C bus behind the serial bridge: TCA9548A at 0x70, two BNO055 on each of its channels.

use super::bno055::Bno055;
use super::upset::{Met, Upset, Upsets};
use crate::{Duration, Instant};

/// Address of the multiplexer with its pins low.
const MUX: u8 = 0x70;
/// Addresses of the even and the odd sensor of a channel.
const SENSORS: [u8; 2] = [0x28, 0x29];

/// How a transaction ended, with its code in the bridge's I2CStat register.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Status {
    Done = 0xF0,
    NackAddress = 0xF1,
    NackData = 0xF2,
    TimedOut = 0xF8,
}

/// One part of a message, up to a repeated start or the stop.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Segment {
    Write { address: u8, bytes: Vec<u8> },
    Read { address: u8, count: usize },
}

/// What a message did.
pub(super) struct Outcome {
    pub status: Status,
    /// Bytes read, all segments in a row; none after a failure.
    pub answer: Vec<u8>,
    /// Time on the bus.
    pub takes: Duration,
    /// Nobody is to be told.
    pub mute: bool,
}

/// Speed of the bus.
#[derive(Debug, Clone, Copy)]
pub(super) struct Timing {
    /// One clock of SCL in ns.
    pub bit_ns: u64,
    /// Give-up time, if the bridge's is enabled.
    pub timeout: Option<Duration>,
}

/// The bus with everything on it.
pub(super) struct Bus {
    pub sensors: [Bno055; 16],
    /// Connected channels, one bit each.
    pub channels: u8,
    /// The multiplexer takes and reads back selections, but these channels stay connected.
    pub mux_stuck: Option<u8>,
    pub mux_unplugged: bool,
    pub mux_address: u8,
    /// SDA or SCL stuck low: nothing ends by itself.
    pub dead: bool,
    pub transactions: u64,
    pub nacks: u64,
    pub upsets: Upsets,
}

/// Gives the orientation of a sensor (w, x, y, z) in a run of its fusion, at a moment.
pub(super) type Orientation<'a> = &'a mut dyn FnMut(usize, u32, Instant) -> [f32; 4];

impl Bus {
    pub fn new(now: Instant) -> Self {
        Self {
            sensors: core::array::from_fn(|index| Bno055::new(index, now)),
            channels: 0,
            mux_stuck: None,
            mux_unplugged: false,
            mux_address: MUX,
            dead: false,
            transactions: 0,
            nacks: 0,
            upsets: Upsets::default(),
        }
    }

    /// Runs a message that starts at `now`. `None`: the bus is dead and the bridge does not give up.
    pub fn run(
        &mut self,
        segments: &[Segment],
        now: Instant,
        timing: Timing,
        orientation: Orientation<'_>,
    ) -> Option<Outcome> {
        let number = self.transactions;
        self.transactions += 1;
        let ended = |status, takes| Outcome {
            status,
            answer: Vec::new(),
            takes,
            mute: false,
        };
        let timed_out = |takes| ended(Status::TimedOut, takes);
        if self.dead {
            return timing.timeout.map(timed_out);
        }
        let upset = self.upset(number, segments);
        let one_byte = Duration::from_ticks(20 * timing.bit_ns / 1_000);
        match upset {
            Some(Upset::NackAddress) => return Some(ended(Status::NackAddress, one_byte)),
            Some(Upset::NackData) => return Some(ended(Status::NackData, one_byte)),
            Some(Upset::Ignored) => return Some(ended(Status::Done, one_byte)),
            Some(Upset::TimedOut) => return timing.timeout.map(timed_out),
            Some(Upset::Short(_) | Upset::Flipped { .. } | Upset::Mute) | None => {}
        }
        let mut message = Message::new(now, timing.bit_ns, self.channels);
        let done = segments
            .iter()
            .all(|segment| self.run_segment(segment, &mut message, orientation));
        message.bits(1);
        // The multiplexer connects its new channels at the stop condition, not before.
        self.channels = message.new_channels;
        if let Some(timeout) = timing.timeout.filter(|t| message.longest_stretch > *t) {
            return Some(timed_out(timeout));
        }
        if !done {
            self.nacks += 1;
            message.answer.clear();
        }
        if let Some(upset) = upset {
            upset.spoil(&mut message.answer);
        }
        Some(Outcome {
            status: if done {
                Status::Done
            } else {
                Status::NackAddress
            },
            takes: message.spent(),
            answer: message.answer,
            mute: upset == Some(Upset::Mute),
        })
    }

    /// What is to happen to message `number`, if anything; notes whom it meets.
    fn upset(&mut self, number: u64, segments: &[Segment]) -> Option<Upset> {
        let upset = self.upsets.due(number)?;
        let (address, written) = match segments.first()? {
            Segment::Write { address, bytes } => (*address, bytes.first().copied()),
            Segment::Read { address, .. } => (*address, None),
        };
        let odd = SENSORS.iter().position(|a| *a == address);
        let channel = (self.channels != 0).then(|| self.channels.trailing_zeros() as usize);
        let sensor = odd.zip(channel).map(|(odd, channel)| 2 * channel + odd);
        let register = match (sensor, written) {
            (Some(sensor), None) => Some(self.sensors[sensor].pointer()),
            (Some(_), written) => written,
            (None, _) => None,
        };
        let reads = segments.iter().map(|segment| match segment {
            Segment::Read { count, .. } => *count,
            Segment::Write { .. } => 0,
        });
        self.upsets.met(Met {
            sensor,
            register,
            reads: reads.sum(),
        });
        Some(upset)
    }

    /// One segment; false where nobody acknowledged the address.
    fn run_segment(
        &mut self,
        segment: &Segment,
        message: &mut Message,
        orientation: Orientation<'_>,
    ) -> bool {
        // Start condition, address with direction bit, acknowledge.
        message.bits(10);
        let (Segment::Write { address, .. } | Segment::Read { address, .. }) = segment;
        if self.mux_unplugged {
            return false;
        }
        if *address == self.mux_address {
            message.run_mux(segment);
            return true;
        }
        let reached = self.reached(*address, message.now());
        match segment {
            Segment::Write { bytes, .. } => {
                message.bytes(bytes.len(), self.stretch_of(&reached));
                for &index in &reached {
                    self.sensors[index].write(bytes, message.now());
                }
            }
            Segment::Read { count, .. } => {
                // Open drain: where two answer at once, a 0 of either wins.
                let mut joined = vec![0xFF; *count];
                let at = message.now();
                for &index in &reached {
                    let mut bytes = vec![0; *count];
                    let chip = &mut self.sensors[index];
                    let start = chip.starts;
                    chip.read(&mut bytes, at, &mut |t| orientation(index, start, t));
                    joined.iter_mut().zip(&bytes).for_each(|(j, b)| *j &= b);
                }
                message.bytes(*count, self.stretch_of(&reached));
                message.answer.extend(joined);
            }
        }
        !reached.is_empty()
    }

    /// The sensors that acknowledge `address` on the connected channels.
    fn reached(&mut self, address: u8, now: Instant) -> Vec<usize> {
        let Some(odd) = SENSORS.iter().position(|a| *a == address) else {
            return Vec::new();
        };
        let channels = self.mux_stuck.unwrap_or(self.channels);
        let connected = (0..8).filter(|channel| channels & (1 << channel) != 0);
        connected
            .map(|channel| 2 * channel + odd)
            .filter(|index| self.sensors[*index].acknowledges(now))
            .collect()
    }

    fn stretch_of(&self, reached: &[usize]) -> Duration {
        let stretches = reached
            .iter()
            .filter_map(|&i| self.sensors[i].faults.stretch);
        stretches.max().unwrap_or(Duration::from_ticks(0))
    }
}

/// A message under way: when it started, how long it has taken, what it has read.
struct Message {
    start: Instant,
    ns: u64,
    bit_ns: u64,
    longest_stretch: Duration,
    answer: Vec<u8>,
    new_channels: u8,
}

impl Message {
    fn new(start: Instant, bit_ns: u64, channels: u8) -> Self {
        Self {
            start,
            ns: 0,
            bit_ns,
            longest_stretch: Duration::from_ticks(0),
            answer: Vec::new(),
            new_channels: channels,
        }
    }

    fn bits(&mut self, count: u64) {
        self.ns += count * self.bit_ns;
    }

    /// `count` data bytes of nine clocks, each stretched.
    fn bytes(&mut self, count: usize, stretch: Duration) {
        self.longest_stretch = self.longest_stretch.max(stretch);
        self.ns += count as u64 * (9 * self.bit_ns + stretch.as_ticks() * 1_000);
    }

    fn spent(&self) -> Duration {
        Duration::from_ticks(self.ns.div_ceil(1_000))
    }

    fn now(&self) -> Instant {
        self.start + self.spent()
    }

    fn run_mux(&mut self, segment: &Segment) {
        match segment {
            Segment::Write { bytes, .. } => {
                self.bytes(bytes.len(), Duration::from_ticks(0));
                self.new_channels = bytes.last().copied().unwrap_or(self.new_channels);
            }
            Segment::Read { count, .. } => {
                self.bytes(*count, Duration::from_ticks(0));
                self.answer
                    .extend(std::iter::repeat_n(self.new_channels, *count));
            }
        }
    }
}
