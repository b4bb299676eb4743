//! A bridge on a chip that is only watched, and its hand recorded.

use std::path::Path;
use std::time::Duration;

use anyhow::Result;

use super::args::BridgeAt;
use super::drive::{Kept, drive, finish, start, start_logged};
use super::poses::{self, PassedOver};
use crate::outputs;
use crate::results::runs;
use crate::tell::Tell;
use crate::web::{Page, ViewOptions};
use host::bridge::protocol::message::Health;
use host::failure::{Failure, with_others};
use host::interrupt::Interrupt;
use host::recording::poses::PosesFile;
use host::session::Snapshot;

pub(super) fn monitor(
    at: &BridgeAt,
    log: Option<&Path>,
    (seconds, view): (Option<Duration>, &ViewOptions),
    interrupt: &Interrupt,
) -> Result<()> {
    let page = Page::start(view, &Tell::new(at.json))?;
    if let Some(path) = log {
        outputs::check_new(path, "a log")?;
    }
    let link = at.connect()?;
    let mut run = match log {
        Some(path) => start_logged(link, path, at.devices(), interrupt)?,
        None => start(link, None, at.devices(), interrupt)?,
    };
    run.shows(page, None);
    let driven = drive(&mut run, "gauntlet bridge monitor", seconds, false, at.json);
    finish("bridge monitor", at, run.finish(), Kept::nothing(), driven)
}

pub(super) fn log(
    at: &BridgeAt,
    path: &Path,
    seconds: Option<Duration>,
    interrupt: &Interrupt,
) -> Result<()> {
    let tell = Tell::new(at.json);
    outputs::check_new(path, "a log")?;
    let mut link = at.connect()?;
    let uncalibrated = |health: Health| !health.calibration.is_calibrated;
    // What a bridge of version 2 follows with is not known.
    if link.health().is_ok_and(uncalibrated) {
        return Err(not_calibrated(at, "its angles would be nobody's").into());
    }
    let passed_over = PassedOver::default();
    let (file, samples) = PosesFile::create(path, interrupt, poses::rows(passed_over.clone()))?;
    let driven = start(link, Some(samples), at.devices(), interrupt).map(|mut run| {
        let driven = drive(&mut run, "gauntlet bridge log", seconds, false, at.json);
        (run.finish(), driven)
    });
    let (rows, written) = file.finish();
    let (finished, driven) = match (driven, &written) {
        (Ok(done), _) => done,
        (Err(first), Err(other)) => return Err(with_others(first, vec![format!("{other:#}")])),
        (Err(first), Ok(())) => return Err(first),
    };
    let passed_over = passed_over.count();
    match rows {
        0 => tell.say(format_args!(
            "log        none: no whole pose came, so that no file was left"
        )),
        rows => tell.say(format_args!(
            "log        {} with {rows} poses; {passed_over} scans without a whole pose",
            path.display()
        )),
    }
    // A file without a row is not there.
    let poses = (rows > 0).then_some(runs::Poses { path, rows });
    let seen = finished.seen.as_ref();
    let lacks_calibration = seen.is_some_and(Snapshot::lacks_calibration);
    let written = match rows {
        0 if lacks_calibration => {
            written.and(Err(not_calibrated(at, "no pose of it is known").into()))
        }
        0 => written.and(Err(no_pose(at, passed_over).into())),
        _ => written,
    };
    let kept = Kept {
        poses,
        passed_over: Some(passed_over),
        written,
    };
    finish("bridge log", at, finished, kept, driven)
}

/// The glove's angles are worth nothing; `why` that matters.
fn not_calibrated(at: &BridgeAt, why: &str) -> Failure {
    Failure::new(
        format!("the bridge's glove is not calibrated: {why}"),
        at.command("bridge calibrate")
            .then(", and the hand flat and still until it says done"),
    )
}

/// Nothing was left to write.
fn no_pose(at: &BridgeAt, passed_over: u64) -> Failure {
    let what = match passed_over {
        0 => "no pose came: the glove gave no scan".to_owned(),
        scans => format!("no pose came: of none of {scans} scans every joint was measured"),
    };
    Failure::new(
        what,
        at.command("bridge status")
            .then(", which says how glove and headings are"),
    )
}
