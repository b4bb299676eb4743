//! The board: the only code that knows addresses. A second board is a second module with the same public items;
//! `docs/porting.md` lists them.

mod flash;
mod interrupts;
mod restart;
mod stack;
mod time;
mod uart;
mod watchdog;

use bridge::protocol::message::Restart;
pub use flash::PsramSlot;
pub use restart::restart;
pub use stack::StackWatch;
pub use time::{SystemTime, wait_for_interrupt};
use uart::Uart;
pub use uart::{Port, bytes_lost};
pub use watchdog::Watchdog;

/// The processor's and the peripheral bus's clock of the emulated board, in hertz (Arm AN386).
pub const CLOCK_HZ: u32 = 25_000_000;

/// From the end of a request to the start of the gripper's reply, at most. An emulator's bytes wait for a PC that has other
/// work; a chip's own UART would take [`bridge::gripper::timing::RESPONSE`].
pub const GRIPPER_RESPONSE: bridge::Duration = bridge::gripper::timing::RESPONSE_PC;

/// Everything the program owns; made once.
pub struct Board {
    /// Monotonic time.
    pub time: SystemTime,
    /// The host protocol's line (UART 0).
    pub host: Port,
    /// The glove's line (UART 1).
    pub glove: Port,
    /// The gripper's line (UART 2).
    pub gripper: Port,
    /// The two halves of the weights flash.
    pub slots: [PsramSlot; 2],
    /// Resets the machine unless fed.
    pub watchdog: Watchdog,
    /// Tells how deep the stack has been.
    pub stack: StackWatch,
    /// Why the machine started.
    pub started: Restart,
}

impl Board {
    /// Sets the board up: clock tick, ports with their interrupts, flash. `None` on a second call.
    pub fn take() -> Option<Self> {
        let core = cortex_m::Peripherals::take()?;
        let time = SystemTime::start(core.SYST);
        let host = Port::open(Uart::Host)?;
        let glove = Port::open(Uart::Glove)?;
        let gripper = Port::open(Uart::Gripper)?;
        let slots = flash::slots();
        interrupts::enable();
        Some(Self {
            time,
            host,
            glove,
            gripper,
            slots,
            watchdog: Watchdog::new(),
            stack: StackWatch::start(),
            started: restart::take(),
        })
    }
}
