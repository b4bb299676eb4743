//! How sure the heading of each joint is, how fast it drifts, and which are held because of it.

use host::glove::hand::SEGMENT_COUNT;
use ratatui::style::{Color, Style};
use ratatui::text::{Line, Span};

use super::parts::{BOLD, DIM};
use host::session::snapshot::Headings;
use host::words::FINGER_NAMES;

/// The joints of a finger, from its base.
const COLUMNS: [&str; 3] = ["base", "mid", "tip"];

/// The heading between a segment and its parent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Heading {
    /// How sure it is: standard deviation, degrees; `None` where it is not known.
    pub sigma: Option<f32>,
    /// How fast it drifts, degrees a minute.
    pub drift: f32,
    /// It is not known, or not sure enough: its joint is held.
    pub held: bool,
}

/// Those of the segments from the thumb's metacarpal on; none without a profile.
pub fn of(known: Option<Headings>) -> Vec<Heading> {
    let Some(known) = known else {
        return Vec::new();
    };
    let one = |k: usize| {
        let is_known = known.unknown >> k & 1 == 0 && known.sigma[k].is_finite();
        Heading {
            sigma: is_known.then(|| known.sigma[k].to_degrees()),
            drift: known.drift[k].to_degrees() * 60.0,
            held: !is_known || known.degraded >> k & 1 == 1,
        }
    };
    (1..SEGMENT_COUNT).map(one).collect()
}

/// In a few words; `None` where there are none.
pub(super) fn summary(headings: &[Heading]) -> Option<String> {
    let known = || headings.iter().filter_map(|heading| heading.sigma);
    let least = known().reduce(f32::min)?;
    let most = known().reduce(f32::max)?;
    let held = headings.iter().filter(|heading| heading.held).count();
    let held = match held {
        0 => String::new(),
        held => format!(", {held} held"),
    };
    Some(format!("headings ±{least:.1}° to ±{most:.1}°{held}"))
}

/// Rows of [`table`].
pub(super) const ROWS: u16 = 6;

/// A header, and a line for each finger.
pub(super) fn table(headings: &[Heading], width: u16) -> Vec<Line<'static>> {
    let column = (usize::from(width).saturating_sub(8) / 3).clamp(16, 30);
    let names: String = COLUMNS
        .iter()
        .map(|name| format!("{name:<column$}"))
        .collect();
    let mut lines = vec![Line::styled(format!("{:8}{names}", ""), DIM)];
    for (finger, joints) in FINGER_NAMES.iter().zip(headings.chunks(COLUMNS.len())) {
        let mut spans = vec![Span::styled(format!("{finger:<8}"), BOLD)];
        spans.extend(joints.iter().map(|joint| cell(joint, column)));
        lines.push(Line::from(spans));
    }
    lines
}

/// With its sign, and nothing has one after the point.
fn signed(value: f32) -> String {
    let text = format!("{value:+.1}");
    if text == "-0.0" {
        "+0.0".to_owned()
    } else {
        text
    }
}

fn cell(joint: &Heading, column: usize) -> Span<'static> {
    let text = match joint.sigma {
        Some(sigma) => format!("±{sigma:.1}° {}°/min", signed(joint.drift)),
        None => "not known".to_owned(),
    };
    let style = match joint.held {
        true => Style::new().fg(Color::Red),
        false => Style::new(),
    };
    Span::styled(format!("{text:<column$}"), style)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known() -> Headings {
        let mut known = Headings {
            sigma: [0.02; SEGMENT_COUNT],
            drift: [0.000_2; SEGMENT_COUNT],
            degraded: 1 << 2,
            unknown: 1 << 15,
            poses: 1,
            pose: None,
        };
        known.sigma[2] = 0.1;
        known
    }

    #[test]
    fn a_drift_that_rounds_to_nothing_is_not_negative() {
        assert_eq!([-0.04, 0.04, -0.06].map(signed), ["+0.0", "+0.0", "-0.1"]);
    }

    #[test]
    fn each_joint_has_its_sigma_and_drift_and_what_is_not_sure_is_held() {
        let headings = of(Some(known()));
        assert_eq!(headings.len(), 15);
        let text: Vec<String> = table(&headings, 78).iter().map(Line::to_string).collect();
        assert_eq!(text.len(), usize::from(ROWS));
        assert!(text[1].contains("±1.1° +0.7°/min"), "{text:?}");
        assert!(text[5].trim_end().ends_with("not known"), "{text:?}");
        let held: Vec<usize> = (0..15).filter(|k| headings[*k].held).collect();
        assert_eq!(held, [1, 14]);
        assert_eq!(
            summary(&headings).as_deref(),
            Some("headings ±1.1° to ±5.7°, 2 held")
        );
        assert_eq!(summary(&of(None)), None);
    }
}
