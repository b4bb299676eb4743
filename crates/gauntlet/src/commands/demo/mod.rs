//! `gauntlet demo`: the whole path, from a moving hand to a moving gripper, with nothing but this machine.

mod args;
mod here;
mod on_chip;
mod parts;
mod person;

use std::time::Instant;

use anyhow::Result;

use crate::progress::Person;
use crate::results::maps::Start;
use crate::results::{self, runs};
use crate::run::{End, Finished, Options, Run, drawn};
use crate::tell::Tell;
use crate::web::picture::{Headline, Picture, Tone};
use crate::web::{Map, Page, space_map};
use crate::{outputs, reading};
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::settings::Settings;
use host::stats::seconds;
use host::training::Outcome;
use host::training::measuring::MOST_FRAMES;
use host::training::motion::Motion;
use parts::{Stage, Started};

use host::trainer::spread::spread;

pub use args::Demo;

/// Runs the demo.
///
/// # Errors
/// A failure that says which of its steps did not succeed.
pub(crate) fn run(options: &Demo, interrupt: &Interrupt) -> Result<()> {
    let begun = Instant::now();
    let tell = Tell::new(options.json);
    // Whose keys are not known is refused before anything is trained or moves.
    Settings::load()?;
    match options.on_chip {
        true => on_chip::check(options)?,
        false => here::check(options)?,
    }
    let motion = reading::ended_by(interrupt, "the recording", || {
        Motion::open_for_training(options.poses.as_deref(), options.seed, &Person)
    })?;
    if let Some(path) = &options.log {
        outputs::check_new(path, "a log")?;
    }
    let mut page = Page::start(&options.view, &tell)?;
    if let Some(page) = &mut page {
        page.show(training);
    }
    let start = match options.on_chip {
        true => on_chip::start,
        false => here::start,
    };
    let mut started = start(Stage {
        options,
        motion: &motion,
        tell: &tell,
        interrupt,
    })?;
    if let Some(page) = &page {
        page.show_map(&map(options, &motion, &started.outcome));
    }
    started.run.shows(page, Some(drawn(options.gripper_model)));
    let driven = drive(options, &mut started, &tell);
    let prepared = started.drives.map(|at| (at - begun).as_secs_f64());
    let Started {
        run,
        outcome,
        person,
        flashed,
        home,
        ..
    } = started;
    let mut finished = run.finish();
    drop(home);
    let first = finished.summary.first_motion_s.zip(prepared);
    let first = first.map(|(after, before)| ((before + after) * 10.0).round() / 10.0);
    if !options.json || finished.ending.is_none() {
        say(&finished, first, &outcome.quality.line(), &tell);
    }
    let moved = finished.summary.first_motion_s.is_some();
    let judgement = finished.judge(driven).and_then(|end| match end {
        End::Time if !moved => Err(not_moved(options)),
        End::Time | End::Asked => Ok(()),
    });
    let (judgement, failure) = results::judged(judgement);
    if options.json && finished.ending.is_some() {
        let result = runs::Demo {
            motion: motion.describe(),
            training_s: outcome.took.as_secs_f64(),
            epochs: outcome.epochs,
            pairs: outcome.pairs,
            starts: Start::all(&outcome.starts),
            quality: &outcome.quality,
            person: person.as_ref(),
            flash: flashed.as_ref(),
            first_motion_from_start_s: first,
            run: finished.result(failure),
        };
        results::print("demo", result)?;
    }
    judgement
}

/// What of the gripper's space the motion reaches.
fn map(options: &Demo, motion: &Motion, outcome: &Outcome) -> Map {
    let frames = motion.frames();
    let frames = frames.select(&spread(&frames, MOST_FRAMES));
    let images = outcome.model.map_all(&frames);
    space_map(parts::space(options), &images, &outcome.references)
}

/// What the page shows before there is anything to see.
fn training() -> Picture {
    Picture {
        title: "gauntlet demo".to_owned(),
        state: Headline {
            words: "training the map".to_owned(),
            tone: Tone::Wait,
        },
        ..Picture::default()
    }
}

/// Brings everything up, activates, engages, runs.
fn drive(options: &Demo, started: &mut Started, tell: &Tell) -> Result<End> {
    let run: &mut Run = &mut started.run;
    let framed = run.wait(started.frame_wait, started.framed)?;
    if run.asked() {
        return Ok(End::Asked);
    }
    if !framed {
        return Err(Failure::new(
            format!(
                "the virtual glove sent no frame in {} s",
                started.frame_wait.as_secs()
            ),
            "the same on a machine with less to do",
        )
        .into());
    }
    if !run.calibrate(tell)? || !run.activate(tell)? {
        return Ok(End::Asked);
    }
    tell.say(format_args!(
        "engaged    the gripper follows the hand for {} (Ctrl-C holds it and ends)",
        seconds(options.seconds)
    ));
    started.drives = Some(Instant::now());
    run.drive(&Options {
        title: match options.on_chip {
            true => "gauntlet demo --on-chip",
            false => "gauntlet demo",
        },
        seconds: Some(options.seconds),
        engage: true,
        drives: true,
        quiet: options.json,
    })
}

/// What the demo says at its end.
fn say(finished: &Finished, first: Option<f64>, map: &str, tell: &Tell) {
    finished.tell(tell, "summary    ");
    if let (Some(after), Some(all)) = (finished.summary.first_motion_s, first) {
        tell.say(format_args!(
            "motion     the gripper first moved with the hand {after:.1} s after the clutch was closed, {all:.1} s after the start"
        ));
    }
    if finished.ending.is_some() {
        tell.say(format_args!("map        {map}"));
    }
}

/// A demo in which the gripper did not move has failed, whatever was printed.
fn not_moved(options: &Demo) -> anyhow::Error {
    let next = match options.on_chip {
        true => {
            "the same on a machine with less to do, without --json, whose lines say what held it"
        }
        false => "the same with --log and a new file's name, whose events say what held it",
    };
    Failure::new("the gripper did not move with the hand", next).into()
}
