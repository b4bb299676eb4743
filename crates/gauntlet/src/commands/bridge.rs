//! `gauntlet bridge`: a bridge on a chip, asked, watched and told over the host protocol.

use std::path::Path;
use std::sync::mpsc::SyncSender;
use std::time::{Duration, Instant};

use anyhow::Result;
use bridge::calibration::{Refusal, Try};
use bridge::protocol::message::{Health, Restart, Sample, Status};
use gripper::{Activation, Fault};
use serde_json::json;

use super::bridge_log::Poses;
use super::flash::slot_lines;
use crate::cli::{Bridge, BridgeAt, BridgeVerb};
use crate::run::{Finished, Options, Run};
use crate::tell::Tell;
use crate::{out, outputs};
use host::chip::link::{Error, HostLink};
use host::clock::Clock;
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::session::{OnChip, refused};
use host::words;

/// For the bridge to see that its clutch was opened.
const RELEASE_WAIT: Duration = Duration::from_secs(2);

/// Does what was asked.
///
/// # Errors
/// A failure that names the line, the file, or what the bridge refuses.
pub(super) fn run(options: &Bridge, interrupt: &Interrupt) -> Result<()> {
    match &options.what {
        BridgeVerb::Status { at } => status(at),
        BridgeVerb::Engage {
            at,
            calibrate_flat,
            activate,
            seconds,
        } => engage(at, *calibrate_flat, *activate, *seconds, interrupt),
        BridgeVerb::Calibrate { at, undo } => calibrate(at, *undo, interrupt),
        BridgeVerb::Release { at } => release(at),
        BridgeVerb::Monitor { at, seconds } => monitor(at, *seconds, interrupt),
        BridgeVerb::Log { at, out, seconds } => log(at, out, *seconds, interrupt),
        BridgeVerb::Select { slot, at } => select(at, *slot),
        BridgeVerb::Reboot { at } => reboot(at),
    }
}

fn connect(at: &BridgeAt) -> Result<HostLink> {
    Ok(HostLink::connect(&at.bridge).map_err(Failure::from)?)
}

