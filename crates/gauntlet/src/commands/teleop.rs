//! `gauntlet teleop`: a gripper driven by a glove, over any two serial ports.

use std::path::Path;
use std::time::Duration;

use anyhow::Result;
use glove::hand::{SEGMENT_COUNT, Side};
use glove::scan::Health;
use gripper::Activation;
use serde_json::json;

use crate::cli::{Hand, Teleop};
use crate::progress::Person;
use crate::run::{LogTo, Options, Run};
use crate::tell::Tell;
use crate::{out, outputs};
use host::clock::Clock;
use host::diagnose;
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::lines::list;
use host::lines::port::BAUD;
use host::probe;
use host::session::{InProcess, Parts, Snapshot, check_image};
use host::training::model;
use host::words;

/// Bring-up of 16 sensors: a reset of 650 ms, two mode changes each, and time to spare.
const FRAME_WAIT: Duration = Duration::from_secs(15);
/// For the others after the first that gives orientations.
const STRAGGLERS: Duration = Duration::from_secs(2);

/// Runs until its time is over or somebody ends it.
///
/// # Errors
/// A failure that names the file, the port or the device.
pub(super) fn run(options: &Teleop, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.json);
    check_ports(options)?;
    if options.engage && !options.calibrate_flat {
        return Err(Failure::usage(
            "--engage closes the clutch from the start, and a glove that is not calibrated does not drive",
            "--calibrate-flat as well: it waits until the hand lies flat and still",
        )
        .into());
    }
    let model = options.gripper_model;
    let line = options.line.settings(&options.gripper)?;
    if let Some(path) = &options.log {
        outputs::check_new(path)?;
    }
    let image = model::weights(&options.model, None, &Person)?.image;
    check_image(&image, model)?;
    for path in [&options.glove, &options.gripper] {
        if let Some(warning) = list::latency_warning(path) {
            tell.say(format_args!("warning: {}: {warning}", path.display()));
        }
    }
    let (gripper, activation) =
        probe::open_gripper_with(&options.gripper, model, line, &Person, interrupt)?;
    tell.say(format_args!(
        "gripper  {}  answers, {}",
        options.gripper.display(),
        words::activation(activation)
    ));
    let glove = probe::open_glove(&options.glove, interrupt)?;
    if glove.switched {
        tell.say(format_args!(
            "glove    {}  spoke 9600 baud, as after power-on; switched it to {BAUD}",
            options.glove.display()
        ));
    }
    let clock = Clock::start();
    let log = options.log.clone();
    let (log, feed) = log.map(|path| LogTo::new(path, model.axes())).unzip();
    let parts = Parts {
        glove: glove.port,
        gripper,
        model,
        line,
        image,
        side: side(options.hand),
        feed,
    };
    let session = InProcess::start(parts, clock, interrupt)?;
    let mut run = Run::new(session, log, clock, interrupt.clone());
    let prepared = prepare(options, &mut run, &tell, activation);
    let frames = !matches!(prepared, Ok(Prepared::NoFrames));
    let driven = match prepared {
        Ok(Prepared::Ready) => drive(options, &mut run),
        Ok(Prepared::Ended | Prepared::NoFrames) => Ok(()),
        Err(error) => Err(error),
    };
    let finished = run.finish();
    let driven = match frames {
        true => driven,
        // The port is free now.
        false => Err(no_frames(&options.glove, interrupt)),
    };
    if !options.json {
        finished.tell(&tell, "");
    } else if finished.ending.is_some() {
        out::json(&json!({
            "gripper": finished.gripper(),
            "run": finished.summary,
            "log": finished.log,
        }))?;
    }
    finished.judge(driven)
}

