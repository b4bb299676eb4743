//! A session on a chip against a scripted bridge.

use std::time::{Duration, Instant};

use bridge::calibration::{CalibrationState, Try};
use bridge::clutch::Position;
use bridge::protocol::message::Refusal;
use bridge::{HoldReason, State};

use super::scripted::Scripted;
use super::{Devices, Driver, OnChip, Order, Session, Snapshot, Stopped};
use crate::chip::link::HostLink;
use crate::clock::Clock;

/// For what comes in milliseconds on a machine with nothing else to do.
const SOON: Duration = Duration::from_secs(10);
const BEAT: Duration = Duration::from_millis(50);

fn watching(bridge: &Scripted) -> OnChip {
    let link = HostLink::connect(&bridge.address()).unwrap();
    OnChip::start(link, Clock::start(), None, None).unwrap()
}

/// Keeps the clutch closed until it is so.
fn until(session: &OnChip, mut so: impl FnMut(&Snapshot) -> bool) {
    let end = Instant::now() + SOON;
    while !session.snapshot().is_some_and(|seen| so(&seen)) {
        assert!(Instant::now() < end, "{:?}", session.snapshot());
        assert!(session.running(), "it ended by itself");
        session.order(Order::Heartbeat);
        std::thread::sleep(BEAT);
    }
}

fn following(bridge: &Scripted) -> OnChip {
    let session = watching(bridge);
    assert!(session.order(Order::Engage));
    until(&session, |seen| seen.state == State::Following);
    session
}

/// Until it ends by itself.
fn until_over(session: &OnChip) {
    let end = Instant::now() + SOON;
    while session.running() {
        assert!(Instant::now() < end, "it goes on");
        session.order(Order::Heartbeat);
        std::thread::sleep(BEAT);
    }
}

#[test]
fn a_hold_that_the_gripper_repeats_is_told_as_held_and_the_clutch_was_opened() {
    let bridge = Scripted::start();
    let mut session = following(&bridge);
    assert_eq!(session.stop().unwrap(), Stopped::Held);
    let script = bridge.script();
    assert!(script.calls.contains(&"Release".to_owned()));
}

#[test]
fn angles_of_a_glove_that_is_not_calibrated_are_not_valid_whatever_else_is_well() {
    let bridge = Scripted::start();
    bridge.script().samples_flow = false;
    let session = watching(&bridge);
    for (not_shown, valid) in [
        (Some(bridge::telemetry::ALL_JOINTS), false),
        (Some(1 << 8), true),
        (Some(bridge::telemetry::ALL_JOINTS), false),
        (Some(0), true),
    ] {
        let mut sample = bridge.script().sample();
        sample.not_shown = not_shown;
        bridge.script().samples.push_back(sample);
        until(&session, |seen| seen.angles_valid == valid);
    }
    // One from before samples said it: by what its health says.
    let sample = bridge.script().sample();
    bridge.script().calibration.is_calibrated = false;
    bridge.script().samples.push_back(sample);
    until(&session, |seen| !seen.angles_valid);
}

#[test]
fn a_wire_that_is_cut_under_a_closed_clutch_leaves_nothing_that_is_called_held() {
    let bridge = Scripted::start();
    let mut session = following(&bridge);
    bridge.script().cut = true;
    until_over(&session);
    let stopped = session.stop().unwrap();
    assert_eq!(stopped, Stopped::Unheard);
    assert!(stopped.judge(&Devices::Unknown).is_err());
}

#[test]
fn a_gripper_that_repeats_another_command_than_the_hold_has_not_confirmed_it() {
    let bridge = Scripted::start();
    let mut session = following(&bridge);
    bridge.script().echo = [90; 4];
    assert_eq!(session.stop().unwrap(), Stopped::NotConfirmed);
    // Nor one that says nothing.
    let bridge = Scripted::start();
    let mut session = following(&bridge);
    bridge.script().gripper = None;
    assert_eq!(session.stop().unwrap(), Stopped::NotConfirmed);
}

#[test]
fn a_bridge_that_restarted_under_a_closed_clutch_is_told_as_restarted() {
    let bridge = Scripted::start();
    let mut session = following(&bridge);
    std::thread::sleep(Duration::from_millis(300));
    bridge.script().restart();
    until_over(&session);
    let stopped = session.stop().unwrap();
    assert_eq!(stopped, Stopped::Restarted);
    assert!(
        stopped
            .judge(&Devices::Unknown)
            .unwrap_err()
            .to_string()
            .contains("restarted")
    );
}

#[test]
fn a_bridge_that_restarted_just_before_the_end_is_told_as_restarted_too() {
    let bridge = Scripted::start();
    let mut session = following(&bridge);
    std::thread::sleep(Duration::from_millis(300));
    session.order(Order::Stop);
    bridge.script().restart();
    assert_eq!(session.stop().unwrap(), Stopped::Restarted);
}

