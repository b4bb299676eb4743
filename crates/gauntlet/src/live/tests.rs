use std::time::Duration;

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};

use super::bars::{Cell, axis, signed};
use super::*;

fn view() -> View {
    let finger = |name, first| Finger {
        name,
        angles: [first, 0.1, -0.1, 0.9, 0.5],
        limits: [
            (-0.3, 1.6),
            (-0.4, 0.4),
            (-0.3, 0.3),
            (0.0, 1.9),
            (0.0, 1.4),
        ],
        good: name != "ring",
    };
    View {
        title: "gauntlet demo".to_owned(),
        elapsed: Duration::from_millis(12_400),
        total: Some(Duration::from_secs(20)),
        state: "engaged".to_owned(),
        following: true,
        fingers: ["thumb", "index", "middle", "ring", "little"]
            .into_iter()
            .zip([0.0, 0.4, 0.8, 1.2, 1.6])
            .map(|(name, first)| finger(name, first))
            .collect(),
        axes: [
            ("finger A", 128),
            ("finger B", 255),
            ("finger C", 0),
            ("scissor", 64),
        ]
        .into_iter()
        .map(|(name, asked)| Axis {
            name,
            asked: Some(asked),
            reached: Some(asked / 2),
            word: "moving",
        })
        .collect(),
        frames_per_s: 25.6,
        cycles_per_s: 98.4,
        latency_p50: Some(31_200),
        latency_p99: Some(41_700),
        dropped: 3,
        faults: vec!["sensor ring_middle: no answer".to_owned()],
        fault_count: 2,
        keys: "space: clutch   q: stop",
    }
}

fn drawn(width: u16, height: u16) -> String {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| draw(&view(), frame)).unwrap();
    terminal.backend().to_string()
}

#[test]
fn everything_that_matters_is_on_an_80_by_24_terminal() {
    let text = drawn(80, 24);
    for part in [
        "engaged",
        "12.4 s of 20.0 s",
        "thumb",
        "little",
        "92°",
        "finger A",
        "scissor",
        "asked 128  at  64",
        "moving",
        "25.6 scans/s",
        "98.4 cycles/s",
        "dropped 3",
        "p50 31.2 ms, p99 41.7 ms",
        "ring_middle: no answer",
        "space: clutch",
    ] {
        assert!(text.contains(part), "{part} is missing in\n{text}");
    }
}

#[test]
fn no_size_of_terminal_breaks_the_drawing() {
    for (width, height) in [(1, 1), (20, 5), (80, 24), (300, 100)] {
        drawn(width, height);
    }
}

#[test]
fn one_line_says_the_same() {
    let line = view().line();
    for part in [
        "12.4 s",
        "engaged",
        "finger A 128→64",
        "25.6/s",
        "p99 41.7 ms",
        "dropped 3",
    ] {
        assert!(line.contains(part), "{part} is missing in {line}");
    }
    assert!(!line.contains('\n'));
}

#[test]
fn a_signed_bar_grows_from_zero_both_ways() {
    assert_eq!(signed(0.5, (-1.0, 1.0), 8), "····██··");
    assert_eq!(signed(-0.5, (-1.0, 1.0), 8), "··██┆···");
    assert_eq!(signed(0.0, (-1.0, 1.0), 8), "····┆···");
    assert_eq!(signed(9.0, (0.0, 1.0), 4), "████");
    assert_eq!(signed(f32::NAN, (0.0, 1.0), 4), "····");
}

#[test]
fn an_axis_bar_fills_to_the_measured_and_marks_the_asked_position() {
    let cells = axis(Some(255), Some(128), 10);
    assert_eq!(
        cells.iter().filter(|cell| **cell == Cell::Filled).count(),
        6
    );
    assert_eq!(cells.last(), Some(&Cell::Asked));
    assert!(axis(None, None, 10).iter().all(|cell| *cell == Cell::Empty));
}

#[test]
fn keys_mean_what_the_foot_line_says() {
    let key = |code, modifiers| Event::Key(KeyEvent::new(code, modifiers));
    assert_eq!(
        meaning(&key(KeyCode::Char(' '), KeyModifiers::NONE)),
        Some(Key::Clutch)
    );
    assert_eq!(
        meaning(&key(KeyCode::Char('q'), KeyModifiers::NONE)),
        Some(Key::End)
    );
    assert_eq!(
        meaning(&key(KeyCode::Char('c'), KeyModifiers::CONTROL)),
        Some(Key::End)
    );
    assert_eq!(
        meaning(&key(KeyCode::Char('c'), KeyModifiers::NONE)),
        Some(Key::Calibrate)
    );
    assert_eq!(meaning(&key(KeyCode::Char('x'), KeyModifiers::NONE)), None);
}
