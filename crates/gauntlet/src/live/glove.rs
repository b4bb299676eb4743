//! The view of a glove alone: the hand, its sensors, how often they are read, what is wrong.

use std::time::Duration;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Paragraph};

use super::Scene;
use super::draw::{draw_headings, titled};
use super::headings;
use super::moving::Finger;
use super::parts::{BOLD, DIM, Heading, fault_lines, hand_table, heading, key_lines, wrapped};
use super::small::{hand_line, too_small};
use super::view::old;
use host::stats::short_or_dash;
use host::words;

/// The least terminal for boxes: columns, rows.
const BOXES: (u16, u16) = (80, 23);
/// The least terminal at all.
const LEAST: (u16, u16) = (30, 5);
/// The least columns for the table of the hand's angles.
const TABLE: u16 = 58;

/// One sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensor {
    /// The segment it sits on.
    pub name: &'static str,
    /// Whether its newest sample is good.
    pub good: bool,
    /// How it is, in a word.
    pub word: &'static str,
    /// Age of its newest good sample, µs.
    pub age_us: Option<u64>,
    /// Scans without a good sample.
    pub lost: u64,
    /// How often it came up.
    pub starts: u16,
    /// The end of its unique id.
    pub id: String,
}

/// Everything the view shows.
#[derive(Debug, Clone, PartialEq)]
pub struct GloveView {
    /// What runs.
    pub title: &'static str,
    /// Time since it started.
    pub elapsed: Duration,
    /// When it will end by itself.
    pub total: Option<Duration>,
    /// What the glove does, in a word or two.
    pub state: String,
    /// It is calibrated, and all its sensors are good.
    pub good: bool,
    /// The fingers, thumb first.
    pub fingers: Vec<Finger>,
    /// Age of the hand's angles in seconds, where they are old.
    pub hand_age: Option<f32>,
    /// Whether the angles are those of the hand; else those of sensors that would sit straight.
    pub calibrated: bool,
    /// How sure the joints' headings are; none without a profile.
    pub headings: Vec<headings::Heading>,
    /// The 16 sensors.
    pub sensors: Vec<Sensor>,
    /// Scans a second.
    pub scans_per_s: f64,
    /// How far 99 of 100 intervals between scans stay from the one before, µs.
    pub jitter_us: Option<u64>,
    /// Speed of the line, baud; `None` on an I²C port.
    pub baud: Option<u32>,
    /// What is wrong now, in words; empty when all is well.
    pub faults: Vec<String>,
    /// What keys do.
    pub keys: String,
}

