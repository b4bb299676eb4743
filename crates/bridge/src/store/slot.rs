//! What a slot holds, read from its mapped bytes.

use super::record::{self, Record};
use super::{Contents, Error, Expected, Image, PAGE};
use crate::board::Slot;
use hae::image::{self, Checked};

/// Whether the store can work with this flash.
pub(super) fn fits<F: Slot>(slot: &F) -> bool {
    let (unit, block, capacity) = (F::WRITE_SIZE, F::ERASE_SIZE, slot.capacity());
    unit.is_power_of_two()
        && unit <= PAGE
        && block >= stride::<F>()
        && block.is_multiple_of(stride::<F>())
        && capacity >= 2 * block
        && capacity.is_multiple_of(block)
        && u32::try_from(capacity).is_ok()
        && slot.mapped().len() >= capacity
}

/// Distance between records: each has a program unit of its own.
pub(super) const fn stride<F: Slot>() -> usize {
    if F::WRITE_SIZE > record::LEN {
        F::WRITE_SIZE
    } else {
        record::LEN
    }
}

/// Start and end of the records: the slot's last erase block.
pub(super) fn records<F: Slot>(slot: &F) -> (usize, usize) {
    let end = slot.capacity();
    (end.saturating_sub(F::ERASE_SIZE), end)
}

pub(super) fn is_erased(bytes: Option<&[u8]>) -> bool {
    bytes.is_some_and(|bytes| {
        let (words, rest) = bytes.as_chunks::<4>();
        words.iter().all(|word| *word == [0xFF; 4]) && rest.iter().all(|&byte| byte == 0xFF)
    })
}

/// The full check of an image at the start of `bytes`.
fn check(bytes: &[u8], expected: &Expected) -> Result<Checked, Error> {
    let checked = image::parse(bytes).map_err(Error::Image)?;
    fits_bridge(&checked, expected)?;
    Ok(checked)
}

/// Whether a sound image is one for this bridge.
pub(super) fn fits_bridge(checked: &Checked, expected: &Expected) -> Result<(), Error> {
    let found = [checked.inputs, checked.hidden, checked.outputs];
    if found != expected.shape {
        return Err(Error::Shape {
            found,
            expected: expected.shape,
        });
    }
    if checked.meta.joint_order != expected.joint_order {
        return Err(Error::JointOrder {
            found: checked.meta.joint_order,
            expected: expected.joint_order,
        });
    }
    Ok(())
}

/// The slot's valid record with the highest sequence.
pub(super) fn newest_record<F: Slot>(slot: &F) -> Option<Record> {
    if !fits(slot) {
        return None;
    }
    let (start, end) = records(slot);
    (start..end)
        .step_by(stride::<F>())
        .filter_map(|at| Record::parse(slot.mapped().get(at..at + record::LEN)?))
        .max_by_key(|record| record.sequence)
}

/// What a slot holds.
pub(super) fn inspect<F: Slot>(index: usize, slot: &F, expected: &Expected) -> Contents {
    let Some(record) = newest_record(slot) else {
        return Contents::Empty;
    };
    let (start, _) = records(slot);
    // The records are no part of an image.
    match check(slot.mapped().get(..start).unwrap_or_default(), expected) {
        Ok(checked) if checked.length as u32 == record.length && checked.crc == record.crc => {
            Contents::Whole(Image {
                checked,
                sequence: record.sequence,
            })
        }
        Ok(_) => Contents::Damaged(Error::NoImage { slot: index }),
        Err(error) => Contents::Damaged(error),
    }
}
