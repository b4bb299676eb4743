//! What the two slots of a bridge hold, in words.

use host::bridge::protocol::message::{SlotContents, Slots, WeightsKind};

/// What both slots hold, a line each.
pub(in crate::commands) fn slot_lines(slots: &Slots) -> Vec<String> {
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
