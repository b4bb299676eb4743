//! One BNO055 orientation sensor at register level (hardware.md §3; Bosch data sheet, register map).
//!
//! What is modelled: both register pages, the persistent pointer, boot and reset with NACKs, mode
//! switch times, the rule that outside CONFIG only a few registers can be written, and 100 Hz fusion
//! output. What is not: raw magnetometer, Euler angles (they read zero), interrupts, units other
//! than the data sheet's first ones.

mod motion;

use crate::chance::Chance;
use crate::{Duration, Instant};
pub use motion::FUSION_PERIOD;
use motion::{gravity_in_sensor, turn_rate};

/// A reset or power-on takes this long; every access gets a NACK meanwhile.
pub const BOOT: Duration = Duration::from_millis(650);
/// CONFIG to any other mode.
pub const LEAVE_CONFIG: Duration = Duration::from_millis(7);
/// Any mode to CONFIG.
pub const ENTER_CONFIG: Duration = Duration::from_millis(19);

/// Quaternion counts of 1.
const QUATERNION_ONE: f32 = 16_384.0;
/// Gyroscope counts of 1 degree a second.
const GYRO_PER_DEGREE: f32 = 16.0;
/// Acceleration counts of standard gravity, 100 counts a m/s².
const GRAVITY_COUNTS: f32 = 980.7;

mod reg {
    pub const PAGE_ID: u8 = 0x07;
    pub const ACCELERATION: u8 = 0x08;
    pub const GYRO: u8 = 0x14;
    pub const QUATERNION: u8 = 0x20;
    pub const GRAVITY: u8 = 0x2E;
    pub const TEMPERATURE: u8 = 0x34;
    pub const CALIB_STAT: u8 = 0x35;
    pub const SELF_TEST: u8 = 0x36;
    pub const SYS_STATUS: u8 = 0x39;
    pub const UNIT_SEL: u8 = 0x3B;
    pub const OPR_MODE: u8 = 0x3D;
    pub const PWR_MODE: u8 = 0x3E;
    pub const SYS_TRIGGER: u8 = 0x3F;
    pub const TEMP_SOURCE: u8 = 0x40;
    pub const AXIS_MAP: u8 = 0x41;
    pub const AXIS_SIGN: u8 = 0x42;
    pub const SIC_MATRIX: u8 = 0x43;
    pub const CALIBRATION_END: u8 = 0x6A;
    pub const OUTPUTS: core::ops::RangeInclusive<u8> = 0x08..=0x33;
    /// Page 1.
    pub const PAGE1_CONFIG: core::ops::RangeInclusive<u8> = 0x08..=0x0D;
    pub const PAGE1_INTERRUPTS: core::ops::RangeInclusive<u8> = 0x0F..=0x10;
    pub const PAGE1_LIMITS: core::ops::RangeInclusive<u8> = 0x11..=0x1F;
    pub const UNIQUE_ID: u8 = 0x50;
}

const CONFIG: u8 = 0x00;
const IMU: u8 = 0x08;
const NDOF: u8 = 0x0C;
const RESET_BIT: u8 = 0x20;
const CRYSTAL_BIT: u8 = 0x80;

/// Faults a test puts on one sensor.
#[derive(Debug, Clone, Default)]
pub(super) struct Faults {
    pub unplugged: bool,
    pub frozen: bool,
    /// Address NACKs still to give.
    pub nacks: u32,
    /// Reads whose bit 15 of a component is still to be flipped: component, how often.
    pub flip: Option<(usize, u32)>,
    /// The chip resets between the address write and the read of the next read-out.
    pub reset_in_read: bool,
    /// Clock stretching for each data byte.
    pub stretch: Option<Duration>,
    /// A register of page 0 that keeps its value whatever is written.
    pub stuck: Option<u8>,
}

/// The chip.
pub(super) struct Bno055 {
    index: usize,
    /// Gloves of different numbers have sensors with different ids.
    glove: Option<Chance>,
    pages: [[u8; 128]; 2],
    page: usize,
    pointer: u8,
    boot_until: Instant,
    mode: u8,
    switching: Option<(Instant, u8)>,
    fusion_since: Option<Instant>,
    ticks: u64,
    /// How often the fusion has begun: each time with a heading of its own.
    pub starts: u32,
    /// Bits that flip by themselves: the share of the reads.
    pub flips: Option<(Chance, f64)>,
    /// Reads so far.
    reads: i64,
    pub faults: Faults,
}

