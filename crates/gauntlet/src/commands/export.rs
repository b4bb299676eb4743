//! `gauntlet export`: a model's weights as the image a bridge takes, in a file.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use trainer::whole_file;

use crate::outputs::{self, Kind};
use crate::progress::Person;
use crate::results::{self, maps};
use crate::tell::Tell;
use host::failure::OrFail;
use host::training::model;

/// Options of `export`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet export model.safetensors --out weights.hae
  gauntlet export model.safetensors --out weights.hae --int16 my_hand.csv --json

The image has the normalisation folded in: raw radians in, counts out (docs/weights-image.md).
--int16 sets the ranges of the integers by the poses, best the ones the model was trained on, and \
stores the largest error over them in the image.")]
pub struct Export {
    /// The trained model.
    #[arg(value_name = "MODEL.safetensors")]
    pub model: PathBuf,
    /// Where the image goes. An image that is there is replaced; anything else never.
    #[arg(long, value_name = "IMAGE")]
    pub out: PathBuf,
    /// Write the weights as 16-bit integers, calibrated on these hand poses: faster on a chip, half as long.
    #[arg(long, value_name = "POSES.csv")]
    pub int16: Option<PathBuf>,
    /// Print the result as JSON on standard output, and nothing else there.
    #[arg(long)]
    pub json: bool,
}

/// Writes the image.
///
/// # Errors
/// A failure that names the file and what is wrong with it.
pub(crate) fn run(options: &Export) -> Result<()> {
    let tell = Tell::new(options.json);
    let mut inputs = vec![options.model.as_path()];
    inputs.extend(options.int16.as_deref());
    outputs::check(&options.out, Kind::Image, &inputs)?;
    let replaced = options.out.metadata().is_ok_and(|there| there.len() > 0);
    let weights = model::weights(&options.model, options.int16.as_deref(), &Person)?;
    whole_file::write(&options.out, &weights.image).or_fail(
        || format!("{} is not written", options.out.display()),
        "a folder with room that you may write in",
    )?;
    if options.json {
        let exported = maps::Exported {
            image: &options.out,
            bytes: weights.image.len(),
            replaced,
            int16: weights.int16.as_ref(),
        };
        return results::print("export", exported);
    }
    if let Some(int16) = &weights.int16 {
        tell.say(format_args!("int16      {}", int16.line()));
    }
    tell.say(format_args!(
        "image      {}, {} bytes{}",
        options.out.display(),
        weights.image.len(),
        if replaced {
            ", in the place of the image that was there"
        } else {
            ""
        }
    ));
    Ok(())
}