impl GloveView {
    fn heading(&self) -> Heading<'_> {
        Heading {
            title: self.title,
            state: &self.state,
            good: self.good,
            elapsed: self.elapsed,
            total: self.total,
        }
    }

    fn rates(&self) -> String {
        let good = self.sensors.iter().filter(|sensor| sensor.good).count();
        let lost: u64 = self.sensors.iter().map(|sensor| sensor.lost).sum();
        format!(
            "{good} of 16 sensors good   {:.1} scans/s   jitter {}   samples lost {lost}   {}",
            self.scans_per_s,
            short_or_dash(self.jitter_us),
            words::line_speed(self.baud)
        )
    }

    fn hand_title(&self) -> String {
        match (self.calibrated, headings::summary(&self.headings)) {
            (true, Some(sure)) => format!("hand: joint angles, degrees; {sure}"),
            (true, None) => "hand: joint angles, degrees".to_owned(),
            (false, _) if self.fingers.is_empty() => {
                "hand: NOT CALIBRATED, no angles before it has lain flat".to_owned()
            }
            (false, _) => {
                "hand: NOT CALIBRATED, as if the sensors sat straight; degrees".to_owned()
            }
        }
    }

    fn live(&self) -> bool {
        self.hand_age.is_none() && self.calibrated
    }

    fn boxes(&self, frame: &mut Frame<'_>) {
        let area = frame.area();
        let keys = key_lines(&self.keys, area.width);
        let room = area.height >= BOXES.1 + headings::ROWS + 2;
        let room = room && self.calibrated && !self.headings.is_empty();
        let sure = if room { headings::ROWS + 2 } else { 0 };
        let [head, hand, sigma, sensors, rates, faults, foot] = Layout::vertical([
            Constraint::Length(1),
            Constraint::Length(8),
            Constraint::Length(sure),
            Constraint::Length(10),
            Constraint::Length(1),
            Constraint::Min(2),
            Constraint::Length(keys.len().try_into().unwrap_or(1)),
        ])
        .areas(area);
        frame.render_widget(heading(&self.heading()), head);
        let block = titled(&self.hand_title(), self.hand_age);
        let inner = block.inner(hand);
        frame.render_widget(block, hand);
        let table = hand_table(&self.fingers, self.live(), inner.width);
        frame.render_widget(Paragraph::new(table), inner);
        if room {
            draw_headings(&self.headings, frame, sigma);
        }
        self.draw_sensors(frame, sensors);
        frame.render_widget(Line::raw(self.rates()), rates);
        let lines = fault_lines(&self.faults, faults.width, faults.height.into());
        frame.render_widget(Paragraph::new(lines), faults);
        frame.render_widget(Paragraph::new(keys), foot);
    }

    /// Two columns of eight.
    fn draw_sensors(&self, frame: &mut Frame<'_>, area: Rect) {
        let block = Block::bordered().title("sensors: state, age of the newest sample, scans lost");
        let inner = block.inner(area);
        frame.render_widget(block, area);
        let halves = Layout::horizontal([Constraint::Fill(1), Constraint::Fill(1)]);
        let columns: [Rect; 2] = halves.areas(inner);
        for (column, sensors) in columns.into_iter().zip(self.sensors.chunks(8)) {
            let lines: Vec<Line<'_>> = sensors
                .iter()
                .map(|sensor| sensor_line(sensor, column.width))
                .collect();
            frame.render_widget(Paragraph::new(lines), column);
        }
    }

    fn small(&self, area: Rect) -> Vec<Line<'_>> {
        let keys = key_lines(&self.keys, area.width);
        let rates: Vec<Line<'_>> = wrapped(&self.rates(), area.width)
            .into_iter()
            .map(Line::raw)
            .collect();
        // The state, a line of the hand and two for what is wrong are always there.
        let mut room = usize::from(area.height).saturating_sub(4);
        let mut fit = |lines: usize| {
            let fits = lines <= room;
            room -= if fits { lines } else { 0 };
            fits
        };
        let with_rates = fit(rates.len());
        let with_keys = fit(keys.len());
        let with_table = area.width >= TABLE && fit(self.fingers.len());
        let mut lines = vec![heading(&self.heading())];
        if !self.calibrated {
            // Before the title, which a narrow terminal cuts off.
            let red = Style::new().fg(Color::Red);
            lines[0]
                .spans
                .insert(1, Span::styled(" NOT CALIBRATED", red));
        }
        match with_table {
            true => lines.extend(hand_table(&self.fingers, self.live(), area.width)),
            false => lines.push(hand_line(&self.fingers, self.hand_age)),
        }
        if with_rates {
            lines.extend(rates);
        }
        lines.extend(fault_lines(&self.faults, area.width, 2 + room));
        if with_keys {
            lines.extend(keys);
        }
        lines
    }
}

fn sensor_line(sensor: &Sensor, width: u16) -> Line<'static> {
    let style = match sensor.good {
        true => BOLD,
        false => Style::new().fg(Color::Red),
    };
    let age = short_or_dash(sensor.age_us);
    let mut spans = vec![
        Span::styled(format!("{:<17}", sensor.name), style),
        Span::raw(format!("{:<9}{age:>8}{:>4}", sensor.word, sensor.lost)),
    ];
    if width >= 60 {
        let more = format!("  started {}  id …{}", sensor.starts, sensor.id);
        spans.push(Span::styled(more, DIM));
    }
    Line::from(spans)
}

impl Scene for GloveView {
    const LEGEND: &'static str = "           a line a second: the state, sensors, rates, how far each finger is bent at its base (degrees), what is wrong";

