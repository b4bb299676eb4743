//! `gauntlet flash`: weights into a bridge on a chip.

mod args;
mod slots;

use anyhow::Result;

pub use args::Flash;
pub(super) use slots::slot_lines;

use crate::progress::{Person, Progress};
use crate::reading;
use crate::results::{self, maps};
use crate::tell::Tell;
use host::chip::link::{Flashed, HostLink};
use host::interrupt::Interrupt;
use host::training::model;

/// Writes the file's weights into the bridge.
///
/// # Errors
/// A failure that names the file, the line, or what the bridge refuses.
pub(crate) fn run(options: &Flash, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.json);
    let weights = reading::ended_by(interrupt, "what is to be written", || {
        model::weights(&options.file, options.int16.as_deref(), &Person)
    })?;
    if let Some(int16) = &weights.int16 {
        tell.say(format_args!("int16      {}", int16.line()));
    }
    let mut link = HostLink::connect(&options.bridge).map_err(|error| error.at(&options.bridge))?;
    let flashed = flash(&mut link, &weights.image, &tell, interrupt)?;
    if options.json {
        let stored = maps::Stored {
            flashed: &flashed,
            int16: weights.int16.as_ref(),
        };
        return results::print("flash", stored);
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
    let bridge = link.address().clone();
    let mut progress = Progress::start("flash", image.len() as u64, false);
    let flashed = link
        .flash(image, interrupt, &mut |done| {
            progress.at(done.into(), || "bytes".to_owned());
        })
        .map_err(|error| error.at(&bridge))?;
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
