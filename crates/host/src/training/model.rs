//! A trained model on its way into the bridge.

use std::path::Path;

use anyhow::Result;
use glove::hand::JOINT_COUNT;
use hae::image::{ALIGNMENT, Checked, JointOrder, Meta};
use hae::quantized;
use serde::Serialize;
use trainer::data::{Matrix, sha256};
use trainer::hand::Space;
use trainer::model::{Model, has_digest};

use crate::failure::{Failure, OrFail, told};
use crate::report::Reporter;
use crate::training::motion::Motion;
use crate::training::task::sorted;

/// Longest file that is looked at: a weights image has some 40 KB, a model some 500 KB.
const LONGEST_FILE: u64 = 64 << 20;
/// Counts of an axis from open to closed.
const STROKE: f32 = 255.0;

/// Weights as the bridge takes them.
#[derive(Debug, Clone, PartialEq)]
pub struct Weights {
    /// The image.
    pub image: Vec<u8>,
    /// What an image in 16-bit integers says about itself; `None` for one in f32.
    pub int16: Option<Int16>,
}

/// The largest difference of a map in 16-bit integers from its f32 map over the poses it was calibrated on.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Int16 {
    /// An axis each, counts; as stored in the image.
    pub error_counts: Vec<f32>,
    /// The largest of them as a share of the 255 counts.
    pub error_of_range: f32,
}

impl Int16 {
    /// In one line.
    pub fn line(&self) -> String {
        let space = Space::of_axes(self.error_counts.len()).unwrap_or(Space::ThreeFinger);
        let axes = self.error_counts.iter().zip(space.axis_names());
        let errors: Vec<_> = axes
            .map(|(counts, axis)| format!("{axis} {counts:.3}"))
            .collect();
        format!(
            "largest error over the calibration poses, counts: {} ({:.4} % of 255)",
            errors.join(", "),
            100.0 * self.error_of_range
        )
    }
}

/// The weights in `path`: those of a model, in 16-bit integers if poses to calibrate on are named, or a weights image as
/// it is.
///
/// # Errors
/// A failure that names the file and what is wrong with it.
pub fn weights(path: &Path, int16: Option<&Path>, reporter: &dyn Reporter) -> Result<Weights> {
    let bytes = trainer::model::read(path).map_err(told)?;
    if bytes.len() as u64 > LONGEST_FILE {
        return Err(Failure::new(
            format!(
                "{} has more bytes than any map: {}",
                path.display(),
                bytes.len()
            ),
            "a model that train made",
        )
        .into());
    }
    if bytes.starts_with(&hae::image::MAGIC) {
        if int16.is_some() {
            return Err(Failure::usage(
                format!("{} is a weights image already", path.display()),
                "--int16 with the model it was made of",
            )
            .into());
        }
        // The bridge checks it too; here it costs no minutes on the line.
        return Weights::of_image(bytes).or_fail(
            || format!("the file {}", path.display()),
            "an image that export wrote, whole",
        );
    }
    let model = hand(parsed(&bytes, path, reporter)?, path)?;
    let image = match int16 {
        None => image(&model)?,
        Some(poses) => image_int16(&model, &Motion::open(Some(poses), 0, reporter)?.frames())?,
    };
    Weights::of_image(image).or_fail(unfit, "training it again")
}

impl Weights {
    fn of_image(image: Vec<u8>) -> Result<Self, hae::image::Error> {
        // A file's bytes lie anywhere, an image starts at a multiple of 64.
        let mut aligned = vec![0; image.len() + ALIGNMENT];
        let start = aligned.as_ptr().align_offset(ALIGNMENT).min(ALIGNMENT);
        let copy = aligned
            .get_mut(start..start + image.len())
            .unwrap_or_default();
        copy.copy_from_slice(&image);
        let checked = hae::image::parse_exact(copy)?;
        let int16 = errors(copy, &checked);
        Ok(Self { image, int16 })
    }
}

