//! A weights image in a store of this process.

use anyhow::Result;
use bridge::WeightsStore;

use super::slots::MemorySlot;
use crate::failure::{Failure, OrFail};
use crate::lines::Model;
use crate::next::{Command, advice};

/// Whether a weights image gives as many positions as the gripper has axes.
///
/// # Errors
/// A failure that says how many it gives, and what to do.
pub fn check_image(image: &[u8], model: Model) -> Result<()> {
    // The header's number of outputs (docs/weights-image.md); whatever else is wrong with it, the store says.
    let outputs = image.get(32..36).and_then(|bytes| bytes.try_into().ok());
    match outputs.map(|bytes| u32::from_le_bytes(bytes) as usize) {
        Some(outputs) if image.starts_with(&hae::image::MAGIC) && outputs != model.axes() => {
            Err(other_shape(outputs, model).into())
        }
        _ => Ok(()),
    }
}

fn other_shape(outputs: usize, model: Model) -> Failure {
    let other = match outputs {
        1 => {
            "the same with --gripper-model 2f85, 2f140 or hande, if it is one of these; else a map for it: "
        }
        4 => "the same with --gripper-model 3f, if it is the 3-Finger; else a map for it: ",
        _ => "a map for this gripper: ",
    };
    let next = advice(other).then(Command::gauntlet("help train"));
    Failure::new(
        format!(
            "the map gives {outputs} position{}, and the {} has {} ax{}s",
            if outputs == 1 { "" } else { "s" },
            model.name(),
            model.axes(),
            if model.axes() == 1 { "i" } else { "e" },
        ),
        next,
    )
}

/// A store that holds the image, put there the way it comes over a line: begun, in chunks, committed last.
pub(crate) fn stored(image: &[u8], model: Model) -> Result<WeightsStore<MemorySlot>> {
    check_image(image, model)?;
    let expected = bridge::app::expected(model.axes());
    let mut store = WeightsStore::new([MemorySlot::new(), MemorySlot::new()], expected);
    let refused = || "the weights image was refused".to_owned();
    let next = "training the model again";
    store.begin(image.len()).or_fail(refused, next)?;
    for (index, chunk) in image.chunks(bridge::store::PAGE).enumerate() {
        store
            .chunk(index * bridge::store::PAGE, chunk)
            .or_fail(refused, next)?;
    }
    store.commit().or_fail(refused, next)?;
    Ok(store)
}
