//! What comes before the clutch may close: frames, the calibration, the gripper's activation.

use std::path::Path;
use std::time::Duration;

use anyhow::Result;
use host::glove::hand::SEGMENT_COUNT;
use host::glove::scan::Health;
use host::gripper::Activation;

use super::args::Teleop;
use crate::commands::glove::speed;
use crate::run::Run;
use crate::tell::Tell;
use host::calibration::virtual_person::VirtualPerson;
use host::calibration::{may_be_ideal, profile_of};
use host::diagnose;
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::next::{Command, NextStep};
use host::session::Snapshot;
use host::words;

/// Bring-up of 16 sensors: a reset of 650 ms, two mode changes each, and time to spare.
const FRAME_WAIT: Duration = Duration::from_secs(15);
/// For the others after the first that gives orientations.
const STRAGGLERS: Duration = Duration::from_secs(2);

/// How the bring-up ended.
pub(super) enum Prepared {
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
pub(super) fn prepare(
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
    tell_speed(options, run, tell);
    find_profile(options, run, tell)?;
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
            NextStep::same(Command::more().word("--activate")).then(": the fingers will move"),
        )
        .into());
    }
    tell.say(format_args!(
        "not activated: you can watch the hand, the gripper will not move"
    ));
    Ok(Prepared::Ready)
}

/// Finds the glove's profile by its sensors' ids. Where there is none nothing follows: that is told, and refused where a flat pose with
/// it was asked for.
fn find_profile(options: &Teleop, run: &mut Run, tell: &Tell) -> Result<()> {
    let any = |seen: &Snapshot| seen.ids.iter().any(Option::is_some);
    run.wait(STRAGGLERS, any)?;
    let ids = run
        .snapshot()
        .map_or([None; SEGMENT_COUNT], |seen| seen.ids);
    if options.ideal {
        may_be_ideal(&options.glove, &ids)?;
        run.is_straight(true);
        return Ok(());
    }
    let why = match profile_of(options.profile.as_deref(), &ids)? {
        Ok((path, kept)) => {
            tell.say(format_args!(
                "profile  {}  of {}, {}",
                path.display(),
                kept.calibrated,
                kept.quality.verdict
            ));
            run.wears(Some(kept.bound));
            return Ok(());
        }
        Err(why) => why,
    };
    run.wears(None);
    let place = options.glove.display();
    let what = format!("the glove on {place} is not calibrated, and moves nothing: {why}");
    let calibrate = Command::gauntlet("calibrate").path("--glove", &options.glove);
    // Never for a real glove: its angles would be wrong by tens of degrees.
    let next = match VirtualPerson::at(&options.glove) {
        Some(_) => calibrate
            .then("; if its sensors sit straight: ")
            .then(NextStep::same(Command::more().word("--ideal"))),
        None => calibrate.into(),
    };
    if options.calibrate_flat || options.profile.is_some() {
        return Err(Failure::new(what, next).into());
    }
    tell.say(format_args!("warning: {what}"));
    tell.say(format_args!("  try: {next}"));
    Ok(())
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

/// How fast its line runs now.
fn tell_speed(options: &Teleop, run: &Run, tell: &Tell) {
    let Some(baud) = run.snapshot().and_then(|seen| seen.glove_baud) else {
        return;
    };
    let (path, reading) = (&options.glove, options.reading.given());
    tell.say(format_args!(
        "glove    {}  {}",
        path.display(),
        words::line_speed(Some(baud))
    ));
    speed::runs(tell, path, reading, Some(baud));
}

/// Why no frame came, once the glove's port is free.
pub(super) fn no_frames(path: &Path, interrupt: &Interrupt) -> anyhow::Error {
    let what = format!(
        "the glove's multiplexer on {} answers, but no sensor sent an orientation in {} s",
        path.display(),
        FRAME_WAIT.as_secs()
    );
    diagnose::no_sensors(&what, path, interrupt).into()
}
