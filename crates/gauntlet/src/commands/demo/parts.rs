//! What both homes of the demo's bridge share: the trained map, the virtual devices, what was started.

use std::any::Any;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::Result;
use host::glove::calibration::Bound;
use host::trainer::algorithm::Schedule;
use host::trainer::hand::Space;
use rig::Device;
use rig::glove::VirtualGlove;
use rig::gripper::{VirtualGripper, tcp};
use rig::pty::{Handle, PtyDevice};

use super::args::Demo;
use crate::commands::simulate;
use crate::commands::train::taken;
use crate::played;
use crate::progress::Person;
use crate::results::runs;
use crate::run::Run;
use crate::tell::Tell;
use crate::wearer::{Listener, Wearer};
use host::chip::link::Flashed;
use host::failure::{Failure, OrFail};
use host::interrupt::Interrupt;
use host::lines::port::BAUD;
use host::next::{Command, NextStep, advice};
use host::realtime;
use host::session::Snapshot;
use host::stats::seconds;
use host::training::motion::Motion;
use host::training::quality::Quality;
use host::training::{Outcome, Request, train};

/// Reference pairs chosen one after another.
const PAIRS: usize = 8;
/// As many starts as are likely to end within this time.
const TRAINING: Duration = Duration::from_secs(8);

/// What both homes of the bridge are started with.
#[derive(Clone, Copy)]
pub(super) struct Stage<'a> {
    pub(super) options: &'a Demo,
    pub(super) motion: &'a Motion,
    pub(super) tell: &'a Tell,
    pub(super) interrupt: &'a Interrupt,
}

impl Stage<'_> {
    /// What is virtual and what is not, and what moves.
    pub(super) fn introduce(&self, rest: &str) {
        self.tell.say(format_args!(
            "gauntlet demo: glove and gripper are virtual, {rest}"
        ));
        let motion = self.motion.describe();
        self.tell.say(format_args!("motion     {motion}"));
    }
}

/// A bridge that runs between virtual devices.
pub(super) struct Started {
    pub(super) run: Run,
    /// The training before it.
    pub(super) outcome: Outcome,
    /// Who wears the glove; `None` with ideal sensors.
    pub(super) person: Option<runs::Person>,
    /// When driving began.
    pub(super) drives: Option<Instant>,
    /// How the map came into a chip.
    pub(super) flashed: Option<Flashed>,
    /// Devices and emulator: gone when this is dropped.
    pub(super) home: Box<dyn Any>,
    /// Whether frames come, and how long they are waited for: virtual sensors boot in 650 ms and are brought up within a few
    /// seconds.
    pub(super) framed: fn(&Snapshot) -> bool,
    pub(super) frame_wait: Duration,
}

/// The gripper's.
pub(super) fn space(options: &Demo) -> Space {
    Space::of_axes(options.gripper_model.axes()).unwrap_or(Space::ThreeFinger)
}

pub(super) fn trained(stage: Stage<'_>) -> Result<Outcome> {
    let Stage {
        options,
        motion,
        tell,
        interrupt,
    } = stage;
    let request = Request {
        motion,
        space: space(options),
        schedule: Schedule::Fast,
        epochs: None,
        pairs: PAIRS,
        start_pairs: !options.no_start_pairs,
        seed: options.seed,
        within: Some(TRAINING),
        reporter: &Person,
    };
    tell.say(format_args!(
        "training   {} and {PAIRS} chosen where they help most; a scripted operator shows the hand poses;",
        if options.no_start_pairs { "no start pairs" } else { "2 start pairs (open hand, fist)" }
    ));
    let paper: NextStep = match &options.poses {
        Some(poses) => Command::gauntlet("train")
            .path("--poses", poses)
            .option("--schedule", "paper")
            .option("--out", "model.safetensors")
            .into(),
        None => advice("train --schedule paper, with a recording of a hand"),
    };
    tell.say(format_args!(
        "           fast schedule, {} epochs (the paper's is 8,000 + 100 a pair: {paper})",
        request.total_epochs()
    ));
    let outcome = train(&request, interrupt)?;
    tell.say(format_args!(
        "trained    in {}{}",
        seconds(outcome.took),
        taken(&outcome.starts)
    ));
    tell.say(format_args!("quality    {}", outcome.quality.line()));
    require_good(&outcome.quality)?;
    Ok(outcome)
}

