//! The vector table and the exceptions.

use super::uart::Uart;
use super::{restart, time};
use cortex_m::peripheral::NVIC;
use cortex_m_rt::{ExceptionFrame, exception};

/// The interrupt lines in use (Arm AN386, interrupt table): each UART has one to receive and one to transmit.
#[derive(Clone, Copy)]
#[repr(u16)]
enum Line {
    HostReceive = 0,
    HostTransmit = 1,
    GloveReceive = 2,
    GloveTransmit = 3,
    GripperReceive = 4,
    GripperTransmit = 5,
}

// SAFETY: the numbers are those of the board's interrupt table, each used once.
unsafe impl cortex_m::interrupt::InterruptNumber for Line {
    fn number(self) -> u16 {
        self as u16
    }
}

/// Lets the ports' interrupts through.
pub(super) fn enable() {
    for line in [
        Line::HostReceive,
        Line::HostTransmit,
        Line::GloveReceive,
        Line::GloveTransmit,
        Line::GripperReceive,
        Line::GripperTransmit,
    ] {
        // SAFETY: no critical section relies on these lines being masked; the handlers are in the table below.
        unsafe { NVIC::unmask(line) };
    }
}

extern "C" fn host() {
    Uart::Host.service();
}

extern "C" fn glove() {
    Uart::Glove.service();
}

extern "C" fn gripper() {
    Uart::Gripper.service();
}

/// What the processor calls for each interrupt line, in the order of [`Line`].
///
/// `cortex-m-rt` places this table behind the exceptions' vectors under this name.
// SAFETY: the name and the section are those that cortex-m-rt's linker script expects; no other item has them.
#[unsafe(link_section = ".vector_table.interrupts")]
#[unsafe(no_mangle)]
static __INTERRUPTS: [extern "C" fn(); 6] = [host, host, glove, glove, gripper, gripper];

#[exception]
fn SysTick() {
    time::tick();
}

/// The watchdog's first count: unless it is fed, the reset follows at the second.
#[exception]
unsafe fn NonMaskableInt() {
    restart::note_watchdog();
}

#[exception]
unsafe fn HardFault(_frame: &ExceptionFrame) -> ! {
    restart::restart()
}
