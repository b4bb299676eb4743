//! The Modbus side: register blocks, their refresh, the server's rules, RTU framing by silence.

use ::gripper::rtu::{Registers, Request, Response, function};

use super::three_finger::ThreeFinger;
use super::two_finger::TwoFinger;
use super::{Config, Family, REFRESH};
use crate::{Duration, Instant};

/// First register of the command block.
const COMMAND: u16 = 0x03E8;
/// First register of the status block.
const STATUS: u16 = 0x07D0;
/// More bytes than a frame can have: kept, so that a frame too long is seen to be too long.
const RECEIVE: usize = 260;

/// Which way a request came: each has its own list of functions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Transport {
    Rtu,
    Tcp,
}

#[derive(Debug, Clone)]
pub(super) enum Model {
    Three(ThreeFinger),
    Two(TwoFinger),
}

/// The gripper behind its registers.
pub(super) struct Server {
    pub config: Config,
    pub model: Model,
    /// The command block as last written.
    pub command: [u8; 16],
    /// The status block as of the last refresh.
    status: [u8; 16],
    refreshed: Instant,
    pub writes: u64,
    pub requests: u64,
    pub refused: u64,
    served_at: Option<Instant>,
    received: Vec<u8>,
    first_byte: Instant,
    last_byte: Instant,
    reply: Vec<u8>,
    reply_at: Instant,
    pub mute: u32,
    pub reply_delay: Duration,
    pub lies: Lies,
    pub liar: Option<super::Liar>,
    /// Without power: silent, deaf, and nothing moves.
    pub off: bool,
}

/// What the status says that is not so.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Lies {
    /// Counts added to each position.
    pub position: [i16; 4],
    /// What a position reads whatever it is.
    pub shown: [Option<u8>; 4],
    /// Every position reads anything at all, by this seed.
    pub scattered: Option<u64>,
    /// What every echo reads.
    pub echo: Option<u8>,
    /// What every gDTx, or gOBJ, reads.
    pub contact: Option<u8>,
}

impl Lies {
    fn tell(&self, block: &mut [u8; 16], now: Instant, family: Family) {
        for (axis, offset) in self.position.iter().enumerate() {
            let at = 3 + 3 * axis;
            let told = (i16::from(block[at + 1]) + offset).clamp(0, 255);
            let told = self.shown[axis].unwrap_or(u8::try_from(told).unwrap_or(0));
            let random = |seed| hash(seed ^ now.as_ticks() << 8 ^ axis as u64) as u8;
            block[at + 1] = self.scattered.map_or(told, random);
            if let Some(echo) = self.echo {
                block[at] = echo;
            }
        }
        if let Some(contact) = self.contact {
            match family {
                Family::ThreeFinger => block[1] = contact * 0b0101_0101,
                _ => block[0] = block[0] & 0x3F | contact << 6,
            }
        }
    }
}

/// A number that looks random (the finaliser of splitmix64).
fn hash(seed: u64) -> u64 {
    let mut z = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ z >> 31
}

impl Server {
    pub fn new(config: Config) -> Self {
        let start = config.start;
        let model = match config.family.traits() {
            None => Model::Three(ThreeFinger::new(start)),
            Some(traits) => Model::Two(TwoFinger::new(start[0], traits)),
        };
        let zero = Instant::from_ticks(0);
        let mut server = Self {
            config,
            model,
            command: [0; 16],
            status: [0; 16],
            refreshed: zero,
            writes: 0,
            requests: 0,
            refused: 0,
            served_at: None,
            received: Vec::new(),
            first_byte: zero,
            last_byte: zero,
            reply: Vec::new(),
            reply_at: zero,
            mute: 0,
            reply_delay: Duration::from_ticks(0),
            lies: Lies::default(),
            liar: None,
            off: false,
        };
        server.show_status();
        server
    }

    /// Refreshes the registers every 5 ms up to `now`.
    pub fn run_until(&mut self, now: Instant) {
        if self.off {
            self.refreshed = now;
        }
        let behind = now
            .checked_duration_since(self.refreshed)
            .map_or(0, |d| d.as_ticks());
        let seconds = REFRESH.as_ticks() as f32 * 1e-6;
        for tick in 0..behind / REFRESH.as_ticks() {
            let before = self.status;
            match &mut self.model {
                Model::Three(three) => three.tick(&self.command, seconds),
                Model::Two(two) => two.tick(&self.command, seconds),
            }
            self.status = self.model_status();
            // Two alike in a row at rest: the rest of the time changes nothing.
            if tick > 0 && before == self.status && self.is_settled() {
                break;
            }
        }
        let whole = behind / REFRESH.as_ticks() * REFRESH.as_ticks();
        self.refreshed = Instant::from_ticks(self.refreshed.as_ticks() + whole);
    }