impl Bno055 {
    /// Sensor number `index`, powered on at `now`.
    pub fn new(index: usize, now: Instant) -> Self {
        let mut chip = Self {
            index,
            glove: None,
            pages: [[0; 128]; 2],
            page: 0,
            pointer: 0,
            boot_until: now,
            mode: CONFIG,
            switching: None,
            fusion_since: None,
            ticks: 0,
            starts: 0,
            flips: None,
            reads: 0,
            faults: Faults::default(),
        };
        chip.reset();
        chip.boot_until = now + BOOT;
        chip
    }

    /// All registers as after power-on; the pointer at 0.
    pub fn reset(&mut self) {
        let mut page0 = [0u8; 128];
        page0[..7].copy_from_slice(&[0xA0, 0xFB, 0x32, 0x0F, 0x11, 0x03, 0x15]);
        page0[usize::from(reg::TEMPERATURE)] = 25;
        page0[usize::from(reg::SELF_TEST)] = 0x0F;
        // The sheet says 80 in one table and 00 in another.
        page0[usize::from(reg::UNIT_SEL)] = 0x80;
        page0[usize::from(reg::TEMP_SOURCE)] = 0x02;
        page0[usize::from(reg::AXIS_MAP)] = 0x24;
        let mut page1 = [0u8; 128];
        page1[usize::from(reg::PAGE_ID)] = 1;
        page1[0x08..=0x0B].copy_from_slice(&[0x0D, 0x6D, 0x38, 0x00]);
        self.pages = [page0, page1];
        self.write_id();
        self.page = 0;
        self.pointer = 0;
        self.mode = CONFIG;
        self.switching = None;
        self.fusion_since = None;
        self.ticks = 0;
    }

    /// Becomes the sensor built as number `built_as`.
    pub fn exchange(&mut self, built_as: usize) {
        self.index = built_as;
        self.write_id();
    }

    /// Belongs to a glove whose sensors have ids of their own.
    pub fn belong_to(&mut self, glove: Chance) {
        self.glove = Some(glove);
        self.write_id();
    }

    fn write_id(&mut self) {
        let (index, glove) = (self.index, self.glove);
        let id = &mut self.pages[1][usize::from(reg::UNIQUE_ID)..][..16];
        for (i, byte) in id.iter_mut().enumerate() {
            *byte = match glove {
                None => unique_id_byte(index, i),
                Some(glove) => glove.of(index).bits(i as i64) as u8,
            };
        }
    }

    /// Resets and answers nothing for the boot time.
    pub fn reset_and_boot(&mut self, now: Instant) {
        self.reset();
        self.boot_until = now + BOOT;
    }

    /// Where the register pointer stands.
    pub fn pointer(&self) -> u8 {
        self.pointer
    }

    /// Whether it has booted by `now`.
    pub fn booted(&self, now: Instant) -> bool {
        now >= self.boot_until
    }

    /// Whether it acknowledges its address at `now`.
    pub fn acknowledges(&mut self, now: Instant) -> bool {
        if self.faults.unplugged || now < self.boot_until {
            return false;
        }
        if self.faults.nacks > 0 {
            self.faults.nacks -= 1;
            return false;
        }
        self.catch_up(now);
        true
    }

    /// A write transaction: the first byte sets the pointer, the others go into registers from there
    /// on. The pointer stays at the address that was written: every later read starts there again.
    pub fn write(&mut self, bytes: &[u8], now: Instant) {
        let Some((pointer, data)) = bytes.split_first() else {
            return;
        };
        self.pointer = pointer & 0x7F;
        for (address, byte) in addresses_from(self.pointer).zip(data) {
            self.write_register(address, *byte, now);
        }
    }

