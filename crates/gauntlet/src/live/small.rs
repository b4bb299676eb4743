//! The view on a small terminal: lines without boxes, what matters most first, each part whole or not at all.

use ratatui::Frame;
use ratatui::style::{Color, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::moving::Finger;
use super::parts::{BOLD, DIM, bar, fault_lines, hand_table, heading, key_lines, wrapped};
use super::view::{View, count, old};
use host::stats::short_or_dash;

/// The least terminal that shows state, faults and axes: columns, rows.
pub const LEAST: (u16, u16) = (30, 7);
/// The least columns for the table of the hand's angles.
const TABLE: u16 = 58;

/// Draws what fits.
pub(super) fn draw(view: &View, frame: &mut Frame<'_>) {
    let area = frame.area();
    let lines = if area.width < LEAST.0 || area.height < LEAST.1 {
        too_small(&view.state)
    } else {
        lines(view, area.width, area.height.into())
    };
    frame.render_widget(Paragraph::new(lines), area);
}

/// The state is said even here.
pub(super) fn too_small(state: &str) -> Vec<Line<'_>> {
    let (width, height) = LEAST;
    vec![
        Line::raw(state),
        Line::styled(
            format!("too small: {width}×{height} at least"),
            Style::new().fg(Color::Red),
        ),
    ]
}

fn lines(view: &View, width: u16, height: usize) -> Vec<Line<'_>> {
    let axes = axes(view, width);
    let keys = key_lines(&view.keys, width);
    // State, axes, and two lines for what is wrong are always there; what is left goes to the others in this order.
    let mut room = height.saturating_sub(1 + axes.len() + 2);
    let mut fit = |part: Vec<Line<'static>>| {
        if part.len() > room {
            return Vec::new();
        }
        room -= part.len();
        part
    };
    let keys = fit(keys);
    let rates = fit(rates(view, width));
    let hand = if width >= TABLE && room_for_table(view, room) {
        let table = hand_table(&view.fingers, view.hand_age.is_none(), width);
        room -= table.len();
        table
    } else if room > 0 {
        room -= 1;
        vec![hand_line(&view.fingers, view.hand_age)]
    } else {
        Vec::new()
    };
    let mut lines = vec![heading(&view.heading())];
    lines.extend(hand);
    lines.extend(axes);
    lines.extend(rates);
    lines.extend(fault_lines(&view.faults, width, 2 + room));
    lines.extend(keys);
    lines
}

fn room_for_table(view: &View, room: usize) -> bool {
    room > view.fingers.len()
}

fn axes(view: &View, width: u16) -> Vec<Line<'static>> {
    let live = view.gripper_age.is_none();
    let bars = usize::from(width).saturating_sub(40).clamp(5, 80);
    view.axes
        .iter()
        .map(|axis| {
            let mut spans = vec![Span::styled(
                format!("{:<9}", axis.name),
                if live { BOLD } else { DIM },
            )];
            spans.extend(bar(axis, bars, live));
            let numbers = format!(" {:>3}→{:<3} ", count(axis.asked), count(axis.reached));
            spans.push(Span::raw(numbers));
            spans.push(Span::styled(axis.word, DIM));
            Line::from(spans)
        })
        .collect()
}

fn rates(view: &View, width: u16) -> Vec<Line<'static>> {
    let text = format!(
        "glove {:.0}/s gripper {:.0}/s p99 {}",
        view.frames_per_s,
        view.cycles_per_s,
        short_or_dash(view.latency_p99),
    );
    let more = format!("{text} dropped {}", view.dropped);
    let text = if more.len() <= width.into() {
        more
    } else {
        text
    };
    wrapped(&text, width).into_iter().map(Line::raw).collect()
}

/// How far each finger is bent at its base, degrees.
pub(super) fn hand_line(fingers: &[Finger], age: Option<f32>) -> Line<'static> {
    let mut spans = vec![match old(age) {
        Some(age) => Span::styled(format!("{age} "), Style::new().fg(Color::Red)),
        None => Span::styled("flex ", DIM),
    }];
    for finger in fingers {
        let style = if finger.good {
            Style::new()
        } else {
            Style::new().fg(Color::Red)
        };
        let name: String = finger.name.chars().take(1).collect();
        let flex = finger.angles[0].to_degrees();
        spans.push(Span::styled(format!("{name}{flex:>3.0}° "), style));
    }
    Line::from(spans)
}
