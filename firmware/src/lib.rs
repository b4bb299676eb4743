//! The bridge's program for a microcontroller: [`run`] ties a board to [`bridge::App`] and to the host protocol's
//! [`bridge::protocol::Server`]. A board is a [`Chip`] and its [`Devices`]; `docs/porting.md` says how one is written.
//!
//! Knows no address and no processor. Not tried on hardware.
#![no_std]
#![forbid(unsafe_code)]

use bridge::protocol::{Machine, Outcome, Server};
use bridge::{App, Board, Config, WeightsStore, glove};
use embedded_io::{Read, ReadReady, Write};
use glove::scan::{self, BusScanner};

/// Axes of the 3-Finger gripper.
pub const AXES: usize = 4;

/// A board with a chip on it: beside what every home of the bridge has, a line to a host and a watchdog.
pub trait Chip: Board<AXES> {
    /// The port of the host protocol. Its reads and writes never wait.
    type Host: Read + ReadReady + Write;
    /// The port of the gripper's line. Its reads and writes never wait.
    type Line;

    /// The gripper on its line: [`bridge::gripper::driver::ThreeFinger`] with the time this board's line wants.
    fn gripper(line: Self::Line) -> Self::Gripper;

    /// The glove's scanner on its bus.
    fn scanner(bus: Self::Glove) -> BusScanner<Self::Glove> {
        BusScanner::on(bus, scan::Config::default())
    }

    /// Starts the watchdog: from now on a second without [`Chip::feed_watchdog`] resets the machine.
    fn start_watchdog(&mut self);

    /// The loop has come round.
    fn feed_watchdog(&mut self);

    /// What only the machine can count, and why it started. Asked once a turn.
    fn machine(&mut self) -> Machine;
}

/// What is connected to a board.
pub struct Devices<C: Chip> {
    /// The host protocol's line.
    pub host: C::Host,
    /// The bus of the glove's sensors: [`glove::sc18im::Sc18im`] on the port of its serial multiplexer. A board whose port can change
    /// its speed ([`glove::sc18im::SetBaud`]) gives it `with_set_baud` and says how fast in [`glove::sc18im::Config::raise_to`]: a
    /// glove fresh from power-on is then found, and found again after a power cut. Elsewhere it must speak the port's speed.
    pub glove: C::Glove,
    /// The gripper's Modbus RTU line.
    pub gripper: C::Line,
    /// Both slots of the weights store.
    pub slots: [C::Flash; 2],
    /// Both slots of the glove's profile: an erase sector each is enough.
    pub profile: [C::Flash; 2],
}

/// Runs the bridge on `board` until a host asks for a restart: the caller's to do then.
pub fn run<C: Chip>(board: C, devices: Devices<C>) {
    let Devices {
        host,
        glove,
        gripper,
        slots,
        profile,
    } = devices;
    let mut app = bridge(board, glove, gripper, slots);
    app.keep_profile(profile);
    let mut server = Server::new(host);
    app.platform_mut().start_watchdog();
    while turn(&mut app, &mut server) == Outcome::Continue {}
}

/// The bridge on its devices.
///
/// A function of its own, so that what it is made of does not stay on the stack beside it.
#[inline(never)]
fn bridge<C: Chip>(
    board: C,
    glove: C::Glove,
    gripper: C::Line,
    slots: [C::Flash; 2],
) -> App<C, AXES> {
    let store = WeightsStore::new(slots, bridge::app::expected(AXES));
    let scanner = C::scanner(glove);
    App::new(
        board,
        scanner,
        C::gripper(gripper),
        store,
        Config::default(),
    )
}

/// One turn of the loop: the bridge, the host, then sleep until something is due.
///
/// A function of its own, so that what it can reach can be told in the linked program.
#[inline(never)]
fn turn<C: Chip>(app: &mut App<C, AXES>, server: &mut Server<C::Host>) -> Outcome {
    let due = app.step();
    // By the clock as it is now: the step may have stood still in between.
    let now = app.platform_mut().now();
    let outcome = server.poll(now, app);
    let board = app.platform_mut();
    server.tell_machine(board.machine());
    board.feed_watchdog();
    board.wait_until(due);
    outcome
}
