//! What the link takes for an answer, rule by rule, on a line of the test's own.
#![allow(clippy::unwrap_used)]

mod support;

use gripper::link::{Config, Error, Event, Field, Link, LocalEcho, Refused};
use gripper::registers::{COMMAND, STATUS};
use gripper::rtu::{Exception, Registers, Request};
use gripper::timing;
use support::ask::*;
use support::{CHARACTER, Line, at, run_link, settle};

#[test]
fn a_whole_reply_is_taken_however_it_is_cut_into_pieces() {
    // 1-byte pieces up to the longest pause the standard allows inside a frame.
    for spacing in [CHARACTER, 200, 500, 750 + CHARACTER] {
        let mut bench = Bench::new();
        assert_eq!(
            bench.ask(read(8), &status(8), spacing),
            Ok(status(8)),
            "{spacing} µs a byte"
        );
        assert_eq!(
            bench.ask(exchange(8), &exchanged(), spacing),
            Ok(exchanged()),
            "{spacing} µs a byte"
        );
    }
    let mut bench = Bench::new();
    assert_eq!(
        bench.ask(read(8), &status(8), 0),
        Ok(status(8)),
        "all at once"
    );
}

#[test]
fn truncated_at_every_length_is_a_timeout_and_the_next_request_succeeds() {
    let mut cases = 0;
    for (request, reply, after) in [
        (read(8), status(8), read(7)),
        (exchange(8), exchanged(), read(8)),
    ] {
        for length in 0..reply.len() {
            let mut bench = Bench::new();
            let started = bench.line.now();
            assert_eq!(
                bench.ask(request, &reply[..length], CHARACTER),
                Err(Error::Timeout { received: length })
            );
            let limit = timing::first_byte(115_200, request.buffer_len(), timing::RESPONSE)
                + if length == 0 {
                    gripper::Duration::from_ticks(0)
                } else {
                    timing::last_byte(115_200, reply.len())
                };
            assert!(
                bench.line.now() <= started + limit.as_ticks() + timing::TICK.as_ticks(),
                "{length}"
            );
            let quantity = after.reply_len() / 2 - 2;
            assert_eq!(
                bench.ask(after, &status(quantity), CHARACTER),
                Ok(status(quantity))
            );
            cases += 1;
        }
    }
    println!("{cases} truncations: all Timeout, the next request answered");
}

#[test]
fn a_wrong_crc_is_told_at_the_last_byte_and_not_at_the_deadline() {
    let mut bench = Bench::new();
    let mut reply = status(8);
    reply[7] ^= 0x10;
    let started = bench.line.now();
    assert_eq!(bench.ask(read(8), &reply, CHARACTER), Err(Error::Crc));
    let end = started + 8 * CHARACTER + TURNAROUND + 21 * CHARACTER;
    assert_eq!(bench.line.now(), end);
    assert_eq!(bench.link.counters().crc, 1);
}

#[test]
fn valid_frames_that_do_not_answer_name_the_field() {
    let frame = |unit: u8, code: u8, count: u8, at: usize, bits: u8| {
        let mut body = vec![unit, code, count];
        body.extend_from_slice(&STATUS_BYTES);
        body[3 + at] ^= bits;
        sealed(&body)
    };
    for (reply, field) in [
        (frame(10, 3, 16, 0, 0), Field::Unit),
        (frame(9, 4, 16, 0, 0), Field::Function),
        (frame(9, 3, 14, 0, 0), Field::ByteCount),
        (frame(9, 3, 16, 2, 0x40), Field::Reserved),
        (frame(9, 3, 16, 15, 1), Field::Reserved),
    ] {
        let mut bench = Bench::new();
        assert_eq!(
            bench.ask(read(8), &reply, CHARACTER),
            Err(Error::Shape(field))
        );
        assert_eq!(bench.ask(read(7), &status(7), CHARACTER), Ok(status(7)));
    }
    // A write's echo of another address, quantity.
    for body in [[9, 16, 3, 0xE9, 0, 8], [9, 16, 3, 0xE8, 0, 7]] {
        let mut bench = Bench::new();
        bench.ask(read(8), &status(8), CHARACTER).unwrap();
        assert_eq!(
            bench.ask(write(), &sealed(&body), CHARACTER),
            Err(Error::Shape(Field::WriteReply))
        );
    }
}

