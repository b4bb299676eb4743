//! `gauntlet bridge`: a bridge on a chip, asked, watched and told over the host protocol.

use std::io::BufWriter;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Result;
use bridge::calibration::{Refusal, Try};
use bridge::protocol::message::{Health, Restart, Status};
use gripper::Activation;
use serde_json::json;

use super::flash::slot_lines;
use crate::chip::{Options, Watch, Watched, standing_faults, write_head, write_row};
use crate::cli::{Bridge, BridgeAt, BridgeVerb};
use crate::out;
use crate::run::calibrating;
use crate::tell::Tell;
use host::chip::link::{Error, HostLink};
use host::failure::{Failure, OrFail};
use host::interrupt::Interrupt;
use host::words;

/// An activation takes a few seconds; a gripper that needs longer has a fault.
const ACTIVATION_WAIT: Duration = Duration::from_secs(20);
const PAUSE: Duration = Duration::from_millis(100);
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
    if calibrate && !calibrated(&mut link, &tell, interrupt)? {
        return Ok(());
    }
    if activate && !activated(&mut link, &tell, interrupt)? {
        return Ok(());
    }
    let options = Options {
        title: "gauntlet bridge engage",
        seconds,
        engage: true,
        quiet: at.json,
    };
    let watched = Watch::new(&mut link, interrupt).run(&options, &mut |_| Ok(()))?;
    if let Some(left) = watched.left() {
        tell.say(format_args!("the clutch is open: {left}"));
    }
    finish(at, &tell, watched)
}

fn calibrate(at: &BridgeAt, undo: bool, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(at.json);
    let mut link = connect(at)?;
    if undo {
        link.undo_calibration().map_err(Failure::from)?;
        tell.say(format_args!("the newest calibration was taken back"));
    } else if !calibrated(&mut link, &tell, interrupt)? {
        return Ok(());
    }
    if at.json {
        let health = serde_json::to_value(link.health().map_err(Failure::from)?)?;
        return out::json(&health["calibration"]);
    }
    Ok(())
}

/// Takes the hand as flat once it has been still, as often as it takes within [`calibrating::WAIT`]. Returns whether to go on.
pub(super) fn calibrated(link: &mut HostLink, tell: &Tell, interrupt: &Interrupt) -> Result<bool> {
    tell.say(format_args!("{}", calibrating::ASK));
    let end = Instant::now() + calibrating::WAIT;
    loop {
        let before = link.health().map_err(Failure::from)?.calibration.ended;
        link.calibrate_flat_hand().map_err(Failure::from)?;
        let newest = loop {
            let state = link.health().map_err(Failure::from)?.calibration;
            if state.ended != before {
                break state.newest;
            }
            if interrupt.sleep(PAUSE) {
                return Ok(false);
            }
            if Instant::now() >= end {
                break Try::Waiting;
            }
        };
        match newest {
            Try::Refused(why) if Instant::now() >= end || why == Refusal::Engaged => {
                return Err(calibrating::refused(why).into());
            }
            Try::Refused(_) => {}
            Try::Taken => {
                tell.say(format_args!("{}", calibrating::DONE));
                return Ok(true);
            }
            Try::None | Try::Waiting | Try::Undone => {
                return Err(Failure::new(
                    "the bridge did not say how the calibration ended",
                    "`gauntlet bridge status`, which says whether it is calibrated; then the same again",
                )
                .into());
            }
        }
    }
}

/// Activates the gripper where it is not, and waits. Returns whether to go on.
pub(super) fn activated(link: &mut HostLink, tell: &Tell, interrupt: &Interrupt) -> Result<bool> {
    let end = Instant::now() + ACTIVATION_WAIT;
    let mut asked = false;
    loop {
        let status = link.status().map_err(Failure::from)?;
        match status.gripper.as_ref().map(|gripper| gripper.activation) {
            Some(Activation::Ready) => return Ok(true),
            Some(_) if !asked => {
                tell.say(format_args!("activating the gripper: its fingers move"));
                link.activate().map_err(Failure::from)?;
                asked = true;
            }
            _ => {}
        }
        if Instant::now() >= end {
            return Err(Failure::new(
                format!(
                    "the gripper was not ready after {} s: {}",
                    ACTIVATION_WAIT.as_secs(),
                    standing_faults(&status).join("; ")
                ),
                "the gripper's cable and its 24 V supply; what blocks its fingers taken away",
            )
            .into());
        }
        if interrupt.sleep(PAUSE) {
            return Ok(false);
        }
    }
}

fn monitor(at: &BridgeAt, seconds: Option<Duration>, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(at.json);
    let mut link = connect(at)?;
    let options = Options {
        title: "gauntlet bridge monitor",
        seconds,
        engage: false,
        quiet: at.json,
    };
    let watched = Watch::new(&mut link, interrupt).run(&options, &mut |_| Ok(()))?;
    finish(at, &tell, watched)
}

fn log(at: &BridgeAt, path: &Path, seconds: Option<Duration>, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(at.json);
    let name = || format!("the log {}", path.display());
    let mut link = connect(at)?;
    let file = std::fs::File::create_new(path)
        .or_fail(name, "a new file's name, in a folder that you may write to")?;
    let mut file = BufWriter::new(file);
    write_head(&mut file).or_fail(name, "room on the disk")?;
    let options = Options {
        title: "gauntlet bridge log",
        seconds,
        engage: false,
        quiet: at.json,
    };
    let mut rows = 0u64;
    let mut last_frame = None;
    let watched = Watch::new(&mut link, interrupt).run(&options, &mut |sample| {
        // The same frame twice is no new pose; before the first frame there is none.
        if sample.frame_sequence == 0
            || last_frame.replace(sample.frame_sequence) == Some(sample.frame_sequence)
        {
            return Ok(());
        }
        rows += 1;
        write_row(&mut file, sample)
    });
    let written = file
        .into_inner()
        .map_err(|error| error.into_error())
        .and_then(|file| file.sync_all());
    if rows == 0 {
        // An empty file would stand in the way of the same command again.
        let _ = std::fs::remove_file(path);
    }
    written.or_fail(name, "room on the disk")?;
    let watched = watched?;
    tell.say(format_args!(
        "log        {} with {rows} poses",
        path.display()
    ));
    finish(at, &tell, watched)
}

/// The numbers, then the judgement over all of it.
fn finish(at: &BridgeAt, tell: &Tell, watched: Watched) -> Result<()> {
    if at.json {
        out::json(&watched.summary)?;
    } else {
        let lines = watched.summary.lines();
        lines
            .iter()
            .for_each(|line| tell.say(format_args!("{line}")));
    }
    watched.judge().map(drop)
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
