//! What the link does with bytes nobody asked for, late replies and broken ports.
#![allow(clippy::unwrap_used)]

mod support;

use gripper::link::{Config, Error, Event, LateReply, Link, PortFault, Refused};
use gripper::timing;
use support::ask::*;
use support::{CHARACTER, Line, at, run_link, settle};

#[test]
fn after_a_timeout_the_same_look_is_refused_and_another_is_not() {
    let mut bench = Bench::new();
    assert_eq!(
        bench.ask(read(8), &[], CHARACTER),
        Err(Error::Timeout { received: 0 })
    );
    settle(&bench.line, &mut bench.link);
    let now = at(bench.line.now());
    assert_eq!(
        bench.link.start(&read(8), RESERVED, now),
        Err(Refused::Ambiguous)
    );
    assert_eq!(bench.link.late_reply(&read(8), now), LateReply::Possible);
    assert_eq!(bench.link.late_reply(&exchange(8), now), LateReply::None);
    // A later answer settles it as far as order goes; time ends it altogether.
    assert!(bench.ask(read(7), &status(7), CHARACTER).is_ok());
    assert!(matches!(
        bench.link.late_reply(&read(8), at(bench.line.now())),
        LateReply::Superseded { .. }
    ));
    bench
        .line
        .set_now(bench.line.now() + timing::MEMORY.as_ticks());
    assert_eq!(
        bench.link.late_reply(&read(8), at(bench.line.now())),
        LateReply::None
    );
}

#[test]
fn after_a_timeout_the_line_rests_for_one_longest_reply_and_a_silence() {
    let mut bench = Bench::new();
    assert!(bench.ask(read(8), &[], CHARACTER).is_err());
    let told = bench.line.now();
    settle(&bench.line, &mut bench.link);
    let rest = timing::quarantine(115_200, 21, timing::silence(115_200));
    assert_eq!(bench.line.now() - told, rest.as_micros());
    // After a wrong reply it rests as long as the true one could still have begun.
    let mut bench = Bench::new();
    let mut wrong = status(8);
    wrong[10] ^= 1;
    let asked = bench.line.now();
    assert_eq!(bench.ask(read(8), &wrong, CHARACTER), Err(Error::Crc));
    settle(&bench.line, &mut bench.link);
    let first = timing::first_byte(115_200, 8, timing::RESPONSE);
    assert!(bench.line.now() - asked >= first.as_micros());
}

#[test]
fn a_late_reply_is_stale_and_never_the_answer() {
    let mut bench = Bench::new();
    assert!(bench.ask(read(8), &[], CHARACTER).is_err());
    // The late reply comes while the next request waits for its own.
    assert_eq!(bench.ask(read(7), &status(8), CHARACTER), Err(Error::Stale));
    // A late reply in the quarantine is recognised too, and is outstanding no longer.
    let mut bench = Bench::new();
    assert!(bench.ask(exchange(8), &[], CHARACTER).is_err());
    bench
        .line
        .send(bench.line.now() + 300, CHARACTER, &exchanged());
    settle(&bench.line, &mut bench.link);
    let counters = bench.link.counters();
    assert_eq!((counters.stale, counters.noise), (1, 0));
    assert_eq!(
        bench.link.late_reply(&exchange(8), at(bench.line.now())),
        LateReply::None
    );
    assert!(
        bench
            .link
            .trace()
            .iter()
            .any(|entry| entry.event == Event::Late && *entry.bytes == *exchanged())
    );
}

/// Exception 02 of slave 9 to a request of this function.
fn refusal(function: u8) -> Vec<u8> {
    sealed(&[9, function | 0x80, 2])
}

#[test]
fn a_late_exception_is_stale_and_never_the_answer_to_the_next_request() {
    for (before, now_asked, answer) in [
        // Of the same function: the exception alone cannot tell the two apart.
        (read(8), read(7), status(7)),
        (exchange(8), read(8), status(8)),
        (read(8), exchange(8), exchanged()),
    ] {
        let late = refusal(before.function());
        let mut bench = Bench::new();
        assert!(bench.ask(before, &[], CHARACTER).is_err());
        // It comes while the next request waits, ahead of that one's own reply.
        let both = [&late[..], &answer[..]].concat();
        assert_eq!(bench.ask(now_asked, &both, CHARACTER), Err(Error::Stale));
        settle(&bench.line, &mut bench.link);
        let counters = bench.link.counters();
        // The exception, and the reply behind it: nobody can say any more what it answers.
        assert_eq!((counters.stale, counters.exceptions), (2, 0));
        // In the quarantine it is recognised too, and is outstanding no longer.
        let mut bench = Bench::new();
        assert!(bench.ask(before, &[], CHARACTER).is_err());
        bench.line.send(bench.line.now() + 300, CHARACTER, &late);
        settle(&bench.line, &mut bench.link);
        let counters = bench.link.counters();
        assert_eq!((counters.stale, counters.noise), (1, 0));
        assert_eq!(
            bench.link.late_reply(&before, at(bench.line.now())),
            LateReply::None
        );
        assert_eq!(bench.ask(now_asked, &answer, CHARACTER), Ok(answer));
        // With nothing outstanding the same bytes are the answer.
        let refused = refusal(now_asked.function());
        let outcome = bench.ask(now_asked, &refused, CHARACTER);
        assert!(matches!(outcome, Err(Error::Exception(_))), "{outcome:?}");
    }
}