#[test]
fn an_exception_counts_only_with_its_own_crc() {
    let mut bench = Bench::new();
    let refused = sealed(&[9, 0x83, 2]);
    assert_eq!(
        bench.ask(read(8), &refused, CHARACTER),
        Err(Error::Exception(Exception::ILLEGAL_ADDRESS))
    );
    // It is the answer: the same request may follow at once.
    let mut broken = refused.clone();
    broken[4] ^= 1;
    assert_eq!(
        bench.ask(read(8), &broken, CHARACTER),
        Err(Error::Timeout { received: 5 })
    );
    // Of another function, of another slave.
    assert_eq!(
        bench.ask(read(7), &sealed(&[9, 0x97, 2]), CHARACTER),
        Err(Error::Timeout { received: 5 })
    );
    // Five sound bytes of the right function are no exception either: only the bit says so.
    assert_eq!(
        bench.ask(read(5), &sealed(&[9, 0x03, 2]), CHARACTER),
        Err(Error::Timeout { received: 5 })
    );
    assert_eq!(
        bench.ask(read(6), &sealed(&[8, 0x83, 2]), CHARACTER),
        Err(Error::Shape(Field::Unit))
    );
}

#[test]
fn foreign_slaves_frames_are_never_taken() {
    let mut cases = 0;
    for unit in (0..=255_u8).filter(|&unit| unit != 9) {
        for quantity in [1, 7, 8] {
            let mut foreign = status(quantity);
            foreign[0] = unit;
            let length = foreign.len();
            let foreign = sealed(&foreign[..length - 2]);
            let mut bench = Bench::new();
            let outcome = bench.ask(read(8), &foreign, CHARACTER);
            let expected = if quantity == 8 {
                Error::Shape(Field::Unit)
            } else {
                Error::Timeout { received: length }
            };
            assert_eq!(outcome, Err(expected));
            assert_eq!(bench.ask(read(7), &status(7), CHARACTER), Ok(status(7)));
            // In front of the reply: the reply is lost, the next is not.
            let mut both = foreign.clone();
            both.extend_from_slice(&status(8));
            let mut bench = Bench::new();
            assert!(bench.ask(read(8), &both, CHARACTER).is_err());
            assert_eq!(bench.ask(read(7), &status(7), CHARACTER), Ok(status(7)));
            cases += 2;
        }
    }
    println!("{cases} foreign frames: 0 taken, the next request answered");
}

#[test]
fn an_adapter_that_echoes_is_recognised_and_its_echo_taken_off() {
    let line = Line::default();
    let mut link = Link::new(line.clone(), Config::new(9, 115_200));
    let mut ask = |request: Request<'_>, reply: &[u8], together: bool| {
        settle(&line, &mut link);
        link.start(&request, RESERVED, at(line.now())).unwrap();
        let until = line.now() + 200_000;
        let outcome = run_link(&line, &mut link, until, &mut |line, end, bytes| {
            // The echo comes while the request goes out; or, through a slow adapter, with the reply.
            let start = if together {
                end + TURNAROUND
            } else {
                end - bytes.len() as u64 * CHARACTER
            };
            line.send(start, CHARACTER, bytes);
            line.send(
                end + TURNAROUND
                    + if together {
                        bytes.len() as u64 * CHARACTER
                    } else {
                        0
                    },
                CHARACTER,
                reply,
            );
        });
        (outcome.expect("every wait ends"), link.local_echo())
    };
    let single = Request::WriteSingle {
        address: COMMAND,
        value: 0x0900,
    };
    let single_reply = sealed(&[9, 6, 3, 0xE8, 9, 0]);
    let wrote = sealed(&[9, 16, 3, 0xE8, 0, 8]);
    for together in [false, true] {
        assert_eq!(
            ask(read(8), &status(8), together),
            (Ok(status(8)), LocalEcho::On)
        );
        assert_eq!(
            ask(exchange(8), &exchanged(), together),
            (Ok(exchanged()), LocalEcho::On)
        );
        assert_eq!(
            ask(write(), &wrote, together),
            (Ok(wrote.clone()), LocalEcho::On)
        );
        assert_eq!(
            ask(single, &single_reply, together),
            (Ok(single_reply.clone()), LocalEcho::On)
        );
    }
    // The slave is gone, the adapter still echoes: nobody takes that for an answer.
    assert_eq!(
        ask(single, &[], false).0,
        Err(Error::Timeout { received: 0 })
    );
    assert_eq!(
        ask(exchange(8), &[], false).0,
        Err(Error::Timeout { received: 0 })
    );
    assert_eq!(
        ask(read(8), &[], false).0,
        Err(Error::Timeout { received: 0 })
    );
}

