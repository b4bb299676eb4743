//! A trained model on its way into the bridge.

use std::path::Path;

use anyhow::Result;
use glove::hand::JOINT_COUNT;
use hae::image::{JointOrder, Meta};
use trainer::model::Model;

use crate::failure::{Failure, OrFail, told};
use crate::record::AXES;

/// Loads a model that maps 25 joint angles to the gripper's 4 positions with as many hidden units as the bridge runs.
///
/// # Errors
/// A failure that names the file and what is wrong with it.
pub fn load(path: &Path) -> Result<Model> {
    let model = Model::load_for(path, JOINT_COUNT, AXES).map_err(told)?;
    let [_, hidden, _] = model.shape();
    if hidden != bridge::HIDDEN {
        return Err(Failure::new(
            format!(
                "{}: the model has {hidden} hidden units, the bridge runs {}",
                path.display(),
                bridge::HIDDEN
            ),
            "a model that `gauntlet train` made",
        )
        .into());
    }
    Ok(model)
}

/// The weights image of `model`.
///
/// # Errors
/// A failure where a weight is not fit for one.
pub fn image(model: &Model) -> Result<Vec<u8>> {
    let meta = Meta {
        model_id: id(model),
        version: 1,
        joint_order: JointOrder::Hand25,
    };
    model.to_image(&meta).or_fail(
        || "the model does not make a weights image".to_owned(),
        "training it again",
    )
}

/// The first 32 bits of the digest of the data it was trained on: enough to tell models apart at a glance.
fn id(model: &Model) -> u32 {
    model
        .metadata
        .get("data_sha256")
        .and_then(|digest| u32::from_str_radix(digest.get(..8)?, 16).ok())
        .unwrap_or(0)
}
