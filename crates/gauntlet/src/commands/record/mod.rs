//! `gauntlet record`: what `train` needs, from a glove on a port: a person's hand as a poses file.

mod session;

use std::path::PathBuf;
use std::time::Duration;

use anyhow::Result;
use clap::Args;

use super::glove::{GloveAt, Opened, take_flat};
use super::teleop::Hand as WhichHand;
use crate::line_log::LineLog;
use crate::options::{log_name, run_time};
use crate::outputs;
use crate::results::{self, gloves, runs};
use crate::tell::Tell;
use crate::web::{Page, ViewOptions};
use host::calibration::virtual_person::VirtualPerson;
use host::clock::Clock;
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::next::{Command, NextStep};
use host::recording::poses::PosesFile;
use host::training::recorded::{self, Verdict};
use session::Session;

/// A recording without prompts in which every movement can have been shown.
const ENOUGH: Duration = Duration::from_secs(60);

/// Options of `record`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet record --glove /dev/ttyUSB0 --out my_hand.csv
  gauntlet record --glove /tmp/glove --out my_hand.csv --seconds 70
  gauntlet train --poses my_hand.csv --out model.safetensors   (then)

No gripper and no model is needed. The hand lies flat first, then each movement is asked for in words: 80 seconds. \
What was not seen is asked once more. Ctrl-C ends it, and what was recorded until then is kept. \
A pose of which a joint was not measured is no row. A file that exists is never written over. \
Exit code 1 where the recording is not good enough to train on; the file is there all the same.")]
pub struct Record {
    /// The glove.
    #[command(flatten)]
    pub at: GloveAt,
    /// Write the poses into this new file.
    #[arg(long, value_name = "POSES.csv")]
    pub out: PathBuf,
    /// The page.
    #[command(flatten)]
    pub view: ViewOptions,
    /// Record for so many seconds without prompts (1 to 86400).
    #[arg(long, value_name = "N", value_parser = run_time, allow_negative_numbers = true)]
    pub seconds: Option<Duration>,
    /// Write everything that the glove says into a log, of this name or one with the date.
    #[arg(long, value_name = "FILE.mcap", num_args = 0..=1, default_missing_value = log_name())]
    pub log: Option<PathBuf>,
}

/// Records until everything was shown, the time is over or somebody ends it.
///
/// # Errors
/// A failure that names the port, the sensor or the file; that the recording is not good enough to train on.
pub(crate) fn run(options: &Record, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.at.json);
    outputs::check_new(&options.out, "a recording")?;
    let page = Page::start(&options.view, &tell)?;
    let mut log = LineLog::new(options.log.as_deref())?;
    let clock = Clock::start();
    let Opened {
        mut scanning,
        hand,
        missing,
    } = options.at.open(&tell, clock, log.trace(), interrupt)?;
    complete(options, missing)?;
    let mut hand = hand.map_err(|why| not_calibrated(options, &why))?;
    if !take_flat(&mut hand, &mut scanning, clock, &tell, interrupt)? {
        return Err(Failure::interrupted("before anything was recorded").into());
    }
    // A full disk is the writer's to tell.
    interrupt.look_after_file_limit();
    log.begin(clock, hand.side(), interrupt)?;
    let (file, rows) = PosesFile::create(&options.out, interrupt, Some)?;
    let side = hand.side();
    let mut session = Session::new(scanning, hand, rows, options.at.json);
    session.shows(page, side);
    session.keeps(log.feed());
    let recorded = match options.seconds {
        Some(time) => session.free(time, interrupt),
        None => session.guided(interrupt),
    };
    let done = session.finish();
    let (rows, written) = file.finish();
    let written = written.and(log.finish(&tell));
    let ended = recorded.map_err(|gone| match gone {
        session::Gone::Silent => options.at.silent().into(),
        session::Gone::NotCalibrated => lost_calibration(options).into(),
        session::Gone::Ended(error) => error,
    });
    let ended = written.and(ended);
    finish(options, &tell, done, rows, ended)
}

/// What is left: the file, what it is worth, and what to do with it.
fn finish(
    options: &Record,
    tell: &Tell,
    done: session::Done,
    rows: u64,
    ended: Result<()>,
) -> Result<()> {
    let verdict = match rows {
        0 => Err(nothing(options).into()),
        _ => recorded::judge(&options.out),
    };
    let good = verdict.as_ref().is_ok_and(|verdict| verdict.good) && ended.is_ok();
    let next = match &verdict {
        Ok(verdict) if verdict.good => train(options),
        _ => better(options),
    };
    let place = options.out.display();
    if rows > 0 {
        tell.say(format_args!(
            "poses      {place}  {rows} poses, {:.1} scans/s, {} scans without a whole pose",
            done.scanned.scans_per_s, done.passed_over
        ));
    }
    let (judged, verdict) = match verdict {
        Ok(verdict) => {
            let judged = match verdict.good {
                true => Ok(()),
                false => Err(not_good(options, &verdict).into()),
            };
            (judged, Some(verdict))
        }
        Err(error) => (Err(error), None),
    };
    if let Some(verdict) = verdict.as_ref().filter(|verdict| verdict.good) {
        let seen: u32 = verdict.movements.iter().map(|seen| seen.times).sum();
        tell.say(format_args!(
            "verdict    good enough to train on: {seen} movements of {} kinds",
            verdict.movements.len()
        ));
        tell.say(format_args!("next       {next}"));
    }
    // What ended it comes first: the recording is short because of it.
    let (judgement, failure) = results::judged(ended.and(judged));
    if options.at.json {
        let verdict = verdict.unwrap_or_else(|| Verdict {
            good: false,
            poses: 0,
            covers_s: 0.0,
            movements: Vec::new(),
            faults: Vec::new(),
            warnings: Vec::new(),
        });
        let result = gloves::Recorded {
            place: options.at.glove.display().to_string(),
            poses: (rows > 0).then_some(runs::Poses {
                path: &options.out,
                rows,
            }),
            covers_s: verdict.covers_s,
            passed_over: done.passed_over,
            scanned: done.scanned,
            movements: verdict.movements,
            good,
            lacks: verdict.faults,
            warnings: verdict.warnings,
            next,
            failure,
        };
        results::print("record", result)?;
    }
    judgement
}