fn errors(image: &[u8], checked: &Checked) -> Option<Int16> {
    let errors = quantized::errors(image, checked)?;
    let largest = errors
        .iter()
        .fold(0.0f32, |largest, error| largest.max(*error));
    Some(Int16 {
        error_counts: errors.to_vec(),
        error_of_range: largest / STROKE,
    })
}

const _: () = assert!(
    bridge::HIDDEN == trainer::network::HIDDEN,
    "the bridge runs maps of the size that the trainer makes"
);

/// Loads a model that maps 25 joint angles to the positions of a gripper with as many hidden units as the bridge runs.
///
/// # Errors
/// A failure that names the file and what is wrong with it.
pub fn load(path: &Path, reporter: &dyn Reporter) -> Result<Model> {
    hand(load_any(path, reporter)?, path)
}

/// Loads a model of any shape; says so where it carries no digest of its weights.
///
/// # Errors
/// A failure that names the file and what is wrong with it.
pub fn load_any(path: &Path, reporter: &dyn Reporter) -> Result<Model> {
    parsed(&trainer::model::read(path).map_err(told)?, path, reporter)
}

/// Whether samples did not train `model`; `None` when the model does not say.
pub fn held_out(model: &Model, samples: &Matrix) -> Option<bool> {
    let whole = model.metadata.get("input_sha256")?;
    let training = model.metadata.get("training_sha256")?;
    let is_file = *whole == sha256(&[samples]);
    let is_training_part = *training == sha256(&[&sorted(samples)]);
    Some(!is_file && !is_training_part)
}

fn parsed(bytes: &[u8], path: &Path, reporter: &dyn Reporter) -> Result<Model> {
    let mut model = Model::from_bytes(bytes, path).map_err(told)?;
    if has_digest(bytes) {
        let digest = model.weights_sha256();
        model.metadata.insert("weights_sha256".to_owned(), digest);
    } else {
        reporter.note(&format!(
            "warning: {} is of an earlier version and carries no digest of its weights: damage would not be seen; train it \
             again for one",
            path.display()
        ));
    }
    Ok(model)
}

fn hand(model: Model, path: &Path) -> Result<Model> {
    let [_, hidden, axes] = model.shape();
    // Of no gripper: told as the 3-Finger's.
    let space = Space::of_axes(axes).unwrap_or(Space::ThreeFinger);
    model
        .require_shape(path, JOINT_COUNT, space.axes())
        .map_err(told)?;
    if hidden != bridge::HIDDEN {
        return Err(Failure::new(
            format!(
                "{}: the model has {hidden} hidden units, the bridge runs {}",
                path.display(),
                bridge::HIDDEN
            ),
            "a model that train made",
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
    model
        .to_image(&meta(model))
        .or_fail(unfit, "training it again")
}

/// The weights image of `model` in 16-bit integers, calibrated on `poses` (radians, one hand pose a row).
///
/// # Errors
/// A failure where a weight is not fit for one.
pub fn image_int16(model: &Model, poses: &Matrix) -> Result<Vec<u8>> {
    let folded = model.folded();
    let parameters = folded.parameters();
    let length = quantized::encoded_len(folded.inputs, folded.hidden, folded.outputs);
    let mut image = vec![0; length];
    quantized::encode(&parameters, &poses.data, &meta(model), &mut image)
        .or_fail(unfit, "training it again")?;
    Ok(image)
}

fn unfit() -> String {
    "the model does not make a weights image".to_owned()
}

fn meta(model: &Model) -> Meta {
    Meta {
        model_id: id(model),
        version: 1,
        joint_order: JointOrder::Hand25,
    }
}

/// The first 32 bits of the digest of the data it was trained on: enough to tell models apart at a glance.
fn id(model: &Model) -> u32 {
    model
        .metadata
        .get("data_sha256")
        .and_then(|digest| u32::from_str_radix(digest.get(..8)?, 16).ok())
        .unwrap_or(0)
}
