//! Microseconds since the start, from a CMSDK APB timer (Arm DDI 0479, chapter 4.1) that counts the bus clock down
//! without end; SysTick only wakes the processor every millisecond.
//!
//! Ticks are not counted: an emulator that is kept waiting by its host merges interrupts, and time would run slow.

use super::clock::CLOCK_HZ;
use bridge::Instant;
use core::cell::Cell;
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use critical_section::Mutex;

const TIMER: usize = 0x4000_0000;
const CONTROL: usize = 0x00;
const VALUE: usize = 0x04;
const RELOAD: usize = 0x08;
const CONTROL_ENABLE: u32 = 1;
const TICKS_PER_MILLISECOND: u32 = CLOCK_HZ / 1_000;
const TICKS_PER_MICROSECOND: u64 = CLOCK_HZ as u64 / 1_000_000;

/// Ticks since the start when the timer was read last. It wraps every 171 s and is read every millisecond.
static TICKS: Mutex<Cell<u64>> = Mutex::new(Cell::new(0));

/// Monotonic time since [`SystemTime::start`].
pub struct SystemTime {
    _tick: SYST,
}

impl SystemTime {
    /// Starts the timer and the tick.
    pub fn start(mut systick: SYST) -> Self {
        write(RELOAD, u32::MAX);
        write(VALUE, u32::MAX);
        write(CONTROL, CONTROL_ENABLE);
        systick.set_clock_source(SystClkSource::Core);
        systick.set_reload(TICKS_PER_MILLISECOND - 1);
        systick.clear_current();
        systick.enable_counter();
        systick.enable_interrupt();
        Self { _tick: systick }
    }

    /// The time now, in microseconds.
    pub fn now(&mut self) -> Instant {
        Instant::from_ticks(ticks() / TICKS_PER_MICROSECOND)
    }
}

/// Sleeps until the next interrupt, a byte on a line or the next millisecond, unless bytes have come since the last call.
///
/// Looking and falling asleep are one: a byte that comes in between stays pending, which ends the sleep at once.
pub fn wait_for_interrupt() {
    critical_section::with(|section| {
        if !super::uart::bytes_came(section) {
            cortex_m::asm::wfi();
        }
    });
}

/// Wakes the processor and sees every wrap of the timer; called by the SysTick exception only.
pub(super) fn tick() {
    ticks();
}

/// Ticks since the start.
fn ticks() -> u64 {
    critical_section::with(|section| {
        let ticks = TICKS.borrow(section);
        // The timer counts down from its greatest value.
        let elapsed = u32::MAX - read(VALUE);
        let since = elapsed.wrapping_sub(ticks.get() as u32);
        let now = ticks.get().wrapping_add(u64::from(since));
        ticks.set(now);
        now
    })
}

fn read(register: usize) -> u32 {
    // SAFETY: the address is a register of the timer that this board has (Arm AN386, memory map); reading it has no
    // effect on memory.
    unsafe { core::ptr::read_volatile((TIMER + register) as *const u32) }
}

fn write(register: usize, value: u32) {
    // SAFETY: as for `read`; the register is not memory that Rust owns.
    unsafe { core::ptr::write_volatile((TIMER + register) as *mut u32, value) }
}
