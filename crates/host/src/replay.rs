//! The trace of a session's log through the bridge again.
//!
//! The same bytes at the same instants give the same commands bit for bit: [`same`] looks, and names the first difference.
//! With another map, profile or other settings the bridge does something else: [`other`] gives it the bytes by their times,
//! and [`compare`] says by how much its commands differ.

use std::marker::PhantomData;

use anyhow::Result;
use bridge::trace::{
    Difference, Entry, GLOVE, GRIPPER, Look, Loose, Port, Reader, Source, Strict, settings,
};
use bridge::{App, Board, Instant, Platform, Settings};
use glove::calibration::Bound;
use glove::sc18im::{Sc18im, SerialPort};
use glove::scan::{BusScanner, Scanner};
use gripper::driver::{ThreeFinger, TwoFinger};

use crate::failure::Failure;
use crate::recording::traced::Traced;
use crate::session::slots::MemorySlot;
use crate::session::stored::stored;

mod compared;
mod echoed;

use echoed::Echoed;

pub use compared::{Apart, Compared, compare};

/// Who follows a replay.
pub trait Follow {
    /// Before each turn of the loop; at `at` µs. Returns whether it goes on.
    fn turn<B: Board<X>, const X: usize>(&mut self, app: &mut App<B, X>, at: u64) -> bool;

    /// The same where a glove was read by itself: there is no bridge.
    fn reading(&mut self, _at: u64) -> bool {
        true
    }
}

/// Nobody looks.
impl Follow for () {
    fn turn<B: Board<X>, const X: usize>(&mut self, _: &mut App<B, X>, _: u64) -> bool {
        true
    }
}

/// Two look, and either ends it.
struct Both<'a, A, C>(&'a mut A, &'a mut C);

impl<A: Follow, C: Follow> Follow for Both<'_, A, C> {
    fn turn<B: Board<X>, const X: usize>(&mut self, app: &mut App<B, X>, at: u64) -> bool {
        self.0.turn(app, at) && self.1.turn(app, at)
    }

    fn reading(&mut self, at: u64) -> bool {
        self.0.reading(at) && self.1.reading(at)
    }
}

/// What another bridge is made of, where that is not as in the log.
#[derive(Debug, Clone, Default)]
pub struct Changes {
    /// Its weights image.
    pub image: Option<Vec<u8>>,
    /// The glove's profile.
    pub profile: Option<Bound>,
    /// How the gripper is driven.
    pub driving: crate::session::Driving,
}

/// How a replay of the same bridge went.
#[derive(Debug, Clone, PartialEq)]
pub struct Same {
    /// Time in the log that was replayed, µs.
    pub time_us: u64,
    /// Turns of the bridge's loop.
    pub turns: u64,
    /// Frames and changes of state that were as in the log.
    pub seen: u64,
    /// Bytes written as in the log: to the glove and to the gripper.
    pub written: [u64; 2],
    /// When the bridge first did something else, µs, and what.
    pub difference: Option<(u64, Difference)>,
    /// Why the log's trace ends before its last byte.
    pub cut: Option<String>,
}

/// Replays the log with the same bridge.
///
/// # Errors
/// A failure where no bridge can be made of what the log holds.
pub fn same(traced: &Traced, follow: &mut impl Follow) -> Result<Same> {
    let strict = Strict::new(&traced.bytes);
    let gripper = Port::new(&strict, GRIPPER);
    run(&strict, gripper, traced, &Changes::default(), follow)?;
    let cut = match (strict.damage(), strict.has_gap(), traced.gap) {
        (Some(damage), _, _) => Some(damage.to_string()),
        (None, true, _) => {
            Some("the disk or the queue was too slow here: bytes are missing".to_owned())
        }
        (None, false, Some((from, to))) => Some(format!(
            "from {:.3} s to {:.3} s the log is damaged",
            seconds(from),
            seconds(to)
        )),
        (None, false, None) => None,
    };
    Ok(Same {
        time_us: strict.at(),
        turns: strict.turns(),
        seen: strict.seen_alike(),
        written: [GLOVE, GRIPPER].map(|port| strict.written(port)),
        difference: strict.difference(),
        cut,
    })
}

fn seconds(us: u64) -> f64 {
    us as f64 * 1e-6
}

/// Replays the log with another bridge, by the times of its bytes.
///
/// # Errors
/// As [`same`].
pub fn other(traced: &Traced, changes: &Changes, follow: &mut impl Follow) -> Result<()> {
    let loose = Loose::new(&traced.bytes);
    let gripper = Echoed::new(Port::new(&loose, GRIPPER));
    run(&loose, gripper, traced, changes, follow)
}

/// The trace as a board whose gripper is on a line `G`.
struct Home<'s, S, G>(&'s S, PhantomData<G>);

impl<S: Source, G> Platform for Home<'_, S, G> {
    fn now(&mut self) -> Instant {
        self.0.now()
    }

    fn wait_until(&mut self, due: Instant) {
        self.0.wait_until(due);
    }
}

impl<'s, S: Source, G: SerialPort> Board<4> for Home<'s, S, G> {
    type Glove = Sc18im<Port<'s, S>>;
    type Gripper = ThreeFinger<G>;
    type Flash = MemorySlot;
}

impl<'s, S: Source, G: SerialPort> Board<1> for Home<'s, S, G> {
    type Glove = Sc18im<Port<'s, S>>;
    type Gripper = TwoFinger<G>;
    type Flash = MemorySlot;
}

