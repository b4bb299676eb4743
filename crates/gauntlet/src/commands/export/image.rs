//! A model's weights as the image a bridge takes, in a file.

use anyhow::Result;
use host::trainer::whole_file;

use super::args::Export;
use crate::outputs::{self, Kind};
use crate::progress::Person;
use crate::results::{self, maps};
use crate::tell::Tell;
use host::failure::{Failure, OrFail};
use host::next::Command;
use host::training::model;

pub(super) fn run(options: &Export) -> Result<()> {
    let tell = Tell::new(options.json);
    let Some(out) = options.out.as_deref() else {
        if !options.file.exists() {
            return Err(Failure::new(
                format!("there is no file {}", options.file.display()),
                "the path of a trained model or of a session log",
            )
            .into());
        }
        return Err(Failure::usage(
            format!(
                "where the image of {} goes is not said",
                options.file.display()
            ),
            Command::gauntlet("export")
                .word(options.file.display().to_string())
                .option("--out", "weights.hae"),
        )
        .into());
    };
    let mut inputs = vec![options.file.as_path()];
    inputs.extend(options.int16.as_deref());
    outputs::check(out, Kind::Image, &inputs)?;
    let replaced = out.metadata().is_ok_and(|there| there.len() > 0);
    let weights = model::weights(&options.file, options.int16.as_deref(), &Person)?;
    whole_file::write(out, &weights.image).or_fail(
        || format!("{} is not written", out.display()),
        "a folder with room that you may write in",
    )?;
    if options.json {
        let exported = maps::Exported {
            image: out,
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
        out.display(),
        weights.image.len(),
        if replaced {
            ", in the place of the image that was there"
        } else {
            ""
        }
    ));
    Ok(())
}
