//! The link's rules, one by one, on a line of the test's own.
#![allow(clippy::unwrap_used)]

mod support;

use gripper::link::{Config, Debt, Echo, Error, Event, Field, Link, PortFault, Refused};
use gripper::registers::{COMMAND, STATUS};
use gripper::rtu::{Exception, Registers, Request, Response, crc16};
use gripper::timing;
use support::{CHARACTER, Line, at, frame_of, run_link, settle};

const STATUS_BYTES: [u8; 16] = [
    0x39, 0xC0, 0, 0xFF, 8, 15, 0, 8, 16, 0, 8, 15, 0, 0x89, 0, 0,
];
const BLOCK: [u8; 16] = [
    9, 12, 0, 128, 255, 150, 128, 255, 150, 128, 255, 150, 128, 255, 150, 0,
];
const RESERVED: &[u8] = &gripper::registers::three_finger::STATUS_RESERVED;
/// From the end of a request to the start of the reply, µs.
const TURNAROUND: u64 = 1_750;

fn read(quantity: u16) -> Request<'static> {
    Request::ReadHolding {
        address: STATUS,
        quantity,
    }
}

fn exchange(quantity: u16) -> Request<'static> {
    let values = Registers::from_bytes(&BLOCK).unwrap();
    Request::ReadWrite {
        read_address: STATUS,
        read_quantity: quantity,
        write_address: COMMAND,
        values,
    }
}

fn write() -> Request<'static> {
    Request::WriteMultiple {
        address: COMMAND,
        values: Registers::from_bytes(&BLOCK).unwrap(),
    }
}

fn status(quantity: usize) -> Vec<u8> {
    frame_of(&Response::ReadHolding(
        Registers::from_bytes(&STATUS_BYTES[..2 * quantity]).unwrap(),
    ))
}

fn exchanged() -> Vec<u8> {
    frame_of(&Response::ReadWrite(
        Registers::from_bytes(&STATUS_BYTES).unwrap(),
    ))
}

fn sealed(body: &[u8]) -> Vec<u8> {
    let mut frame = body.to_vec();
    frame.extend_from_slice(&crc16(body).to_le_bytes());
    frame
}

struct Bench {
    line: Line,
    link: Link<Line>,
}

impl Bench {
    fn new() -> Self {
        let line = Line::default();
        let mut link = Link::new(line.clone(), Config::new(9, 115_200));
        settle(&line, &mut link);
        Self { line, link }
    }

    /// Sends `request`; the line answers with `reply` after the turnaround, bytes `spacing` apart.
    fn ask(&mut self, request: Request<'_>, reply: &[u8], spacing: u64) -> Result<Vec<u8>, Error> {
        settle(&self.line, &mut self.link);
        assert_eq!(
            self.link.start(&request, RESERVED, at(self.line.now())),
            Ok(())
        );
        let until = self.line.now() + 200_000;
        let mut device = |line: &Line, end, _: &[u8]| line.send(end + TURNAROUND, spacing, reply);
        run_link(&self.line, &mut self.link, until, &mut device).expect("every wait ends")
    }
}

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
            Err(Error::Shape(Field::Echo))
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
        (outcome.expect("every wait ends"), link.echo())
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
            (Ok(status(8)), Echo::On)
        );
        assert_eq!(
            ask(exchange(8), &exchanged(), together),
            (Ok(exchanged()), Echo::On)
        );
        assert_eq!(
            ask(write(), &wrote, together),
            (Ok(wrote.clone()), Echo::On)
        );
        assert_eq!(
            ask(single, &single_reply, together),
            (Ok(single_reply.clone()), Echo::On)
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
        Err(Refused::EchoUnknown)
    );
    bench.ask(read(1), &status(1), CHARACTER).unwrap();
    assert_eq!(bench.link.echo(), Echo::Off);
    let wrote = sealed(&[9, 16, 3, 0xE8, 0, 8]);
    assert_eq!(bench.ask(write(), &wrote, CHARACTER), Ok(wrote));
}

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
        Err(Refused::Owed)
    );
    assert_eq!(bench.link.debt(&read(8), now), Debt::Open);
    assert_eq!(bench.link.debt(&exchange(8), now), Debt::None);
    // A later answer settles it as far as order goes; time ends it altogether.
    assert!(bench.ask(read(7), &status(7), CHARACTER).is_ok());
    assert!(matches!(
        bench.link.debt(&read(8), at(bench.line.now())),
        Debt::Settled { .. }
    ));
    bench
        .line
        .set_now(bench.line.now() + timing::MEMORY.as_ticks());
    assert_eq!(bench.link.debt(&read(8), at(bench.line.now())), Debt::None);
}

#[test]
fn a_late_reply_is_stale_and_never_the_answer() {
    let mut bench = Bench::new();
    assert!(bench.ask(read(8), &[], CHARACTER).is_err());
    // The late reply comes while the next request waits for its own.
    assert_eq!(bench.ask(read(7), &status(8), CHARACTER), Err(Error::Stale));
    // A late reply in the quarantine is recognised too, and pays its debt.
    let mut bench = Bench::new();
    assert!(bench.ask(exchange(8), &[], CHARACTER).is_err());
    bench
        .line
        .send(bench.line.now() + 300, CHARACTER, &exchanged());
    settle(&bench.line, &mut bench.link);
    let counters = bench.link.counters();
    assert_eq!((counters.stale, counters.noise), (1, 0));
    assert_eq!(
        bench.link.debt(&exchange(8), at(bench.line.now())),
        Debt::None
    );
    assert!(
        bench
            .link
            .trace()
            .iter()
            .any(|entry| entry.event == Event::Late && *entry.bytes == *exchanged())
    );
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
