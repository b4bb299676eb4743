//! What the view says while it is so, on a terminal with a person's keys.

use crate::support;

use std::time::{Duration, Instant};

use support::bench::{BRINGUP, Bench, ends_soon, jumps};
use support::terminal::Terminal;

/// Longer than a mere event is shown.
const LONG: Duration = Duration::from_secs(6);

/// Looks at the whole view until it says `words`.
fn until_shown(terminal: &mut Terminal, words: &[&str]) {
    let end = Instant::now() + BRINGUP;
    loop {
        let shown = terminal.redrawn();
        if words.iter().all(|word| shown.contains(word)) {
            return;
        }
        assert!(Instant::now() < end, "not {words:?}: {shown}");
    }
}

#[test]
fn a_sensor_that_jumped_is_named_as_long_as_its_joints_are_held() {
    let bench = Bench::new(&[]);
    let mut terminal = Terminal::start(&bench.arguments());
    until_shown(&mut terminal, &["all", "well"]);
    jumps(&bench.glove, 5);
    until_shown(&mut terminal, &["index_middle", "jumped"]);
    std::thread::sleep(LONG);
    until_shown(&mut terminal, &["index_middle", "calibration"]);
    terminal.keys(b"c");
    until_shown(&mut terminal, &["calibrated"]);
    std::thread::sleep(LONG);
    let shown = terminal.redrawn();
    assert!(!shown.contains("index_middle"), "{shown}");
    assert!(shown.contains("well"), "{shown}");
    terminal.keys(b"q");
    assert_eq!(ends_soon(&mut terminal.child), Some(0));
}

#[test]
fn a_frozen_sensor_is_named_until_it_lives_again() {
    let bench = Bench::new(&["--engage"]);
    let mut terminal = Terminal::start(&bench.arguments());
    bench.until_moving(&mut terminal.child);
    bench.glove.freeze(8, true);
    until_shown(&mut terminal, &["middle_middle", "frozen"]);
    std::thread::sleep(LONG);
    until_shown(&mut terminal, &["middle_middle"]);
    bench.glove.freeze(8, false);
    std::thread::sleep(Duration::from_secs(2));
    let shown = terminal.redrawn();
    assert!(!shown.contains("frozen"), "{shown}");
    terminal.keys(b"q");
    assert_eq!(ends_soon(&mut terminal.child), Some(0));
}

#[test]
fn a_moving_hand_is_not_calibrated_on_the_view_says_so_and_the_clutch_moves_nothing() {
    let mut bench = Bench::new(&[]);
    bench.arguments.retain(|word| word != "--calibrate-flat");
    bench.hand_moves();
    let mut terminal = Terminal::start(&bench.arguments());
    until_shown(
        &mut terminal,
        &["idle:", "not", "calibrated", "press", "flat"],
    );
    let shown = terminal.redrawn();
    for wrong in ["well", "closes"] {
        assert!(!shown.contains(wrong), "{wrong}: {shown}");
    }
    terminal.keys(b"c");
    until_shown(&mut terminal, &["calibrating"]);
    until_shown(&mut terminal, &["not", "calibrated:", "still"]);
    terminal.keys(b" ");
    until_shown(&mut terminal, &["holding", "calibrated:", "open"]);
    assert_eq!(bench.gripper.writes(), 0, "something was commanded");
    terminal.keys(b"q");
    assert_eq!(ends_soon(&mut terminal.child), Some(0));
}

#[test]
fn a_key_takes_the_newest_flat_pose_back_and_what_is_not_done_by_itself_stands_above() {
    let bench = Bench::new(&["--find-flat", "off"]);
    let mut terminal = Terminal::start(&bench.arguments());
    until_shown(&mut terminal, &["all", "well", "finds no flat", "u: undo"]);
    terminal.keys(b"u");
    until_shown(&mut terminal, &["not", "calibrated:", "press"]);
    terminal.keys(b"c");
    until_shown(&mut terminal, &["all", "well"]);
    // With the clutch closed nothing is taken back.
    terminal.keys(b" ");
    until_shown(&mut terminal, &["following"]);
    terminal.keys(b"u");
    until_shown(&mut terminal, &["refused,", "(space)"]);
    terminal.keys(b"q");
    let end = ends_soon(&mut terminal.child);
    assert_eq!(end, Some(0), "{}", terminal.seen());
}

#[test]
fn a_refused_calibration_leaves_the_one_before_and_the_view_says_so_and_why() {
    let bench = Bench::new(&[]);
    let mut terminal = Terminal::start(&bench.arguments());
    until_shown(&mut terminal, &["all", "well"]);
    bench.hand_moves();
    terminal.keys(b"c");
    until_shown(&mut terminal, &["refused,", "before", "stays", "hand"]);
    let shown = terminal.redrawn();
    assert!(!shown.contains("calibrated"), "{shown}");
    std::thread::sleep(LONG);
    until_shown(&mut terminal, &["all", "well", "closes"]);
    // With the clutch closed the key that opens it is named.
    terminal.keys(b" ");
    until_shown(&mut terminal, &["following"]);
    terminal.keys(b"c");
    until_shown(&mut terminal, &["refused,", "(space)"]);
    terminal.keys(b"q");
    assert_eq!(ends_soon(&mut terminal.child), Some(0));
}
