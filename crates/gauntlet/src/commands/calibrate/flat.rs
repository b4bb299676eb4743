//! `gauntlet calibrate --flat`: one flat pose with the profile there is. It shows whether a sensor has slipped since.

use std::time::Duration;

use anyhow::Result;
use host::glove::calibration::{Bound, Step};
use host::glove::headings::NotFlat;

use super::args::Calibrate;
use super::source::{Place, Source};
use crate::commands::bridge::flat_pose;
use crate::line_log::LineLog;
use crate::results::{self, calibrations};
use crate::tell::Tell;
use crate::wearer::Listener;
use host::calibration::guide::{Finding, FlatPose, PoseEnd, slipped};
use host::calibration::profile_of;
use host::calibration::virtual_person::VirtualPerson;
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::session::Devices;

/// Pause between two looks.
const ROUND: Duration = Duration::from_millis(20);
/// How often a pose that was none is asked for again.
const TRIES: usize = 3;

/// Takes one.
///
/// # Errors
/// No profile is of this glove; the hand did not lie flat; a sensor has slipped.
pub(super) fn run(options: &Calibrate, place: &Place<'_>, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.json);
    let (mut source, _) = place.open(&tell, &mut LineLog::default(), interrupt)?;
    let known = known(options, place, &mut source)?;
    match &known.calibrated {
        Some(when) => tell.say(format_args!("profile    {}  of {when}", known.place)),
        None => tell.say(format_args!("profile    {}", known.place)),
    }
    let person = place.person();
    let end = take(&known.bound, &mut source, person.as_ref(), &tell, interrupt);
    let link = source.end();
    if let Some(person) = &person {
        person.let_go();
    }
    let findings = match end? {
        PoseEnd::Taken(report) => slipped(&report),
        PoseEnd::NotFlat(NotFlat::Tilted { segment, by }) => vec![tilted(segment, by)],
        PoseEnd::NotFlat(not_flat) => {
            return Err(Failure::new(not_flat.to_string(), place.doctor()).into());
        }
        PoseEnd::Moved(remark) => {
            let what = format!("no flat pose in {TRIES} tries: {remark}");
            return Err(
                Failure::new(what, "the same again, the hand flat on a table and still").into(),
            );
        }
    };
    let judged = match findings.first() {
        None => Ok(()),
        Some(first) => Err(Failure::new(first.what.clone(), first.todo.clone()).into()),
    };
    if !options.json && findings.is_empty() {
        tell.say(format_args!(
            "flat       no sensor is tilted against its calibration; one turned about the vertical cannot be seen so"
        ));
    }
    let judged = judged.and_then(|()| match (place, link) {
        (Place::Chip(bridge), Some(link)) => {
            let link = link.map_err(|error| error.at(bridge))?;
            let person = place.person().map(Listener::There);
            let devices = Devices::Chip((*bridge).clone());
            flat_pose(link, devices, false, person, &tell, interrupt).map(drop)
        }
        _ => Ok(()),
    });
    let (judgement, failure) = results::judged(judged);
    if options.json {
        let result = calibrations::FlatPose {
            place: place.name(),
            profile: known.place,
            calibrated: known.calibrated,
            findings,
            failure,
        };
        results::print("calibrate --flat", result)?;
    }
    judgement
}

/// The profile there is.
struct Known {
    bound: Bound,
    place: String,
    calibrated: Option<String>,
}

/// The one that a chip keeps, or that is found here.
fn known(options: &Calibrate, place: &Place<'_>, source: &mut Source) -> Result<Known> {
    let ids = source.ids();
    let none = |why: String| {
        let what = format!("the glove on {}: {why}", place.name());
        Failure::new(what, place.command("calibrate"))
    };
    if let Source::Chip { scans, address } = source {
        let kept = scans.profile().map_err(|error| error.at(address))?;
        let bound = kept.ok_or_else(|| none("the bridge keeps no profile of it".to_owned()))?;
        bound
            .fits(&ids)
            .map_err(|misfit| none(misfit.to_string()))?;
        return Ok(Known {
            bound,
            place: "in the bridge".to_owned(),
            calibrated: None,
        });
    }
    let (path, kept) = profile_of(options.profile.as_deref(), &ids)?.map_err(&none)?;
    let fits = kept.bound.fits(&ids);
    fits.map_err(|misfit| none(misfit.to_string()))?;
    Ok(Known {
        bound: kept.bound,
        place: path.display().to_string(),
        calibrated: Some(kept.calibrated),
    })
}

fn tilted(segment: u8, by: f32) -> Finding {
    let name = host::glove::hand::SEGMENT_NAMES
        .get(usize::from(segment))
        .copied();
    Finding {
        verdict: "bad",
        segment: name,
        what: format!("{} lies {:.0}° tilted against how it was calibrated", name.unwrap_or("?"), by.to_degrees()),
        todo: "the same again with that finger straight; if it stays, its sensor slipped: press it on and calibrate anew".to_owned(),
    }
}

fn take(
    bound: &Bound,
    source: &mut Source,
    person: Option<&VirtualPerson>,
    tell: &Tell,
    interrupt: &Interrupt,
) -> Result<PoseEnd> {
    let mut tries = 0;
    loop {
        source.begin()?;
        tell.say(format_args!(
            "flat       lay your hand flat on the table, fingers straight and together; hold still for 2 s"
        ));
        if let Some(person) = person {
            person.ask(Step::FirstFlat);
        }
        let mut pose = FlatPose::new(&bound.profile, source.now());
        let end = loop {
            let mut scanned = source.next(ROUND)?;
            while let Some(scan) = scanned {
                pose.take(&scan.frame, &scan.starts);
                scanned = source.next(Duration::ZERO)?;
            }
            if let Some(end) = pose.pass(source.now()) {
                break end;
            }
            if interrupt.asked() {
                return Err(Failure::interrupted("before the flat pose was taken").into());
            }
        };
        tries += 1;
        match end {
            PoseEnd::Moved(remark) if tries < TRIES => {
                tell.say(format_args!("           again: {remark}"))
            }
            end => return Ok(end),
        }
    }
}
