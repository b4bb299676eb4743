//! The view of a live training: the gripper pose to mimic, the live hand, how long to hold on.

use std::time::Duration;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;
use ratatui::widgets::canvas::{Canvas, Line as Stroke};

use charts::{Sketch, hand_gripper};
use host::glove::hand::JOINT_COUNT;
use host::stats::seconds;
use host::teaching::{Ask, FreeAsk, Stage, State};

use super::Scene;
use super::bars::signed;
use super::parts::{BOLD, DIM, key_lines, wrapped};

/// The least terminal for the drawings: columns, rows.
const DRAWN: (u16, u16) = (60, 20);

/// What is done.
#[derive(Debug, Clone, PartialEq)]
pub enum Doing {
    /// The free motion.
    Free(FreeAsk),
    /// The poses.
    Poses(Ask),
}

/// Everything the view shows.
#[derive(Debug, Clone, PartialEq)]
pub struct TeachView {
    /// Time since the session began.
    pub elapsed: Duration,
    /// What is done.
    pub doing: Doing,
    /// The pose to mimic, in words.
    pub words: String,
    /// The gripper drawn: the pose to mimic, or what the map makes of the hand; none for other targets.
    pub gripper: Option<Vec<f32>>,
    /// The target's axes: name, value, range.
    pub axes: Vec<(String, f32, (f32, f32))>,
    /// The hand as it is, radians.
    pub hand: [f32; JOINT_COUNT],
    /// What was said last, and whether it is good news.
    pub said: Option<(String, bool)>,
    /// How the glove is read, in a line.
    pub glove: String,
    /// What keys do.
    pub keys: &'static str,
}

impl TeachView {
    fn place(&self) -> String {
        match &self.doing {
            Doing::Free(ask) => format!("movement {} of {}", ask.number, ask.of),
            Doing::Poses(ask) => format!("pose {} of {}", ask.number, ask.of),
        }
    }

    /// What to do now, and its colour.
    pub fn state(&self) -> (String, Color) {
        let Doing::Poses(ask) = &self.doing else {
            return ("move".to_owned(), Color::Cyan);
        };
        match ask.state {
            State::Choosing => ("choosing a pose".to_owned(), Color::Yellow),
            State::Asking(Stage::Reading) => ("look".to_owned(), Color::Cyan),
            State::Asking(Stage::Movement) => ("show this pose".to_owned(), Color::Cyan),
            State::Asking(Stage::Stillness) => ("hold still".to_owned(), Color::Yellow),
            State::Asking(Stage::Holding(share)) => {
                (format!("hold {}", count(share)), Color::Green)
            }
            State::Asking(Stage::Unseen) => ("no hand seen".to_owned(), Color::Red),
            State::Refused(_) => ("not taken".to_owned(), Color::Red),
            State::Trying => ("try the map".to_owned(), Color::Green),
            State::Finished => ("done".to_owned(), Color::Green),
        }
    }

    /// How much of the hold, or of the movement, is over.
    fn share(&self) -> f64 {
        match &self.doing {
            Doing::Free(ask) => 1.0 - ask.left.as_secs_f64() / ask.time.as_secs_f64().max(0.001),
            Doing::Poses(Ask {
                state: State::Asking(Stage::Holding(share)),
                ..
            }) => f64::from(*share),
            Doing::Poses(_) => 0.0,
        }
    }

