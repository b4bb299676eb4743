//! `gauntlet flash`: weights into a bridge on a chip.

use std::path::Path;

use anyhow::Result;
use bridge::protocol::message::{SlotContents, Slots};

use crate::cli::Flash;
use crate::failure::{Failure, OrFail, told};
use crate::host_link::{Flashed, HostLink};
use crate::interrupt::Interrupt;
use crate::progress::Progress;
use crate::tell::Tell;
use crate::{model, out};

/// Longest file that is looked at: a weights image has some 40 KB, a model some 500 KB.
const LONGEST_FILE: u64 = 64 << 20;

/// Writes the file's weights into the bridge.
///
/// # Errors
/// A failure that names the file, the line, or what the bridge refuses.
pub(super) fn run(options: &Flash, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.json);
    let image = image_of(&options.file)?;
    let mut link = HostLink::connect(&options.bridge).map_err(Failure::from)?;
    let flashed = flash(&mut link, &image, &tell, interrupt)?;
    if options.json {
        return out::json(&flashed);
    }
    slot_lines(&flashed.slots)
        .iter()
        .for_each(|line| tell.say(format_args!("{line}")));
    Ok(())
}

/// Writes `image` with a progress bar, and says what became of it.
pub(super) fn flash(
    link: &mut HostLink,
    image: &[u8],
    tell: &Tell,
    interrupt: &Interrupt,
) -> Result<Flashed> {
    let mut progress = Progress::start("flash", image.len() as u64, false);
    let flashed = link
        .flash(image, interrupt, &mut |done| {
            progress.at(done.into(), || "bytes".to_owned());
        })
        .map_err(Failure::from)?;
    let took = progress.finish();
    if flashed.resumed_at > 0 {
        tell.say(format_args!(
            "resumed    an interrupted transfer, from byte {}",
            flashed.resumed_at
        ));
    }
    if flashed.broken_lines > 0 {
        tell.say(format_args!(
            "line       broke {} times and was opened again",
            flashed.broken_lines
        ));
    }
    tell.say(format_args!(
        "flashed    {} bytes into slot {} in {:.1} s; read back, CRC {:08x} as sent",
        flashed.bytes,
        flashed.slot,
        took.as_secs_f64(),
        flashed.crc
    ));
    Ok(flashed)
}

/// The weights image in `path`, which is one or is a model.
fn image_of(path: &Path) -> Result<Vec<u8>> {
    let name = || format!("the file {}", path.display());
    let length = std::fs::metadata(path)
        .or_fail(name, "the path of a trained model or a weights image")?
        .len();
    if length > LONGEST_FILE {
        return Err(Failure::new(
            format!("{} has {length} bytes, far more than a map", path.display()),
            "a model that `gauntlet train` made",
        )
        .into());
    }
    let bytes = std::fs::read(path).or_fail(name, "a file that you may read")?;
    if !bytes.starts_with(&hae::image::MAGIC) {
        return model::image(&model::load(path)?);
    }
    // The bridge checks it too; here it costs no minutes on the line.
    hae::image::parse_exact(&bytes)
        .map_err(|error| told(format!("{}: {error}", path.display())))?;
    Ok(bytes)
}

/// What both slots hold, a line each.
pub(super) fn slot_lines(slots: &Slots) -> Vec<String> {
    slots
        .contents
        .iter()
        .enumerate()
        .map(|(slot, contents)| {
            let mark = if slots.active.map(usize::from) == Some(slot) {
                " (active)"
            } else {
                ""
            };
            match contents {
                SlotContents::Empty => format!("slot {slot}     empty"),
                SlotContents::Damaged => format!("slot {slot}     damaged: not a whole image for this bridge"),
                SlotContents::Image {
                    model_id,
                    version,
                    length,
                    crc,
                } => format!(
                    "slot {slot}     model {model_id:08x} version {version}, {length} bytes, CRC {crc:08x}{mark}"
                ),
            }
        })
        .collect()
}