fn run<S: Source, G: SerialPort>(
    source: &S,
    gripper: G,
    traced: &Traced,
    changes: &Changes,
    follow: &mut impl Follow,
) -> Result<()> {
    let why = match traced.home.glove.as_str() {
        "serial" => None,
        "chip" => Some(
            "it is of a bridge on a chip: it holds what that told and was told, and not what came over its ports",
        ),
        _ => Some("its glove was on an I²C port, whose bytes a log does not hold"),
    };
    if let Some(why) = why {
        let next = "a log of teleop or demo with a glove on a serial port";
        let what = format!("{} cannot be replayed: {why}", traced.path.display());
        return Err(Failure::new(what, next).into());
    }
    if traced.is_scan() {
        scan(source, traced, follow);
        return Ok(());
    }
    match traced.model.two_finger() {
        None => turns::<4, _, _>(source, gripper, traced, changes, follow, ThreeFinger::new),
        Some(model) => {
            let driver = move |line, config| TwoFinger::new(line, model, config);
            turns::<1, _, _>(source, gripper, traced, changes, follow, driver)
        }
    }
}

/// A glove that was read by itself: only what is written to it can be compared.
fn scan<S: Source>(source: &S, traced: &Traced, follow: &mut impl Follow) {
    let config = traced.home.scan.config();
    let mut scanner = Scanner::new(Port::new(source, GLOVE), config).with_set_baud();
    while !source.is_over() {
        let now = source.now();
        if !follow.reading(now.as_ticks()) {
            return;
        }
        // What became of the sensors is in the next writes.
        let _ = scanner.poll(now);
        source.wait_until(scanner.next_due().unwrap_or(now));
    }
}

fn turns<'s, const X: usize, S: Source, G: SerialPort>(
    source: &'s S,
    gripper: G,
    traced: &Traced,
    changes: &Changes,
    follow: &mut impl Follow,
    driver: impl FnOnce(G, gripper::driver::Config) -> <Home<'s, S, G> as Board<X>>::Gripper,
) -> Result<()>
where
    Home<'s, S, G>: Board<X, Glove = Sc18im<Port<'s, S>>, Flash = MemorySlot>,
{
    let image = changes.image.as_deref().unwrap_or(&traced.image);
    let store = stored(image, traced.model)?;
    let unusable = || Failure::new("the log's settings cannot be used", "another log");
    let logged = settings::<X>(&traced.settings, Settings::default()).ok_or_else(unusable)?;
    let changed = changes.driving.over(*logged.settings());
    let config = bridge::Config::new(changed).map_err(|error| {
        Failure::usage(
            format!("the bridge's settings: {error}"),
            "a value in its range",
        )
    })?;
    let scan = traced.home.scan.config();
    let bus = Scanner::new(Port::new(source, GLOVE), scan).with_set_baud();
    let scanner = BusScanner::on(bus.into_bus(), scan);
    let gripper = driver(gripper, traced.home.driver());
    let mut app = App::new(Home(source, PhantomData), scanner, gripper, store, config);
    let profile = changes.profile.as_ref();
    if let Some(profile) = profile.or(traced.profile.as_ref()) {
        // The clutch is open.
        let _ = app.set_profile(Some(profile));
    }
    let mut look = Look::default();
    loop {
        while let Some(order) = source.order() {
            match (order, profile) {
                // Another profile stays the one in use.
                (bridge::trace::Order::Profile(_), Some(profile)) => {
                    let _ = app.set_profile(Some(profile));
                }
                (order, _) => drop(order.give(&mut app)),
            }
        }
        if let Some(seen) = look.look(app.telemetry()) {
            source.see(seen);
        }
        let at = app.telemetry().now.as_ticks();
        if !follow.turn(&mut app, at) || source.is_over() {
            return Ok(());
        }
        let due = app.step();
        app.platform_mut().wait_until(due);
    }
}

/// What went over a log's line to the gripper.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct GripperLine {
    /// When something was written, µs, and what.
    pub requests: Vec<(u64, Vec<u8>)>,
    /// Where the gripper stood at last, counts; `None` where it never said.
    pub positions: Option<Vec<u8>>,
}

/// What went over the line to the gripper, and where the gripper stood at last; `follow` sees the turns.
pub fn gripper_line(traced: &Traced, follow: &mut impl Follow) -> GripperLine {
    let mut line = GripperLine::default();
    let mut reader = Reader::new(&traced.bytes);
    while let Ok(Some(entry)) = reader.read() {
        if let Entry::Write {
            port: GRIPPER,
            bytes,
        } = entry
        {
            line.requests.push((reader.at(), bytes.to_vec()));
        }
    }
    let mut stood = Stood(None);
    // A log that cannot be replayed is told elsewhere.
    if same(traced, &mut Both(&mut stood, follow)).is_ok() {
        line.positions = stood.0;
    }
    line
}

struct Stood(Option<Vec<u8>>);

impl Follow for Stood {
    fn turn<B: Board<X>, const X: usize>(&mut self, app: &mut App<B, X>, _: u64) -> bool {
        if let Some(status) = &app.telemetry().status {
            let stood = self.0.get_or_insert_default();
            stood.clear();
            stood.extend_from_slice(&status.position);
        }
        true
    }
}

#[cfg(test)]
mod tests;
