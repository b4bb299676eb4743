//! The glove's profile in a bridge: shown, given to a bridge that has this glove and no other, taken away.

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Result;
use host::glove::calibration::{Bound, Misfit};

use super::args::BridgeAt;
use crate::results::{self, calibrations, devices};
use crate::tell::Tell;
use host::calibration::profile_file::id_text;
use host::calibration::{Kept, ProfileStore};
use host::chip::link::{Error, HostLink};
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::next::Command;

/// For the sensors of a bridge that has just started to tell their ids.
const IDS_WAIT: Duration = Duration::from_secs(10);
/// Pause between two questions for them.
const ASK_AGAIN: Duration = Duration::from_millis(200);

/// What is known of the profile that a bridge keeps; `None` where it keeps none, or is too old to keep any.
///
/// # Errors
/// A failure that names the line.
pub(super) fn kept(link: &mut HostLink, at: &BridgeAt) -> Result<Option<devices::KeptProfile>> {
    let bound = match link.profile() {
        Err(Error::Older { .. } | Error::Silent { .. } | Error::Refused(_)) => return Ok(None),
        profile => at.told(profile)?,
    };
    let Some(bound) = bound else {
        return Ok(None);
    };
    let ids = at.told(link.sensor_ids())?;
    let own = bound.ids.iter().zip(&ids);
    let read = ids.iter().flatten().count();
    let same = own.filter(|(own, id)| id.as_ref() == Some(own)).count();
    let here = here(&bound);
    Ok(Some(devices::KeptProfile {
        hand: calibrations::hand(bound.profile.side),
        sensors: bound.ids.iter().map(id_text).collect(),
        ids_read: read,
        ids_same: same,
        fits: bound.fits(&ids).is_ok(),
        calibrated: here.as_ref().map(|kept| kept.calibrated.clone()),
        verdict: here.map(|kept| kept.quality.verdict),
    }))
}

/// The same profile among this user's: the bridge keeps its numbers, and not when they were measured and how well.
fn here(bound: &Bound) -> Option<Kept> {
    let list = ProfileStore::usual().and_then(|store| store.list()).ok()?;
    let mut kept = list.into_iter().filter_map(|(_, kept)| kept.ok());
    kept.find(|kept| kept.bound == *bound)
}

/// The line of `bridge status`.
pub(super) fn line(kept: Option<&devices::KeptProfile>) -> String {
    let Some(kept) = kept else {
        return "profile    none is kept".to_owned();
    };
    let measured = match (&kept.calibrated, &kept.verdict) {
        (Some(when), Some(verdict)) => format!("of {when}, {verdict}"),
        _ => "not among the profiles of this computer, so nobody knows of when and how good"
            .to_owned(),
    };
    let whose = match kept.ids_read {
        0 => "no sensor has told its id".to_owned(),
        read => format!(
            "{} of {read} sensors that told their ids are its own",
            kept.ids_same
        ),
    };
    format!("profile    {} hand, {measured}; {whose}", kept.hand)
}

/// Gives the bridge a profile, once its sensors have told that it is theirs.
///
/// # Errors
/// A failure that names the sensors that are others; the line's; that the end was asked for.
pub(super) fn give(
    link: &mut HostLink,
    at: &BridgeAt,
    (path, kept): (&Path, &Kept),
    tell: &Tell,
    interrupt: &Interrupt,
) -> Result<()> {
    let end = Instant::now() + IDS_WAIT;
    let fits = loop {
        let fits = kept.bound.fits(&at.told(link.sensor_ids())?);
        let may_come = matches!(fits, Err(Misfit::NoIds | Misfit::Unread(_)));
        if !may_come || Instant::now() >= end {
            break fits;
        }
        if interrupt.sleep(ASK_AGAIN) {
            return Err(Failure::interrupted("before the bridge had the profile").into());
        }
    };
    if let Err(misfit) = fits {
        let what = format!(
            "the bridge on {} was not given {}: {misfit}",
            at.bridge,
            path.display()
        );
        return Err(Failure::new(what, mend(misfit, at)).into());
    }
    at.told(link.set_profile(Some(&kept.bound)))?;
    tell.say(format_args!(
        "profile    {}  is kept by the bridge",
        path.display()
    ));
    Ok(())
}

fn mend(misfit: Misfit, at: &BridgeAt) -> Command {
    match misfit {
        Misfit::NoIds | Misfit::Unread(_) => at.command("bridge status"),
        Misfit::Alike(_) | Misfit::Differ(_) => at.command("calibrate"),
    }
}

/// Takes the profile away that the bridge keeps.
///
/// # Errors
/// A failure that names the line, or what the bridge refuses.
pub(super) fn forget(at: &BridgeAt) -> Result<()> {
    let tell = Tell::new(at.json);
    let mut link = at.connect()?;
    let health = at.told(link.health())?;
    let was_there = at.told(link.profile())?.is_some();
    if was_there {
        at.told(link.set_profile(None))?;
    }
    tell.say(match was_there {
        true => format_args!("profile    the bridge keeps none any more: nothing moves before it has another and a flat pose"),
        false => format_args!("profile    the bridge kept none"),
    });
    if at.json {
        let calibration = host::bridge::calibration::CalibrationState {
            is_calibrated: health.calibration.is_calibrated && !was_there,
            ..health.calibration
        };
        let health = host::bridge::protocol::message::Health {
            calibration,
            ..health
        };
        return results::print("bridge calibrate", devices::Calibrated { health: &health });
    }
    Ok(())
}