    fn is_settled(&self) -> bool {
        match &self.model {
            Model::Three(three) => three.is_settled(),
            Model::Two(two) => two.is_settled(),
        }
    }

    fn model_status(&self) -> [u8; 16] {
        let mut block = match &self.model {
            Model::Three(three) => three.status(),
            Model::Two(two) => two.status(),
        };
        self.lies
            .tell(&mut block, self.refreshed, self.config.family);
        if self.config.family != Family::ThreeFinger {
            // Its block ends here.
            block[6..].fill(0);
        }
        block
    }

    /// Puts the model's state into the registers before the next refresh does.
    pub fn show_status(&mut self) {
        self.status = self.model_status();
    }

    /// The status block as a read would give it.
    pub fn status(&self) -> [u8; 16] {
        self.status
    }

    /// Bytes of a register block of this family.
    fn block_bytes(&self) -> usize {
        if self.config.family == Family::ThreeFinger {
            16
        } else {
            6
        }
    }

    /// Serves one request; an answer is a PDU in `out`, silence is `None`.
    pub fn serve(
        &mut self,
        pdu: &[u8],
        transport: Transport,
        now: Instant,
        out: &mut [u8],
    ) -> Option<usize> {
        self.run_until(now);
        let Ok(request) = Request::parse_pdu(pdu) else {
            self.refused += 1;
            return None;
        };
        if !self.allows(request.function(), transport) {
            self.refused += 1;
            return None;
        }
        let length = self.apply(&request, out);
        match length {
            Some(_) => {
                self.requests += 1;
                if let Model::Two(two) = &mut self.model {
                    two.heard();
                }
            }
            None => self.refused += 1,
        }
        length
    }

    /// The functions each variant knows (hardware.md §1, §2).
    fn allows(&self, code: u8, transport: Transport) -> bool {
        use function::{READ_HOLDING, READ_INPUT, READ_WRITE, WRITE_MULTIPLE, WRITE_SINGLE};
        match (self.config.family, transport) {
            (_, Transport::Tcp) => matches!(code, READ_HOLDING | READ_INPUT | WRITE_MULTIPLE),
            (Family::ThreeFinger, Transport::Rtu) => {
                matches!(
                    code,
                    READ_HOLDING | WRITE_SINGLE | WRITE_MULTIPLE | READ_WRITE
                )
            }
            (_, Transport::Rtu) => {
                matches!(
                    code,
                    READ_HOLDING | READ_INPUT | WRITE_MULTIPLE | READ_WRITE
                )
            }
        }
    }

    fn apply(&mut self, request: &Request<'_>, out: &mut [u8]) -> Option<usize> {
        let bytes;
        let response = match *request {
            Request::ReadHolding { address, quantity } => {
                bytes = self.read(address, quantity)?;
                Response::ReadHolding(Registers::from_bytes(&bytes)?)
            }
            Request::ReadInput { address, quantity } => {
                bytes = self.read(address, quantity)?;
                Response::ReadInput(Registers::from_bytes(&bytes)?)
            }
            Request::WriteSingle { address, value } => {
                self.write(address, &value.to_be_bytes())?;
                Response::WriteSingle { address, value }
            }
            Request::WriteMultiple { address, values } => {
                self.write(address, values.bytes())?;
                let quantity = u16::try_from(values.len()).ok()?;
                Response::WriteMultiple { address, quantity }
            }
            Request::ReadWrite {
                read_address,
                read_quantity,
                write_address,
                values,
            } => {
                // Both ranges must be right before either counts.
                bytes = self.read(read_address, read_quantity)?;
                self.write(write_address, values.bytes())?;
                Response::ReadWrite(Registers::from_bytes(&bytes)?)
            }
        };
        response.emit_pdu(out).ok()
    }

