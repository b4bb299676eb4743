//! `gauntlet reproduce`: the paper's tables and figures. Trainings that are done are kept, so that a run that was stopped goes on.

mod args;
mod figures;
mod tables;
mod work;

use std::path::PathBuf;

use anyhow::Result;
use host::glove::hand::LIMITS;
use paper::plan::{Frame, What};
use paper::{Laboratory, Store};

pub use args::Reproduce;

use crate::progress::Person;
use crate::results;
use crate::results::paper::{Made, Numbers, Reproduced};
use crate::tell::Tell;
use crate::{outputs, reading};
use host::failure::{OrFail, told};
use host::interrupt::Interrupt;
use host::stats::seconds;
use host::training::motion::Motion;
use work::Work;

/// Where everything is, for the parts that make a table or a figure.
pub(super) struct Bench<'a> {
    laboratory: Laboratory,
    store: Store,
    frame: Frame,
    folder: PathBuf,
    /// The recording, if there is one.
    motion: Option<Motion>,
    work: Work<'a>,
    tell: Tell,
}

/// Trains what is not there yet and writes the tables and figures.
///
/// # Errors
/// A failure that names the file or the training, or says that the run was stopped and how it goes on.
pub(crate) fn run(options: &Reproduce, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.json);
    let motion = match &options.poses {
        Some(path) => Some(reading::ended_by(interrupt, "the recording", || {
            Motion::open_for_training(Some(path), 0, &Person)
        })?),
        None => None,
    };
    let recording = motion.as_ref().map(Motion::frames);
    std::fs::create_dir_all(&options.out).or_fail(
        || format!("the folder {}", options.out.display()),
        "another name in --out, in a folder where you may write",
    )?;
    outputs::room(&options.out.join("result"))?;
    let frame = options.frame();
    let wanted = What::each(&options.what);
    let store = Store::open(options.out.join("trainings"), recording.as_ref()).map_err(told)?;
    let threads = options.threads.map_or_else(
        || std::thread::available_parallelism().map_or(1, usize::from),
        usize::from,
    );
    let work = Work::plan(&wanted, &frame, &store, threads, interrupt);
    tell.say(format_args!("results    in {}", options.out.display()));
    tell.say(format_args!("trainings  {}", work.describe()));
    let bench = Bench {
        laboratory: Laboratory::new(&LIMITS, recording),
        store,
        frame,
        folder: options.out.clone(),
        motion,
        work,
        tell,
    };
    let mut made = Vec::new();
    for what in wanted {
        made.push(bench.make(what)?);
    }
    let took = bench.work.finish();
    if options.json {
        let reproduced = Reproduced {
            folder: &options.out,
            seeds: frame.seeds,
            took_s: took.as_secs_f64(),
            results: made,
        };
        return results::print("reproduce", reproduced);
    }
    tell.say(format_args!("done       in {}", seconds(took)));
    Ok(())
}

impl Bench<'_> {
    /// Trains for a table or a figure and writes it.
    fn make(&self, what: What) -> Result<Made> {
        let done = self
            .work
            .train(&self.laboratory, &self.store, &self.frame.cells(what))?;
        match what {
            What::Table2 | What::Table4 => self.table(what, &done),
            _ => self.figure(what, &done),
        }
    }

    /// Says where a result is.
    fn wrote(&self, what: What, files: &[PathBuf], numbers: Option<Numbers>) -> Made {
        let names: Vec<String> = files
            .iter()
            .map(|file| file.display().to_string())
            .collect();
        self.work.say(
            &self.tell,
            &format!("{:<10} {}", what.name(), names.join(", ")),
        );
        Made {
            what: what.name().to_owned(),
            files: names,
            numbers,
        }
    }
}
