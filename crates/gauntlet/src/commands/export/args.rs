//! The options of `export`.

use std::path::PathBuf;

use clap::Args;

/// Options of `export`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet export model.safetensors --out weights.hae
  gauntlet export model.safetensors --out weights.hae --int16 my_hand.csv --json
  gauntlet export session.mcap
  gauntlet export session.mcap --poses my_hand.csv

Of a model: the image has the normalisation folded in: raw radians in, counts out (docs/weights-image.md). \
--int16 sets the ranges of the integers by the poses, best the ones the model was trained on, and \
stores the largest error over them in the image.

Of a session log: the hand's joint angles (as train reads them), the commands that left, and the hand's 26 \
joints as OpenXR has them; without a name all three, beside the log. Of a damaged log what can be read is \
written, and the rest is named.")]
pub struct Export {
    /// The trained model, or the session log.
    #[arg(value_name = "MODEL.safetensors|LOG.mcap")]
    pub file: PathBuf,
    /// Where a model's image goes. An image that is there is replaced; anything else never.
    #[arg(long, value_name = "IMAGE", conflicts_with_all = ["poses", "commands", "openxr"])]
    pub out: Option<PathBuf>,
    /// Write a model's weights as 16-bit integers, calibrated on these hand poses: faster on a chip, half as long.
    #[arg(long, value_name = "POSES.csv", requires = "out")]
    pub int16: Option<PathBuf>,
    /// Where a log's joint angles go, radians; never over anything.
    #[arg(long, value_name = "POSES.csv")]
    pub poses: Option<PathBuf>,
    /// Where a log's commands go, counts; never over anything.
    #[arg(long, value_name = "COMMANDS.csv")]
    pub commands: Option<PathBuf>,
    /// Where the hand's joints go as OpenXR has them, metres; never over anything.
    #[arg(long, value_name = "HAND.csv")]
    pub openxr: Option<PathBuf>,
    /// Print the result as JSON on standard output, and nothing else there.
    #[arg(long)]
    pub json: bool,
}