    fn gauge(&self, width: u16) -> Line<'static> {
        let room = usize::from(width);
        let cells = (self.share() * room as f64).round() as usize;
        Line::from(vec![
            Span::styled("█".repeat(cells.min(room)), Style::new().fg(Color::Green)),
            Span::styled("·".repeat(room.saturating_sub(cells)), DIM),
        ])
    }

    /// What to do, in words.
    pub fn prompt(&self) -> String {
        match &self.doing {
            Doing::Free(ask) => format!(
                "{} ({} s; {} s of it all)",
                ask.ask,
                ask.left.as_secs() + 1,
                ask.all_left.as_secs() + 1
            ),
            Doing::Poses(ask) => match (ask.state, ask.start) {
                (State::Trying, _) => {
                    "move the hand: this is what the map makes of it so far".to_owned()
                }
                (State::Choosing | State::Finished, _) => String::new(),
                (_, Some(0)) => format!("open your hand, as you will for this: {}", self.words),
                (_, Some(_)) => format!("make a fist, as you will for this: {}", self.words),
                (_, None) => format!("mimic with your hand: {}", self.words),
            },
        }
    }

    fn bars(&self, width: u16) -> Vec<Line<'static>> {
        let bar = usize::from(width).saturating_sub(16).clamp(4, 30);
        let line = |(name, value, range): &(String, f32, (f32, f32))| {
            Line::from(vec![
                Span::styled(format!("{name:<9}"), BOLD),
                Span::styled(signed(*value, *range, bar), Style::new().fg(Color::Yellow)),
                Span::raw(format!("{value:>5.0}")),
            ])
        };
        self.axes.iter().map(line).collect()
    }

    fn bends(&self, width: u16) -> Vec<Line<'static>> {
        let bar = usize::from(width).saturating_sub(16).clamp(4, 30);
        let names = host::words::FINGER_NAMES.iter().enumerate();
        let line = |(digit, name): (usize, &&str)| {
            let of = |k: usize| self.hand[5 * digit + k];
            let bend = of(0) + of(3) + of(4);
            Line::from(vec![
                Span::styled(format!("{name:<9}"), BOLD),
                Span::styled(signed(bend, (0.0, 4.0), bar), Style::new().fg(Color::Cyan)),
                Span::raw(format!("{:>4.0}°", bend.to_degrees())),
            ])
        };
        names.map(line).collect()
    }
}

/// 3, 2, 1 over a hold.
pub fn count(share: f32) -> u8 {
    match share {
        ..0.34 => 3,
        0.34..0.67 => 2,
        _ => 1,
    }
}

impl Scene for TeachView {
    const LEGEND: &'static str = "           a line a second: the pose, what to do now";

    fn draw(&self, frame: &mut Frame<'_>) {
        let area = frame.area();
        let drawn = area.width >= DRAWN.0 && area.height >= DRAWN.1;
        let (state, color) = self.state();
        let head = Line::from(vec![
            Span::styled(
                format!(" {state} "),
                Style::new().fg(Color::Black).bg(color),
            ),
            Span::raw(format!("  {}  {}", self.place(), seconds(self.elapsed))),
        ]);
        let prompt = wrapped(&self.prompt(), area.width);
        let said = self.said.as_ref().map_or(Vec::new(), |(text, good)| {
            let color = if *good { Color::Green } else { Color::Yellow };
            let lines = wrapped(text, area.width).into_iter();
            lines
                .map(|line| Line::styled(line, Style::new().fg(color)))
                .collect()
        });
        let keys = key_lines(self.keys, area.width);
        let length = |lines: usize| Constraint::Length(lines.try_into().unwrap_or(u16::MAX));
        let bars = self.axes.len().max(5);
        let [top, asked, gauge, picture, numbers, words, glove, foot] = Layout::vertical([
            Constraint::Length(1),
            length(prompt.len()),
            Constraint::Length(1),
            if drawn {
                Constraint::Fill(1)
            } else {
                Constraint::Length(0)
            },
            length(bars),
            length(said.len().max(1)),
            Constraint::Length(1),
            length(keys.len()),
        ])
        .areas(area);
        frame.render_widget(Paragraph::new(head), top);
        let prompt: Vec<Line<'_>> = prompt
            .into_iter()
            .map(|line| Line::styled(line, BOLD))
            .collect();
        frame.render_widget(Paragraph::new(prompt), asked);
        frame.render_widget(Paragraph::new(self.gauge(area.width)), gauge);
        let halves = Layout::horizontal([Constraint::Fill(1), Constraint::Fill(1)]);
        if drawn {
            let [left, right] = halves.areas(picture);
            if let Some(counts) = &self.gripper {
                draw_sketch(frame, left, &hand_gripper::gripper(counts));
            }
            draw_sketch(frame, right, &hand_gripper::hand(&self.hand));
        }
        let [left, right] = halves.areas(numbers);
        frame.render_widget(Paragraph::new(self.bars(left.width)), left);
        frame.render_widget(Paragraph::new(self.bends(right.width)), right);
        frame.render_widget(Paragraph::new(said), words);
        frame.render_widget(Paragraph::new(Line::styled(self.glove.clone(), DIM)), glove);
        frame.render_widget(Paragraph::new(keys), foot);
    }

