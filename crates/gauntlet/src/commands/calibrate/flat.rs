//! `gauntlet calibrate --flat`: one flat pose with the profile there is. It shows whether a sensor has slipped since.

use std::path::Path;
use std::time::Duration;

use anyhow::Result;
use glove::calibration::Step;
use glove::headings::NotFlat;

use super::args::Calibrate;
use crate::results::{self, calibrations};
use crate::tell::Tell;
use host::calibration::guide::{Finding, FlatPose, PoseEnd, slipped};
use host::calibration::virtual_person::VirtualPerson;
use host::calibration::{Kept, profile_of};
use host::clock::Clock;
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::next::Command;
use host::scanning::Scanning;

/// Pause between two looks.
const ROUND: Duration = Duration::from_millis(20);
/// How often a pose that was none is asked for again.
const TRIES: usize = 3;

/// Takes one.
///
/// # Errors
/// No profile is of this glove; the hand did not lie flat; a sensor has slipped.
pub(super) fn run(options: &Calibrate, glove: &Path, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.json);
    let at = options.at(glove);
    let clock = Clock::start();
    let (mut scanning, _) = at.read(&tell, clock, interrupt)?;
    let ids = scanning
        .snapshot()
        .map(|seen| seen.ids())
        .unwrap_or_default();
    let (path, kept) = profile_of(at.profile.as_deref(), &ids)?.map_err(|why| {
        let calibrate = Command::gauntlet("calibrate").path("--glove", glove);
        Failure::new(
            format!("the glove on {}: {why}", glove.display()),
            calibrate,
        )
    })?;
    tell.say(format_args!(
        "profile    {}  of {}",
        path.display(),
        kept.calibrated
    ));
    let person = VirtualPerson::at(glove);
    let end = take(
        &kept,
        &mut scanning,
        clock,
        person.as_ref(),
        &tell,
        interrupt,
    );
    // What ended it before is told.
    let _ = scanning.stop();
    if let Some(person) = &person {
        person.let_go();
    }
    let findings = match end? {
        PoseEnd::Taken(report) => slipped(&report),
        PoseEnd::NotFlat(NotFlat::Tilted { segment, by }) => vec![tilted(segment, by)],
        PoseEnd::NotFlat(not_flat) => {
            return Err(Failure::new(not_flat.to_string(), at.doctor()).into());
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
    let (judgement, failure) = results::judged(judged);
    if options.json {
        let result = calibrations::FlatPose {
            place: glove.display().to_string(),
            profile: path.display().to_string(),
            calibrated: kept.calibrated.clone(),
            findings,
            failure,
        };
        results::print("calibrate --flat", result)?;
    }
    judgement
}

fn tilted(segment: u8, by: f32) -> Finding {
    let name = glove::hand::SEGMENT_NAMES
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
    kept: &Kept,
    scanning: &mut Scanning,
    clock: Clock,
    person: Option<&VirtualPerson>,
    tell: &Tell,
    interrupt: &Interrupt,
) -> Result<PoseEnd> {
    let mut tries = 0;
    loop {
        scanning.waiting().for_each(drop);
        tell.say(format_args!(
            "flat       lay your hand flat on the table, fingers straight and together; hold still for 2 s"
        ));
        if let Some(person) = person {
            person.ask(Step::FirstFlat);
        }
        let mut pose = FlatPose::new(&kept.bound.profile, clock.now());
        let end = loop {
            let mut scanned = scanning.next(ROUND);
            while let Some(scan) = scanned {
                pose.take(&scan.frame, &scan.starts);
                scanned = scanning.next(Duration::ZERO);
            }
            if let Some(end) = pose.pass(clock.now()) {
                break end;
            }
            if interrupt.asked() {
                return Err(Failure::interrupted("before the flat pose was taken").into());
            }
            if !scanning.running() {
                return Err(scanning.ended());
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