    /// A read transaction: bytes from the pointer on. `orientation` gives the sensor's quaternion
    /// (w, x, y, z) at a moment.
    pub fn read(
        &mut self,
        out: &mut [u8],
        now: Instant,
        orientation: &mut dyn FnMut(Instant) -> [f32; 4],
    ) {
        if core::mem::take(&mut self.faults.reset_in_read) {
            self.reset();
        }
        self.fuse(now, orientation);
        for (address, slot) in addresses_from(self.pointer).zip(out.iter_mut()) {
            *slot = self.register(self.page, address);
        }
        self.flip_sign(self.pointer, out);
        self.flip_by_chance(out);
    }

    /// Booted by `now`, and in IMU mode since `since`.
    pub fn run_since(&mut self, since: Instant, now: Instant) {
        self.reset();
        self.boot_until = now;
        self.store(reg::UNIT_SEL, 0);
        self.switching = Some((since, IMU));
        self.catch_up(now);
    }

    /// The eight bytes of the quaternion, as a client reads them: it writes the address, then reads. `None` where the chip does not
    /// acknowledge.
    pub fn sample(
        &mut self,
        now: Instant,
        orientation: &mut dyn FnMut(u32, Instant) -> [f32; 4],
    ) -> Option<[u8; 8]> {
        if !self.acknowledges(now) {
            return None;
        }
        self.write(&[reg::QUATERNION], now);
        let (mut bytes, start) = ([0; 8], self.starts);
        self.read(&mut bytes, now, &mut |t| orientation(start, t));
        Some(bytes)
    }

    /// A register as a read would give it, without moving the pointer.
    pub fn register(&self, page: usize, address: u8) -> u8 {
        let stored = self.pages[page.min(1)][usize::from(address & 0x7F)];
        if page != 0 {
            return stored;
        }
        match address {
            reg::PAGE_ID => u8::from(self.page == 1),
            reg::OPR_MODE => self.mode,
            reg::SYS_STATUS => match (self.mode, self.fusion_since) {
                (CONFIG, _) => 0,
                (_, Some(_)) => 5,
                _ => 6,
            },
            reg::CALIB_STAT => match (self.mode, self.fusion_since) {
                (NDOF, Some(_)) => 0xFF,
                (_, Some(_)) => 0xFC,
                _ => 0,
            },
            _ => stored,
        }
    }

    /// The operation mode it is in now (0 CONFIG, 8 IMU, 0C NDOF).
    pub fn mode(&self) -> u8 {
        self.mode
    }

    /// Finishes a mode switch whose time has come.
    fn catch_up(&mut self, now: Instant) {
        let Some((at, mode)) = self.switching.filter(|(at, _)| *at <= now) else {
            return;
        };
        self.switching = None;
        self.mode = mode;
        self.ticks = 0;
        self.fusion_since = (IMU..=NDOF).contains(&mode).then_some(at);
        self.starts += u32::from(self.fusion_since.is_some());
        self.clear_outputs();
    }

    fn clear_outputs(&mut self) {
        for address in reg::OUTPUTS {
            self.pages[0][usize::from(address)] = 0;
        }
    }

    fn write_register(&mut self, address: u8, value: u8, now: Instant) {
        if address == reg::PAGE_ID {
            if value <= 1 {
                self.page = usize::from(value);
            }
            return;
        }
        // The sheet: outside CONFIG only OPR_MODE and the interrupt registers can be written.
        let configurable = self.mode == CONFIG && self.switching.is_none();
        if self.page == 1 {
            let interrupts = reg::PAGE1_INTERRUPTS.contains(&address);
            let config =
                reg::PAGE1_CONFIG.contains(&address) || reg::PAGE1_LIMITS.contains(&address);
            if interrupts || (configurable && config) {
                self.pages[1][usize::from(address)] = value;
            }
            return;
        }
        if self.faults.stuck == Some(address) {
            return;
        }
        match address {
            reg::OPR_MODE => self.start_switch(value & 0x0F, now),
            reg::SYS_TRIGGER if configurable => self.trigger(value, now),
            reg::PWR_MODE if configurable && value & 3 != 3 => self.store(address, value & 3),
            reg::UNIT_SEL | reg::TEMP_SOURCE | reg::AXIS_MAP | reg::AXIS_SIGN if configurable => {
                self.store(address, value);
            }
            reg::SIC_MATRIX..=reg::CALIBRATION_END if configurable => self.store(address, value),
            _ => {}
        }
    }

