//! The networks and inputs whose output bits are compared between machines: made from integers, so that every machine
//! makes the same. Shared by the chip's image and the host's benchmark.

/// Calibration poses of the 16-bit maps.
pub const POSES: usize = 16;

/// Marsaglia's xorshift32.
pub struct Random(pub u32);

impl Random {
    fn next(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0
    }

    /// Uniform in [-size, size), on a grid of 2^-23: exact in f32 on any machine.
    pub fn signed(&mut self, size: f32) -> f32 {
        ((self.next() >> 8) as f32 / 8_388_608.0 - 1.0) * size
    }

    /// One input of a map: mostly angles, now and then an edge value.
    pub fn angle(&mut self) -> f32 {
        match self.next() % 64 {
            0 => 0.0,
            1 => -0.0,
            2 => f32::from_bits(self.next() & 0x807f_ffff), // zero or denormal
            3 => hae::INPUT_LIMIT,
            4 => -hae::INPUT_LIMIT,
            5..16 => self.signed(6.25),
            _ => self.signed(1.6),
        }
    }
}

/// Fills parameters with the spread of a trained hand map. Every eleventh bias is a negative zero, every seventh weight
/// a denormal.
pub fn parameters(
    random: &mut Random,
    w1: &mut [f32],
    b1: &mut [f32],
    w2: &mut [f32],
    b2: &mut [f32],
) {
    for (n, w) in w1.iter_mut().enumerate() {
        *w = if n % 7 == 6 {
            random.signed(1e-39)
        } else {
            random.signed(0.3)
        };
    }
    for (n, b) in b1.iter_mut().enumerate() {
        *b = if n % 11 == 10 {
            -0.0
        } else {
            random.signed(0.2)
        };
    }
    w2.iter_mut().for_each(|w| *w = random.signed(12.0));
    b2.iter_mut().for_each(|b| *b = 127.5 + random.signed(10.0));
}

/// FNV-1a over output bits.
#[derive(Clone, Copy)]
pub struct Hash(pub u64);

impl Hash {
    pub const fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    pub fn add(&mut self, value: f32) {
        for byte in value.to_bits().to_le_bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}