fn status(at: &BridgeAt) -> Result<()> {
    let mut link = connect(at)?;
    let hello = link.hello();
    let status = link.status().map_err(Failure::from)?;
    let slots = link.slots().map_err(Failure::from)?;
    let counters = link.counters().map_err(Failure::from)?;
    // A bridge of version 2 has none.
    let health = match link.health() {
        Err(Error::Older { .. }) => None,
        health => Some(health.map_err(Failure::from)?),
    };
    if at.json {
        return out::json(&json!({
            "hello": hello, "status": status, "slots": slots, "counters": counters, "health": health,
        }));
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
    if let Some((there, announced)) = status.transfer {
        tell.say(format_args!(
            "transfer   {there} of {announced} bytes, not ended: `gauntlet flash` goes on with it, `gauntlet bridge reboot` gives it up"
        ));
    }
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
    Ok(())
}

fn health_lines(health: &Health) -> Vec<String> {
    let calibration = match (health.calibration.is_calibrated, health.calibration.newest) {
        (true, _) => "calibrated".to_owned(),
        (false, Try::Refused(why)) => format!("not calibrated: {why}"),
        (false, _) => "not calibrated: `gauntlet bridge calibrate` does it".to_owned(),
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
        (true, false) => "left by a host that vanished: `gauntlet bridge release` ends the hold",
    }
}

fn release(at: &BridgeAt) -> Result<()> {
    let mut link = connect(at)?;
    link.release().map_err(Failure::from)?;
    // The next step of the bridge, 10 ms later, takes it.
    let end = Instant::now() + RELEASE_WAIT;
    let mut status = link.status().map_err(Failure::from)?;
    while status.engaged && Instant::now() < end {
        status = link.status().map_err(Failure::from)?;
    }
    if status.engaged {
        return Err(Failure::new(
            format!("the bridge keeps its clutch closed: it is {}", status.state),
            "the same again; `gauntlet bridge status` says what keeps it",
        )
        .into());
    }
    if at.json {
        return out::json(&status);
    }
    Tell::new(false).say(format_args!(
        "the clutch is open; the bridge is {}",
        status.state
    ));
    Ok(())
}

fn engage(
    at: &BridgeAt,
    calibrate: bool,
    activate: bool,
    seconds: Option<Duration>,
    interrupt: &Interrupt,
) -> Result<()> {
    let tell = Tell::new(at.json);
    let mut link = connect(at)?;
    // An older bridge is refused before anything moves.
    link.health().map_err(Failure::from)?;
    let mut run = start(link, None, interrupt)?;
    let ready = ready(&mut run, calibrate, activate, &tell);
    let began = matches!(ready, Ok(true));
    let driven = ready.and_then(|ready| match ready {
        true => drive(&mut run, "gauntlet bridge engage", seconds, true, at.json),
        false => Ok(()),
    });
    let finished = run.finish();
    if !began {
        return finished.judge(driven);
    }
    if let Some(left) = finished.left() {
        tell.say(format_args!("the clutch is open: {left}"));
    }
    finish(at, &tell, finished, driven)
}

/// What comes before the clutch may close. Returns whether to go on.
fn ready(run: &mut Run, calibrate: bool, activate: bool, tell: &Tell) -> Result<bool> {
    Ok((!calibrate || run.calibrate(tell)?) && (!activate || run.activate(tell)?))
}

/// A run of the bridge behind `link`.
pub(super) fn start(
    link: HostLink,
    samples: Option<SyncSender<Sample>>,
    interrupt: &Interrupt,
) -> Result<Run> {
    let clock = Clock::start();
    let session = OnChip::start(link, clock, samples)?;
    Ok(Run::new(session, None, clock, interrupt.clone()))
}

fn drive(
    run: &mut Run,
    title: &'static str,
    seconds: Option<Duration>,
    engage: bool,
    quiet: bool,
) -> Result<()> {
    let options = Options {
        title,
        seconds,
        engage,
        drives: engage,
        quiet,
    };
    run.drive(&options).map(drop)
}

fn calibrate(at: &BridgeAt, undo: bool, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(at.json);
    let mut link = connect(at)?;
    if undo {
        link.undo_calibration().map_err(Failure::from)?;
        let health = link.health().map_err(Failure::from)?;
        if let Try::Refused(why @ Refusal::NothingBefore) = health.calibration.newest {
            return Err(refused(why).into());
        }
        tell.say(format_args!("the newest calibration was taken back"));
        if at.json {
            return calibration_json(health);
        }
        return Ok(());
    }
    // An older bridge is refused by name.
    let health = link.health().map_err(Failure::from)?;
    let mut run = start(link, None, interrupt)?;
    let taken = run.calibrate(&tell).and_then(|taken| match taken {
        true => Ok(()),
        false => Err(Failure::interrupted("before the hand was taken").into()),
    });
    let now = run.snapshot().map(|seen| seen.calibration);
    run.finish().judge_prepared(taken)?;
    if at.json {
        let calibration = now.unwrap_or(health.calibration);
        return calibration_json(Health {
            calibration,
            ..health
        });
    }
    Ok(())
}

/// Its part of the health, with the names of the wire.
fn calibration_json(health: Health) -> Result<()> {
    let health = serde_json::to_value(health)?;
    out::json(&health["calibration"])
}

fn monitor(at: &BridgeAt, seconds: Option<Duration>, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(at.json);
    let mut run = start(connect(at)?, None, interrupt)?;
    let driven = drive(&mut run, "gauntlet bridge monitor", seconds, false, at.json);
    finish(at, &tell, run.finish(), driven)
}

fn log(at: &BridgeAt, path: &Path, seconds: Option<Duration>, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(at.json);
    outputs::check_new(path)?;
    let link = connect(at)?;
    let (poses, samples) = Poses::create(path, interrupt)?;
    let driven = start(link, Some(samples), interrupt).map(|mut run| {
        let driven = drive(&mut run, "gauntlet bridge log", seconds, false, at.json);
        (run.finish(), driven)
    });
    let rows = poses.finish()?;
    let (finished, driven) = driven?;
    match rows {
        0 => tell.say(format_args!(
            "log        none: no pose came, so that no file was left"
        )),
        rows => tell.say(format_args!(
            "log        {} with {rows} poses",
            path.display()
        )),
    }
    finish(at, &tell, finished, driven)
}

/// The numbers, then the judgement over all of it.
fn finish(at: &BridgeAt, tell: &Tell, finished: Finished, driven: Result<()>) -> Result<()> {
    if at.json {
        out::json(&finished.summary)?;
    } else {
        let lines = finished.summary.lines();
        lines
            .iter()
            .for_each(|line| tell.say(format_args!("{line}")));
    }
    finished.judge(driven)
}

fn select(at: &BridgeAt, slot: u8) -> Result<()> {
    let tell = Tell::new(at.json);
    let slots = connect(at)?.select(slot).map_err(Failure::from)?;
    if at.json {
        return out::json(&slots);
    }
    slot_lines(&slots)
        .iter()
        .for_each(|line| tell.say(format_args!("{line}")));
    Ok(())
}

fn reboot(at: &BridgeAt) -> Result<()> {
    let mut link = connect(at)?;
    link.reboot().map_err(Failure::from)?;
    if at.json {
        return out::json(&json!({ "restarting": true }));
    }
    Tell::new(false).say(format_args!("the bridge restarts"));
    Ok(())
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
