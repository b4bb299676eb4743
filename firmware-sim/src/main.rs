//! The bridge on the board that QEMU emulates (`mps2-an386`, a Cortex-M4F): board code; the program is [`firmware::run`].
//!
//! UART 0 speaks the host protocol, UART 1 the glove's serial multiplexer, UART 2 the gripper's Modbus RTU. The weights
//! live in the board's flash. Not tried on hardware.
#![no_std]
#![no_main]

mod board;

#[cortex_m_rt::entry]
fn main() -> ! {
    if let Some((board, devices)) = board::take() {
        firmware::run(board, devices);
    }
    // A host asked for it; or, which cannot be on a whole machine, the board was taken before.
    board::restart()
}

/// Nothing in the loop panics (a check on the linked program shows it); start-up may.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    board::restart()
}
