//! A gripper that says one thing and does another, status after status.

use super::*;
use host::gripper::{Activation, Fault};

/// What one axis says and does 8 ms at a time: its position and contact by time (ms).
fn ended(target: u8, says: impl Fn(u64) -> (u8, Contact, bool)) -> (Option<Judgement<1>>, u64) {
    let mut progress = Progress::new([target], [true], Duration::from_ticks(0));
    for ms in (0..4_000).step_by(8) {
        let (here, contact, echoed) = says(ms);
        let command = target.clamp(here.saturating_sub(30), here.saturating_add(30));
        let status = Status {
            stamp: Instant::from_ticks(ms * 1_000),
            activation: Activation::Ready,
            going_to: true,
            contact: [contact],
            echo: [command],
            position: [here],
            current: [0],
            fault: Fault::None,
        };
        match progress.take(status.stamp, &status, &[command], echoed) {
            Judgement::Goes => {}
            end => return (Some(end), ms),
        }
    }
    (None, 4_000)
}

/// 100 counts a second from `from`, beginning at `start` ms, up to `to`.
fn moving(ms: u64, start: u64, from: u8, to: u8) -> u8 {
    let way = (ms.saturating_sub(start) / 10).min(255) as u8;
    if to >= from {
        from.saturating_add(way).min(to)
    } else {
        from.saturating_sub(way).max(to)
    }
}

const STANDS_AT: fn(Rest) -> Option<Judgement<1>> = |rest| Some(Judgement::Stands([Some(rest)]));

#[test]
fn a_flag_that_says_done_is_not_believed_against_the_position() {
    for contact in [
        Contact::AtPosition,
        Contact::ContactClosing,
        Contact::ContactOpening,
    ] {
        for pause in [60, 300, 900, 1_300] {
            // The motor begins late; until then the flag is the last motion's.
            let (end, at) = ended(150, |ms| {
                let here = moving(ms, pause, 40, 150);
                let there = here == 150;
                (
                    here,
                    if ms < pause {
                        contact
                    } else if there {
                        Contact::AtPosition
                    } else {
                        Contact::Moving
                    },
                    true,
                )
            });
            assert_eq!(end, STANDS_AT(Rest::Target), "{contact:?} {pause}");
            assert!(at >= pause + 1_100, "{at}");
        }
        // It never begins.
        let (end, at) = ended(150, |_| (40, contact, true));
        if contact == Contact::ContactClosing {
            // Pressed against what it holds already: for as long as a motor could pause.
            assert_eq!(end, STANDS_AT(Rest::Object));
        } else {
            assert_eq!(end, Some(Judgement::Stuck(0)), "{contact:?}");
        }
        assert!((1_500..2_000).contains(&at), "{at}");
    }
    // A pause on the way, with the flag up.
    let (end, _) = ended(150, |ms| {
        let here = if ms < 1_000 {
            moving(ms, 0, 40, 90)
        } else {
            moving(ms, 1_000, 90, 150)
        };
        (here, Contact::AtPosition, true)
    });
    assert_eq!(end, STANDS_AT(Rest::Target));
}

#[test]
fn an_axis_ends_at_its_target_an_object_or_a_limit_it_was_seen_to_move_to() {
    let (end, at) = ended(150, |ms| {
        let here = moving(ms, 0, 40, 90);
        (
            here,
            if here == 90 {
                Contact::ContactClosing
            } else {
                Contact::Moving
            },
            true,
        )
    });
    assert_eq!(end, STANDS_AT(Rest::Object));
    assert!(at < 700, "{at}");
    let (end, at) = ended(250, |ms| {
        (moving(ms, 0, 200, 230), Contact::AtPosition, true)
    });
    assert_eq!(end, STANDS_AT(Rest::Limit));
    assert!((1_300..1_600).contains(&at), "{at}");
    // At the stop from the start: there is no motion to see.
    for (here, target) in [(6, 0), (13, 0), (230, 255), (249, 255)] {
        assert_eq!(
            ended(target, |_| (here, Contact::AtPosition, true)).0,
            STANDS_AT(Rest::Limit)
        );
    }
    // There already, whatever the flag says.
    assert_eq!(
        ended(150, |_| (150, Contact::Moving, true)).0,
        STANDS_AT(Rest::Target)
    );
}

#[test]
fn what_stands_or_is_not_repeated_is_told_within_two_seconds() {
    let (end, at) = ended(150, |_| (40, Contact::Moving, true));
    assert_eq!((end, at < 2_000), (Some(Judgement::Stuck(0)), true));
    let (end, at) = ended(150, |ms| (moving(ms, 0, 40, 80), Contact::Moving, true));
    assert_eq!((end, at < 2_400), (Some(Judgement::Stuck(0)), true));
    let (end, at) = ended(150, |_| (40, Contact::AtPosition, false));
    assert_eq!((end, at < 2_000), (Some(Judgement::Untaken), true));
}

#[test]
fn time_in_which_nothing_was_seen_is_no_standing() {
    let mut progress = Progress::new([150], [true], Duration::from_ticks(0));
    let status = |ms: u64| Status {
        stamp: Instant::from_ticks(ms * 1_000),
        activation: Activation::Ready,
        going_to: true,
        contact: [Contact::Moving],
        echo: [70],
        position: [40],
        current: [0],
        fault: Fault::None,
    };
    let mut take = |ms: u64, restart: bool| {
        if restart {
            progress.restart();
        }
        let status = status(ms);
        progress.take(status.stamp, &status, &[70], true)
    };
    assert_eq!(take(0, false), Judgement::Goes);
    assert_eq!(take(9_000, true), Judgement::Goes);
    assert_eq!(take(10_400, false), Judgement::Goes);
    assert_eq!(take(10_600, false), Judgement::Stuck(0));
}

#[test]
fn the_newest_commands_may_be_repeated_and_no_others() {
    let mut progress = Progress::new([150, 0], [true, false], Duration::from_ticks(0));
    (10..30).for_each(|count| progress.note_command([count, 99]));
    let axes = [true, false];
    assert!(progress.repeats(&[29, 0], axes) && progress.repeats(&[22, 0], axes));
    assert!(!progress.repeats(&[21, 0], axes) && !progress.repeats(&[30, 0], axes));
}
