//! Runs of a bridge on a chip: calibrated, engaged, watched, recorded.

use std::path::Path;
use std::sync::mpsc::SyncSender;
use std::time::Duration;

use anyhow::Result;
use bridge::calibration::{Refusal, Try};
use bridge::protocol::message::{Health, Sample};

use super::args::BridgeAt;
use super::poses;
use crate::outputs;
use crate::results::{self, devices, runs};
use crate::run::{Finished, Options, Run};
use crate::tell::Tell;
use host::calibration::Kept;
use host::chip::link::HostLink;
use host::clock::Clock;
use host::failure::{Failure, with_others};
use host::interrupt::Interrupt;
use host::recording::poses::PosesFile;
use host::session::{Devices, OnChip, refused};

/// A flat pose.
#[derive(Debug, Clone, Copy)]
pub(super) struct Flat {
    /// Of sensors that sit straight and share a heading.
    pub ideal: bool,
}

pub(super) fn engage(
    at: &BridgeAt,
    flat: Option<Flat>,
    activate: bool,
    seconds: Option<Duration>,
    interrupt: &Interrupt,
) -> Result<()> {
    let tell = Tell::new(at.json);
    let mut link = at.connect()?;
    // An older bridge is refused before anything moves.
    at.told(link.health())?;
    let mut run = start(link, None, at.devices(), interrupt)?;
    let ready = ready(&mut run, flat, activate, &tell);
    let began = matches!(ready, Ok(true));
    let driven = ready.and_then(|ready| match ready {
        true => drive(&mut run, "gauntlet bridge engage", seconds, true, at.json),
        false => Ok(()),
    });
    let mut finished = run.finish();
    if !began {
        return finished.judge(driven);
    }
    if let Some(left) = finished.left() {
        tell.say(format_args!("the clutch is open: {left}"));
    }
    finish("bridge engage", at, finished, (None, Ok(())), driven)
}

/// What comes before the clutch may close. Returns whether to go on.
fn ready(run: &mut Run, flat: Option<Flat>, activate: bool, tell: &Tell) -> Result<bool> {
    run.is_straight(flat.is_some_and(|flat| flat.ideal));
    Ok((flat.is_none() || run.calibrate(tell)?) && (!activate || run.activate(tell)?))
}

/// A run of the bridge behind `link`.
pub(crate) fn start(
    link: HostLink,
    samples: Option<SyncSender<Sample>>,
    devices: Devices,
    interrupt: &Interrupt,
) -> Result<Run> {
    let clock = Clock::start();
    let session = OnChip::start(link, clock, samples)?;
    Ok(Run::new(session, None, clock, interrupt.clone(), devices))
}

fn drive(
    run: &mut Run,
    title: &'static str,
    seconds: Option<Duration>,
    engage: bool,
    quiet: bool,
) -> Result<()> {
    let options = Options {
        title,
        seconds,
        engage,
        drives: engage,
        quiet,
    };
    run.drive(&options).map(drop)
}

pub(super) fn undo_calibration(at: &BridgeAt) -> Result<()> {
    let tell = Tell::new(at.json);
    let mut link = at.connect()?;
    at.told(link.undo_calibration())?;
    let health = at.told(link.health())?;
    if let Try::Refused(why @ Refusal::NothingBefore) = health.calibration.newest {
        return Err(refused(why, &at.devices()).into());
    }
    tell.say(format_args!("the newest calibration was taken back"));
    if at.json {
        return results::print("bridge calibrate", devices::Calibrated { health: &health });
    }
    Ok(())
}

pub(super) fn calibrate(
    at: &BridgeAt,
    profile: Option<&Path>,
    flat: Flat,
    interrupt: &Interrupt,
) -> Result<()> {
    let tell = Tell::new(at.json);
    let profile = profile.map(|path| Kept::read(path).map(|kept| (path, kept)));
    let profile = profile.transpose()?;
    let mut link = at.connect()?;
    // An older bridge is refused by name.
    let health = at.told(link.health())?;
    if let Some((path, kept)) = &profile {
        at.told(link.set_profile(Some(&kept.bound)))?;
        tell.say(format_args!(
            "profile    {}  is kept by the bridge",
            path.display()
        ));
    }
    let mut run = start(link, None, at.devices(), interrupt)?;
    run.is_straight(flat.ideal);
    let taken = run.calibrate(&tell).and_then(|taken| match taken {
        true => Ok(()),
        false => Err(Failure::interrupted("before the hand was taken").into()),
    });
    let now = run.snapshot().map(|seen| seen.calibration);
    run.finish().judge_prepared(taken)?;
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

pub(super) fn monitor(
    at: &BridgeAt,
    seconds: Option<Duration>,
    interrupt: &Interrupt,
) -> Result<()> {
    let mut run = start(at.connect()?, None, at.devices(), interrupt)?;
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

/// The numbers, then the judgement over all of it.
fn finish(
    verb: &'static str,
    at: &BridgeAt,
    mut finished: Finished,
    (poses, written): (Option<runs::Poses<'_>>, Result<()>),
    driven: Result<()>,
) -> Result<()> {
    let (judgement, failure) = results::judged(finished.judge_with(driven, written));
    if at.json {
        let result = runs::Run {
            poses,
            ..finished.result(failure)
        };
        results::print(verb, result)?;
    } else {
        let tell = Tell::new(false);
        let lines = finished.summary.lines();
        lines
            .iter()
            .for_each(|line| tell.say(format_args!("{line}")));
    }
    judgement
}