/// The demo does not drive with a map that leaves out much of the gripper's range, or folds.
fn require_good(quality: &Quality) -> Result<()> {
    let Some(fault) = quality.fault() else {
        return Ok(());
    };
    let next = "another --seed, or a recording in which every finger moves over its whole range, alone and together";
    Err(Failure::new(fault, next).into())
}

/// The virtual devices, each behind a pseudo-terminal; the gripper behind a port of this computer's network where that is asked for.
pub(super) struct Virtual {
    /// The glove.
    pub(super) glove: VirtualGlove,
    /// The way to it.
    pub(super) glove_port: Handle,
    /// Where the gripper is, which is not activated: a terminal, or `tcp:HOST:PORT`.
    pub(super) gripper_place: PathBuf,
    /// The gripper: gone when this is dropped.
    _gripper: Box<dyn Any>,
}

impl Virtual {
    /// A glove on a hand that moves as the motion does, and a gripper.
    pub(super) fn start(stage: Stage<'_>) -> Result<Self> {
        let options = stage.options;
        let glove = match options.ideal {
            true => VirtualGlove::new(
                played::virtual_hand(stage.motion),
                rig::glove::Config::at_baud(BAUD),
            ),
            false => Wearer::new(options.seed).playing(played::source(stage.motion)),
        };
        let family = simulate::family(options.gripper_model);
        let gripper = VirtualGripper::new(rig::gripper::Config::of(family));
        let glove_port = spawn("glove", Box::new(glove.clone()))?;
        let (gripper_place, gripper): (PathBuf, Box<dyn Any>) = match options.gripper_tcp {
            true => {
                let server = listen(&gripper)?;
                let place = format!("tcp:{}", server.address());
                (place.into(), Box::new(server))
            }
            false => {
                let port = spawn("gripper", Box::new(gripper))?;
                (port.path().to_owned(), Box::new(port))
            }
        };
        Ok(Self {
            glove,
            glove_port,
            gripper_place,
            _gripper: gripper,
        })
    }
}

/// Gives the bridge the glove's profile; the person in it lies flat when that is asked for.
pub(super) fn worn(
    mut run: Run,
    profile: Option<(Bound, runs::Person)>,
    devices: &Virtual,
) -> (Run, Option<runs::Person>) {
    let Some((bound, person)) = profile else {
        run.is_straight(true);
        return (run, None);
    };
    run.wears(Some(bound));
    run.has(Some(Listener::Here(devices.glove.clone())));
    (run, Some(person))
}

fn spawn(name: &str, device: Box<dyn Device>) -> Result<Handle> {
    realtime::starting(|| PtyDevice::spawn(device, None))
        .and_then(|(handle, _)| handle)
        .or_fail(
            || format!("the virtual {name} gets no pseudo-terminal"),
            advice("ending programs that hold many of them (")
                .then(Command::program("ls").word("/dev/pts"))
                .then(")"),
        )
}

/// Lets `gripper` answer at any free port of this computer.
fn listen(gripper: &VirtualGripper) -> Result<tcp::TcpHandle> {
    let serve = || tcp::serve(gripper, "127.0.0.1:0", &rig::Clock::system());
    realtime::starting(serve)
        .and_then(|(server, _)| server)
        .or_fail(
            || "the virtual gripper gets no port of 127.0.0.1".to_owned(),
            "ending programs that hold many of them, or the same without --gripper-tcp",
        )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quality(volume_occupancy: f64, d_knn: f64) -> Quality {
        Quality {
            mean_distortion: 6.0,
            volume_occupancy,
            d_knn,
            frames: 254,
            measured_on: "held-out frames".to_owned(),
            bar: host::training::quality::Bar::of(Space::ThreeFinger),
        }
    }

    #[test]
    fn a_map_below_the_gate_is_refused_with_both_measures() {
        assert!(require_good(&quality(0.90, 16.0)).is_ok());
        for (occupancy, d_knn) in [
            (0.899, 5.0),
            (0.99, 16.01),
            (f64::NAN, 5.0),
            (0.99, f64::NAN),
        ] {
            let error = require_good(&quality(occupancy, d_knn)).unwrap_err();
            assert!(
                error.to_string().contains(&format!("{d_knn:.2}")),
                "{error}"
            );
        }
    }
}
