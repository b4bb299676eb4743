//! What the drawn view has on any terminal: the state, the hand's table, an axis's bar, what is wrong, the keys.

use std::time::Duration;

use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};

use super::bars::{Cell, axis, signed};
use super::moving::{Axis, Finger};
use host::stats::seconds;

pub(super) const DIM: Style = Style::new().add_modifier(Modifier::DIM);
pub(super) const BOLD: Style = Style::new().add_modifier(Modifier::BOLD);
const COLUMNS: [&str; 5] = ["base flex", "abduction", "twist", "mid flex", "tip flex"];

/// What stands above everything.
pub(super) struct Heading<'a> {
    pub title: &'a str,
    pub state: &'a str,
    /// All is as it should be.
    pub good: bool,
    pub elapsed: Duration,
    pub total: Option<Duration>,
}

/// The state first: it is what a person looks for.
pub(super) fn heading<'a>(shown: &Heading<'a>) -> Line<'a> {
    let color = if shown.good {
        Color::Green
    } else {
        Color::Yellow
    };
    let time = match shown.total {
        Some(total) => format!("{} of {}", seconds(shown.elapsed), seconds(total)),
        None => seconds(shown.elapsed),
    };
    Line::from(vec![
        Span::styled(
            format!(" {} ", shown.state),
            Style::new().fg(Color::Black).bg(color),
        ),
        Span::raw(format!("  {time}  ")),
        Span::styled(shown.title, BOLD),
    ])
}

pub(super) fn key_lines(keys: &str, width: u16) -> Vec<Line<'static>> {
    wrapped(keys, width)
        .into_iter()
        .map(|line| Line::styled(line, DIM))
        .collect()
}

/// A header, and a line for each finger; `live`: the angles are of now.
pub(super) fn hand_table(fingers: &[Finger], live: bool, width: u16) -> Vec<Line<'_>> {
    let column = (usize::from(width).saturating_sub(8) / 5).clamp(10, 24);
    let mut lines = vec![header(column)];
    lines.extend(
        fingers
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

/// What is wrong, in `rows` lines at most; what does not fit is counted.
pub(super) fn fault_lines(faults: &[String], width: u16, rows: usize) -> Vec<Line<'static>> {
    if faults.is_empty() {
        return vec![Line::styled("all well", Style::new().fg(Color::Green))];
    }
    let red = Style::new().fg(Color::Red);
    let faults: Vec<Vec<String>> = faults.iter().map(|fault| wrapped(fault, width)).collect();
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

/// `text` in lines of at most `width` columns, broken between words; a longer word is broken where it must be.
pub(super) fn wrapped(text: &str, width: u16) -> Vec<String> {
    let width = usize::from(width).max(1);
    let mut lines: Vec<String> = Vec::new();
    let mut line = String::new();
    let mut length = 0;
    for word in text.split_inclusive(' ') {
        let letters = word.trim_end().chars().count();
        if length > 0 && length + letters > width {
            lines.push(std::mem::take(&mut line).trim_end().to_owned());
            length = 0;
        }
        for letter in word.chars() {
            if length == width && letter != ' ' {
                lines.push(std::mem::take(&mut line));
                length = 0;
            }
            if length < width {
                line.push(letter);
                length += 1;
            }
        }
    }
    lines.push(line.trim_end().to_owned());
    lines
}
