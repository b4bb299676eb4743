//! The view of the guided calibration: what to do now and how long, a drawing, how the fingers bend, what is seen of it.

use std::time::Duration;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::Scene;
use super::bars::signed;
use super::key::Bindings;
use super::parts::{BOLD, DIM, Heading, heading, key_lines, wrapped};
use super::postures::{COLUMNS, ROWS, drawing};
use host::calibration::guide::{Ask, PARTS, Stage, plan};
use host::words::FINGER_NAMES;

/// The least terminal for the drawing: columns, rows.
const DRAWN: (u16, u16) = (56, 18);
/// A finger that is bent so far fills its bar, radians.
const WHOLE: f32 = 3.8;

/// Everything the view shows.
#[derive(Debug, Clone, PartialEq)]
pub struct GuideView {
    /// Time since the glove was opened.
    pub elapsed: Duration,
    /// What to do now.
    pub ask: Ask,
    /// How the glove is read, in a line.
    pub glove: String,
    /// What it came to, once it is over; the first line says whether it is good.
    pub end: Vec<String>,
    /// Whether that is good.
    pub good: bool,
    /// What keeps it is called, once it can be kept.
    pub keep: Option<String>,
    /// What keys do.
    pub keys: String,
}

impl GuideView {
    fn state(&self) -> &'static str {
        match self.ask.stage {
            Stage::Waiting => "ready to begin",
            Stage::Ready(_) => "get ready",
            Stage::Doing(_) if self.ask.counts => "measuring",
            Stage::Doing(_) => "go on",
            Stage::Over => "done",
        }
    }

    fn seconds_left(&self) -> u64 {
        self.ask.left.as_ticks().div_ceil(1_000_000)
    }

    /// What to do, a line each.
    fn prompt(&self, width: u16) -> Vec<Line<'static>> {
        let ask = &self.ask;
        let what = match ask.stage {
            Stage::Waiting => {
                format!(
                    "Wear the glove, sit at a table with room for the hand, and press {}.",
                    Bindings::name(Bindings::load().clutch)
                )
            }
            Stage::Over => return Vec::new(),
            _ => plan::words(ask.step).to_owned(),
        };
        let mut lines: Vec<Line<'static>> = wrapped(&what, width)
            .into_iter()
            .map(|line| Line::styled(line, BOLD))
            .collect();
        if let Some(way) = ask.turning {
            let style = Style::new().fg(Color::Black).bg(Color::Cyan);
            lines.push(Line::styled(format!(" {way} "), style));
        }
        lines
    }

    /// Where in the session it is, and a bar of the time that is left.
    fn gauge(&self, width: u16) -> Line<'static> {
        let ask = &self.ask;
        let place = format!("{:>2} of {PARTS}  {:<15}", ask.number, plan::name(ask.step));
        let left = match ask.stage {
            Stage::Ready(_) => format!(" begins in {} s", self.seconds_left()),
            Stage::Doing(_) => format!(" {:>2} s", self.seconds_left()),
            Stage::Waiting | Stage::Over => String::new(),
        };
        let room = usize::from(width).saturating_sub(place.len() + 16);
        let share = ask.left.as_ticks() as f64 / ask.of.as_ticks().max(1) as f64;
        let cells = (share.clamp(0.0, 1.0) * room as f64).round() as usize;
        let color = if ask.counts {
            Color::Green
        } else {
            Color::Yellow
        };
        Line::from(vec![
            Span::raw(place),
            Span::styled("█".repeat(cells), Style::new().fg(color)),
            Span::styled("·".repeat(room.saturating_sub(cells)), DIM),
            Span::raw(left),
        ])
    }

    fn fingers(&self, width: u16) -> Vec<Line<'static>> {
        let bar = usize::from(width).saturating_sub(14).clamp(4, 30);
        let mut lines = vec![Line::styled("bent by, at the tip", DIM)];
        for (name, bend) in FINGER_NAMES.iter().zip(self.ask.bends) {
            lines.push(Line::from(vec![
                Span::styled(format!("{name:<7}"), BOLD),
                Span::styled(
                    signed(bend, (0.0, WHOLE), bar),
                    Style::new().fg(Color::Cyan),
                ),
                Span::raw(format!("{:>4.0}°", bend.to_degrees())),
            ]));
        }
        if let Some(ratio) = self.ask.ratio {
            let enough = ratio <= host::glove::calibration::checks::RATIO_DOUBTFUL;
            let color = if enough { Color::Green } else { Color::Yellow };
            // Nothing is turned at 1, enough at 0.80, all of it at about 0.55.
            let turned = ((1.0 - ratio) / 0.45).clamp(0.0, 1.0);
            lines.push(Line::from(vec![
                Span::styled(format!("{:<7}", "turned"), BOLD),
                Span::styled(signed(turned, (0.0, 1.0), bar), Style::new().fg(color)),
            ]));
        }
        lines
    }

    fn remarks(&self, width: u16) -> Vec<Line<'static>> {
        if self.ask.stage == Stage::Over {
            let lines = self.end.iter().enumerate().flat_map(|(i, text)| {
                let style = match (i, self.good) {
                    (0, true) => Style::new().fg(Color::Green),
                    (0, false) => Style::new().fg(Color::Red),
                    _ => Style::new(),
                };
                wrapped(text, width)
                    .into_iter()
                    .map(move |line| Line::styled(line, style))
            });
            return lines.collect();
        }
        let lines = self.ask.remarks.iter().flat_map(|remark| {
            let color = if remark.is_good() {
                Color::Green
            } else {
                Color::Yellow
            };
            let lines = wrapped(&remark.to_string(), width);
            lines
                .into_iter()
                .map(move |line| Line::styled(line, Style::new().fg(color)))
        });
        lines.collect()
    }

    fn draw_posture(&self, frame: &mut Frame<'_>, area: Rect) {
        let halves = Layout::horizontal([Constraint::Length(COLUMNS + 2), Constraint::Fill(1)]);
        let [left, right] = halves.areas(area);
        let drawn = drawing(self.ask.step, self.ask.turning);
        frame.render_widget(Paragraph::new(drawn), left);
        frame.render_widget(Paragraph::new(self.fingers(right.width)), right);
    }
}

