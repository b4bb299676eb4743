//! What a bridge does, what its slots hold, and its counters.

use anyhow::Result;
use host::bridge::calibration::Try;
use host::bridge::protocol::message::{Health, Restart, Status};
use host::gripper::{Activation, Fault};

use super::args::BridgeAt;
use super::profile;
use crate::commands::flash::slot_lines;
use crate::results::{self, devices};
use crate::tell::Tell;
use host::chip::link::Error;
use host::next::{Warning, advice};
use host::session::refused;
use host::words;

/// Shows all of it.
///
/// # Errors
/// A failure that names the line, or what the bridge refuses.
pub(super) fn status(at: &BridgeAt) -> Result<()> {
    let mut link = at.connect()?;
    let hello = link.hello();
    let status = at.told(link.status())?;
    let slots = at.told(link.slots())?;
    let counters = at.told(link.counters())?;
    // A bridge of version 2 has none.
    let health = match link.health() {
        Err(Error::Older { .. }) => None,
        health => Some(at.told(health)?),
    };
    let profile = match health {
        Some(_) => profile::kept(&mut link, at)?,
        None => None,
    };
    let warnings = warnings(&status, health.as_ref(), profile.is_some(), at);
    if at.json {
        let bridge = devices::Bridge {
            hello: hello.as_ref(),
            status: &status,
            slots: &slots,
            counters: &counters,
            health: health.as_ref(),
            profile: profile.as_ref(),
            warnings: &warnings,
        };
        return results::print("bridge status", bridge);
    }
    let tell = Tell::new(false);
    if let Some(hello) = hello {
        let [inputs, hidden, outputs] = hello.shape;
        tell.say(format_args!(
            "bridge     protocol {}, map {inputs} → {hidden} → {outputs}, images up to {} bytes, up for {:.1} s",
            hello.version,
            hello.capacity,
            status.now_us as f64 / 1e6
        ));
    }
    tell.say(format_args!(
        "state      {}, clutch {}",
        status.state,
        clutch_words(&status)
    ));
    for fault in standing_faults(&status) {
        tell.say(format_args!("fault      {fault}"));
    }
    if let Some(health) = &health {
        health_lines(health)
            .iter()
            .for_each(|line| tell.say(format_args!("{line}")));
    }
    if health.is_some() {
        tell.say(format_args!("{}", profile::line(profile.as_ref())));
    }
    if let Some(gripper) = &status.gripper {
        tell.say(format_args!(
            "gripper    {}, at {:?}",
            words::activation(gripper.activation),
            gripper.position.as_slice()
        ));
    }
    slot_lines(&slots)
        .iter()
        .for_each(|line| tell.say(format_args!("{line}")));
    tell.say(format_args!(
        "counters   {} frames, {} to follow, {} of those answered; {} commands; {} gripper cycles, {} errors; bytes lost {:?} (host, glove, gripper)",
        counters.frames,
        counters.following_frames,
        counters.answered_frames,
        counters.commands,
        counters.statuses,
        counters.gripper_errors,
        counters.bytes_lost
    ));
    if counters.stack_used > 0 {
        tell.say(format_args!(
            "stack      {} bytes at most so far",
            counters.stack_used
        ));
    }
    for warning in &warnings {
        tell.say(format_args!("warning    {warning}"));
    }
    Ok(())
}

/// What was left half done, or is still to do, and the commands for it.
fn warnings(
    status: &Status,
    health: Option<&Health>,
    has_profile: bool,
    at: &BridgeAt,
) -> Vec<Warning> {
    let mut warnings = Vec::new();
    if status.engaged && !status.heartbeat {
        let releases = at.command("bridge release").then(", which ends the hold");
        warnings.push(Warning::new(
            "the clutch was left closed by a host that vanished",
            releases,
        ));
    }
    if let Some((there, announced)) = status.transfer {
        let next = advice("flashing the same file again, which goes on; or ")
            .then(at.command("bridge reboot"))
            .then(", which gives it up");
        let what =
            format!("{there} of {announced} bytes of a weights image came, and it did not end");
        warnings.push(Warning::new(what, next));
    }
    let calibration = health.map(|health| health.calibration);
    if let Some(calibration) = calibration.filter(|calibration| !calibration.is_calibrated) {
        let next = match calibration.newest {
            Try::Refused(why) => refused(why, &at.devices()).next().clone(),
            // A flat pose alone is refused without one.
            _ if !has_profile => at.command("calibrate").then(", which makes its profile"),
            _ => at.command("bridge calibrate").into(),
        };
        warnings.push(Warning::new("the glove is not calibrated", next));
    }
    warnings
}

fn health_lines(health: &Health) -> Vec<String> {
    let calibration = match (health.calibration.is_calibrated, health.calibration.newest) {
        (true, _) => "calibrated".to_owned(),
        (false, Try::Refused(why)) => format!("not calibrated: {why}"),
        (false, _) => "not calibrated".to_owned(),
    };
    let restart = match health.restart {
        Restart::Unknown => "for a reason the board cannot tell",
        Restart::Power => "by power or its reset pin",
        Restart::Software => "by request, or after a fault of its own",
        Restart::Watchdog => "by its watchdog: its loop hung",
    };
    vec![
        format!("glove      {calibration}"),
        format!("started    {restart}; {} stalls since", health.stalls),
    ]
}

/// How the clutch is. A host that vanished leaves a hold, which keeps the bridge from other work until it is released.
fn clutch_words(status: &Status) -> &'static str {
    match (status.engaged, status.heartbeat) {
        (false, _) => "open",
        (true, true) => "closed",
        (true, false) => "left by a host that vanished",
    }
}

/// What is wrong with the bridge's devices now.
fn standing_faults(status: &Status) -> Vec<String> {
    let mut faults = Vec::new();
    if !status.glove_answers {
        faults.push("the glove sends no frames".to_owned());
    }
    let Some(gripper) = &status.gripper else {
        faults.push("the gripper does not answer".to_owned());
        return faults;
    };
    if gripper.activation != Activation::Ready {
        let activation = words::activation(gripper.activation);
        faults.push(format!("the gripper is {activation}"));
    }
    if gripper.fault != Fault::None {
        faults.push(words::fault(gripper.fault));
    }
    faults
}
