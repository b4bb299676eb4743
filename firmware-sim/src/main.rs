//! The bridge as a program for a Cortex-M4F: board code, and the loop that is [`bridge::App`].
//!
//! UART 0 speaks the host protocol, UART 1 the glove's serial multiplexer, UART 2 the gripper's Modbus RTU. The weights
//! live in the board's flash. Runs in QEMU (`mps2-an386`); not tried on hardware.
#![no_std]
#![no_main]

mod board;

use board::{Board, Port, PsramSlot, StackWatch, SystemTime, Watchdog, wait_for_interrupt};
use bridge::gripper::driver::ThreeFinger;
use bridge::protocol::message::Restart;
use bridge::protocol::{self, Outcome, Server};
use bridge::{App, Config, Instant, Platform, WeightsStore, glove, gripper};

/// Axes of the 3-Finger gripper.
const AXES: usize = 4;

type Bridge = App<Machine, Port, ThreeFinger<Port>, PsramSlot, AXES>;

/// What the loop needs from the machine.
struct Machine {
    time: SystemTime,
}

impl Platform for Machine {
    fn now(&mut self) -> Instant {
        self.time.now()
    }

    fn wait_until(&mut self, due: Instant) {
        if self.time.now() < due {
            wait_for_interrupt();
        }
    }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    if let Some(board) = Board::take() {
        run(board);
    }
    // Unreachable on a whole machine: the board is taken once. A reset is the only thing left to try.
    board::restart()
}

fn run(board: Board) {
    let Board {
        time,
        host,
        glove,
        gripper,
        slots,
        mut watchdog,
        mut stack,
        started,
    } = board;
    let mut app = bridge(time, glove, gripper, slots);
    let mut server = Server::new(host);
    watchdog.start();
    while turn(&mut app, &mut server, &mut watchdog, &mut stack, started) == Outcome::Continue {}
    board::restart()
}

/// The bridge on its devices.
///
/// A function of its own, so that what it is made of does not stay on the stack beside it.
#[inline(never)]
fn bridge(time: SystemTime, glove: Port, gripper: Port, slots: [PsramSlot; 2]) -> Bridge {
    let store = WeightsStore::new(slots, bridge::app::expected(AXES));
    let scanner = glove::scan::Scanner::new(glove, glove::scan::Config::default());
    let config = gripper::driver::Config {
        response: board::GRIPPER_RESPONSE,
        ..gripper::driver::Config::default()
    };
    let gripper = ThreeFinger::new(gripper, config);
    App::new(Machine { time }, scanner, gripper, store, Config::default())
}

/// One turn of the loop: the bridge, the host, then sleep until something is due.
///
/// A function of its own, so that what it can reach can be told in the linked program.
#[inline(never)]
fn turn(
    app: &mut Bridge,
    server: &mut Server<Port>,
    watchdog: &mut Watchdog,
    stack: &mut StackWatch,
    started: Restart,
) -> Outcome {
    let due = app.step();
    // By the clock as it is now: the step may have stood still in between.
    let now = app.platform_mut().now();
    let outcome = server.poll(now, app);
    server.tell_board(protocol::Board {
        bytes_lost: board::bytes_lost(),
        stack_used: stack.look(),
        restart: started,
    });
    watchdog.feed();
    app.platform_mut().wait_until(due);
    outcome
}

/// Nothing in the loop panics (a check on the linked program shows it); start-up may.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    board::restart()
}