    fn draw(&self, frame: &mut Frame<'_>) {
        let area = frame.area();
        if area.width >= BOXES.0 && area.height >= BOXES.1 {
            return self.boxes(frame);
        }
        let lines = if area.width < LEAST.0 || area.height < LEAST.1 {
            too_small(&self.state)
        } else {
            self.small(area)
        };
        frame.render_widget(Paragraph::new(lines), area);
    }

    fn line(&self) -> String {
        let flex =
            |finger: &Finger| format!("{} {:.0}°", finger.name, finger.angles[0].to_degrees());
        let bent: Vec<String> = self.fingers.iter().map(flex).collect();
        let old = old(self.hand_age).map_or_else(String::new, |age| format!("  hand {age}"));
        let calibrated = match self.calibrated {
            true => "",
            false => " (NOT CALIBRATED)",
        };
        let faults = match self.faults.is_empty() {
            true => String::new(),
            false => format!(" | {}", self.faults.join("; ")),
        };
        format!(
            "{:5.1} s  {:<11} {}  {}{calibrated}{old}{faults}",
            self.elapsed.as_secs_f64(),
            self.state,
            self.rates(),
            bent.join(" ")
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use host::glove::hand::SEGMENT_NAMES;
    use host::words::FINGER_NAMES;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    fn view() -> GloveView {
        let finger = |name| Finger {
            name,
            angles: [0.5, 0.1, -0.1, 0.9, 0.4],
            limits: [(-0.4, 1.6); 5],
            good: true,
        };
        let sensor = |name| Sensor {
            name,
            good: name != "ring_middle",
            word: if name == "ring_middle" {
                "frozen"
            } else {
                "good"
            },
            age_us: Some(12_300),
            lost: 7,
            starts: 1,
            id: "a1b2c3".to_owned(),
        };
        GloveView {
            title: "gauntlet glove watch",
            elapsed: Duration::from_millis(3_200),
            total: Some(Duration::from_secs(10)),
            state: "scanning".to_owned(),
            good: false,
            fingers: FINGER_NAMES.map(finger).into(),
            hand_age: None,
            calibrated: false,
            headings: Vec::new(),
            sensors: SEGMENT_NAMES.map(sensor).into(),
            scans_per_s: 35.2,
            jitter_us: Some(1_100),
            baud: Some(115_200),
            faults: vec!["the sensor on ring_middle is frozen".to_owned()],
            keys: "q: end".to_owned(),
        }
    }

    fn drawn(width: u16, height: u16) -> String {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| view().draw(frame)).unwrap();
        terminal.backend().to_string()
    }

    #[test]
    fn the_hand_every_sensor_the_rates_and_what_is_wrong_are_on_an_80_by_24_terminal() {
        let text = drawn(80, 24);
        let mut parts = vec![
            "scanning",
            "3.2 s of 10.0 s",
            "NOT CALIBRATED",
            "29°",
            "frozen",
            "12.3 ms   7",
            "35.2 scans/s",
            "jitter 1.1 ms",
            "15 of 16 sensors good",
            "ring_middle is frozen",
            "q: end",
        ];
        parts.extend(SEGMENT_NAMES);
        for part in parts {
            assert!(text.contains(part), "{part} is missing in\n{text}");
        }
        assert!(drawn(160, 50).contains("id …a1b2c3"));
    }

    #[test]
    fn no_size_of_terminal_breaks_the_drawing_and_none_hides_that_it_is_not_calibrated() {
        for (width, height) in [(1, 1), (30, 5), (40, 12), (60, 20), (80, 22), (300, 100)] {
            let text = drawn(width, height);
            assert!(width < 60 || text.contains("NOT CALIBRATED"), "{text}");
        }
    }

    #[test]
    fn one_line_says_the_same() {
        let line = view().line();
        for part in [
            "3.2 s",
            "scanning",
            "15 of 16",
            "thumb 29°",
            "NOT CALIBRATED",
            "ring_middle is frozen",
        ] {
            assert!(line.contains(part), "{part} is missing in {line}");
        }
        assert!(!line.contains('\n'));
    }
}
