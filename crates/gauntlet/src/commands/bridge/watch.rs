//! A bridge on a chip that is only watched, and its hand recorded.

use std::path::Path;
use std::time::Duration;

use anyhow::Result;

use super::args::BridgeAt;
use super::drive::{drive, finish, start};
use super::poses;
use crate::line_log::LineLog;
use crate::outputs;
use crate::results::runs;
use crate::tell::Tell;
use crate::web::{Page, ViewOptions};
use host::clock::Clock;
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
    let mut log = LineLog::new(log)?;
    let mut link = at.connect()?;
    let clock = Clock::start();
    // The bytes of the chip's own ports do not fit this line: 17 kB/s into 11.5 kB/s.
    log.trace().begin_monitor();
    link.keep(log.trace(), clock);
    let mut run = start(link, None, at.devices(), interrupt)?;
    run.shows(page, None);
    log.begin(clock)?;
    let driven = drive(&mut run, "gauntlet bridge monitor", seconds, false, at.json);
    let driven = driven.and(log.finish(&Tell::new(at.json)));
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