#[test]
fn of_samples_that_come_together_the_newest_is_what_is_shown() {
    let bridge = Scripted::start();
    bridge.script().samples_flow = false;
    let session = watching(&bridge);
    // What is older than the status says nothing of the state.
    let mut sample = bridge.script().sample();
    (sample.now_us, sample.state) = (1, State::Blending);
    bridge.script().samples.push_back(sample.clone());
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!(session.snapshot().map(|seen| seen.state), Some(State::Idle));
    {
        let mut script = bridge.script();
        let now_us = script.now_us();
        for sequence in 5..=7 {
            (sample.now_us, sample.frame_sequence) = (now_us + u64::from(sequence), sequence);
            script.samples.push_back(sample.clone());
        }
    }
    until(&session, |seen| seen.frame_sequence >= 5);
    let frames = session.snapshot().map(|seen| seen.frame_sequence);
    assert_eq!(frames, Some(7), "an older one was shown");
    // All of them were counted.
    assert_eq!(session.hub().summary().samples, Some(4));
}

#[test]
fn an_order_that_the_bridge_refuses_ends_the_session_with_its_word() {
    let bridge = Scripted::start();
    let mut session = watching(&bridge);
    bridge.script().refused = Some(("Activate", Refusal::Engaged));
    session.order(Order::Activate);
    until_over(&session);
    let told = session.ended().to_string();
    assert!(told.contains("its clutch is closed"), "{told}");
}

#[test]
fn a_clutch_that_another_host_opened_is_open_and_not_kept_closed() {
    let bridge = Scripted::start();
    let session = following(&bridge);
    bridge.script().open();
    until(&session, |seen| seen.clutch == Position::Open);
    assert_eq!(session.snapshot().map(|seen| seen.state), Some(State::Idle));
}

#[test]
fn a_hand_that_is_refused_under_a_calibration_says_that_it_stays_and_is_no_fault() {
    let bridge = Scripted::start();
    let session = following(&bridge);
    let mut seen = 0;
    session.hub().happened(&mut seen);
    session.order(Order::CalibrateStraight(gripper::Duration::from_millis(
        100,
    )));
    until(&session, |seen| {
        matches!(seen.calibration.newest, Try::Refused(_))
    });
    let events = session.hub().happened(&mut seen);
    let [event] = &events[..] else {
        panic!("{events:?}");
    };
    assert!(
        event.text.contains("stays in use") && event.text.contains("(space)"),
        "{event:?}"
    );
    assert_eq!(event.sort, super::record::Sort::Note);
}

#[test]
fn a_bridge_that_says_that_its_glove_is_not_calibrated_is_believed_once_it_has_said_so() {
    let bridge = Scripted::start();
    bridge.script().calibration = CalibrationState::default();
    let session = watching(&bridge);
    until(&session, Snapshot::lacks_calibration);
    bridge.script().calibration.is_calibrated = true;
    until(&session, |seen| !seen.lacks_calibration());
}

#[test]
fn a_bridge_that_was_held_all_the_time_makes_a_run_that_has_failed() {
    let bridge = Scripted::start();
    bridge.holds(HoldReason::Settling);
    let session = watching(&bridge);
    session.hub().begin();
    session.order(Order::Engage);
    until(&session, |seen| seen.state.hold_reason().is_some());
    let begun = Instant::now();
    until(&session, |_| begun.elapsed() > Duration::from_millis(300));
    let driver = Driver {
        engages: true,
        closed: true,
        ..Driver::default()
    };
    let ending = session.hub().ending(driver).unwrap();
    let told = ending.judge(&Devices::Unknown).unwrap_err().to_string();
    assert!(told.contains("never followed"), "{told}");
}