fn check_ports(options: &Teleop) -> Result<()> {
    let same = |a: &Path, b: &Path| {
        a == b || std::fs::canonicalize(a).ok() == std::fs::canonicalize(b).ok()
    };
    if options.glove.exists() && same(&options.glove, &options.gripper) {
        return Err(Failure::usage(
            format!(
                "glove and gripper are on the same port, {}",
                options.glove.display()
            ),
            "`gauntlet ports` to tell them apart",
        )
        .into());
    }
    Ok(())
}

fn side(hand: Hand) -> Side {
    match hand {
        Hand::Right => Side::Right,
        Hand::Left => Side::Left,
    }
}

/// How the bring-up ended.
enum Prepared {
    /// The clutch may close.
    Ready,
    /// Somebody asked for the end.
    Ended,
    /// No sensor of the glove gave an orientation.
    NoFrames,
}

impl From<bool> for Prepared {
    fn from(go_on: bool) -> Self {
        if go_on { Self::Ready } else { Self::Ended }
    }
}

/// Everything before the clutch may close.
fn prepare(
    options: &Teleop,
    run: &mut Run,
    tell: &Tell,
    activation: Activation,
) -> Result<Prepared> {
    tell.say(format_args!(
        "glove    {}  answers, bringing up its 16 sensors",
        options.glove.display()
    ));
    let framed = run.wait(FRAME_WAIT, |s| s.frame_sequence > 0)?;
    if run.asked() {
        return Ok(Prepared::Ended);
    }
    if !framed {
        return Ok(Prepared::NoFrames);
    }
    tell_missing(run, tell)?;
    if options.calibrate_flat && !run.calibrate(tell)? {
        return Ok(Prepared::Ended);
    }
    if activation == Activation::Ready {
        return Ok(Prepared::Ready);
    }
    if options.activate
        || run.ask_yes(
            "The gripper is not activated. Activation moves its fingers. Type yes to activate it: ",
        )?
    {
        return run.activate(tell).map(Prepared::from);
    }
    if run.asked() {
        return Ok(Prepared::Ended);
    }
    if options.engage {
        return Err(Failure::new(
            format!(
                "the gripper on {} is {}, so it cannot follow",
                options.gripper.display(),
                words::activation(activation)
            ),
            "the same with --activate: the fingers will move",
        )
        .into());
    }
    tell.say(format_args!(
        "not activated: you can watch the hand, the gripper will not move"
    ));
    Ok(Prepared::Ready)
}

/// Names the sensors that did not come up, as `doctor` does: their joints are held.
fn tell_missing(run: &mut Run, tell: &Tell) -> Result<()> {
    let all = |health: &[Health; SEGMENT_COUNT]| health.iter().all(|health| health.is_good());
    let health = |seen: &Snapshot| seen.sensors.map(|sensors| sensors.health);
    run.wait(STRAGGLERS, |seen| health(seen).is_some_and(|h| all(&h)))?;
    // One that is still being brought up says soon what it fails with.
    run.wait(2 * STRAGGLERS, |seen| {
        health(seen).is_some_and(|h| !h.contains(&Health::Starting))
    })?;
    let seen = run.snapshot();
    let Some(health) = seen.as_ref().and_then(health).filter(|health| !all(health)) else {
        return Ok(());
    };
    for finding in diagnose::missing_sensors(&health).0 {
        tell.say(format_args!("warning: {}", finding.what));
        if let Some(next) = finding.next {
            tell.say(format_args!("  try: {next}"));
        }
    }
    Ok(())
}

fn no_frames(path: &Path, interrupt: &Interrupt) -> anyhow::Error {
    let what = format!(
        "the glove's serial multiplexer on {} answers, but no sensor sent an orientation in {} s",
        path.display(),
        FRAME_WAIT.as_secs()
    );
    diagnose::no_sensors(&what, path, interrupt).into()
}

fn drive(options: &Teleop, run: &mut Run) -> Result<()> {
    run.drive(&Options {
        title: "gauntlet teleop",
        seconds: options.seconds,
        engage: options.engage,
        drives: true,
        quiet: options.json,
    })?;
    Ok(())
}
