//! Which family answers: found out by reading, before anything is written.
//!
//! Both families have their blocks at the same addresses, and a command for one is a command for the
//! other. What tells them apart without a write: the 3-Finger gripper has eight status registers, the
//! others three; the others answer FC04, which the 3-Finger gripper's serial variant does not have.
//! One lost reply is no evidence, so silence counts only beside answers to other reads.

use super::family::{Block, Family};
use crate::registers::Kind;
use crate::rtu::{Exception, function};

/// Reads of more registers than the family has that must go unanswered before an answer to FC04
/// proves it, and before answers to FC03 do.
const SILENT: (u8, u8) = (2, 6);
/// Unanswered reads with FC04 after which a gripper whose eight registers say nothing counts as a
/// 3-Finger one; partial reads alone that are answered before it counts as none.
const PERSISTENT: u8 = 3;

/// What is known of the family so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Identity {
    /// Somebody wants to know, written or not.
    pub(super) asked: bool,
    pub(super) known: bool,
    /// It has answered as a gripper of another family. Only answers that say something else count
    /// after that, or its absence.
    foreign: bool,
    /// The next probe.
    pub(super) step: usize,
    /// Overlong reads without an answer; reads with FC03 answered after one.
    silent: u8,
    answered: u8,
    /// Eight registers came, and all that only a 3-Finger gripper has are 0.
    zeros: bool,
    /// Reads with FC04 without an answer.
    unheard: u8,
    /// Reads of three registers or fewer answered since a longer one was, and late replies then.
    partial: u8,
    stale: u32,
}

impl Identity {
    pub(super) fn new(known: bool) -> Self {
        Self {
            known,
            ..Self::default()
        }
    }

    /// Everything but the wish to know.
    pub(super) fn forget(&mut self) {
        *self = Self {
            asked: self.asked,
            ..Self::default()
        };
    }

    /// A read of more registers than the family has was answered.
    pub(super) fn overlong_answer(&mut self, values: &[u8]) -> Result<(), Kind> {
        let mut block = Block::default();
        block
            .iter_mut()
            .zip(values)
            .for_each(|(byte, value)| *byte = *value);
        match Kind::of_status(&block) {
            Some(Kind::ThreeFinger) => return Err(self.is_foreign()),
            Some(Kind::TwoFinger) => self.known = true,
            None => self.zeros = true,
        }
        Ok(())
    }

    fn is_foreign(&mut self) -> Kind {
        self.forget();
        self.foreign = true;
        Kind::ThreeFinger
    }

    pub(super) fn overlong_silence(&mut self) {
        self.silent = self.silent.saturating_add(1);
    }

    /// Whether this refusal of an overlong read is a device's own: then it has fewer registers.
    pub(super) fn overlong_refusal(&mut self, code: Exception) -> bool {
        let own = matches!(
            code,
            Exception::ILLEGAL_ADDRESS | Exception::ILLEGAL_VALUE | Exception::ILLEGAL_FUNCTION
        );
        self.known |= own;
        own
    }

    /// A read of what the family has was answered.
    pub(super) fn block_answer(&mut self, code: u8) {
        let (with_input, with_holding) = SILENT;
        if code == function::READ_INPUT {
            let silent = self.silent >= with_input && !self.foreign;
            self.known |= self.zeros || silent;
        } else if self.silent > self.answered && !self.foreign {
            self.answered += 1;
            self.known |= self.answered >= with_holding;
        }
    }

    /// FC04 went unanswered.
    pub(super) fn input_silence(&mut self) -> Result<(), Kind> {
        self.unheard = self.unheard.saturating_add(1);
        if self.zeros && self.unheard >= PERSISTENT {
            return Err(self.is_foreign());
        }
        Ok(())
    }

    /// A read too short for a status was answered, where whole ones are not. Replies that come late
    /// explain that too.
    pub(super) fn partial_answer(&mut self, quantity: u16, stale: u32) -> Result<(), Kind> {
        if quantity > 3 || stale != self.stale {
            (self.partial, self.stale) = (0, stale);
            return Ok(());
        }
        self.partial += 1;
        if self.partial >= PERSISTENT {
            self.partial = 0;
            return Err(Kind::TwoFinger);
        }
        Ok(())
    }

    pub(super) fn whole_answer(&mut self) {
        self.partial = 0;
    }

    /// Whether the family still has to be found out before a write.
    pub(super) fn is_open<F: Family<X>, const X: usize>(&self) -> bool {
        !self.known && !F::PROBES.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn silence_proves_no_family_once_another_has_answered() {
        let proved = |mut identity: Identity| {
            (0..SILENT.0).for_each(|_| identity.overlong_silence());
            identity.block_answer(function::READ_INPUT);
            identity.known
        };
        assert!(proved(Identity::default()));
        let mut met = Identity::default();
        assert_eq!(met.is_foreign(), Kind::ThreeFinger);
        assert!(!proved(met));
    }
}
