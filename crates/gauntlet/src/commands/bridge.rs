//! `gauntlet bridge`: a bridge on a chip, asked, watched and told over the host protocol.

use std::io::BufWriter;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Result;
use bridge::protocol::message::Status;
use gripper::Activation;
use serde_json::json;

use super::flash::slot_lines;
use crate::chip::{Options, Watch, standing_faults, write_head, write_row};
use crate::cli::{Bridge, BridgeAt, BridgeVerb};
use crate::failure::{Failure, OrFail};
use crate::host_link::HostLink;
use crate::interrupt::Interrupt;
use crate::tell::Tell;
use crate::{out, words};

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
            activate,
            seconds,
        } => engage(at, *activate, *seconds, interrupt),
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
    if at.json {
        return out::json(&json!({
            "hello": hello, "status": status, "slots": slots, "counters": counters,
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
    activate: bool,
    seconds: Option<Duration>,
    interrupt: &Interrupt,
) -> Result<()> {
    let tell = Tell::new(at.json);
    let mut link = connect(at)?;
    if activate && !activated(&mut link, &tell, interrupt)? {
        return Ok(());
    }
    let options = Options {
        title: "gauntlet bridge engage",
        seconds,
        engage: true,
        quiet: at.json,
    };
    let (summary, _) = Watch::new(&mut link, interrupt).run(&options, &mut |_| Ok(()))?;
    tell.say(format_args!("the clutch is open, the gripper is held"));
    finish(at, &tell, &summary)
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
    let (summary, _) = Watch::new(&mut link, interrupt).run(&options, &mut |_| Ok(()))?;
    finish(at, &tell, &summary)
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
    file.into_inner()
        .map_err(|error| error.into_error())
        .and_then(|file| file.sync_all())
        .or_fail(name, "room on the disk")?;
    let (summary, _) = watched?;
    tell.say(format_args!(
        "log        {} with {rows} poses",
        path.display()
    ));
    finish(at, &tell, &summary)
}

fn finish(at: &BridgeAt, tell: &Tell, summary: &crate::chip::Summary) -> Result<()> {
    if at.json {
        return out::json(summary);
    }
    summary
        .lines()
        .iter()
        .for_each(|line| tell.say(format_args!("{line}")));
    Ok(())
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
