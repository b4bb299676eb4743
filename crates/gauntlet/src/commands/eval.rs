//! `gauntlet eval`: measures a trained map.

use anyhow::Result;
use serde_json::json;

use crate::cli::Eval;
use crate::poses::Motion;
use crate::quality::{GREATEST_D_KNN, LEAST_OCCUPANCY, Quality, measuring_targets};
use crate::{model, out, say};

/// Measures.
///
/// # Errors
/// A failure that names the file and what is wrong with it.
pub(super) fn run(options: &Eval) -> Result<()> {
    let model = model::load(&options.model)?;
    let frames = Motion::open_for_measuring(&options.poses)?.frames();
    let measured_on = format!("frames of {}", options.poses.display());
    let quality = Quality::of(
        &model,
        &frames,
        &measuring_targets(options.seed),
        measured_on,
    );
    if options.json {
        return out::json(&json!({
            "model": options.model,
            "metadata": model.metadata,
            "quality": quality,
            "good": quality.good(),
        }));
    }
    say!("model              {}", options.model.display());
    say!(
        "measured on        {}, all {} frames",
        options.poses.display(),
        quality.frames
    );
    say!("mean distortion    {:.3}", quality.mean_distortion);
    say!(
        "volume occupancy   {:.3}   (good: {LEAST_OCCUPANCY} or more)",
        quality.volume_occupancy
    );
    say!(
        "d-Knn              {:.3}   (good: {GREATEST_D_KNN} or less)",
        quality.d_knn
    );
    if let Some(pairs) = model.metadata.get("pairs") {
        say!(
            "trained with       {pairs} reference pairs, seed {}, {} epochs",
            model.metadata.get("seed").map_or("?", String::as_str),
            model.metadata.get("epochs").map_or("?", String::as_str)
        );
    }
    Ok(())
}
