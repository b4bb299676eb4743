//! What a calibration came to, for a person.

use host::glove::calibration::Verdict;
use host::glove::hand::Side;

use host::calibration::Judged;

/// What it came to, for a person.
pub(super) fn lines(judged: &Judged) -> Vec<String> {
    let findings = judged.findings();
    let hand = match judged.outcome.profile.side {
        Side::Right => "right",
        Side::Left => "left",
    };
    let quality = judged.quality();
    let verdict = match judged.verdict() {
        Verdict::Good => "good: every check holds",
        Verdict::Doubtful => "usable, with doubts",
        Verdict::Bad => "not good enough to be used",
    };
    let joints = judged.joints();
    let good = joints
        .iter()
        .filter(|joint| joint.verdict == "good")
        .count();
    let mut lines = vec![
        format!(
            "verdict    {verdict}; {good} of {} joints good, a {hand} hand",
            joints.len()
        ),
        format!(
            "checks     moved in the turn {:.1}° (6° at most), ambiguity {:.2} (0.80), last flat pose tilted {:.1}° (9°), turned {:.1}° (4°)",
            quality.fit_deg, quality.ratio, quality.tilt_deg, quality.heading_deg
        ),
    ];
    for finding in findings {
        lines.push(format!("{:<10} {}", finding.verdict, finding.what));
        lines.push(format!("  try: {}", finding.todo));
    }
    lines
}
