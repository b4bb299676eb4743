//! The board: the only code that knows addresses. Another board is another module like this one: a [`firmware::Chip`] and
//! its devices; `docs/porting.md` lists what each part must do.

mod clock;
mod flash;
mod interrupts;
mod restart;
mod stack;
mod time;
mod uart;
mod watchdog;

use bridge::glove::sc18im::{self, Sc18im};
use bridge::gripper::driver::{self, ThreeFinger};
use bridge::gripper::timing;
use bridge::protocol::Machine;
use bridge::protocol::message::Restart;
use bridge::{Board, Instant, Platform};
use firmware::{AXES, Chip, Devices};
use flash::PsramSlot;
pub use restart::restart;
use stack::StackWatch;
use time::{SystemTime, wait_for_interrupt};
use uart::{Port, Uart, bytes_lost};
use watchdog::Watchdog;

/// Highest speed of the glove's line, baud. A board sets it to what its cable and its processor carry: at 460,800 the glove gives
/// three times as many scans. The emulator's bytes pass through a PC that has other work.
pub const GLOVE_BAUD: u32 = 115_200;

/// How the glove's serial bridge is run: found at whatever speed it speaks, after a power cut too, and set to [`GLOVE_BAUD`].
fn glove_line() -> sc18im::Config {
    sc18im::Config {
        raise_to: Some(GLOVE_BAUD),
        ..sc18im::Config::default()
    }
}

/// The emulated board.
pub struct Mps2 {
    time: SystemTime,
    watchdog: Watchdog,
    stack: StackWatch,
    started: Restart,
}

/// Sets the board up: clock tick, ports with their interrupts, flash. `None` on a second call.
pub fn take() -> Option<(Mps2, Devices<Mps2>)> {
    let core = cortex_m::Peripherals::take()?;
    let time = SystemTime::start(core.SYST);
    let devices = Devices {
        host: Port::open(Uart::Host)?,
        glove: Sc18im::new(Port::open(Uart::Glove)?, glove_line()).with_set_baud(),
        gripper: Port::open(Uart::Gripper)?,
        slots: flash::slots(),
        profile: flash::profile_slots(),
    };
    interrupts::enable();
    let board = Mps2 {
        time,
        watchdog: Watchdog::new(),
        stack: StackWatch::start(),
        started: restart::take(),
    };
    Some((board, devices))
}

impl Platform for Mps2 {
    fn now(&mut self) -> Instant {
        self.time.now()
    }

    fn wait_until(&mut self, due: Instant) {
        if self.time.now() < due {
            wait_for_interrupt();
        }
    }
}

impl Board<AXES> for Mps2 {
    type Glove = Sc18im<Port>;
    type Gripper = ThreeFinger<Port>;
    type Flash = PsramSlot;
}

impl Chip for Mps2 {
    type Host = Port;
    type Line = Port;

    fn gripper(line: Port) -> ThreeFinger<Port> {
        let config = driver::Config {
            // An emulator's bytes wait for a PC that has other work; a chip's own UART takes the default.
            response: timing::RESPONSE_PC,
            ..driver::Config::default()
        };
        ThreeFinger::new(line, config)
    }

    fn start_watchdog(&mut self) {
        self.watchdog.start();
    }

    fn feed_watchdog(&mut self) {
        self.watchdog.feed();
    }

    fn machine(&mut self) -> Machine {
        Machine {
            bytes_lost: bytes_lost(),
            stack_used: self.stack.scan(),
            restart: self.started,
        }
    }
}
