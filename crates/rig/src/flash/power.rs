//! Power that fails at a chosen operation: before it, inside it, or right after it.

use std::sync::{Arc, Mutex};

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Error;
use crate::clock::lock;

/// Where in an operation the power fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// The operation leaves no trace.
    Before,
    /// The operation stops half way: a part is done, one unit holds random bits.
    Inside,
    /// The operation is complete, but the program never hears so.
    After,
}

/// One planned power cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cut {
    /// Operations that still complete: 0 hits the next one. A `write` call is one operation, or
    /// each of its program units ([`Nor::by_unit`](super::Nor::by_unit)); each erased sector is one.
    pub after_operations: u64,
    /// Where in that operation.
    pub phase: Phase,
    /// Decides how much of a torn operation is done and which bits it leaves.
    pub seed: u64,
}

/// The supply of one or more flashes. Clones are the same supply.
#[derive(Debug, Clone, Default)]
pub struct Power {
    state: Arc<Mutex<State>>,
}

#[derive(Debug, Default)]
struct State {
    off: bool,
    operations: u64,
    cut: Option<Cut>,
}

impl Power {
    /// A supply that is on and stays on until told otherwise.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Plans a cut; it replaces one planned before.
    pub fn plan(&self, cut: Cut) {
        lock(&self.state).cut = Some(cut);
    }

    /// Puts the power back on and forgets a planned cut.
    pub fn restore(&self) {
        let mut state = lock(&self.state);
        state.off = false;
        state.cut = None;
    }

    /// Whether there is power.
    #[must_use]
    pub fn is_on(&self) -> bool {
        !lock(&self.state).off
    }

    /// Operations (programs and sector erases) that completed, over all flashes of this supply.
    #[must_use]
    pub fn operations(&self) -> u64 {
        lock(&self.state).operations
    }

    /// Runs one operation: `act(None)` does it whole, `act(Some(_))` does it torn.
    pub(super) fn operate(&self, act: impl FnOnce(Option<&mut Torn>)) -> Result<(), Error> {
        let mut state = lock(&self.state);
        if state.off {
            return Err(Error::PowerLost);
        }
        let Some(cut) = state.cut.as_mut() else {
            state.operations += 1;
            act(None);
            return Ok(());
        };
        if cut.after_operations > 0 {
            cut.after_operations -= 1;
            state.operations += 1;
            act(None);
            return Ok(());
        }
        match cut.phase {
            Phase::Before => {}
            Phase::Inside => act(Some(&mut Torn(ChaCha8Rng::seed_from_u64(cut.seed)))),
            Phase::After => act(None),
        }
        state.off = true;
        state.cut = None;
        Err(Error::PowerLost)
    }
}

/// What a torn operation leaves behind.
pub(super) struct Torn(ChaCha8Rng);

impl Torn {
    fn byte(&mut self) -> u8 {
        let [byte, ..] = self.0.next_u32().to_le_bytes();
        byte
    }

    /// A prefix of whole units is programmed, in the next unit any of the bits that were to fall
    /// have fallen, the rest is untouched.
    pub(super) fn program(&mut self, cells: &mut [u8], bytes: &[u8], unit: usize) {
        let unit = unit.max(1);
        let done = self.0.random_range(0..=bytes.len() / unit) * unit;
        for (i, (cell, byte)) in cells.iter_mut().zip(bytes).enumerate() {
            if i < done {
                *cell = *byte;
            } else if i < done + unit {
                *cell &= *byte | self.byte();
            }
        }
    }

    /// The sector is part erased: a prefix FF, then bits that may have risen, then old content; or
    /// random all over, as a chip leaves it whose cells were driven but not settled.
    pub(super) fn erase(&mut self, cells: &mut [u8]) {
        let everywhere = self.0.random_bool(0.5);
        let prefix = self.0.random_range(0..=cells.len());
        let end = (prefix + 64).min(cells.len());
        for (i, cell) in cells.iter_mut().enumerate() {
            if everywhere || (prefix..end).contains(&i) {
                *cell |= self.byte();
            } else if i < prefix {
                *cell = 0xFF;
            }
        }
    }
}
