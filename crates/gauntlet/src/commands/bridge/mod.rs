//! `gauntlet bridge`: a bridge on a chip, asked, watched and told over the host protocol.

mod args;
mod calibrate;
mod drive;
mod poses;
mod profile;
mod status;
mod watch;

use std::time::{Duration, Instant};

use anyhow::Result;

use super::flash::slot_lines;
use crate::results::{self, devices};
use crate::tell::Tell;
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::next::advice;

pub use args::{Bridge, BridgeAt, BridgeVerb};
pub(super) use calibrate::flat_pose;
pub(super) use drive::start;

/// For the bridge to see that its clutch was opened.
const RELEASE_WAIT: Duration = Duration::from_secs(2);

/// Does what was asked.
///
/// # Errors
/// A failure that names the line, the file, or what the bridge refuses.
pub(crate) fn run(options: &Bridge, interrupt: &Interrupt) -> Result<()> {
    match &options.what {
        BridgeVerb::Status { at } => status::status(at),
        BridgeVerb::Engage {
            at,
            calibrate_flat,
            ideal,
            activate,
            seconds,
            view,
        } => {
            let flat = calibrate_flat.then_some(drive::Flat { ideal: *ideal });
            drive::engage(at, flat, *activate, (*seconds, view), interrupt)
        }
        BridgeVerb::Calibrate { at, undo: true, .. } => calibrate::undo(at),
        BridgeVerb::Calibrate {
            at, forget: true, ..
        } => profile::forget(at),
        BridgeVerb::Calibrate {
            at, profile, ideal, ..
        } => {
            let flat = drive::Flat { ideal: *ideal };
            calibrate::calibrate(at, profile.as_deref(), flat, interrupt)
        }
        BridgeVerb::Release { at } => release(at),
        BridgeVerb::Monitor {
            at,
            seconds,
            view,
            log,
        } => watch::monitor(at, log.as_deref(), (*seconds, view), interrupt),
        BridgeVerb::Log { at, out, seconds } => watch::log(at, out, *seconds, interrupt),
        BridgeVerb::Select { slot, at } => select(at, *slot),
        BridgeVerb::Reboot { at } => reboot(at),
    }
}

fn release(at: &BridgeAt) -> Result<()> {
    let mut link = at.connect()?;
    at.told(link.release())?;
    // The next step of the bridge, 10 ms later, takes it.
    let end = Instant::now() + RELEASE_WAIT;
    let mut status = at.told(link.status())?;
    while status.engaged && Instant::now() < end {
        status = at.told(link.status())?;
    }
    if status.engaged {
        return Err(Failure::new(
            format!("the bridge keeps its clutch closed: it is {}", status.state),
            advice("the same again; ")
                .then(at.command("bridge status"))
                .then(" says what keeps it"),
        )
        .into());
    }
    if at.json {
        return results::print("bridge release", devices::Released { status: &status });
    }
    Tell::new(false).say(format_args!(
        "the clutch is open; the bridge is {}",
        status.state
    ));
    Ok(())
}

fn select(at: &BridgeAt, slot: u8) -> Result<()> {
    let tell = Tell::new(at.json);
    let slots = at.told(at.connect()?.select(slot))?;
    if at.json {
        return results::print("bridge select", devices::Selected { slots: &slots });
    }
    slot_lines(&slots)
        .iter()
        .for_each(|line| tell.say(format_args!("{line}")));
    Ok(())
}

fn reboot(at: &BridgeAt) -> Result<()> {
    let mut link = at.connect()?;
    at.told(link.reboot())?;
    if at.json {
        return results::print("bridge reboot", devices::Rebooted { restarting: true });
    }
    Tell::new(false).say(format_args!("the bridge restarts"));
    Ok(())
}
