//! The drawn view: hand above, gripper in the middle, rates and faults below. Made for 80 × 24, grows with the window.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Paragraph, Wrap};

use super::bars::{Cell, axis, signed};
use super::view::{Axis, Finger, View, count};
use crate::stats::{seconds, short_or_dash};

const DIM: Style = Style::new().add_modifier(Modifier::DIM);
const BOLD: Style = Style::new().add_modifier(Modifier::BOLD);
const COLUMNS: [&str; 5] = ["base flex", "abduction", "twist", "middle flex", "tip flex"];

/// Draws `view` over the whole of `frame`.
pub fn draw(view: &View, frame: &mut Frame<'_>) {
    let [head, hand, gripper, numbers, faults, foot] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Length(8),
        Constraint::Length(6),
        Constraint::Length(4),
        Constraint::Min(3),
        Constraint::Length(1),
    ])
    .areas(frame.area());
    frame.render_widget(heading(view), head);
    draw_hand(view, frame, hand);
    draw_gripper(view, frame, gripper);
    frame.render_widget(rates(view), numbers);
    frame.render_widget(fault_list(view), faults);
    frame.render_widget(Line::styled(view.keys, DIM), foot);
}

fn heading(view: &View) -> Line<'_> {
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
        Span::styled(format!("{}  ", view.title), BOLD),
        Span::styled(
            format!(" {} ", view.state),
            Style::new().fg(Color::Black).bg(color),
        ),
        Span::raw(format!("  {time}")),
    ])
}

fn draw_hand(view: &View, frame: &mut Frame<'_>, area: Rect) {
    let block = Block::bordered().title("hand: joint angles, degrees");
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let column = (usize::from(inner.width).saturating_sub(8) / 5).clamp(10, 24);
    let mut lines = vec![header(column)];
    lines.extend(
        view.fingers
            .iter()
            .map(|finger| finger_line(finger, column)),
    );
    frame.render_widget(Paragraph::new(lines), inner);
}

fn header(column: usize) -> Line<'static> {
    let names: String = COLUMNS
        .iter()
        .map(|name| format!("{name:<column$}"))
        .collect();
    Line::styled(format!("{:8}{names}", ""), DIM)
}

fn finger_line(finger: &Finger, column: usize) -> Line<'_> {
    let name_style = if finger.good {
        BOLD
    } else {
        Style::new().fg(Color::Red)
    };
    let bar_style = if finger.good {
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
    let block =
        Block::bordered().title("gripper: counts, 0 open to 255 closed; ┃ asked, █ reached");
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let width = usize::from(inner.width).saturating_sub(44).clamp(10, 80);
    let lines: Vec<Line<'_>> = view
        .axes
        .iter()
        .map(|axis| axis_line(axis, width))
        .collect();
    frame.render_widget(Paragraph::new(lines), inner);
}

fn axis_line(shown: &Axis, width: usize) -> Line<'_> {
    let mut spans = vec![Span::styled(format!("{:<9}", shown.name), BOLD)];
    spans.extend(
        axis(shown.asked, shown.reached, width)
            .into_iter()
            .map(|cell| match cell {
                Cell::Empty => Span::styled("·", DIM),
                Cell::Filled => Span::styled("█", Style::new().fg(Color::Green)),
                Cell::Asked => Span::styled("┃", Style::new().fg(Color::Yellow)),
            }),
    );
    spans.push(Span::raw(format!(
        "  asked {:>3}  at {:>3}  ",
        count(shown.asked),
        count(shown.reached)
    )));
    spans.push(Span::styled(shown.word, DIM));
    Line::from(spans)
}

fn rates(view: &View) -> Paragraph<'static> {
    let block = Block::bordered().title("loop");
    let first = format!(
        "glove {:5.1} scans/s   gripper {:5.1} cycles/s   frames dropped {}",
        view.frames_per_s, view.cycles_per_s, view.dropped
    );
    let second = format!(
        "latency, sample to command: p50 {}, p99 {}   faults so far {}",
        short_or_dash(view.latency_p50),
        short_or_dash(view.latency_p99),
        view.fault_count
    );
    Paragraph::new(vec![Line::raw(first), Line::raw(second)]).block(block)
}

fn fault_list(view: &View) -> Paragraph<'_> {
    let block = Block::bordered().title("now");
    let lines: Vec<Line<'_>> = if view.faults.is_empty() {
        vec![Line::styled("all well", Style::new().fg(Color::Green))]
    } else {
        view.faults
            .iter()
            .map(|fault| Line::styled(fault.as_str(), Style::new().fg(Color::Red)))
            .collect()
    };
    Paragraph::new(lines).wrap(Wrap { trim: true }).block(block)
}
