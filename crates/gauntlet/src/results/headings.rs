//! How sure the headings of a glove's joints are, as data.

use host::glove::hand::SEGMENT_NAMES;
use host::session::snapshot::Headings;
use serde::Serialize;

/// The heading between a segment and its parent.
#[derive(Debug, Serialize)]
pub struct Joint {
    /// The segment it leads to.
    pub segment: &'static str,
    /// `sure`, `unsure` (its joint is held) or `unknown` (as well).
    pub heading: &'static str,
    /// Standard deviation; `null` where it is unknown.
    pub sigma_deg: Option<f64>,
    /// How fast it drifts.
    pub drift_deg_per_min: f64,
}

/// The headings of a glove with a profile.
pub fn joints(known: &Headings) -> Vec<Joint> {
    let rounded = |degrees: f32| (f64::from(degrees) * 100.0).round() / 100.0;
    let one = |k: usize| {
        let is_known = known.unknown >> k & 1 == 0 && known.sigma[k].is_finite();
        Joint {
            segment: SEGMENT_NAMES[k],
            heading: match (is_known, known.degraded >> k & 1) {
                (false, _) => "unknown",
                (true, 0) => "sure",
                (true, _) => "unsure",
            },
            sigma_deg: is_known.then(|| rounded(known.sigma[k].to_degrees())),
            drift_deg_per_min: rounded(known.drift[k].to_degrees() * 60.0),
        }
    };
    (1..SEGMENT_NAMES.len()).map(one).collect()
}
