//! `gauntlet bridge calibrate`: the profile goes into the chip, the flat hand is taken, or the newest one taken back.

use std::path::Path;

use anyhow::Result;
use host::bridge::calibration::{CalibrationState, Refusal, Try};
use host::bridge::protocol::message::Health;

use super::args::BridgeAt;
use super::drive::{Flat, start};
use super::profile;
use crate::results::{self, devices};
use crate::tell::Tell;
use crate::wearer::Listener;
use host::calibration::Kept;
use host::chip::link::HostLink;
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::session::{Devices, refused};

pub(super) fn undo(at: &BridgeAt) -> Result<()> {
    let tell = Tell::new(at.json);
    let mut link = at.connect()?;
    at.told(link.undo_calibration())?;
    let health = at.told(link.health())?;
    if let Try::Refused(why @ Refusal::NothingBefore) = health.calibration.newest {
        return Err(refused(why, &at.devices()).into());
    }
    tell.say(format_args!(
        "the newest flat pose or calibration that was asked for was taken back, with those found since"
    ));
    if at.json {
        return results::print("bridge calibrate", devices::Calibrated { health: &health });
    }
    Ok(())
}

pub(super) fn calibrate(
    at: &BridgeAt,
    given: Option<&Path>,
    flat: Flat,
    interrupt: &Interrupt,
) -> Result<()> {
    let tell = Tell::new(at.json);
    let given = given.map(|path| Kept::read(path).map(|kept| (path, kept)));
    let given = given.transpose()?;
    let mut link = at.connect()?;
    // An older bridge is refused by name.
    let health = at.told(link.health())?;
    if let Some((path, kept)) = &given {
        profile::give(&mut link, at, (path, kept), &tell, interrupt)?;
    }
    let now = flat_pose(link, at.devices(), flat.ideal, None, &tell, interrupt)?;
    if at.json {
        let calibration = now.unwrap_or(health.calibration);
        let health = Health {
            calibration,
            ..health
        };
        return results::print("bridge calibrate", devices::Calibrated { health: &health });
    }
    Ok(())
}

/// Takes the flat hand, waited for as long as it takes to lie still; what the bridge then says of its calibration.
///
/// # Errors
/// Why it was not taken; the line's fault; that the end was asked for.
pub(in crate::commands) fn flat_pose(
    link: HostLink,
    devices: Devices,
    is_straight: bool,
    person: Option<Listener>,
    tell: &Tell,
    interrupt: &Interrupt,
) -> Result<Option<CalibrationState>> {
    let mut run = start(link, None, devices, interrupt)?;
    run.is_straight(is_straight);
    run.has(person);
    let taken = run.calibrate(tell).and_then(|taken| match taken {
        true => Ok(()),
        false => Err(Failure::interrupted("before the hand was taken").into()),
    });
    let now = run.snapshot().map(|seen| seen.calibration);
    run.finish().judge_prepared(taken)?;
    Ok(now)
}
