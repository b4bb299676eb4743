//! `gauntlet teleop`: a gripper driven by a glove, over any two serial ports.

use std::path::Path;
use std::time::Duration;

use anyhow::Result;
use glove::hand::SEGMENT_COUNT;
use glove::scan::Health;
use gripper::{Activation, Status};
use serde_json::json;

use crate::cli::{Hand, Teleop};
use crate::progress::Person;
use crate::run::{Options, Run};
use crate::tell::Tell;
use crate::{out, outputs};
use host::clock::Clock;
use host::diagnose;
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::lines::list;
use host::lines::port::BAUD;
use host::probe;
use host::session::record::AXES;
use host::session::{Order, Parts, Session, Snapshot};
use host::training::model;
use host::words;

/// Bring-up of 16 sensors: a reset of 650 ms, two mode changes each, and time to spare.
const FRAME_WAIT: Duration = Duration::from_secs(15);
/// For the others after the first that gives orientations.
const STRAGGLERS: Duration = Duration::from_secs(2);
/// An activation takes a few seconds; a gripper that needs longer has a fault.
pub(super) const ACTIVATION_WAIT: Duration = Duration::from_secs(20);

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
    check_model(options)?;
    let line = options.line.settings(&options.gripper)?;
    if let Some(path) = &options.log {
        outputs::check_new(path)?;
    }
    let image = model::weights(&options.model, None, &Person)?.image;
    let config = config(options.hand)?;
    for path in [&options.glove, &options.gripper] {
        if let Some(warning) = list::latency_warning(path) {
            tell.say(format_args!("warning: {}: {warning}", path.display()));
        }
    }
    let (gripper, status) = probe::open_gripper_with(&options.gripper, line, &Person, interrupt)?;
    tell.say(format_args!(
        "gripper  {}  answers, {}",
        options.gripper.display(),
        words::activation(status.activation)
    ));
    let glove = probe::open_glove(&options.glove, interrupt)?;
    if glove.switched {
        tell.say(format_args!(
            "glove    {}  spoke 9600 baud, as after power-on; switched it to {BAUD}",
            options.glove.display()
        ));
    }
    let clock = Clock::start();
    let parts = Parts {
        glove: glove.port,
        gripper,
        line,
        image,
        config,
    };
    let session = Session::start(parts, clock, interrupt)?;
    let mut run = Run::new(session, options.log.clone(), clock, interrupt.clone());
    let prepared = prepare(options, &mut run, &tell, interrupt, status);
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

/// Only the 3-Finger gripper follows a glove for now.
fn check_model(options: &Teleop) -> Result<()> {
    let model = options.gripper_model;
    if model.two_finger().is_none() {
        return Ok(());
    }
    let what = format!(
        "teleop drives the 3-Finger gripper only for now, not the {}",
        model.name()
    );
    let next = format!(
        "`gauntlet gripper move --gripper {} --gripper-model {} --to 100`, which moves it at a bench",
        options.gripper.display(),
        model.option()
    );
    Err(Failure::usage(what, next).into())
}

fn config(hand: Hand) -> Result<bridge::Config<AXES>> {
    use glove::hand::Side;
    let settings = bridge::Settings {
        side: match hand {
            Hand::Right => Side::Right,
            Hand::Left => Side::Left,
        },
        ..bridge::Settings::default()
    };
    bridge::Config::new(settings).map_err(host::failure::told)
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
    interrupt: &Interrupt,
    status: Status<AXES>,
) -> Result<Prepared> {
    tell.say(format_args!(
        "glove    {}  answers, bringing up its 16 sensors",
        options.glove.display()
    ));
    let framed = run.wait(FRAME_WAIT, |s| s.frame_sequence > 0)?;
    if interrupt.asked() {
        return Ok(Prepared::Ended);
    }
    if !framed {
        return Ok(Prepared::NoFrames);
    }
    tell_missing(run, tell)?;
    if options.calibrate_flat && !run.calibrate(tell)? {
        return Ok(Prepared::Ended);
    }
    if status.activation == Activation::Ready {
        return Ok(Prepared::Ready);
    }
    if options.activate
        || run.ask_yes(
            "The gripper is not activated. Activation moves its fingers. Type yes to activate it: ",
        )?
    {
        return activate(run, tell, interrupt).map(Prepared::from);
    }
    if interrupt.asked() {
        return Ok(Prepared::Ended);
    }
    if options.engage {
        return Err(Failure::new(
            format!(
                "the gripper on {} is {}, so it cannot follow",
                options.gripper.display(),
                words::activation(status.activation)
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
    let health = |seen: &Snapshot| seen.frame.map(|frame| frame.samples.map(|s| s.health));
    run.wait(STRAGGLERS, |seen| health(seen).is_some_and(|h| all(&h)))?;
    // One that is still being brought up says soon what it fails with.
    run.wait(2 * STRAGGLERS, |seen| {
        health(seen).is_some_and(|h| !h.contains(&Health::Starting))
    })?;
    let seen = run.session().snapshot();
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

/// Activates the gripper and waits until it is ready. Returns whether to go on.
pub(super) fn activate(run: &mut Run, tell: &Tell, interrupt: &Interrupt) -> Result<bool> {
    tell.say(format_args!("activating the gripper: its fingers move"));
    run.order(Order::Activate);
    let ready = run.wait(ACTIVATION_WAIT, |s| {
        s.status
            .is_some_and(|status| status.activation == Activation::Ready)
    })?;
    if !ready && !interrupt.asked() {
        let fault = run
            .session()
            .snapshot()
            .and_then(|snapshot| snapshot.status)
            .map_or_else(String::new, |status| {
                format!(
                    " (fault {:02X}: {})",
                    status.fault.code(),
                    status.fault.sentence()
                )
            });
        return Err(Failure::new(
            format!(
                "the gripper was not ready {} s after its activation was asked for{fault}",
                ACTIVATION_WAIT.as_secs()
            ),
            "take what blocks its fingers away, switch its 24 V supply off and on, and start again",
        )
        .into());
    }
    Ok(ready)
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
        quiet: options.json,
    })?;
    Ok(())
}
