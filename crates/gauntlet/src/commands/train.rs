//! `gauntlet train`: learns the map and writes the model.

use anyhow::Result;
use serde_json::json;

use crate::cli::{Schedule, Train};
use crate::failure::told;
use crate::interrupt::Interrupt;
use crate::outputs::Kind;
use crate::poses::Motion;
use crate::stats::seconds;
use crate::tell::Tell;
use crate::training::{Request, train};
use crate::{out, outputs};

/// Trains on a recording.
///
/// # Errors
/// A failure that names the file and what is wrong with it.
pub(super) fn run(options: &Train, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.json);
    // Before minutes of training, not after.
    outputs::check(&options.out, Kind::Model, &[&options.poses])?;
    let motion = Motion::open_for_training(Some(&options.poses), options.seed)?;
    let request = Request {
        motion: &motion,
        schedule: match options.schedule {
            Schedule::Short => trainer::algorithm::Schedule::Fast,
            Schedule::Paper => trainer::algorithm::Schedule::Paper,
        },
        epochs: options.epochs.map(|epochs| epochs as usize),
        pairs: options.pairs as usize,
        start_pairs: !options.no_start_pairs,
        seed: options.seed,
        quiet: false,
    };
    tell.say(format_args!("poses      {}", motion.describe()));
    tell.say(format_args!(
        "training   {} epochs, {} reference pairs chosen on the way, the scripted operator shows the hand poses",
        request.total_epochs(),
        request.pairs
    ));
    let outcome = train(&request, interrupt)?;
    outcome.model.save(&options.out).map_err(told)?;
    if options.json {
        return out::json(&json!({
            "model": options.out,
            "epochs": outcome.epochs,
            "pairs": outcome.pairs,
            "training_s": outcome.took.as_secs_f64(),
            "quality": outcome.quality,
        }));
    }
    tell.say(format_args!("trained    in {}", seconds(outcome.took)));
    tell.say(format_args!("quality    {}", outcome.quality.line()));
    tell.say(format_args!("model      {}", options.out.display()));
    Ok(())
}
