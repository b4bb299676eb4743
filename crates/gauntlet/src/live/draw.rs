//! The drawn view: hand above, gripper in the middle, rates and faults below. Boxes from 60 × 23 on; on a smaller
//! terminal lines without boxes, the most important first, each whole or not at all; less than [`LEAST`] is said.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Paragraph};

use super::bars::{Cell, axis, signed};
use super::small::{self, wrapped};
use super::view::{Axis, Finger, View, count, old};
use host::stats::{seconds, short_or_dash};

pub(super) const DIM: Style = Style::new().add_modifier(Modifier::DIM);
pub(super) const BOLD: Style = Style::new().add_modifier(Modifier::BOLD);
const COLUMNS: [&str; 5] = ["base flex", "abduction", "twist", "mid flex", "tip flex"];
/// The least terminal for boxes: columns, rows.
const BOXES: (u16, u16) = (60, 23);

/// Draws `view` over the whole of `frame`.
pub fn draw(view: &View, frame: &mut Frame<'_>) {
    let area = frame.area();
    if area.width < BOXES.0 || area.height < BOXES.1 {
        return small::draw(view, frame);
    }
    let keys = key_lines(view, area.width);
    let [head, hand, gripper, numbers, faults, foot] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Length(8),
        Constraint::Length(6),
        Constraint::Length(4),
        Constraint::Min(3),
        Constraint::Length(keys.len().try_into().unwrap_or(1)),
    ])
    .areas(area);
    frame.render_widget(heading(view), head);
    draw_hand(view, frame, hand);
    draw_gripper(view, frame, gripper);
    frame.render_widget(
        Paragraph::new(rates(view)).block(Block::bordered().title("loop")),
        numbers,
    );
    draw_faults(view, frame, faults);
    frame.render_widget(Paragraph::new(keys), foot);
}

/// The state first: it is what a person looks for.
pub(super) fn heading(view: &View) -> Line<'_> {
    let color = if view.following {
        Color::Green
    } else {
        Color::Yellow
    };
    let time = match view.total {
        Some(total) => format!("{} of {}", seconds(view.elapsed), seconds(total)),
        None => seconds(view.elapsed),
    };
    Line::from(vec![
        Span::styled(
            format!(" {} ", view.state),
            Style::new().fg(Color::Black).bg(color),
        ),
        Span::raw(format!("  {time}  ")),
        Span::styled(view.title.as_str(), BOLD),
    ])
}

pub(super) fn key_lines(view: &View, width: u16) -> Vec<Line<'static>> {
    wrapped(view.keys, width)
        .into_iter()
        .map(|line| Line::styled(line, DIM))
        .collect()
}

fn titled(title: &str, age: Option<f32>) -> Block<'static> {
    let block = Block::bordered();
    match old(age) {
        Some(age) => block.title(Line::styled(
            format!("{title}; {age}"),
            Style::new().fg(Color::Red),
        )),
        None => block.title(title.to_owned()),
    }
}

fn draw_hand(view: &View, frame: &mut Frame<'_>, area: Rect) {
    let block = titled("hand: joint angles, degrees", view.hand_age);
    let inner = block.inner(area);
    frame.render_widget(block, area);
    frame.render_widget(Paragraph::new(hand_table(view, inner.width)), inner);
}

/// A header, and a line for each finger.
pub(super) fn hand_table(view: &View, width: u16) -> Vec<Line<'_>> {
    let column = (usize::from(width).saturating_sub(8) / 5).clamp(10, 24);
    let mut lines = vec![header(column)];
    let live = view.hand_age.is_none();
    lines.extend(
        view.fingers
            .iter()
            .map(|finger| finger_line(finger, column, live)),
    );
    lines
}

fn header(column: usize) -> Line<'static> {
    let names: String = COLUMNS
        .iter()
        .map(|name| format!("{name:<column$}"))
        .collect();
    Line::styled(format!("{:8}{names}", ""), DIM)
}

