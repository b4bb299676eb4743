//! The CMSDK APB watchdog (Arm DDI 0479, chapter 4.5): resets the machine unless fed.

use super::clock::CLOCK_HZ;

const BASE: usize = 0x4000_8000;
const LOAD: usize = 0x00;
const CONTROL: usize = 0x08;
const INTERRUPT_CLEAR: usize = 0x0C;
const CONTROL_INTERRUPT_AND_RESET: u32 = 0b11;
const LOCK: usize = 0xC00;
const UNLOCK: u32 = 0x1ACC_E551;

/// The watchdog counts down twice, first to its interrupt, then to the reset: this is one count.
const PERIOD_TICKS: u32 = CLOCK_HZ / 2;

/// Feeds the watchdog; dropping it does not stop the count.
pub struct Watchdog {
    _made_by_the_board: (),
}

impl Watchdog {
    pub(super) const fn new() -> Self {
        Self {
            _made_by_the_board: (),
        }
    }

    /// Starts the count: 1 s without [`Watchdog::feed`] resets the machine.
    pub fn start(&mut self) {
        write(LOCK, UNLOCK);
        write(LOAD, PERIOD_TICKS);
        write(CONTROL, CONTROL_INTERRUPT_AND_RESET);
    }

    /// Starts the count afresh.
    pub fn feed(&mut self) {
        write(INTERRUPT_CLEAR, 1);
        super::restart::forget();
    }
}

fn write(register: usize, value: u32) {
    // SAFETY: the address is a register of the watchdog that this board has (Arm AN386, memory map), not memory that
    // Rust owns.
    unsafe { core::ptr::write_volatile((BASE + register) as *mut u32, value) }
}
