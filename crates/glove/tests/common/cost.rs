//! What the driver's questions cost by the documents of the chips: bytes on the serial line, and on the I²C bus. The bounds of tests are
//! sums of these, and not what the driver happened to take.

/// Bytes on the serial line, both ways, and on the I²C bus.
#[derive(Debug, Clone, Copy)]
pub struct Cost {
    serial: u64,
    i2c: u64,
}

impl Cost {
    /// `S a n register value P`, then `R 0A P` and the status that answers it.
    const WRITE: Self = Self {
        serial: 6 + 3 + 1,
        i2c: 3,
    };

    /// `S a 1 register S a n P`, and `n` bytes.
    const fn read(n: u64) -> Self {
        Self {
            serial: 8 + n,
            i2c: 2 + 1 + n,
        }
    }

    /// `S m 1 channel P S m 1 P`, and the channel read back.
    const SELECT: Self = Self {
        serial: 5 + 4 + 1,
        i2c: 2 + 2,
    };

    /// Page 1, the id twice, page 0, and the page read back.
    const UNIQUE_ID: Self = Self::WRITE
        .times(2)
        .and(Self::read(16).times(2))
        .and(Self::read(1));

    /// The mode of a sensor and its unique id: who is there, and what does it do?
    const RECHECK: Self = Self::WRITE.and(Self::read(1)).and(Self::UNIQUE_ID);

    /// The bring-up of one sensor after power-on, in five steps: who it is; that it is in CONFIG mode; reset; set up (nine writes and
    /// three reads); mode, id and fusion looked at, the status read once more without its register (4 bytes less, 2 on the bus).
    const BRING_UP: Self = Self::RECHECK
        .and(Self::WRITE.and(Self::read(1)))
        .and(Self::WRITE.times(2))
        .and(Self::WRITE.times(9).and(Self::read(1).times(3)))
        .and(Self::RECHECK.and(Self::read(2).times(2)));

    const fn and(self, more: Self) -> Self {
        Self {
            serial: self.serial + more.serial,
            i2c: self.i2c + more.i2c,
        }
    }

    const fn times(self, n: u64) -> Self {
        Self {
            serial: n * self.serial,
            i2c: n * self.i2c,
        }
    }

    /// How long it takes at `baud` and 369 kHz, one after the other, microseconds.
    const fn us(self, baud: u32) -> u64 {
        self.serial * 10_000_000 / baud as u64 + self.i2c * 9_000 / 369
    }
}

/// Each sensor asked who it is, each channel selected for its two, microseconds.
pub const fn who_is_there(baud: u32) -> u64 {
    let channels = Cost::SELECT.times(8);
    Cost::RECHECK.times(16).and(channels).us(baud)
}

/// One scan: 272 bytes, 176 on the bus (`timing.rs`), microseconds.
pub const fn scan(baud: u32) -> u64 {
    Cost {
        serial: 272,
        i2c: 176,
    }
    .us(baud)
}

/// From the serial bridge's first answer to a whole frame, microseconds: the sensors boot for 650 ms and are asked each 20; 16 bring-ups,
/// each channel selected for each of their five steps; the reset's 650 ms, and 20 and 10 for the changes of mode; and two scans, the
/// first of which may find a sensor that has no sample yet. Nothing of it at the same time.
pub const fn bring_up(baud: u32) -> u64 {
    let channels = Cost::SELECT.times(8 * 5);
    let work = Cost::BRING_UP.times(16).and(channels).us(baud);
    work + 650_000 + 20_000 + 650_000 + 30_000 + 2 * scan(baud)
}
