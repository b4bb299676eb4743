//! `gauntlet calibrate`: a glove gets to know a hand, and a file remembers it.

mod args;
mod flat;
mod list;
mod paged;
pub(in crate::commands) mod session;
pub(in crate::commands) mod source;
mod verdict;

use std::path::Path;
use std::time::SystemTime;

use anyhow::Result;
use host::glove::calibration::{Bound, Misfit, Verdict};
use host::glove::hand::{SEGMENT_COUNT, SEGMENT_NAMES};
use host::glove::imu::UniqueId;

use crate::commands::bridge::flat_pose;
use crate::line_log::LineLog;
use crate::outputs::{self, Kind};
use crate::results::{self, calibrations};
use crate::tell::Tell;
use crate::wearer::Listener;
use crate::web::Page;
pub use args::Calibrate;
use host::calibration::guide::Finding;
use host::calibration::{Judged, ProfileStore};
use host::chip::link::{Address, Error, HostLink};
use host::clock;
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::next::{Command, NextStep, advice};
use host::session::Devices;
use session::{Leading, Led, Session};
use source::{Place, give_by_hand};
use verdict::lines;

/// Calibrates, looks whether a calibration still fits, or lists.
///
/// # Errors
/// A failure that names the port, the sensor or the file; that nothing was kept, and why.
pub(crate) fn run(options: &Calibrate, interrupt: &Interrupt) -> Result<()> {
    if options.list {
        return list::run(options.json);
    }
    let place = match (&options.bridge, &options.glove) {
        (Some(bridge), _) => Place::Chip(bridge),
        (None, Some(glove)) => Place::Port(options.at(glove)),
        (None, None) => {
            return Err(Failure::usage(
                "no glove is named",
                advice("--glove PORT; ").then(Command::gauntlet("ports").then(" lists them")),
            )
            .into());
        }
    };
    match options.flat {
        true => flat::run(options, &place, interrupt),
        false => guided(options, &place, interrupt),
    }
}

/// The ids of a whole glove.
fn whole(
    ids: &[Option<UniqueId>; SEGMENT_COUNT],
    at: &Place<'_>,
) -> Result<[UniqueId; SEGMENT_COUNT], Failure> {
    let lacks: Vec<&str> = (0..SEGMENT_COUNT)
        .filter(|&k| ids[k].is_none())
        .map(|k| SEGMENT_NAMES[k])
        .collect();
    let place = at.name();
    if !lacks.is_empty() {
        let what = format!(
            "a profile is bound to its sensors' unique ids, and the glove on {place} has none of {}",
            lacks.join(", ")
        );
        return Err(Failure::new(what, at.doctor()));
    }
    let known = ids.map(Option::unwrap_or_default);
    let alike =
        (0..SEGMENT_COUNT).filter(|&k| known.iter().filter(|id| **id == known[k]).count() > 1);
    let alike = alike.fold(0u16, |mask, k| mask | 1 << k);
    match alike {
        0 => Ok(known),
        _ => {
            let what = format!("the glove on {place}: {}", Misfit::Alike(alike));
            Err(Failure::new(what, at.doctor()))
        }
    }
}

