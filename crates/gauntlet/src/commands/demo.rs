//! `gauntlet demo`: the whole path, from a moving hand to a moving gripper, with nothing but this machine.

use std::time::Duration;

use anyhow::Result;
use glove::hand::Side;
use rig::Device;
use rig::glove::VirtualGlove;
use rig::gripper::VirtualGripper;
use rig::pty::{Handle, PtyDevice};
use serde_json::json;
use trainer::algorithm::Schedule;
use trainer::hand::Space;

use super::{on_chip, simulate};
use crate::cli::Demo;
use crate::played;
use crate::progress::Person;
use crate::run::{End, Finished, LogTo, Options, Run};
use crate::tell::Tell;
use crate::{out, outputs, reading};
use host::clock::Clock;
use host::failure::{Failure, OrFail};
use host::interrupt::Interrupt;
use host::lines::Model;
use host::lines::port::BAUD;
use host::probe;
use host::realtime;
use host::session::record::Feed;
use host::session::{InProcess, Parts};
use host::stats::seconds;
use host::training::model;
use host::training::motion::Motion;
use host::training::quality::Quality;
use host::training::{Outcome, Request, train};

/// Reference pairs chosen one after another.
const PAIRS: usize = 8;
/// The virtual sensors boot in 650 ms and are brought up within a few seconds.
const FRAME_WAIT: Duration = Duration::from_secs(15);

/// Runs the demo.
///
/// # Errors
/// A failure that says which of its steps did not succeed.
pub(super) fn run(options: &Demo, interrupt: &Interrupt) -> Result<()> {
    if options.on_chip {
        return on_chip::run(options, interrupt);
    }
    let clock = Clock::start();
    let tell = Tell::new(options.json);
    let motion = reading::ended_by(interrupt, "the recording", || {
        Motion::open_for_training(options.poses.as_deref(), options.seed, &Person)
    })?;
    if let Some(path) = &options.log {
        outputs::check_new(path)?;
    }
    tell.say(format_args!(
        "gauntlet demo: glove and gripper are virtual, everything between them is real"
    ));
    tell.say(format_args!("motion     {}", motion.describe()));
    let outcome = trained(options, &motion, &tell, interrupt)?;
    let image = model::image(&outcome.model)?;
    let length = image.len();
    let model = options.gripper_model;
    let log = options.log.clone();
    let (log, feed) = log.map(|path| LogTo::new(path, model.axes())).unzip();
    let (devices, parts) = devices(&motion, model, image, feed, &tell, interrupt)?;
    let session = InProcess::start(parts, clock, interrupt)?;
    tell.say(format_args!(
        "weights    an image of {length} bytes is stored and checked in the bridge's weights store"
    ));
    let mut run = Run::new(session, log, clock, interrupt.clone());
    let driven = drive(options, &mut run, &tell, interrupt);
    let finished = run.finish();
    drop(devices);
    let told = Told {
        outcome: &outcome,
        motion: &motion,
    };
    told.tell(options, &tell, &finished)?;
    let moved = finished.summary.first_motion_s.is_some();
    match finished.judge(driven)? {
        End::Time if !moved => Err(not_moved()),
        End::Time | End::Asked => Ok(()),
    }
}

