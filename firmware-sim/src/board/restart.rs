//! Why the machine started: noted before a reset in memory that the start-up code leaves as it is.
//!
//! The system controller of the Cortex-M System Design Kit tells a watchdog's reset from others (RSTINFO, Arm DDI 0479,
//! chapter 4.6); the emulator has none, so the program keeps the note itself. After power-on the memory holds no note.

use bridge::protocol::message::Restart;
use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

/// A note and its complement: what memory holds by chance is hardly both.
struct Note(UnsafeCell<MaybeUninit<[u32; 2]>>);

// SAFETY: the words are only read and written whole and volatile, on one processor; whoever interrupts a write leaves a
// note that is whole or none.
unsafe impl Sync for Note {}

#[unsafe(link_section = ".uninit.restart")]
static NOTE: Note = Note(UnsafeCell::new(MaybeUninit::uninit()));

const SOFTWARE: u32 = 0x50F7_3A7E;
const WATCHDOG: u32 = 0x3A7C_4D06;

/// What the note says, which is gone then: the next start has none unless it is written again.
pub(super) fn take() -> Restart {
    // SAFETY: the pointer is to a static of this type, aligned; every bit pattern is an array of u32. The value is whatever
    // memory holds, which a volatile read may see.
    let [note, complement] = unsafe { core::ptr::read_volatile(NOTE.0.get().cast::<[u32; 2]>()) };
    forget();
    if note != !complement {
        return Restart::Power;
    }
    match note {
        SOFTWARE => Restart::Software,
        WATCHDOG => Restart::Watchdog,
        _ => Restart::Unknown,
    }
}

/// Restarts the machine, on request or after a fault.
pub fn restart() -> ! {
    write([SOFTWARE, !SOFTWARE]);
    cortex_m::peripheral::SCB::sys_reset()
}

/// The watchdog is about to reset the machine.
pub(super) fn note_watchdog() {
    write([WATCHDOG, !WATCHDOG]);
}

/// Nothing is about to reset the machine.
pub(super) fn forget() {
    write([0, u32::MAX]);
}

fn write(note: [u32; 2]) {
    // SAFETY: as for `take`; nobody holds a reference to the words.
    unsafe { core::ptr::write_volatile(NOTE.0.get().cast::<[u32; 2]>(), note) }
}
