//! `gauntlet train --live`: the person with the glove on shows the poses.

mod files;
mod hand;
mod paged;
mod said;
mod session;
mod shower;

use std::time::Instant;

use anyhow::Result;
use host::trainer::data::read_samples;
use host::trainer::hand::Space;

use super::args::Train;
use super::request;
use crate::commands::calibrate::source::Place;
use crate::commands::glove::GloveAt;
use crate::progress::Person;
use crate::results::{self, maps};
use crate::run::drawn;
use crate::tell::Tell;
use crate::web::Page;
use host::failure::{Failure, told, with_others};
use host::interrupt::Interrupt;
use host::next::{Command, advice};
use host::stats::seconds;
use host::teaching::kept::matrices;
use host::teaching::{Aim, Learner};
use host::training::judgement::Judgement;
use host::training::lessons::Lessons;
use host::training::pairs_kept::reference_pairs;
use host::training::quality::Quality;
use host::training::{Course, PairKind};
use paged::OnPage;
use session::{Session, Shown};
use shower::Shower;

/// Pairs besides the start poses where nothing else is said (§3.3.4).
const ROUNDS: usize = 8;

/// Leads a person through it.
///
/// # Errors
/// A failure that names the port, the sensor or the file; where the pairs are kept, and how to go on.
pub(super) fn run(options: &Train, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.json);
    let aim = aim(options)?;
    let rounds = rounds(options)?;
    let files = files::Files::of(options, &aim)?;
    let place = place(options)?;
    let page = Page::start(&options.worn.view, &tell)?;
    let drawn = aim.space().map(|_| drawn(options.gripper_model));
    let on_page = OnPage::new(page, drawn);
    let mut worn = hand::Worn::open(&place, options, on_page.clone(), (&tell, interrupt))?;
    let begun = Instant::now();
    let motion = files.motion(&mut worn, options, &tell, interrupt)?;
    let on_page = on_page.of_motion(&motion.frames());
    // --resume names pairs here, no checkpoint.
    let course = Course {
        checkpoint: None,
        resume: None,
        ..request::course(options)
    };
    let mut lessons = match &aim {
        Aim::Gripper(space) => Lessons::of_gripper(&motion, *space, course, &Person)?,
        Aim::Samples { samples, .. } => Lessons::of_samples(&motion, samples, course, &Person)?,
    };
    // What begins to be learned is ready before the first pose is asked.
    let learner = Learner::start(lessons)?;
    let shower = (options.worn.show_on.as_deref())
        .map(|gripper| Shower::new(gripper, options.gripper_model))
        .transpose()?;
    let mut session = Session::new(worn, learner, &aim, rounds, &files, options.json)
        .on(shower)
        .on_page(on_page.clone());
    let led = session.lead(&tell, interrupt);
    let done = session.finish()?;
    let with_left = |error| with_others(error, done.left.iter().cloned().collect());
    if led.map_err(|error| with_left(files.goes_on(error, &done.pairs)))? == Shown::Stopped {
        return Err(with_left(files.stopped(&done.pairs).into()));
    }
    if let Some(left) = &done.left {
        tell.say(format_args!("warning: {left}"));
    }
    lessons = done.lessons;
    let pairs = matrices(&done.pairs);
    let finished = lessons
        .finish(pairs.clone(), &on_page, interrupt)
        .map_err(|error| match interrupt.asked() {
            true => files.untrained(&done.pairs).into(),
            false => files.goes_on(error, &done.pairs),
        })?;
    on_page.show_map(aim.space(), &finished.model, &done.pairs);
    super::files::save(&finished.model, options)?;
    super::files::keep_curve(&finished.learned.curve, options);
    let mut warnings = finished.learned.warnings.clone();
    let judgement = aim.space().map(|space| {
        let quality = Quality::from_measured(&finished.measured, space);
        Judgement::of(
            (&finished.model, space),
            &motion.frames(),
            reference_pairs(&finished.model).as_ref(),
            quality,
        )
    });
    if let Some(judgement) = &judgement {
        warnings.extend(judgement.quality.unfit());
    }
    let taught = maps::Taught {
        model: &options.out,
        poses: files.poses(),
        pairs_file: files.pairs(),
        pairs: pairs.inputs.rows,
        seed: options.seed,
        refused: done.counts.refused,
        taken_back: done.counts.taken_back,
        next_pose_s: done.slowest.as_secs_f64(),
        session_s: begun.elapsed().as_secs_f64(),
        training_s: finished.learned.took.as_secs_f64(),
        warnings: &warnings,
        quality: match &judgement {
            Some(judgement) => maps::Measures::Hand(&judgement.quality),
            None => maps::Measures::Domains(&finished.measured),
        },
        good: judgement.as_ref().map(Judgement::good),
        verdict: judgement.as_ref().map(ToString::to_string),
        faults: judgement.as_ref().map(Judgement::named).unwrap_or_default(),
        off_pairs: judgement
            .as_ref()
            .and_then(|judgement| judgement.pairs.as_ref())
            .map(|pairs| pairs.off().into()),
    };
    if let Some(judgement) = &judgement {
        on_page.show_end(&said::lines(judgement), judgement.good());
    }
    if options.json {
        return results::print("train --live", taught);
    }
    tell.say(format_args!(
        "trained    in {}",
        seconds(finished.learned.took)
    ));
    match &judgement {
        Some(judgement) => {
            for (name, text) in said::lines(judgement) {
                tell.say(format_args!("{name:<11}{text}"));
            }
        }
        None => {
            for line in finished.measured.lines() {
                tell.say(format_args!("quality    {line}"));
            }
        }
    }
    tell.say(format_args!("pairs      {}", files.pairs().display()));
    tell.say(format_args!("model      {}", options.out.display()));
    let mut report = Command::gauntlet("report").path("--model", &options.out);
    if let Some(poses) = &options.poses {
        report = report.path("--poses", poses);
    }
    tell.say(format_args!(
        "next       {}",
        report.then(" draws what it does")
    ));
    Ok(())
}

/// What the hand will move.
fn aim(options: &Train) -> Result<Aim> {
    match &options.target {
        Some(file) => Ok(Aim::Samples {
            samples: read_samples(file, "x").map_err(told)?,
            name: file.display().to_string(),
        }),
        None => Ok(Aim::Gripper(
            Space::of_axes(options.gripper_model.axes()).unwrap_or(Space::ThreeFinger),
        )),
    }
}

fn rounds(options: &Train) -> Result<usize> {
    match options.pairs {
        None => Ok(ROUNDS),
        Some(choice) if choice.kind == PairKind::Adaptive => Ok(choice.count.unwrap_or(ROUNDS)),
        Some(_) => {
            let what = "--live chooses the poses one after another";
            Err(Failure::usage(what, "--pairs 8, or none").into())
        }
    }
}

fn place(options: &Train) -> Result<Place<'_>> {
    match (&options.worn.bridge, &options.worn.glove) {
        (Some(bridge), _) => Ok(Place::Chip(bridge)),
        (None, Some(glove)) => Ok(Place::Port(GloveAt {
            glove: glove.clone(),
            profile: options.worn.profile.clone(),
            ideal: options.worn.ideal,
            hand: options.worn.hand,
            reading: options.worn.reading,
            json: options.json,
        })),
        (None, None) => Err(Failure::usage(
            "no glove is named",
            advice("--glove PORT; ").then(Command::gauntlet("ports").then(" lists them")),
        )
        .into()),
    }
}
