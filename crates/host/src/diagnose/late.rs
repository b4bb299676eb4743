//! Answers that come late, told with the patience that helps.

use std::time::Duration;

use super::{Findings, Place};

/// Tells of answers that came `middle` and at most `worst` after their questions, later than they are waited for at `place`. `more`
/// stands behind the numbers, `without` is what helps besides patience. Returns the patience that is needed where most are too late.
pub fn tell(
    (place, title): (&Place<'_>, &'static str),
    (middle, worst): (Duration, Duration),
    (more, without): (&str, &str),
    findings: &mut Findings,
) -> Option<Duration> {
    let patience = place.patience();
    let needed = enough(worst);
    let what = format!(
        "answers come late: {} ms after the question, {} ms at most, where {} ms are waited for{more}",
        middle.as_millis(),
        worst.as_millis(),
        patience.as_millis()
    );
    let next = place.with_patience(needed).command("gripper status");
    let next = next.then(format!(" (teleop takes --patience too); {without}"));
    if middle <= patience {
        findings.note(title, what, next);
        return None;
    }
    findings.wrong(title, what, next);
    Some(needed)
}

/// A patience with which answers `worst` late are in time: half more, in tens of milliseconds.
fn enough(worst: Duration) -> Duration {
    let millis = u64::try_from(worst.as_millis()).unwrap_or(u64::MAX);
    Duration::from_millis((millis.saturating_mul(3) / 20 + 1).saturating_mul(10))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_patience_advised_is_half_more_than_what_was_seen() {
        let advised = |ms| enough(Duration::from_millis(ms)).as_millis();
        assert_eq!([advised(30), advised(31), advised(200)], [50, 50, 310]);
    }
}
