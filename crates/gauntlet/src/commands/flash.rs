//! `gauntlet flash`: weights into a bridge on a chip.

use std::path::PathBuf;

use anyhow::Result;
use bridge::protocol::message::{SlotContents, Slots, WeightsKind};
use clap::Args;

use crate::progress::Person;
use crate::progress::Progress;
use crate::reading;
use crate::results::{self, maps};
use crate::tell::Tell;
use host::chip::link::{Address, Flashed, HostLink};
use host::interrupt::Interrupt;
use host::training::model;

/// Options of `flash`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet flash model.safetensors --bridge /dev/ttyUSB0
  gauntlet flash model.safetensors --bridge unix:/tmp/gauntlet/host.sock --json
  gauntlet flash weights.hae --bridge tcp:localhost:4000
  gauntlet flash model.safetensors --int16 my_hand.csv --bridge /dev/ttyUSB0

The bridge keeps its old weights until the new image is there, whole and checked: power may go at any moment. \
A broken line is waited for and opened again; the transfer goes on where the bridge says it was. At the end \
the bridge reads its flash and the CRC is compared. Refused while the clutch is closed.")]
pub struct Flash {
    /// A trained model (MODEL.safetensors) or a weights image.
    #[arg(value_name = "MODEL|IMAGE")]
    pub file: PathBuf,
    /// The bridge: a serial port, unix:PATH or tcp:HOST:PORT.
    #[arg(long, value_name = "PORT")]
    pub bridge: Address,
    /// Write the model's weights as 16-bit integers, calibrated on these hand poses: faster on a chip, half as long.
    #[arg(long, value_name = "POSES.csv")]
    pub int16: Option<PathBuf>,
    /// Print the result as JSON on standard output, and nothing else there.
    #[arg(long)]
    pub json: bool,
}

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
                    weights,
                } => format!(
                    "slot {slot}     model {model_id:08x} version {version} in {}, {length} bytes, CRC {crc:08x}{mark}",
                    kind(*weights)
                ),
            }
        })
        .collect()
}

const fn kind(weights: WeightsKind) -> &'static str {
    match weights {
        WeightsKind::Float32 => "f32",
        WeightsKind::Int16 => "16-bit integers",
        WeightsKind::Other => "numbers of a kind this tool does not know",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slot_s_line_says_how_its_weights_are_stored() {
        let image = |weights| SlotContents::Image {
            model_id: 0xAB,
            version: 3,
            length: 600,
            crc: 0x1234,
            weights,
        };
        let lines = slot_lines(&Slots {
            active: Some(1),
            contents: [image(WeightsKind::Float32), image(WeightsKind::Int16)],
        });
        assert_eq!(
            lines,
            [
                "slot 0     model 000000ab version 3 in f32, 600 bytes, CRC 00001234",
                "slot 1     model 000000ab version 3 in 16-bit integers, 600 bytes, CRC 00001234 (active)",
            ]
        );
    }
}