    fn read(&mut self, address: u16, quantity: u16) -> Option<Vec<u8>> {
        let mut block = if address >= STATUS {
            self.status
        } else {
            self.command
        };
        if let Some(liar) = self.liar.as_mut().filter(|_| address >= STATUS) {
            liar(self.refreshed, &mut block);
        }
        let first = if address >= STATUS { STATUS } else { COMMAND };
        let from = 2 * usize::from(address.checked_sub(first)?);
        let to = from + 2 * usize::from(quantity);
        (to <= self.block_bytes()).then(|| block[from..to].to_vec())
    }

    fn write(&mut self, address: u16, bytes: &[u8]) -> Option<()> {
        let from = 2 * usize::from(address.checked_sub(COMMAND)?);
        let to = from + bytes.len();
        if to > self.block_bytes() {
            return None;
        }
        self.command[from..to].copy_from_slice(bytes);
        self.writes += 1;
        Some(())
    }

    /// Switches its power off, or on again: it stands where it stood, has to be activated, and knows no command.
    pub fn power(&mut self, on: bool) {
        self.off = !on;
        self.received.clear();
        self.reply.clear();
        self.command = [0; 16];
        self.model = match &self.model {
            Model::Three(three) => Model::Three(ThreeFinger::new(core::array::from_fn(|k| {
                three.axes[k].position
            }))),
            Model::Two(two) => {
                let traits = self.config.family.traits();
                let new = |traits| Model::Two(TwoFinger::new(two.axis.position, traits));
                traits.map_or_else(|| self.model.clone(), new)
            }
        };
        self.show_status();
    }

    /// A byte on the RTU line.
    pub fn receive(&mut self, byte: u8, now: Instant) {
        if self.off {
            return;
        }
        if self.frame_due().is_some_and(|due| due <= now) {
            self.end_frame(now);
        }
        if self.received.is_empty() {
            self.first_byte = now;
        }
        self.last_byte = now;
        if self.received.len() < RECEIVE {
            self.received.push(byte);
        }
    }

    /// When the silence after the last byte ends the frame.
    fn frame_due(&self) -> Option<Instant> {
        (!self.received.is_empty()).then(|| self.last_byte + self.config.frame_gap)
    }

    pub fn next_due(&self) -> Option<Instant> {
        let reply = (!self.reply.is_empty()).then_some(self.reply_at);
        self.frame_due().into_iter().chain(reply).min()
    }

    /// Bytes that leave by `now`.
    pub fn transmit(&mut self, now: Instant, out: &mut [u8]) -> usize {
        if self.frame_due().is_some_and(|due| due <= now) {
            self.end_frame(now);
        }
        if self.reply.is_empty() || self.reply_at > now {
            return 0;
        }
        let count = out.len().min(self.reply.len());
        for (slot, byte) in out.iter_mut().zip(self.reply.drain(..count)) {
            *slot = byte;
        }
        count
    }

    fn end_frame(&mut self, now: Instant) {
        let frame = core::mem::take(&mut self.received);
        let Some(reply) = self.judge(&frame, now) else {
            return;
        };
        if self.swallow() {
            return;
        }
        self.reply = reply;
        self.reply_at = now + self.reply_delay;
    }

    /// Whether the next answer is to be swallowed.
    pub fn swallow(&mut self) -> bool {
        let mute = self.mute > 0;
        if self.mute != u32::MAX {
            self.mute = self.mute.saturating_sub(1);
        }
        mute
    }

    /// The reply to a whole frame; silence to a bad one, to another unit, or to one that comes sooner
    /// than the registers are refreshed.
    fn judge(&mut self, frame: &[u8], now: Instant) -> Option<Vec<u8>> {
        let Ok(checked) = ::gripper::rtu::Frame::new_checked(frame) else {
            self.refused += 1;
            return None;
        };
        let unit = checked.unit();
        if unit != self.config.unit && unit != 0 {
            return None;
        }
        let since = self
            .served_at
            .and_then(|at| self.first_byte.checked_duration_since(at));
        if since.is_some_and(|d| d < self.config.request_spacing) {
            self.refused += 1;
            return None;
        }
        let mut out = [0u8; 256];
        let length = self.serve(checked.pdu(), Transport::Rtu, now, &mut out)?;
        self.served_at = Some(self.first_byte);
        if unit == 0 {
            return None;
        }
        let mut reply = vec![unit];
        reply.extend_from_slice(&out[..length]);
        let crc = ::gripper::rtu::crc16(&reply);
        reply.extend_from_slice(&crc.to_le_bytes());
        Some(reply)
    }
}