/// Until the reply to the next such question is lost.
fn lose(bridge: &Scripted, question: &'static str) {
    bridge.script().lost = Some(question);
    let end = Instant::now() + SOON;
    while bridge.script().lost.is_some() {
        assert!(Instant::now() < end, "nobody asks for {question}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn a_clutch_is_closed_although_the_reply_to_a_question_before_was_lost() {
    for question in ["Status", "Health"] {
        let bridge = Scripted::start();
        let session = watching(&bridge);
        lose(&bridge, question);
        assert!(session.order(Order::Engage));
        std::thread::sleep(Duration::from_millis(600));
        let clutch = session.snapshot().map(|seen| seen.clutch);
        assert_eq!(clutch, Some(Position::Closed), "{question}");
    }
}

#[test]
fn an_order_to_close_the_clutch_that_does_not_arrive_at_once_closes_nothing_later() {
    let bridge = Scripted::start();
    let session = watching(&bridge);
    bridge.script().unheard = Some("Engage");
    let given = Instant::now();
    assert!(session.order(Order::Engage));
    until(&session, |_| session.orders().too_late() == 1);
    bridge.script().unheard = None;
    // Longer than any repetition would be waited for.
    until(&session, |seen| {
        assert_eq!(seen.clutch, Position::Open);
        given.elapsed() > Duration::from_secs(2)
    });
    assert_eq!(bridge.script().calls.last().unwrap(), "Release");
    assert!(!bridge.script().calls.contains(&"Engage".to_owned()));
    assert!(session.order(Order::Engage));
    until(&session, |seen| seen.clutch == Position::Closed);
}

#[test]
fn an_activation_that_was_asked_for_goes_on_until_the_gripper_says_that_it_is_ready() {
    use gripper::Activation::{Activating, Ready, Reset};
    let left = |asked: bool, commands: u32, says: Option<gripper::Activation>| {
        let bridge = Scripted::start();
        {
            let mut script = bridge.script();
            (script.counters.commands, script.activation) = (commands, Reset);
        }
        let mut session = watching(&bridge);
        if asked {
            session.order(Order::Activate);
            until(&session, |_| {
                bridge.script().calls.contains(&"Activate".to_owned())
            });
        }
        {
            let mut script = bridge.script();
            script.gripper = says.and(script.gripper);
            script.activation = says.unwrap_or(Reset);
        }
        session.stop().unwrap()
    };
    for commands in [0, 1] {
        for says in [None, Some(Reset), Some(Activating)] {
            let left = left(true, commands, says);
            assert_eq!(left, Stopped::Activating, "{commands} {says:?}");
        }
    }
    assert_eq!(left(true, 0, Some(Ready)), Stopped::Untouched);
    assert_eq!(left(true, 1, Some(Ready)), Stopped::Held);
    assert_eq!(left(false, 0, Some(Reset)), Stopped::Untouched);
}

#[test]
fn the_clutch_of_another_host_that_has_the_bridge_is_not_opened() {
    let bridge = Scripted::start();
    let mut session = following(&bridge);
    bridge.script().taken();
    until_over(&session);
    let told = session.stop().unwrap_err().to_string();
    assert!(told.contains("another"), "{told}");
    assert!(!bridge.script().calls.contains(&"Release".to_owned()));
    // Nor where closing it was refused.
    let bridge = Scripted::start();
    let mut session = watching(&bridge);
    bridge.script().refused = Some(("Engage", Refusal::Busy { session: 7 }));
    session.order(Order::Engage);
    until_over(&session);
    assert!(session.stop().is_err());
    assert!(!bridge.script().calls.contains(&"Release".to_owned()));
}

#[test]
fn an_axis_that_stood_before_the_run_began_and_stands_is_told() {
    let bridge = Scripted::start();
    bridge.script().stands = Some(1);
    let session = following(&bridge);
    let driver = Driver {
        closed: true,
        ..Driver::default()
    };
    let stood = |_: &Snapshot| {
        let ending = session.hub().ending(driver).unwrap();
        ending.disobeyed.is_some()
    };
    until(&session, stood);
    session.hub().begin();
    until(&session, stood);
}

#[test]
fn what_a_bridge_on_a_chip_tells_is_handed_to_who_keeps_it_at_this_computers_time() {
    use super::record::{Record, queue};
    let bridge = Scripted::start();
    let link = HostLink::connect(&bridge.address()).unwrap();
    let clock = Clock::start();
    let begin = clock.now();
    let (feed, records) = queue(10_000);
    let session = OnChip::start(link, clock, None, Some(feed)).unwrap();
    assert!(session.order(Order::Engage));
    until(&session, |seen| seen.state == State::Following);
    // A sample comes every 50 ms.
    std::thread::sleep(Duration::from_millis(300));
    drop(session);
    let kept: Vec<Record> = records.records.iter().collect();
    let end = clock.now();
    assert!(
        kept.iter()
            .all(|record| begin <= record.at() && record.at() <= end),
        "the bridge's own time"
    );
    let count = |what: fn(&Record) -> bool| kept.iter().filter(|record| what(record)).count();
    assert!(count(|record| matches!(record, Record::Told(_))) > 0);
    assert!(count(|record| matches!(record, Record::Status(_))) > 0);
    let events: Vec<&String> = kept
        .iter()
        .filter_map(|record| match record {
            Record::Event { text, .. } => Some(text),
            _ => None,
        })
        .collect();
    let follows = State::Following.to_string();
    assert!(
        events.iter().any(|text| text.contains(&follows)),
        "{events:?}"
    );
    // The same status is told once.
    let statuses = count(|record| matches!(record, Record::Status(_)));
    assert!(statuses < 100, "{statuses}");
}
