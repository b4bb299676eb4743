//! `gauntlet demo`: the whole path, from a moving hand to a moving gripper, with nothing but this machine.

mod here;
mod on_chip;
mod parts;

use std::path::PathBuf;
use std::time::Duration;

use anyhow::Result;
use clap::Args;

use crate::options::{model_parser, run_time};
use crate::progress::Person;
use crate::results::{self, runs};
use crate::run::{End, Finished, Options, Run};
use crate::tell::Tell;
use crate::{outputs, reading};
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::lines::Model;
use host::stats::seconds;
use host::training::motion::Motion;
use parts::Started;

/// Options of `demo`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet demo
  gauntlet demo --poses my_hand.csv --log session.mcap
  gauntlet demo --seconds 60 --json > result.json
  gauntlet demo --gripper-model 2f85
  gauntlet demo --on-chip

The poses file is CSV with a header: optional `time_s` first, then the 25 joint angles in radians \
(thumb_cmc_flex, thumb_cmc_abd, … little_dip_flex; docs/tool.md lists them). \
Keys while it runs on a terminal: space opens and closes the clutch, q holds the gripper and ends.")]
pub struct Demo {
    /// Train on and play this recording of a hand instead of generated motion.
    #[arg(long, value_name = "FILE.csv")]
    pub poses: Option<PathBuf>,
    /// Write every frame, command and status into this session log.
    #[arg(long, value_name = "FILE.mcap")]
    pub log: Option<PathBuf>,
    /// How long to drive the gripper, in seconds (1 to 86400).
    #[arg(long, value_name = "N", default_value = "20", value_parser = run_time, allow_negative_numbers = true)]
    pub seconds: Duration,
    /// Seed of everything random: the same seed trains the same map.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Begin with no reference pairs, as the paper's experiments do, instead of with open hand and fist.
    #[arg(long)]
    pub no_start_pairs: bool,
    /// Which gripper follows the hand.
    #[arg(long, value_name = "MODEL", value_parser = model_parser(), default_value = "3f")]
    pub gripper_model: Model,
    /// Run the bridge's ARM firmware in QEMU instead of on this processor.
    #[arg(long, conflicts_with = "log")]
    pub on_chip: bool,
    /// The firmware for --on-chip, instead of the one that `cargo xtask firmware` built.
    #[arg(long, value_name = "ELF", requires = "on_chip")]
    pub firmware: Option<PathBuf>,
    /// Print the summary as JSON on standard output, and nothing else there.
    #[arg(long)]
    pub json: bool,
}

impl Default for Demo {
    /// What `gauntlet` without a verb does.
    fn default() -> Self {
        Self {
            poses: None,
            log: None,
            seconds: Duration::from_secs(20),
            seed: 1,
            no_start_pairs: false,
            gripper_model: Model::ThreeFinger,
            on_chip: false,
            firmware: None,
            json: false,
        }
    }
}

/// Runs the demo.
///
/// # Errors
/// A failure that says which of its steps did not succeed.
pub(crate) fn run(options: &Demo, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.json);
    if options.on_chip {
        on_chip::check(options)?;
    }
    let motion = reading::ended_by(interrupt, "the recording", || {
        Motion::open_for_training(options.poses.as_deref(), options.seed, &Person)
    })?;
    if let Some(path) = &options.log {
        outputs::check_new(path)?;
    }
    let start = match options.on_chip {
        true => on_chip::start,
        false => here::start,
    };
    let mut started = start(options, &motion, &tell, interrupt)?;
    let driven = drive(options, &mut started, &tell);
    let Started {
        run,
        outcome,
        flashed,
        home,
        ..
    } = started;
    let finished = run.finish();
    drop(home);
    if options.json && finished.ending.is_some() {
        let result = runs::Demo {
            motion: motion.describe(),
            training_s: outcome.took.as_secs_f64(),
            epochs: outcome.epochs,
            pairs: outcome.pairs,
            quality: &outcome.quality,
            flash: flashed.as_ref(),
            run: finished.result(),
        };
        results::print("demo", result)?;
    } else {
        say(&finished, &outcome.quality.line(), &tell);
    }
    let moved = finished.summary.first_motion_s.is_some();
    match finished.judge(driven)? {
        End::Time if !moved => Err(not_moved(options)),
        End::Time | End::Asked => Ok(()),
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
fn say(finished: &Finished, map: &str, tell: &Tell) {
    finished.tell(tell, "summary    ");
    if let Some(first) = finished.summary.first_motion_s {
        tell.say(format_args!(
            "motion     the gripper first moved with the hand {first:.1} s after the clutch was closed"
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
        false => "--log FILE.mcap, whose events say what held it",
    };
    Failure::new("the gripper did not move with the hand", next).into()
}