fn guided(options: &Calibrate, place: &Place<'_>, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.json);
    if let Some(out) = &options.out {
        outputs::check(out, Kind::Profile, &[])?;
    }
    let page = Page::start(&options.view, &tell)?;
    let mut log = LineLog::new(options.log.as_deref())?;
    let (source, missing) = place.open(&tell, &mut log, interrupt)?;
    if missing > 0 {
        let what = format!(
            "the glove on {} lacks sensors, and a calibration needs all 16",
            place.name()
        );
        return Err(Failure::new(what, place.doctor()).into());
    }
    let ids = whole(&source.ids(), place)?;
    let leading = Leading {
        declared: options.declared(),
        keep_anyway: options.keep_anyway,
        by_itself: false,
        json: options.json,
    };
    let person = place.person().map(Listener::There);
    let mut session = Session::new(source, leading, person);
    session.shows(page);
    let led = session.lead(&tell, interrupt);
    let mut done = session.finish();
    let logged = log.finish(&tell);
    let link = done.link.take();
    let mut kept = None;
    let decided = led.and_then(|led| match led {
        Led::Stopped => Err(Failure::new(
            "ended before the calibration was kept; nothing was written",
            "the same again",
        )
        .into()),
        Led::Unfinished(unfinished) => {
            let what = format!("the calibration came to nothing: {unfinished}");
            Err(Failure::new(
                what,
                place
                    .doctor()
                    .then(" looks at the glove; then the same again"),
            )
            .into())
        }
        Led::Judged { judged, agreed } => {
            decide(options, &judged, agreed)?;
            done.judged = Some((*judged).clone());
            let when = clock::rfc3339(SystemTime::now());
            let profile = judged.kept(ids, when);
            let path = match &options.out {
                Some(path) => profile.write(path).map(|()| path.clone()),
                None => ProfileStore::usual().and_then(|store| store.save(&profile)),
            };
            let path = kept.insert(path?);
            match (place, link) {
                (Place::Chip(bridge), Some(link)) => {
                    give(link, bridge, &profile.bound, path, &tell, interrupt)
                }
                _ => Ok(()),
            }
        }
    });
    let next = next(place, options.out.as_deref());
    if let (Some(judged), false) = (&done.judged, options.json) {
        lines(judged)
            .iter()
            .for_each(|line| tell.say(format_args!("{line}")));
    }
    let (scans, lost) = (done.scanned.scans, done.scanned.not_taken);
    if lost > 0 {
        tell.say(format_args!("scans      {scans} came, {lost} were lost"));
    }
    if let (Some(path), false) = (&kept, options.json) {
        tell.say(format_args!("profile    {}", path.display()));
        tell.say(format_args!("next       {next}"));
    }
    let (judgement, failure) = results::judged(decided.and(logged));
    if options.json {
        results::print(
            "calibrate",
            calibrations::Calibrated::of(
                place.name(),
                done.judged.as_ref(),
                kept.as_deref(),
                done.again,
                done.took_s,
                done.scanned,
                next,
                failure,
            ),
        )?;
    }
    judgement
}

/// What one does with a calibrated glove.
fn next(place: &Place<'_>, out: Option<&Path>) -> NextStep {
    match place {
        // One that lies elsewhere is not found by the sensors' ids.
        Place::Port(_) => out
            .iter()
            .fold(place.command("record"), |record, profile| {
                record.path("--profile", profile)
            })
            .option("--out", "my_hand.csv")
            .then(" records the hand, to train a map on"),
        Place::Chip(_) => place
            .command("bridge log")
            .option("--out", "my_hand.csv")
            .then(" records the hand, to train a map on"),
    }
}

/// Gives the profile to the bridge, which keeps it, and takes the flat pose there that gives the headings.
fn give(
    link: Result<HostLink, Error>,
    bridge: &Address,
    bound: &Bound,
    path: &Path,
    tell: &Tell,
    interrupt: &Interrupt,
) -> Result<()> {
    let by_hand = || give_by_hand(path, bridge).then(" gives it to the bridge");
    let not_kept = |error: Error| {
        let what = format!(
            "the profile is in {}, and not in the bridge: {error}",
            path.display()
        );
        Failure::new(what, by_hand())
    };
    let mut link = link.map_err(not_kept)?;
    link.set_profile(Some(bound)).map_err(not_kept)?;
    tell.say(format_args!("bridge     keeps the profile"));
    let person = Place::Chip(bridge).person().map(Listener::There);
    let devices = Devices::Chip(bridge.clone());
    flat_pose(link, devices, false, person, tell, interrupt).map(drop)
}

/// Whether it is kept. `agreed`: the person saw the verdict and wants it.
fn decide(options: &Calibrate, judged: &Judged, agreed: bool) -> Result<()> {
    let findings = judged.findings();
    if judged.verdict() == Verdict::Bad && !options.keep_anyway {
        let first = findings.iter().find(|finding| finding.verdict == "bad");
        let (what, todo) = first.map_or(("", ""), |finding| (&finding.what, &finding.todo));
        let others = findings.len().saturating_sub(1);
        let others = match others {
            0 => String::new(),
            1 => " (and one thing more)".to_owned(),
            _ => format!(" (and {others} things more)"),
        };
        let what = format!("the calibration is not good enough to be used: {what}{others}");
        return Err(Failure::new(what, advice(todo.to_owned())).into());
    }
    if judged.is_swapped() && !options.as_they_sit && !agreed {
        let names: Vec<String> = swapped(&findings);
        let what = format!(
            "sensors sit elsewhere than they are wired: {}",
            names.join("; ")
        );
        let next = NextStep::same(Command::more().word("--as-they-sit"))
            .then(" takes them as they sit; or put them where they belong, and calibrate again");
        return Err(Failure::new(what, next).into());
    }
    Ok(())
}

fn swapped(findings: &[Finding]) -> Vec<String> {
    let sits = |finding: &&Finding| finding.what.contains(" sits on ");
    findings
        .iter()
        .filter(sits)
        .map(|finding| finding.what.clone())
        .collect()
}
