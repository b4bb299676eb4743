use std::time::Duration;

use ratatui::Terminal;
use ratatui::backend::TestBackend;

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
        hand_age: None,
        headings: Vec::new(),
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
        gripper_age: None,
        frames_per_s: 25.6,
        cycles_per_s: 98.4,
        latency_p50: Some(31_200),
        latency_p99: Some(41_700),
        dropped: 3,
        faults: vec!["sensor ring_middle: no answer".to_owned()],
        gripper_faults: 2,
        keys: "space: clutch   q: stop".to_owned(),
    }
}

fn drawn(width: u16, height: u16) -> String {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| view().draw(frame)).unwrap();
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
fn on_a_small_terminal_the_state_the_axes_and_what_is_wrong_are_whole() {
    for (width, height) in [(60, 20), (40, 12), LEAST] {
        let text = drawn(width, height);
        for part in [
            "engaged", "finger A", "finger B", "finger C", "scissor", "128→64", "sensor",
        ] {
            assert!(
                text.contains(part),
                "{part} is missing at {width}×{height} in\n{text}"
            );
        }
        assert!(!text.contains("too small"), "{text}");
        // No half boxes: either all four corners of each, or none at all.
        let corners = |corner| text.matches(corner).count();
        assert_eq!(corners('┌'), corners('┘'), "{text}");
    }
    let text = drawn(60, 20);
    assert!(text.contains("thumb") && text.contains("little"), "{text}");
    assert!(drawn(40, 12).contains("space: clutch"));
}

#[test]
fn a_terminal_below_the_least_size_says_so_and_the_state() {
    let text = drawn(LEAST.0, LEAST.1 - 1);
    assert!(
        text.contains("engaged") && text.contains("too small: 30×7"),
        "{text}"
    );
}

#[test]
fn what_is_old_is_marked_in_boxes_on_small_terminals_and_in_the_line() {
    let mut view = view();
    (view.hand_age, view.gripper_age) = (Some(3.25), Some(1.5));
    let line = view.line();
    assert!(
        line.contains("hand 3.2 s old") && line.contains("1.5 s old"),
        "{line}"
    );
    for (width, height) in [(80, 24), (40, 12)] {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| view.draw(frame)).unwrap();
        let text = terminal.backend().to_string();
        assert!(text.contains("3.2 s old"), "{text}");
    }
}

#[test]
fn faults_that_do_not_fit_are_counted() {
    let mut view = view();
    view.faults = (1..=9).map(|k| format!("fault {k}")).collect();
    let mut terminal = Terminal::new(TestBackend::new(80, 24)).unwrap();
    terminal.draw(|frame| view.draw(frame)).unwrap();
    let text = terminal.backend().to_string();
    assert!(
        text.contains("fault 1") && text.contains("and 6 more"),
        "{text}"
    );
}