pub(super) fn trained(
    options: &Demo,
    motion: &Motion,
    tell: &Tell,
    interrupt: &Interrupt,
) -> Result<Outcome> {
    let request = Request {
        motion,
        space: Space::of_axes(options.gripper_model.axes()).unwrap_or(Space::ThreeFinger),
        schedule: Schedule::Fast,
        epochs: None,
        pairs: PAIRS,
        start_pairs: !options.no_start_pairs,
        seed: options.seed,
        reporter: &Person,
    };
    tell.say(format_args!(
        "training   {} and {PAIRS} chosen where they help most; a scripted operator shows the hand poses;",
        if options.no_start_pairs { "no start pairs" } else { "2 start pairs (open hand, fist)" }
    ));
    tell.say(format_args!(
        "           fast schedule, {} epochs (the paper's is 8,000 + 100 a pair: `gauntlet train --schedule paper`)",
        request.total_epochs()
    ));
    let outcome = train(&request, interrupt)?;
    tell.say(format_args!("trained    in {}", seconds(outcome.took)));
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

/// Starts both devices and opens the ports to them.
fn devices(
    motion: &Motion,
    model: Model,
    image: Vec<u8>,
    feed: Option<Feed>,
    tell: &Tell,
    interrupt: &Interrupt,
) -> Result<([Handle; 2], Parts)> {
    let [glove, gripper] = virtual_devices(motion, model)?;
    tell.say(format_args!(
        "devices    virtual glove on {}, virtual gripper on {}, {BAUD} baud",
        glove.path().display(),
        gripper.path().display()
    ));
    let (gripper_port, _) = probe::open_gripper(gripper.path(), model, &Person, interrupt)?;
    let parts = Parts {
        glove: probe::open_glove(glove.path(), interrupt)?.port,
        gripper: gripper_port,
        model,
        line: host::lines::Settings::default(),
        image,
        side: Side::Right,
        feed,
    };
    Ok(([glove, gripper], parts))
}

/// A glove that moves as `motion` does, and a gripper that is not activated, each behind a pseudo-terminal.
pub(super) fn virtual_devices(motion: &Motion, model: Model) -> Result<[Handle; 2]> {
    let glove = VirtualGlove::new(
        played::virtual_hand(motion),
        rig::glove::Config::at_baud(BAUD),
    );
    let glove = spawn("glove", Box::new(glove))?;
    let gripper = VirtualGripper::new(rig::gripper::Config::of(simulate::family(model)));
    let gripper = spawn("gripper", Box::new(gripper))?;
    Ok([glove, gripper])
}

fn spawn(name: &str, device: Box<dyn Device>) -> Result<Handle> {
    realtime::starting(|| PtyDevice::spawn(device, None))
        .and_then(|(handle, _)| handle)
        .or_fail(
            || format!("the virtual {name} gets no pseudo-terminal"),
            "ending programs that hold many of them (`ls /dev/pts`)",
        )
}

/// Brings everything up, activates, engages, runs.
fn drive(options: &Demo, run: &mut Run, tell: &Tell, interrupt: &Interrupt) -> Result<End> {
    let framed = run.wait(FRAME_WAIT, |snapshot| snapshot.frame_sequence > 0)?;
    if interrupt.asked() {
        return Ok(End::Asked);
    }
    if !framed {
        return Err(Failure::new(
            format!(
                "the virtual glove sent no frame in {} s",
                FRAME_WAIT.as_secs()
            ),
            "the same on a machine with less to do",
        )
        .into());
    }
    if !run.calibrate(tell)? || !run.activate(tell)? {
        return Ok(End::Asked);
    }
    tell.say(format_args!(
        "engaged    the gripper follows the hand for {} (Ctrl-C holds it and ends)",
        seconds(options.seconds)
    ));
    run.drive(&Options {
        title: "gauntlet demo",
        seconds: Some(options.seconds),
        engage: true,
        drives: true,
        quiet: options.json,
    })
}

/// What the demo says at its end besides the run's own words.
struct Told<'a> {
    outcome: &'a Outcome,
    motion: &'a Motion,
}

impl Told<'_> {
    fn tell(&self, options: &Demo, tell: &Tell, finished: &Finished) -> Result<()> {
        let began = finished.ending.is_some();
        if options.json && began {
            return out::json(&json!({
                "motion": self.motion.describe(),
                "training_s": self.outcome.took.as_secs_f64(),
                "epochs": self.outcome.epochs,
                "pairs": self.outcome.pairs,
                "quality": self.outcome.quality,
                "gripper": finished.gripper(),
                "run": finished.summary,
                "log": finished.log,
            }));
        }
        finished.tell(tell, "summary    ");
        if let Some(first) = finished.summary.first_motion_s {
            tell.say(format_args!(
                "motion     the gripper first moved with the hand {first:.1} s after the clutch was closed"
            ));
        }
        if began {
            tell.say(format_args!("map        {}", self.outcome.quality.line()));
        }
        Ok(())
    }
}

/// A demo in which the gripper did not move has failed, whatever was printed.
fn not_moved() -> anyhow::Error {
    Failure::new(
        "the gripper did not move with the hand",
        "--log FILE.mcap, whose events say what held it",
    )
    .into()
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
