//! The options of `eval`.

use std::path::PathBuf;

use clap::{ArgGroup, Args};

use crate::commands::train::CoverageArgs;
use host::training::measuring;

/// Options of `eval`.
#[derive(Debug, Args)]
#[command(
    group(ArgGroup::new("data").required(true).args(["poses", "input"])),
    after_help = "\
Examples:
  gauntlet eval --model model.safetensors --poses other_recording.csv
  gauntlet eval --model model.safetensors --poses my_hand.csv --json
  gauntlet eval --model map.safetensors --input Q.csv --target X.csv --truth PAIRS.csv --volume 9 --dim 2 --json

Mean distortion: how much the map stretches small motions unevenly; lower is smoother.
Volume occupancy (VO): the share of the target (the gripper's poses) that is reached, 0 to 1; 0.9 and more is good.
d-Knn: how much farther apart neighbours come to lie; for a hand, over about 16 the map folds somewhere.
NMSE: the error against true pairs, as a share of their variance; a mirrored or folded map has about 1."
)]
pub struct Eval {
    /// The trained model.
    #[arg(long, value_name = "MODEL.safetensors")]
    pub model: PathBuf,
    /// The hand poses to measure on: of those that the model was trained on the part that was held out.
    #[arg(long, value_name = "FILE.csv", conflicts_with_all = ["target", "truth", "epsilon", "volume", "dim"])]
    pub poses: Option<PathBuf>,
    /// Samples of the input domain to measure on, columns q0, q1, …; best ones the model was not trained on.
    #[arg(long, value_name = "Q.csv", requires = "target")]
    pub input: Option<PathBuf>,
    /// Samples of the target domain, columns x0, x1, …
    #[arg(long, value_name = "X.csv", requires = "input")]
    pub target: Option<PathBuf>,
    /// True pairs, columns q0… and x0…, for NMSE: those whose inputs are measured on, or all where none is.
    #[arg(long, value_name = "PAIRS.csv", requires = "input")]
    pub truth: Option<PathBuf>,
    /// For the volume occupancy.
    #[command(flatten)]
    pub coverage: CoverageArgs,
    /// Seed of the gripper poses that a hand's map is compared with.
    #[arg(long, value_name = "N", default_value_t = measuring::SEED)]
    pub seed: u64,
    /// Print the result as JSON.
    #[arg(long)]
    pub json: bool,
}
