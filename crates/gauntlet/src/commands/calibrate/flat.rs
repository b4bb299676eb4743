//! `gauntlet calibrate --flat`: one flat pose with the profile there is. It shows whether a sensor has slipped since.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Result;
use glove::calibration::Step;
use glove::headings::NotFlat;

use super::Calibrate;
use crate::results::{self, calibrations};
use crate::tell::Tell;
use host::calibration::guide::{Finding, FlatPose, PoseEnd, slipped};
use host::calibration::virtual_person::VirtualPerson;
use host::calibration::{Found, Kept, ProfileStore};
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
    let mut opened = at.open(&tell, clock, interrupt)?;
    let ids = opened
        .scanning
        .snapshot()
        .map(|seen| seen.ids())
        .unwrap_or_default();
    let (path, kept) = profile(options, glove, &ids)?;
    tell.say(format_args!(
        "profile    {}  of {}",
        path.display(),
        kept.calibrated
    ));
    let person = VirtualPerson::at(glove);
    let end = take(
        &kept,
        &mut opened.scanning,
        clock,
        person.as_ref(),
        &tell,
        interrupt,
    );
    // What ended it before is told.
    let _ = opened.scanning.stop();
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
            "flat       every sensor lies as it was calibrated"
        ));
    }
    let (judgement, failure) = results::judged(judged);
    if options.json {
        let result = calibrations::FlatPose {
            place: glove.display().to_string(),
            profile: path.display().to_string(),
            calibrated: kept.calibrated,
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

/// The glove's profile: what was named, if it fits, else what its ids find.
fn profile(
    options: &Calibrate,
    glove: &Path,
    ids: &[Option<glove::imu::UniqueId>; glove::hand::SEGMENT_COUNT],
) -> Result<(PathBuf, Kept)> {
    let calibrate = || Command::gauntlet("calibrate").path("--glove", glove);
    if let Some(path) = &options.profile {
        let kept = Kept::read(path)?;
        return match kept.bound.fits(ids) {
            Ok(()) => Ok((path.clone(), kept)),
            Err(misfit) => {
                Err(Failure::new(format!("{}: {misfit}", path.display()), calibrate()).into())
            }
        };
    }
    let store = ProfileStore::usual()?;
    let place = glove.display();
    let what = match store.find(ids)? {
        Found::Fits(path, kept) => return Ok((path, *kept)),
        Found::Nearly(path, misfit) => format!("{}: {misfit}", path.display()),
        Found::Untold(misfit) => format!("the glove on {place}: {misfit}"),
        Found::Nothing => format!(
            "no profile in {} is of the glove on {place}",
            store.folder().display()
        ),
    };
    Err(Failure::new(what, calibrate()).into())
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
