//! `gauntlet replay`: a session's log through the same bridge again, or through another one.

mod args;
mod on_virtual;
mod watched;

use std::time::Instant;

use anyhow::Result;
use host::bridge::{App, Board};

use crate::progress::{Person, Progress};
use crate::results::{self, replays};
use crate::tell::Tell;
use crate::web::Page;
use host::calibration::profile_file::Kept;
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::next::advice;
use host::recording::traced::Traced;
use host::replay::{self, Changes, Follow, Same};
use host::session::check_image;
use host::training::model;

pub use args::{Replay, Target};

/// Replays the log.
///
/// # Errors
/// A failure that names the log and what is wrong with it, or the first difference.
pub(crate) fn run(options: &Replay, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.json);
    let traced = Traced::read(&options.file)?;
    for damage in &traced.found.damage {
        tell.say(format_args!(
            "warning: {}: {damage}",
            options.file.display()
        ));
    }
    let changes = changes(options, &traced)?;
    let started = Instant::now();
    let page = Page::start(&options.view, &tell)?;
    let same = match options.pace() {
        Some(speed) => {
            let shown = watched::Shown {
                speed,
                quiet: options.json,
                page,
            };
            watched::run(traced.clone(), shown, interrupt)?
        }
        None => {
            let mut bar = Bar {
                shown: Progress::start("replay", traced.end, options.json),
                interrupt,
            };
            let same = replay::same(&traced, &mut bar)?;
            bar.shown.finish();
            same
        }
    };
    let took = started.elapsed();
    let mut result = replays::Replayed::new(&options.file, &traced, &same, took);
    if let Some(changes) = &changes {
        result.other = Some(replay::compare(&traced, changes)?.into());
    }
    if options.to == Some(Target::Virtual) {
        result.driven = Some(on_virtual::drive(&traced, options.speed, interrupt)?);
    }
    result.lines(|line| tell.say(format_args!("{line}")));
    let (judgement, failure) = results::judged(judge(options, &same));
    if options.json {
        result.failure = failure;
        results::print("replay", result)?;
    }
    judgement
}

/// The progress of a replay, which Ctrl-C ends.
struct Bar<'i> {
    shown: Progress,
    interrupt: &'i Interrupt,
}

impl Follow for Bar<'_> {
    fn turn<B: Board<X>, const X: usize>(&mut self, _: &mut App<B, X>, at: u64) -> bool {
        self.shown
            .at(at, || format!("{:.0} s of the log", at as f64 * 1e-6));
        !self.interrupt.asked()
    }
}

/// What is to be other than in the log, if anything is.
fn changes(options: &Replay, traced: &Traced) -> Result<Option<Changes>> {
    if !options.changes() {
        return Ok(None);
    }
    let image = match &options.model {
        Some(path) => Some(model::weights(path, None, &Person)?.image),
        None => None,
    };
    if let Some(image) = &image {
        check_image(image, traced.model)?;
    }
    let profile = match &options.profile {
        Some(path) => Some(Kept::read(path)?.bound),
        None => None,
    };
    Ok(Some(Changes {
        image,
        profile,
        driving: options.driving(),
    }))
}

/// A failure where the bridge did something else, or a part of the log is missing.
fn judge(options: &Replay, same: &Same) -> Result<()> {
    let file = options.file.display();
    if let Some((at, difference)) = &same.difference {
        let at = *at as f64 * 1e-6;
        return Err(Failure::new(
            format!("{file}: the replay differs from the log at {at:.6} s: {difference}"),
            "the program that wrote the log, which gives the same commands",
        )
        .into());
    }
    match &same.cut {
        Some(cut) => Err(Failure::new(
            format!(
                "{file} is replayed until {:.3} s: {cut}",
                same.time_us as f64 * 1e-6
            ),
            advice("a log that is whole; of this one all that can be read was replayed"),
        )
        .into()),
        None => Ok(()),
    }
}
