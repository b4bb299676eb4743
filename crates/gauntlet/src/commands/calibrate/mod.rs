//! `gauntlet calibrate`: a glove gets to know a hand, and a file remembers it.

mod args;
mod flat;
mod list;
pub(in crate::commands) mod session;
mod verdict;

use std::path::Path;
use std::time::SystemTime;

use anyhow::Result;
use glove::calibration::{Misfit, Verdict};
use glove::hand::{SEGMENT_COUNT, SEGMENT_NAMES};
use glove::imu::UniqueId;

use crate::commands::glove::GloveAt;
use crate::outputs::{self, Kind};
use crate::results::{self, calibrations, gloves};
use crate::tell::Tell;
use crate::wearer::Listener;
pub use args::Calibrate;
use host::calibration::guide::Finding;
use host::calibration::virtual_person::VirtualPerson;
use host::calibration::{Judged, ProfileStore};
use host::clock::{self, Clock};
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::next::{Command, NextStep, advice};
use host::scanning::Snapshot;
use session::{Leading, Led, Session};
use verdict::lines;

/// Calibrates, looks whether a calibration still fits, or lists.
///
/// # Errors
/// A failure that names the port, the sensor or the file; that nothing was kept, and why.
pub(crate) fn run(options: &Calibrate, interrupt: &Interrupt) -> Result<()> {
    match &options.glove {
        _ if options.list => list::run(options.json),
        Some(glove) if options.flat => flat::run(options, glove, interrupt),
        Some(glove) => guided(options, glove, interrupt),
        None => Err(Failure::usage(
            "no glove is named",
            advice("--glove PORT; ").then(Command::gauntlet("ports").then(" lists them")),
        )
        .into()),
    }
}

/// The ids of a whole glove.
fn ids(seen: Option<&Snapshot>, at: &GloveAt) -> Result<[UniqueId; SEGMENT_COUNT], Failure> {
    let ids = seen.map_or([None; SEGMENT_COUNT], Snapshot::ids);
    let lacks: Vec<&str> = (0..SEGMENT_COUNT)
        .filter(|&k| ids[k].is_none())
        .map(|k| SEGMENT_NAMES[k])
        .collect();
    let place = at.glove.display();
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

fn guided(options: &Calibrate, glove: &Path, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.json);
    if let Some(out) = &options.out {
        outputs::check(out, Kind::Profile, &[])?;
    }
    let at = options.at(glove);
    let clock = Clock::start();
    let (scanning, missing) = at.read(&tell, clock, interrupt)?;
    if missing > 0 {
        let what = format!(
            "the glove on {} lacks sensors, and a calibration needs all 16",
            glove.display()
        );
        return Err(Failure::new(what, at.doctor()).into());
    }
    let ids = ids(scanning.snapshot().as_ref(), &at)?;
    let leading = Leading {
        declared: options.declared(),
        keep_anyway: options.keep_anyway,
        by_itself: false,
        json: options.json,
    };
    let person = VirtualPerson::at(glove).map(Listener::There);
    let mut session = Session::new(scanning, clock, leading, person);
    let led = session.lead(&tell, interrupt);
    let done = session.finish();
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
                at.doctor().then(" looks at the glove; then the same again"),
            )
            .into())
        }
        Led::Judged { judged, agreed } => {
            decide(options, &judged, agreed)?;
            let when = clock::rfc3339(SystemTime::now());
            let profile = judged.kept(ids, when);
            let path = match &options.out {
                Some(path) => profile.write(path).map(|()| path.clone()),
                None => ProfileStore::usual().and_then(|store| store.save(&profile)),
            };
            kept = Some(path?);
            Ok(())
        }
    });
    let next = next(glove);
    if let (Some(judged), false) = (&done.judged, options.json) {
        lines(judged)
            .iter()
            .for_each(|line| tell.say(format_args!("{line}")));
    }
    if let (Some(path), false) = (&kept, options.json) {
        tell.say(format_args!("profile    {}", path.display()));
        tell.say(format_args!("next       {next}"));
    }
    let (judgement, failure) = results::judged(decided);
    if options.json {
        results::print(
            "calibrate",
            calibrations::Calibrated::of(
                glove.display().to_string(),
                done.judged.as_ref(),
                kept.as_deref(),
                done.again,
                done.took_s,
                done.seen
                    .as_ref()
                    .map(gloves::Scanned::from)
                    .unwrap_or_default(),
                next,
                failure,
            ),
        )?;
    }
    judgement
}

/// What one does with a calibrated glove.
fn next(glove: &Path) -> NextStep {
    Command::gauntlet("record")
        .path("--glove", glove)
        .option("--out", "my_hand.csv")
        .then(" records the hand, to train a map on")
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
