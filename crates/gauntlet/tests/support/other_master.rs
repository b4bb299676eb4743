//! A gripper that notes what it is told, and another master on its line.

use std::sync::{Arc, Mutex};

use rig::Device;
use rig::gripper::VirtualGripper;

/// A write of these command bytes, as another master sends it.
pub fn command(block: &[u8]) -> Vec<u8> {
    let registers = u8::try_from(block.len() / 2).unwrap();
    let mut frame = vec![9, 0x10, 0x03, 0xE8, 0, registers, 2 * registers];
    frame.extend(block);
    frame.extend(host::gripper::rtu::crc16(&frame).to_le_bytes());
    frame
}

/// The commands a gripper took, and its true positions then.
pub type Notes = Arc<Mutex<Vec<([u8; 16], [f32; 4])>>>;
/// What another master says, once.
pub type Word = Arc<Mutex<Option<Vec<u8>>>>;

pub fn noted(gripper: &VirtualGripper) -> (Noted, Notes, Word) {
    let (notes, word) = (Notes::default(), Word::default());
    let noted = Noted {
        gripper: gripper.clone(),
        notes: Arc::clone(&notes),
        word: Arc::clone(&word),
        of_other: 0,
    };
    (noted, notes, word)
}

/// Bytes that answer a write of registers.
const ANSWER_TO_WRITE: usize = 8;

/// A gripper that notes where it was told to go and where it was then; another master can put in a word.
pub struct Noted {
    gripper: VirtualGripper,
    notes: Notes,
    word: Word,
    /// Bytes still to come that answer the other master.
    of_other: usize,
}

impl Device for Noted {
    fn receive(&mut self, bytes: &[u8], now: rig::Instant) {
        let writes = self.gripper.writes();
        self.gripper.receive(bytes, now);
        self.note(writes);
    }

    fn transmit(&mut self, now: rig::Instant, out: &mut [u8]) -> usize {
        if let Some(word) = self.word.lock().unwrap().take() {
            self.gripper.receive(&word, now);
            self.of_other = ANSWER_TO_WRITE;
        }
        let writes = self.gripper.writes();
        let count = self.gripper.transmit(now, out);
        if self.of_other == 0 {
            self.note(writes);
        }
        // The other master's answer is not for this line.
        let dropped = self.of_other.min(count);
        self.of_other -= dropped;
        out.copy_within(dropped..count, 0);
        count - dropped
    }

    fn next_due(&self) -> Option<rig::Instant> {
        // The other master speaks at once.
        let word = self.word.lock().unwrap().is_some();
        let at_once = word.then(|| rig::Instant::from_ticks(0));
        at_once.or_else(|| self.gripper.next_due())
    }

    fn baud(&self) -> u32 {
        self.gripper.baud()
    }
}

impl Noted {
    fn note(&self, writes: u64) {
        if self.gripper.writes() > writes {
            let note = (self.gripper.command_block(), self.gripper.positions());
            self.notes.lock().unwrap().push(note);
        }
    }
}