impl Scene for GuideView {
    const LEGEND: &'static str =
        "           a line a second: the step, the time that is left of it, what is seen";

    fn draw(&self, frame: &mut Frame<'_>) {
        let area = frame.area();
        let drawn =
            area.width >= DRAWN.0 && area.height >= DRAWN.1 && self.ask.stage != Stage::Over;
        let keys = key_lines(&self.keys, area.width);
        let prompt = self.prompt(area.width);
        let length = |lines: usize| Constraint::Length(lines.try_into().unwrap_or(u16::MAX));
        let gap = u16::from(drawn);
        let [head, gauge, _, asked, _, posture, remarks, rates, foot] = Layout::vertical([
            Constraint::Length(1),
            Constraint::Length(1),
            Constraint::Length(gap),
            length(prompt.len()),
            Constraint::Length(gap),
            Constraint::Length(if drawn { ROWS } else { 0 }),
            Constraint::Min(1),
            Constraint::Length(gap),
            length(keys.len()),
        ])
        .areas(area);
        let shown = Heading {
            title: "gauntlet calibrate",
            state: self.state(),
            good: self.ask.counts || (self.ask.stage == Stage::Over && self.good),
            elapsed: self.elapsed,
            total: None,
        };
        frame.render_widget(heading(&shown), head);
        frame.render_widget(self.gauge(area.width), gauge);
        frame.render_widget(Paragraph::new(prompt), asked);
        if drawn {
            self.draw_posture(frame, posture);
        }
        frame.render_widget(Paragraph::new(self.remarks(area.width)), remarks);
        frame.render_widget(Line::styled(self.glove.clone(), DIM), rates);
        frame.render_widget(Paragraph::new(keys), foot);
    }

    fn line(&self) -> String {
        let remarks: Vec<String> = self.ask.remarks.iter().map(ToString::to_string).collect();
        format!(
            "{:>2} of {PARTS}  {:<15}{:>3} s  {}",
            self.ask.number,
            plan::name(self.ask.step),
            self.seconds_left(),
            remarks.join("; ")
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use host::calibration::guide::Remark;
    use host::glove::calibration::Step;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    fn view() -> GuideView {
        let us = host::glove::Duration::from_ticks;
        GuideView {
            elapsed: Duration::from_secs(9),
            ask: Ask {
                stage: Stage::Doing(host::glove::Instant::from_ticks(0)),
                step: Step::Turn,
                number: 2,
                left: us(6_100_000),
                of: us(13_000_000),
                turning: Some("fingers up"),
                counts: true,
                remarks: vec![Remark::TurnFurther(0.91)],
                bends: [0.1, 0.2, 0.3, 0.4, 0.5],
                ratio: Some(0.91),
            },
            glove: "16 of 16 sensors, 35.0 scans/s".to_owned(),
            end: Vec::new(),
            good: false,
            keep: None,
            keys: "space: begin   r: this step again   q: end".to_owned(),
        }
    }

    fn drawn(view: &GuideView, width: u16, height: u16) -> String {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| view.draw(frame)).unwrap();
        terminal.backend().to_string()
    }

    #[test]
    fn what_to_do_where_to_how_long_and_what_is_seen_are_on_an_80_by_24_terminal() {
        let text = drawn(&view(), 80, 24);
        for part in [
            "measuring",
            "2 of 12  turn",
            "7 s",
            "flat like a board",
            "fingers up",
            "arm",
            "little",
            "turned",
            "turn further, all ways (0.91",
            "35.0 scans/s",
            "r: this step again",
        ] {
            assert!(text.contains(part), "{part} is missing in\n{text}");
        }
    }

    #[test]
    fn on_a_small_terminal_the_prompt_and_the_remark_are_there_and_no_size_breaks_it() {
        let text = drawn(&view(), 40, 12);
        for part in ["2 of 12", "flat like a", "fingers up", "turn further"] {
            assert!(text.contains(part), "{part} is missing in\n{text}");
        }
        // Where there is room for the drawing and the values they are there.
        let text = drawn(&view(), 60, 20);
        for part in ["arm", "little", "turned", "turn further"] {
            assert!(text.contains(part), "{part} is missing in\n{text}");
        }
        for (width, height) in [(1, 1), (20, 5), (300, 100)] {
            drawn(&view(), width, height);
        }
    }

    #[test]
    fn the_end_says_what_it_came_to() {
        let mut view = view();
        view.ask.stage = Stage::Over;
        view.end = vec!["good: every check holds".to_owned(), "kept".to_owned()];
        let text = drawn(&view, 80, 24);
        assert!(
            text.contains("good: every check holds") && text.contains("kept"),
            "{text}"
        );
    }
}
