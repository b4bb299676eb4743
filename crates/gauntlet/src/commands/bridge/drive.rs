//! Runs of a bridge on a chip, and the one in which it is engaged.

use std::path::Path;
use std::sync::mpsc::SyncSender;
use std::time::Duration;

use anyhow::Result;
use host::bridge::protocol::message::Sample;

use super::args::BridgeAt;
use crate::results::{self, runs};
use crate::run::{Finished, LogTo, Options, Run};
use crate::tell::Tell;
use crate::web::{Page, ViewOptions};
use host::chip::link::HostLink;
use host::clock::Clock;
use host::glove::hand::Side;
use host::interrupt::Interrupt;
use host::recording::Drawn;
use host::session::{Devices, OnChip};
use host::settings::Settings;

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
    (seconds, view): (Option<Duration>, &ViewOptions),
    interrupt: &Interrupt,
) -> Result<()> {
    let tell = Tell::new(at.json);
    // Whose keys are not known is refused before anything moves.
    Settings::load()?;
    let page = Page::start(view, &tell)?;
    let mut link = at.connect()?;
    // An older bridge is refused before anything moves.
    at.told(link.health())?;
    let mut run = start(link, None, at.devices(), interrupt)?;
    run.shows(page, None);
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
    finish("bridge engage", at, finished, Kept::nothing(), driven)
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
    let session = OnChip::start(link, clock, samples, None)?;
    Ok(Run::new(session, None, clock, interrupt.clone(), devices))
}

/// The same with a log at `path`, of what the bridge tells and is told. The bytes of the chip's own ports do not fit its line to
/// here: 17 kB/s into 11.5 kB/s.
pub(super) fn start_logged(
    mut link: HostLink,
    path: &Path,
    devices: Devices,
    interrupt: &Interrupt,
) -> Result<Run> {
    let clock = Clock::start();
    // One without a profile, or from before there were any, has a right hand's.
    let profile = link.profile().ok().flatten();
    let drawn = Drawn {
        side: profile.map_or(Side::Right, |bound| bound.profile.side),
        ..Drawn::USUAL
    };
    let (log, feed) = LogTo::new(path.to_owned(), drawn);
    let trace = feed.trace();
    trace.begin_monitor();
    link.keep(trace, clock);
    let session = OnChip::start(link, clock, None, Some(feed))?;
    Ok(Run::new(
        session,
        Some(log),
        clock,
        interrupt.clone(),
        devices,
    ))
}

pub(super) fn drive(
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

/// What a run wrote besides its log.
pub(super) struct Kept<'a> {
    /// The poses file.
    pub poses: Option<runs::Poses<'a>>,
    /// Scans that are no row of it.
    pub passed_over: Option<u64>,
    /// What became of it.
    pub written: Result<()>,
}

impl Kept<'_> {
    /// None was to be written.
    pub fn nothing() -> Self {
        Self {
            poses: None,
            passed_over: None,
            written: Ok(()),
        }
    }
}

/// The numbers, then the judgement over all of it.
pub(super) fn finish(
    verb: &'static str,
    at: &BridgeAt,
    mut finished: Finished,
    kept: Kept<'_>,
    driven: Result<()>,
) -> Result<()> {
    let (judgement, failure) = results::judged(finished.judge_with(driven, kept.written));
    if at.json {
        let result = runs::Run {
            poses: kept.poses,
            passed_over: kept.passed_over,
            ..finished.result(failure)
        };
        results::print(verb, result)?;
    } else {
        let tell = Tell::new(false);
        let lines = finished.summary.lines();
        lines
            .iter()
            .for_each(|line| tell.say(format_args!("{line}")));
        tell.log(finished.log.as_ref());
    }
    judgement
}