#[test]
fn a_write_waits_until_a_read_has_shown_whether_the_adapter_echoes() {
    let mut bench = Bench::new();
    let now = at(bench.line.now());
    assert_eq!(
        bench.link.start(&write(), RESERVED, now),
        Err(Refused::LocalEchoUnknown)
    );
    bench.ask(read(1), &status(1), CHARACTER).unwrap();
    assert_eq!(bench.link.local_echo(), LocalEcho::Off);
    let wrote = sealed(&[9, 16, 3, 0xE8, 0, 8]);
    assert_eq!(bench.ask(write(), &wrote, CHARACTER), Ok(wrote));
}

#[test]
fn requests_and_replies_too_long_for_the_link_are_refused() {
    let mut bench = Bench::new();
    let now = at(bench.line.now());
    assert_eq!(
        bench.link.start(&read(60), RESERVED, now),
        Err(Refused::Length)
    );
    assert_eq!(
        bench.link.start(&read(0), RESERVED, now),
        Err(Refused::Length)
    );
    let long = [0; 100];
    let write = Request::ReadWrite {
        read_address: STATUS,
        read_quantity: 1,
        write_address: COMMAND,
        values: Registers::from_bytes(&long).unwrap(),
    };
    assert_eq!(
        bench.link.start(&write, RESERVED, now),
        Err(Refused::Length)
    );
    assert!(bench.line.take_written().is_empty());
}

#[test]
fn the_trace_tells_what_happened_last() {
    let mut bench = Bench::new();
    bench.ask(read(8), &status(8), CHARACTER).unwrap();
    assert!(bench.ask(read(1), &[1, 2], CHARACTER).is_err());
    let events: Vec<Event> = bench.link.trace().iter().map(|entry| entry.event).collect();
    let failed = Event::Failed(Error::Timeout { received: 2 });
    assert_eq!(events, [Event::Sent, Event::Received, Event::Sent, failed]);
    assert_eq!(bench.link.trace().iter().last().unwrap().bytes, [1, 2]);
}

#[test]
fn a_good_reply_behind_a_few_extra_bytes_is_named_and_not_taken() {
    for (request, reply) in [(read(8), status(8)), (exchange(8), exchanged())] {
        for extra in [&[0][..], &[0xFF], &[0, 0], &[0x80, 0, 0]] {
            let mut bench = Bench::new();
            let shifted = [extra, &reply].concat();
            assert_eq!(
                bench.ask(request, &shifted, CHARACTER),
                Err(Error::Shifted(extra.len() as u8))
            );
        }
        // One bit of it wrong: no good reply stands there.
        let mut broken = [&[0][..], &reply].concat();
        broken[9] ^= 4;
        let mut bench = Bench::new();
        assert_eq!(bench.ask(request, &broken, CHARACTER), Err(Error::Crc));
    }
}

#[test]
fn with_patience_a_reply_may_start_and_end_later_and_without_it_may_not() {
    let patient = |millis| Config {
        patience: gripper::Duration::from_millis(millis),
        ..Config::new(9, 115_200)
    };
    // 60 ms late; and pieces with 20 ms between them.
    for (delay, pieces) in [(60_000, 1), (2_000, 3)] {
        for (millis, taken) in [(0, false), (100, true)] {
            let line = Line::default();
            let mut link = Link::new(line.clone(), patient(millis));
            settle(&line, &mut link);
            let asked = line.now();
            link.start(&read(8), RESERVED, at(asked)).unwrap();
            for (k, piece) in status(8).chunks(21usize.div_ceil(pieces)).enumerate() {
                line.send(asked + delay + 20_000 * k as u64, CHARACTER, piece);
            }
            let heard = run_link(&line, &mut link, asked + 1_000_000, &mut |_, _, _| {});
            let good = matches!(heard, Some(Ok(_)));
            assert_eq!(
                good, taken,
                "{delay} µs, {pieces} pieces, {millis} ms: {heard:?}"
            );
        }
    }
}