    fn line(&self) -> String {
        format!("{}: {}", self.place(), self.state().0)
    }
}

/// A sketch in braille dots, as large as the place allows with its own proportions (a character is twice as high as wide).
fn draw_sketch(frame: &mut Frame<'_>, area: Rect, sketch: &Sketch) {
    let width = area
        .width
        .min((f32::from(area.height) * 2.0 / Sketch::ASPECT) as u16);
    let area = Rect {
        x: area.x + (area.width - width) / 2,
        width,
        ..area
    };
    let canvas = Canvas::default()
        .marker(Marker::Braille)
        .x_bounds([0.0, 1.0])
        .y_bounds([0.0, 1.0])
        .paint(|context| {
            // The white rims that tell lines apart on paper would wipe out nothing here.
            let drawn = sketch
                .strokes
                .iter()
                .filter(|stroke| stroke.colour != [255, 255, 255]);
            for stroke in drawn {
                let [red, green, blue] = stroke.colour;
                let color = match stroke.width {
                    0 => Color::DarkGray,
                    _ => Color::Rgb(
                        red.saturating_add(60),
                        green.saturating_add(60),
                        blue.saturating_add(60),
                    ),
                };
                let ends = stroke.points.windows(2).map(|pair| (pair[0], pair[1]));
                let closing = match (stroke.points.first(), stroke.points.last()) {
                    (Some(first), Some(last)) if stroke.width == 0 => Some((*last, *first)),
                    _ => None,
                };
                for ((x1, y1), (x2, y2)) in ends.chain(closing) {
                    context.draw(&Stroke {
                        x1,
                        y1,
                        x2,
                        y2,
                        color,
                    });
                }
            }
        });
    frame.render_widget(canvas, area);
}

#[cfg(test)]
mod tests {
    use super::*;
    use host::teaching::Doubt;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    fn view(state: State) -> TeachView {
        TeachView {
            elapsed: Duration::from_secs(75),
            doing: Doing::Poses(Ask {
                state,
                target: Some(vec![255.0, 0.0, 0.0, 0.0]),
                number: 3,
                of: 10,
                start: None,
            }),
            words: "finger A closed, fingers B and C open, scissor wide".to_owned(),
            gripper: Some(vec![255.0, 0.0, 0.0, 0.0]),
            axes: ["finger A", "finger B", "finger C", "scissor"]
                .map(|name| (name.to_owned(), 100.0, (0.0, 255.0)))
                .to_vec(),
            hand: [0.1; JOINT_COUNT],
            said: Some(("pose 2 taken".to_owned(), true)),
            glove: "16 of 16 sensors, 35.1 scans/s".to_owned(),
            keys: "any key: take it   u: undo   r: redo   s: another pose   q: end",
        }
    }

    fn drawn(view: &TeachView, width: u16, height: u16) -> String {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| view.draw(frame)).unwrap();
        let buffer = terminal.backend().buffer();
        let line = |row: u16| -> String {
            (0..width)
                .map(|column| buffer[(column, row)].symbol().to_owned())
                .collect()
        };
        (0..height).map(line).collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn every_state_says_what_to_do_on_a_large_and_on_a_small_terminal() {
        for (state, word) in [
            (State::Choosing, "choosing"),
            (State::Asking(Stage::Movement), "show this pose"),
            (State::Asking(Stage::Stillness), "hold still"),
            (State::Asking(Stage::Holding(0.1)), "hold 3"),
            (State::Asking(Stage::Holding(0.9)), "hold 1"),
            (State::Asking(Stage::Unseen), "no hand seen"),
            (State::Refused(Doubt::Alike { pair: 2 }), "not taken"),
            (State::Trying, "try the map"),
        ] {
            for (width, height) in [(100, 36), (60, 20), (40, 14)] {
                let text = drawn(&view(state), width, height);
                assert!(text.contains(word), "{word} at {width}x{height}:\n{text}");
                assert!(text.contains("pose 3 of 10"), "{text}");
                assert!(text.contains("any key"), "{text}");
            }
        }
        let large = drawn(&view(State::Asking(Stage::Movement)), 100, 36);
        println!("{large}");
        let dots = large
            .chars()
            .filter(|c| ('\u{2801}'..='\u{28ff}').contains(c))
            .count();
        assert!(dots > 60, "gripper and hand are drawn:\n{large}");
    }
}
