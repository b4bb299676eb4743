//! The drawn view: hand above, gripper in the middle, rates and faults below. Boxes from 60 × 23 on; on a smaller
//! terminal lines without boxes, the most important first, each whole or not at all; less than [`LEAST`] is said.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Paragraph};

use super::headings::{self, Heading};
use super::moving::Axis;
use super::parts::{BOLD, DIM, bar, fault_lines, hand_table, heading, key_lines};
use super::small;
use super::view::{View, count, old};
use host::stats::short_or_dash;

/// The least terminal for boxes: columns, rows.
const BOXES: (u16, u16) = (60, 23);

/// The least rows for a frame around what is wrong.
const FRAMED: u16 = 5;

/// Draws `view` over the whole of `frame`.
pub fn draw(view: &View, frame: &mut Frame<'_>) {
    let area = frame.area();
    if area.width < BOXES.0 || area.height < BOXES.1 {
        return small::draw(view, frame);
    }
    let keys = key_lines(&view.keys, area.width);
    // Where there is room for them beside two lines of what is wrong.
    let room = area.height >= BOXES.1 + headings::ROWS + 2 && !view.headings.is_empty();
    let sure = if room { headings::ROWS + 2 } else { 0 };
    let [head, hand, sigma, gripper, numbers, faults, foot] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Length(8),
        Constraint::Length(sure),
        Constraint::Length(6),
        Constraint::Length(4),
        Constraint::Min(3),
        Constraint::Length(keys.len().try_into().unwrap_or(1)),
    ])
    .areas(area);
    frame.render_widget(heading(&view.heading()), head);
    draw_hand(view, frame, hand);
    if room {
        draw_headings(&view.headings, frame, sigma);
    }
    draw_gripper(view, frame, gripper);
    frame.render_widget(
        Paragraph::new(rates(view)).block(Block::bordered().title("loop")),
        numbers,
    );
    draw_faults(view, frame, faults);
    frame.render_widget(Paragraph::new(keys), foot);
}

pub(super) fn titled(title: &str, age: Option<f32>) -> Block<'static> {
    let block = Block::bordered();
    match old(age) {
        Some(age) => block.title(Line::styled(
            format!("{title}; {age}"),
            Style::new().fg(Color::Red),
        )),
        None => block.title(title.to_owned()),
    }
}

/// How sure each joint's heading is.
pub(super) fn draw_headings(headings: &[Heading], frame: &mut Frame<'_>, area: Rect) {
    let block = Block::bordered().title("headings: sigma, drift; red: its joint is held");
    let inner = block.inner(area);
    frame.render_widget(block, area);
    frame.render_widget(
        Paragraph::new(headings::table(headings, inner.width)),
        inner,
    );
}

fn draw_hand(view: &View, frame: &mut Frame<'_>, area: Rect) {
    let title = match headings::summary(&view.headings) {
        Some(sure) => format!("hand: joint angles, degrees; {sure}"),
        None => "hand: joint angles, degrees".to_owned(),
    };
    let block = titled(&title, view.hand_age);
    let inner = block.inner(area);
    frame.render_widget(block, area);
    frame.render_widget(
        Paragraph::new(hand_table(
            &view.fingers,
            view.hand_age.is_none(),
            inner.width,
        )),
        inner,
    );
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
    // On a low terminal the words of a reason count for more than a frame around them.
    let inner = if area.height < FRAMED {
        area
    } else {
        let block = Block::bordered().title("now");
        let inner = block.inner(area);
        frame.render_widget(block, area);
        inner
    };
    frame.render_widget(
        Paragraph::new(fault_lines(&view.faults, inner.width, inner.height.into())),
        inner,
    );
}
