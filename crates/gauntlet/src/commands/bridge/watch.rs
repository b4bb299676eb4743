//! A bridge on a chip that is only watched, and its hand recorded.

use std::path::Path;
use std::time::Duration;

use anyhow::Result;

use super::args::BridgeAt;
use super::drive::{drive, finish, start, start_logged};
use super::poses;
use crate::outputs;
use crate::results::runs;
use crate::tell::Tell;
use crate::web::{Page, ViewOptions};
use host::failure::with_others;
use host::interrupt::Interrupt;
use host::recording::poses::PosesFile;

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
    finish("bridge monitor", at, run.finish(), (None, Ok(())), driven)
}

pub(super) fn log(
    at: &BridgeAt,
    path: &Path,
    seconds: Option<Duration>,
    interrupt: &Interrupt,
) -> Result<()> {
    let tell = Tell::new(at.json);
    outputs::check_new(path, "a log")?;
    let link = at.connect()?;
    let (file, samples) = PosesFile::create(path, interrupt, poses::rows())?;
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
    match rows {
        0 => tell.say(format_args!(
            "log        none: no pose came, so that no file was left"
        )),
        rows => tell.say(format_args!(
            "log        {} with {rows} poses",
            path.display()
        )),
    }
    // A file without a row is not there.
    let poses = (rows > 0).then_some(runs::Poses { path, rows });
    finish("bridge log", at, finished, (poses, written), driven)
}
