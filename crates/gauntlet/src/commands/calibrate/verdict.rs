//! What a calibration came to, for a person.

use host::glove::calibration::{Verdict, checks};
use host::glove::hand::{SEGMENT_COUNT, Side};

use host::calibration::Judged;

/// The value that comes nearest to the limit of its segment, and that limit, degrees: limits differ by segment.
fn nearest(values: &[f32; SEGMENT_COUNT], limit: impl Fn(usize) -> f32) -> (f32, f32) {
    let all = (0..SEGMENT_COUNT).map(|k| (values[k].abs(), limit(k)));
    let most = all.max_by(|(a, of_a), (b, of_b)| (a / of_a).total_cmp(&(b / of_b)));
    let (value, limit) = most.unwrap_or_default();
    (value.to_degrees(), limit.to_degrees())
}

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
        Verdict::Doubtful => "doubtful, and usable",
        Verdict::Bad => "not good enough to be used",
    };
    let checks = &judged.outcome.checks;
    let (tilt, tilt_limit) = nearest(&checks.tilt, checks::tilt_limit);
    let (turn, turn_limit) = nearest(&checks.innovation, checks::innovation_limit);
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
            "checks     moved in the turn {:.1}° (6° at most), ambiguity {:.2} (0.80), last flat pose tilted {tilt:.1}° ({tilt_limit:.0}°), turned {turn:.1}° ({turn_limit:.0}°)",
            quality.fit_deg, quality.ratio
        ),
    ];
    for finding in findings {
        lines.push(format!("{:<10} {}", finding.verdict, finding.what));
        lines.push(format!("  try: {}", finding.todo));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_shown_with_the_limit_of_its_own_segment() {
        let mut tilt = [0f32; SEGMENT_COUNT];
        // Within the thumb's 14°, and beyond the 9° of others.
        tilt[2] = 10f32.to_radians();
        tilt[5] = 5f32.to_radians();
        let (value, limit) = nearest(&tilt, checks::tilt_limit);
        assert_eq!((value.round(), limit.round()), (10.0, 14.0));
        // Nearer to its limit, though smaller.
        tilt[5] = 8.5f32.to_radians();
        let (value, limit) = nearest(&tilt, checks::tilt_limit);
        assert!(
            (value - 8.5).abs() < 0.01 && limit.round() == 9.0,
            "{value} {limit}"
        );
    }
}