/// A model's name beside the recording's.
fn train(options: &Record) -> NextStep {
    let model = options.out.with_extension("safetensors");
    Command::gauntlet("train")
        .path("--poses", &options.out)
        .path("--out", &model)
        .into()
}

/// The same again into another file: this one is never written over.
/// What makes a good recording: in less than a minute nobody shows every movement, and the prompts lead through them.
fn better(options: &Record) -> NextStep {
    let seconds = options.seconds.filter(|time| *time >= ENOUGH);
    once_more(options, seconds)
}

/// The same into another file, for `seconds` or with prompts.
fn once_more(options: &Record, seconds: Option<Duration>) -> NextStep {
    let name = options
        .out
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy();
    let other = (2..).map(|n| options.out.with_file_name(format!("{name}_{n}.csv")));
    let free = other.take(99).find(|path| !path.exists());
    let free = free.unwrap_or_else(|| options.out.with_extension("again.csv"));
    let mut command = Command::gauntlet("record")
        .path("--glove", &options.at.glove)
        .path("--out", &free);
    if options.at.ideal {
        command = command.word("--ideal");
    }
    // Where a profile says, it says so again.
    match options.at.hand {
        WhichHand::Left => command = command.option("--hand", "left"),
        WhichHand::Right if options.at.ideal => command = command.option("--hand", "right"),
        WhichHand::Right => {}
    }
    if let Some(time) = seconds {
        command = command.option("--seconds", time.as_secs_f64());
    }
    if let Some(profile) = &options.at.profile {
        command = command.path("--profile", profile);
    }
    command.into()
}

fn not_good(options: &Record, verdict: &Verdict) -> Failure {
    let what = format!(
        "the recording {} is not good enough to train on: {}",
        options.out.display(),
        verdict.faults.join("; ")
    );
    Failure::new(what, better(options))
}

fn nothing(options: &Record) -> Failure {
    let what = format!(
        "no pose came, and {} was not left: of no scan all joints were measured",
        options.out.display()
    );
    Failure::new(what, options.at.doctor())
}

/// Every row needs every sensor.
fn complete(options: &Record, missing: usize) -> Result<()> {
    if missing == 0 {
        return Ok(());
    }
    let what = format!(
        "the glove on {} lacks sensors, and a recording needs every joint",
        options.at.glove.display()
    );
    Err(Failure::new(what, options.at.doctor()).into())
}

fn not_calibrated(options: &Record, why: &str) -> Failure {
    let place = options.at.glove.display();
    let calibrate = Command::gauntlet("calibrate")
        .path("--glove", &options.at.glove)
        .then(", and then the same again");
    // Never for a real glove: its angles would be wrong by tens of degrees.
    let next = match VirtualPerson::at(&options.at.glove) {
        Some(_) => calibrate
            .then("; if its sensors sit straight: ")
            .then(NextStep::same(Command::more().word("--ideal"))),
        None => calibrate,
    };
    Failure::new(
        format!("the glove on {place} is not calibrated: {why}"),
        next,
    )
}

fn lost_calibration(options: &Record) -> Failure {
    let place = options.at.glove.display();
    let what = format!(
        "the glove on {place} is no longer calibrated: the sensor of the hand, or two others, started anew"
    );
    Failure::new(what, once_more(options, options.seconds))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Typed {
        #[command(flatten)]
        record: Record,
    }

    #[test]
    fn once_more_is_the_same_into_another_file() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("hand.csv");
        std::fs::write(&out, "").unwrap();
        let words = "record --glove /dev/g --hand left --ideal --seconds 20.5 --out";
        let typed = words.split(' ').chain(out.to_str());
        let options = Typed::parse_from(typed).record;
        let next = once_more(&options, options.seconds);
        let again = next.commands().next().unwrap().words();
        let again = Typed::parse_from(again.iter().skip(1)).record;
        assert_eq!(again.out, folder.path().join("hand_2.csv"));
        assert_eq!(again.at.glove, options.at.glove);
        assert!(again.at.hand == WhichHand::Left && again.at.ideal);
        assert_eq!(again.seconds, options.seconds);
        let better = better(&options);
        let better = better.commands().next().unwrap().words();
        let better = Typed::parse_from(better.iter().skip(1)).record;
        assert_eq!((better.out, better.seconds), (again.out, None));
    }
}
