//! Microseconds since the start, from SysTick: one interrupt a millisecond, and the counter's value in between
//! (Armv7-M Architecture Reference Manual, B3.3).

use super::CLOCK_HZ;
use bridge::Instant;
use core::cell::Cell;
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use critical_section::Mutex;

const TICKS_PER_MILLISECOND: u32 = CLOCK_HZ / 1_000;
const TICKS_PER_MICROSECOND: u32 = CLOCK_HZ / 1_000_000;

static MILLISECONDS: Mutex<Cell<u64>> = Mutex::new(Cell::new(0));

/// Monotonic time since [`SystemTime::start`].
pub struct SystemTime {
    systick: SYST,
}

impl SystemTime {
    /// Starts the tick.
    pub fn start(mut systick: SYST) -> Self {
        systick.set_clock_source(SystClkSource::Core);
        systick.set_reload(TICKS_PER_MILLISECOND - 1);
        systick.clear_current();
        systick.enable_counter();
        systick.enable_interrupt();
        Self { systick }
    }

    /// The time now, in microseconds.
    pub fn now(&mut self) -> Instant {
        let microseconds = critical_section::with(|section| {
            let before = SYST::get_current();
            // With interrupts off a wrap shows as a pending tick that nobody has counted; the value is read again then,
            // because the first may be from before the wrap.
            let pending = cortex_m::peripheral::SCB::is_pendst_pending();
            let current = if pending { SYST::get_current() } else { before };
            let milliseconds = MILLISECONDS.borrow(section).get() + u64::from(pending);
            let into = (TICKS_PER_MILLISECOND - 1).saturating_sub(current) / TICKS_PER_MICROSECOND;
            milliseconds * 1_000 + u64::from(into)
        });
        let _ = &self.systick;
        Instant::from_ticks(microseconds)
    }
}

/// Sleeps until the next interrupt: a byte on a line or the next millisecond.
pub fn wait_for_interrupt() {
    cortex_m::asm::wfi();
}

/// Counts one millisecond; called by the SysTick exception only.
pub(super) fn tick() {
    critical_section::with(|section| {
        let milliseconds = MILLISECONDS.borrow(section);
        milliseconds.set(milliseconds.get().wrapping_add(1));
    });
}