#[test]
fn bytes_on_an_idle_line_are_drained_before_anything_is_sent() {
    let mut bench = Bench::new();
    bench.line.send(bench.line.now(), 0, &status(8));
    let now = at(bench.line.now());
    assert_eq!(
        bench.link.start(&read(8), RESERVED, now),
        Err(Refused::Busy)
    );
    let began = bench.line.now();
    settle(&bench.line, &mut bench.link);
    assert!(bench.line.now() >= began + 1_750);
    assert_eq!(bench.link.counters().noise, 21);
    assert_eq!(bench.ask(read(8), &status(8), CHARACTER), Ok(status(8)));
}

#[test]
fn what_lies_unread_when_the_port_is_opened_is_thrown_away() {
    let line = Line::default();
    line.send(0, 0, &status(8));
    let mut link = Link::new(line.clone(), Config::new(9, 115_200));
    settle(&line, &mut link);
    assert_eq!((link.counters().noise, link.counters().replies), (21, 0));
}

#[test]
fn silence_counts_from_the_last_poll_that_saw_bytes() {
    let mut bench = Bench::new();
    // A byte came long ago, but is seen only now.
    bench.line.send(bench.line.now(), 0, &[0x55]);
    bench.line.set_now(bench.line.now() + 50_000);
    let seen = bench.line.now();
    assert!(bench.link.poll(at(seen)).is_none());
    settle(&bench.line, &mut bench.link);
    assert!(bench.line.now() >= seen + 1_750);
}

#[test]
fn a_line_that_never_falls_silent_is_an_error_again_and_again() {
    let mut bench = Bench::new();
    bench.line.send(bench.line.now(), CHARACTER, &[0xA5; 3_000]);
    let (mut errors, mut thrown, end) = (0, 0, bench.line.now() + 3_000 * CHARACTER);
    while bench.line.now() < end {
        let until = bench.line.now() + 60_000;
        match run_link(&bench.line, &mut bench.link, until, &mut |_, _, _| {}) {
            Some(Err(Error::Noise(count))) => (errors, thrown) = (errors + 1, thrown + count),
            other => assert!(bench.line.now() >= end, "{other:?}"),
        }
    }
    assert!(
        errors >= 4 && thrown > 2_000,
        "{errors} errors, {thrown} bytes"
    );
    assert_eq!(bench.ask(read(8), &status(8), CHARACTER), Ok(status(8)));
}

#[test]
fn bytes_after_a_valid_reply_do_not_spoil_it() {
    let mut bench = Bench::new();
    let mut reply = status(8);
    reply.extend_from_slice(&[0xFF, 0x00]);
    assert_eq!(bench.ask(read(8), &reply, 0), Ok(status(8)));
    assert_eq!(bench.link.counters().noise, 2);
    assert_eq!(bench.ask(read(8), &status(8), CHARACTER), Ok(status(8)));
}

#[test]
fn a_broken_port_is_told_and_rested_and_comes_back() {
    let mut bench = Bench::new();
    bench.line.break_port(true);
    let fault = PortFault::Read(embedded_io::ErrorKind::BrokenPipe);
    let mut errors = 0;
    let end = bench.line.now() + 1_000_000;
    while bench.line.now() < end {
        match run_link(&bench.line, &mut bench.link, end, &mut |_, _, _| {}) {
            Some(outcome) => {
                assert_eq!(outcome, Err(Error::Port(fault)));
                errors += 1;
            }
            None => break,
        }
    }
    assert!((8..=11).contains(&errors), "{errors} in a second");
    bench.line.break_port(false);
    assert_eq!(bench.ask(read(8), &status(8), CHARACTER), Ok(status(8)));
}
