//! `gauntlet flash`: weights into a bridge on a chip.

use anyhow::Result;
use bridge::protocol::message::{SlotContents, Slots, WeightsKind};
use serde::Serialize;

use crate::cli::Flash;
use crate::progress::Person;
use crate::progress::Progress;
use crate::tell::Tell;
use crate::{out, reading};
use host::chip::link::{Flashed, HostLink};
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::training::model::{self, Int16};

/// Writes the file's weights into the bridge.
///
/// # Errors
/// A failure that names the file, the line, or what the bridge refuses.
pub(super) fn run(options: &Flash, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.json);
    let weights = reading::ended_by(interrupt, "what is to be written", || {
        model::weights(&options.file, options.int16.as_deref(), &Person)
    })?;
    if let Some(int16) = &weights.int16 {
        tell.say(format_args!("int16      {}", int16.line()));
    }
    let mut link = HostLink::connect(&options.bridge).map_err(Failure::from)?;
    let flashed = flash(&mut link, &weights.image, &tell, interrupt)?;
    if options.json {
        return out::json(&Told {
            flashed: &flashed,
            int16: weights.int16.as_ref(),
        });
    }
    slot_lines(&flashed.slots)
        .iter()
        .for_each(|line| tell.say(format_args!("{line}")));
    Ok(())
}

/// The result as JSON.
#[derive(Serialize)]
struct Told<'a> {
    #[serde(flatten)]
    flashed: &'a Flashed,
    /// `null` for an image in f32.
    int16: Option<&'a Int16>,
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
