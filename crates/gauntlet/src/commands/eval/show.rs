//! What `eval` prints for a person.

use std::path::Path;

use host::trainer::model::Model;

use crate::say;
use host::training::judgement::Judgement;
use host::training::quality::Measured;

/// The measures of a hand's map.
pub(super) fn hand(file: &Path, model: &Model, judgement: &Judgement) {
    let quality = &judgement.quality;
    say!("model              {}", file.display());
    say!(
        "measured on        {} {}",
        quality.frames,
        quality.measured_on
    );
    say!("mean distortion    {:.3}", quality.mean_distortion);
    say!(
        "volume occupancy   {:.3}   (good: {} or more)",
        quality.volume_occupancy,
        quality.bar.volume_occupancy
    );
    let bar = quality
        .bar
        .d_knn
        .map_or_else(String::new, |most| format!("   (good: {most} or less)"));
    say!("d-Knn              {:.3}{bar}", quality.d_knn);
    say!("verdict            {judgement}");
    if let Some(advice) = judgement.advice() {
        say!("  try: {advice}");
    }
    trained_with(model);
}

/// The measures of a map between any two domains, on the samples in `input`.
pub(super) fn domains(file: &Path, model: &Model, input: &Path, measured: &Measured) {
    let or_dash = |value: Option<f64>| value.map_or("—".to_owned(), |v| format!("{v:.3}"));
    say!("model              {}", file.display());
    say!(
        "measured on        {}, all {} rows; {} true pairs",
        input.display(),
        measured.samples,
        measured.true_pairs
    );
    say!("mean distortion    {:.3}", measured.mean_distortion);
    say!("volume occupancy   {}", or_dash(measured.volume_occupancy));
    say!("d-Knn              {:.3}", measured.d_knn);
    say!("NMSE               {}", or_dash(measured.nmse));
    for line in &measured.unknown {
        say!("                   {line}");
    }
    trained_with(model);
}

fn trained_with(model: &Model) {
    if let Some(pairs) = model.metadata.get("pairs") {
        let known = |key: &str| model.metadata.get(key).map_or("?", String::as_str);
        say!(
            "trained with       cost {}, {pairs} reference pairs, seed {}, {} epochs",
            known("cost"),
            known("seed"),
            known("epochs")
        );
    }
}