    fn store(&mut self, address: u8, value: u8) {
        self.pages[0][usize::from(address)] = value;
    }

    fn start_switch(&mut self, mode: u8, now: Instant) {
        if mode > NDOF || (mode == self.mode && self.switching.is_none()) {
            return;
        }
        let time = match (self.mode, mode) {
            (CONFIG, _) => LEAVE_CONFIG,
            (_, CONFIG) => ENTER_CONFIG,
            _ => ENTER_CONFIG + LEAVE_CONFIG,
        };
        self.switching = Some((now + time, mode));
    }

    fn trigger(&mut self, value: u8, now: Instant) {
        if value & RESET_BIT != 0 {
            self.reset_and_boot(now);
        } else {
            self.store(reg::SYS_TRIGGER, value & CRYSTAL_BIT);
        }
    }

    /// Puts the newest fusion output into the registers, if there is one since the last.
    fn fuse(&mut self, now: Instant, orientation: &mut dyn FnMut(Instant) -> [f32; 4]) {
        self.catch_up(now);
        let Some(since) = self.fusion_since else {
            return;
        };
        let suspended = self.pages[0][usize::from(reg::PWR_MODE)] == 2;
        let elapsed = now
            .checked_duration_since(since)
            .map_or(0, |d| d.as_ticks());
        let ticks = elapsed / FUSION_PERIOD.as_ticks();
        if ticks == self.ticks || suspended || self.faults.frozen {
            return;
        }
        self.ticks = ticks;
        let at =
            |tick: u64| Instant::from_ticks(since.as_ticks() + tick * FUSION_PERIOD.as_ticks());
        let q = orientation(at(ticks));
        let before = orientation(at(ticks.saturating_sub(1)));
        self.put(reg::QUATERNION, &q.map(|c| c * QUATERNION_ONE));
        let degrees = turn_rate(before, q).map(|r| r.to_degrees() * GYRO_PER_DEGREE);
        self.put(reg::GYRO, &degrees);
        let down = gravity_in_sensor(q).map(|g| g * GRAVITY_COUNTS);
        self.put(reg::GRAVITY, &down);
        self.put(reg::ACCELERATION, &down);
    }

    fn put(&mut self, address: u8, values: &[f32]) {
        for (i, value) in values.iter().enumerate() {
            // The cast saturates, and a value that is not finite becomes 0.
            let [low, high] = (value.round() as i16).to_le_bytes();
            let at = usize::from(address) + 2 * i;
            self.pages[0][at] = low;
            self.pages[0][at + 1] = high;
        }
    }

    fn flip_sign(&mut self, first: u8, out: &mut [u8]) {
        let Some((component, left)) = self.faults.flip.filter(|(_, left)| *left > 0) else {
            return;
        };
        if let Some(byte) = self.high_byte(component, first, out) {
            *byte ^= 0x80;
            self.faults.flip = Some((component, left - 1));
        }
    }

    fn flip_by_chance(&mut self, out: &mut [u8]) {
        let Some((chance, share)) = self.flips.filter(|_| self.fusion_since.is_some()) else {
            return;
        };
        self.reads += 1;
        let component = (chance.bits(-self.reads) % 4) as usize;
        if chance.share(self.reads) < share
            && let Some(byte) = self.high_byte(component, self.pointer, out)
        {
            *byte ^= 0x80;
        }
    }

    /// Where a read from `first` on has the high byte of a component of the quaternion.
    fn high_byte<'a>(&self, component: usize, first: u8, out: &'a mut [u8]) -> Option<&'a mut u8> {
        let high = usize::from(reg::QUATERNION) + 2 * component.min(3) + 1;
        let at = high.checked_sub(usize::from(first))?;
        out.get_mut(at).filter(|_| self.page == 0)
    }
}

/// Register addresses from `first` on: 00 follows 7F.
fn addresses_from(first: u8) -> impl Iterator<Item = u8> {
    (first..=0x7F).chain((0..=0x7F).cycle())
}

/// The unique id of sensor `index`, byte `i`: any bytes, different for each sensor.
fn unique_id_byte(index: usize, i: usize) -> u8 {
    let mixed = (index * 29 + 7) * (i * 13 + 5);
    (mixed % 251) as u8
}