fn finger_line(finger: &Finger, column: usize, live: bool) -> Line<'_> {
    let name_style = if finger.good {
        BOLD
    } else {
        Style::new().fg(Color::Red)
    };
    let bar_style = if finger.good && live {
        Style::new().fg(Color::Cyan)
    } else {
        Style::new().fg(Color::DarkGray)
    };
    let mut spans = vec![Span::styled(format!("{:<8}", finger.name), name_style)];
    for (angle, limits) in finger.angles.iter().zip(finger.limits) {
        let bar = signed(*angle, limits, column.saturating_sub(6));
        spans.push(Span::styled(bar, bar_style));
        spans.push(Span::raw(format!("{:>4.0}° ", angle.to_degrees())));
    }
    Line::from(spans)
}

fn draw_gripper(view: &View, frame: &mut Frame<'_>, area: Rect) {
    let block = titled(
        "gripper: counts, 0 open to 255 closed; ┃ asked, █ reached",
        view.gripper_age,
    );
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let width = usize::from(inner.width).saturating_sub(52).clamp(6, 80);
    let live = view.gripper_age.is_none();
    let lines: Vec<Line<'_>> = view
        .axes
        .iter()
        .map(|axis| axis_line(axis, width, live))
        .collect();
    frame.render_widget(Paragraph::new(lines), inner);
}

fn axis_line(shown: &Axis, width: usize, live: bool) -> Line<'_> {
    let mut spans = vec![Span::styled(format!("{:<9}", shown.name), BOLD)];
    spans.extend(bar(shown, width, live));
    spans.push(Span::raw(format!(
        "  asked {:>3}  at {:>3}  ",
        count(shown.asked),
        count(shown.reached)
    )));
    spans.push(Span::styled(shown.word, DIM));
    Line::from(spans)
}

pub(super) fn bar(shown: &Axis, width: usize, live: bool) -> impl Iterator<Item = Span<'static>> {
    let filled = if live { Color::Green } else { Color::DarkGray };
    axis(shown.asked, shown.reached, width)
        .into_iter()
        .map(move |cell| match cell {
            Cell::Empty => Span::styled("·", DIM),
            Cell::Filled => Span::styled("█", Style::new().fg(filled)),
            Cell::Asked => Span::styled("┃", Style::new().fg(Color::Yellow)),
        })
}

fn rates(view: &View) -> Vec<Line<'static>> {
    let first = format!(
        "glove {:5.1} scans/s   gripper {:5.1} cycles/s   dropped {}",
        view.frames_per_s, view.cycles_per_s, view.dropped
    );
    let second = format!(
        "sample to command: p50 {}, p99 {}   gripper faults so far {}",
        short_or_dash(view.latency_p50),
        short_or_dash(view.latency_p99),
        view.gripper_faults
    );
    vec![Line::raw(first), Line::raw(second)]
}

fn draw_faults(view: &View, frame: &mut Frame<'_>, area: Rect) {
    let block = Block::bordered().title("now");
    let inner = block.inner(area);
    frame.render_widget(block, area);
    frame.render_widget(
        Paragraph::new(fault_lines(view, inner.width, inner.height.into())),
        inner,
    );
}

/// What is wrong, in `rows` lines at most; what does not fit is counted.
pub(super) fn fault_lines(view: &View, width: u16, rows: usize) -> Vec<Line<'static>> {
    if view.faults.is_empty() {
        return vec![Line::styled("all well", Style::new().fg(Color::Green))];
    }
    let red = Style::new().fg(Color::Red);
    let faults: Vec<Vec<String>> = view
        .faults
        .iter()
        .map(|fault| wrapped(fault, width))
        .collect();
    let total: usize = faults.iter().map(Vec::len).sum();
    let room = if total > rows {
        rows.saturating_sub(1)
    } else {
        rows
    };
    let mut lines: Vec<String> = Vec::new();
    let mut shown = 0;
    for fault in &faults {
        if lines.len() + fault.len() > room && shown > 0 {
            break;
        }
        lines.extend(fault.iter().cloned());
        shown += 1;
    }
    lines.truncate(rows.max(1));
    if shown < faults.len() {
        lines.truncate(room.max(1));
        lines.push(format!("and {} more", faults.len() - shown));
        lines.truncate(rows.max(1));
    }
    lines
        .into_iter()
        .map(|line| Line::styled(line, red))
        .collect()
}
