//! Campaigns against the line: every small error, every late reply, every noise. Each prints its
//! counts (`cargo test -p gripper --test campaigns -- --nocapture`). Seeded; time is virtual.
#![allow(clippy::unwrap_used)]

mod support;

use gripper::driver::{Config, Error, ThreeFinger, TwoFinger};
use gripper::link::{self, Field, Link};
use gripper::registers::{STATUS, two_finger};
use gripper::rtu::{Registers, Request, Response, crc16};
use gripper::{Gripper, Motion, Status};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::collections::BTreeMap;
use support::{CHARACTER, Line, Slave, at, frame_of, run_gripper, run_link, settle};

/// The 11-byte reply of the maker's example: 2F closing, 3 registers.
const REPLY: [u8; 11] = [
    0x09, 0x03, 0x06, 0x39, 0x00, 0x00, 0xFF, 0x0E, 0x0A, 0xF7, 0x8B,
];
const BITS: usize = 8 * REPLY.len();
const READ_3: Request<'static> = Request::ReadHolding {
    address: STATUS,
    quantity: 3,
};

fn flipped(bits: &[usize]) -> [u8; 11] {
    let mut reply = REPLY;
    bits.iter().for_each(|bit| reply[bit / 8] ^= 1 << (bit % 8));
    reply
}

fn below(rng: &mut ChaCha8Rng, limit: u64) -> u64 {
    rng.next_u64() % limit
}

/// One request, this reply: what the link says, and how long after the reply's last byte.
fn judge(reply: &[u8]) -> (Result<Vec<u8>, link::Error>, u64) {
    let line = Line::default();
    let mut link = Link::new(line.clone(), link::Config::new(9, 115_200));
    settle(&line, &mut link);
    link.start(&READ_3, &two_finger::STATUS_RESERVED, at(line.now()))
        .unwrap();
    let mut last = 0;
    let outcome = run_link(
        &line,
        &mut link,
        line.now() + 100_000,
        &mut |line, end, _| {
            line.send(end + 1_750, CHARACTER, reply);
            last = end + 1_750 + reply.len() as u64 * CHARACTER;
        },
    );
    (outcome.unwrap(), line.now() - last)
}

#[test]
fn all_errors_of_one_to_three_bits_are_crc_errors_at_once() {
    assert_eq!(judge(&REPLY), (Ok(REPLY.to_vec()), 0));
    let (mut cases, mut rejected) = (0, 0);
    let mut check = |bits: &[usize]| {
        cases += 1;
        // Told in the very poll that saw the last byte.
        rejected += u32::from(judge(&flipped(bits)) == (Err(link::Error::Crc), 0));
    };
    for a in 0..BITS {
        check(&[a]);
        for b in a + 1..BITS {
            check(&[a, b]);
            for c in b + 1..BITS {
                check(&[a, b, c]);
            }
        }
    }
    println!(
        "errors of 1, 2, 3 bits: {rejected} of {cases} rejected as Crc at the reply's last byte"
    );
    assert_eq!((rejected, cases), (113_652, 113_652));
}

/// All 4-bit patterns whose CRC is 0: four single-bit syndromes that cancel.
fn invisible_patterns() -> Vec<[usize; 4]> {
    let clean = crc16(&[0; 9]);
    let syndrome = |bit: usize| {
        let mut frame = [0_u8; 11];
        frame[bit / 8] = 1 << (bit % 8);
        crc16(&frame[..9]) ^ clean ^ u16::from_le_bytes([frame[9], frame[10]])
    };
    let syndromes: Vec<u16> = (0..BITS).map(syndrome).collect();
    let mut found = Vec::new();
    for a in 0..BITS {
        for b in a + 1..BITS {
            for c in b + 1..BITS {
                let rest = syndromes[a] ^ syndromes[b] ^ syndromes[c];
                found.extend(
                    (c + 1..BITS)
                        .filter(|&d| syndromes[d] == rest)
                        .map(|d| [a, b, c, d]),
                );
            }
        }
    }
    found
}

/// The field of the reply a bit lies in.
fn field_of(bit: usize) -> &'static str {
    match (bit / 8, bit % 8) {
        (0, _) => "unit",
        (1, _) => "function",
        (2, _) => "count",
        (3, 0) => "gACT",
        (3, 1 | 2) | (4, _) => "reserved",
        (3, 3) => "gGTO",
        (3, 4 | 5) => "gSTA",
        (3, _) => "gOBJ",
        (5, 0..=3) => "gFLT",
        (5, _) => "kFLT",
        (6, _) => "gPR",
        (7, _) => "gPO",
        (8, _) => "gCU",
        _ => "CRC",
    }
}

#[test]
fn four_bit_errors_the_crc_cannot_see_are_stopped_by_the_other_checks() {
    let patterns = invisible_patterns();
    let mut stopped: BTreeMap<String, u32> = BTreeMap::new();
    let mut passed: BTreeMap<String, u32> = BTreeMap::new();
    for bits in &patterns {
        let line = Line::default();
        let mut gripper = TwoFinger::new(
            line.clone(),
            two_finger::Model::TwoFinger85,
            Config::default(),
        );
        let mut ask = |reply: &[u8]| {
            run_gripper(
                &line,
                &mut gripper,
                line.now() + 100_000,
                &mut |line, end, _| {
                    line.send(end + 1_750, CHARACTER, reply);
                },
            )
        };
        // The driver has seen the true status once: the echo it repeats is known.
        assert!(ask(&REPLY).unwrap().is_ok());
        match ask(&flipped(bits)).unwrap() {
            Err(Error::Link(link::Error::Shape(field))) => {
                *stopped.entry(format!("{field:?}")).or_default() += 1
            }
            Err(other) => panic!("{bits:?}: {other:?}"),
            Ok(_) => {
                let mut fields: Vec<&str> = bits.iter().map(|&bit| field_of(bit)).collect();
                fields.dedup();
                *passed.entry(fields.join(" + ")).or_default() += 1;
            }
        }
    }
    let (stops, passes) = (stopped.values().sum::<u32>(), passed.values().sum::<u32>());
    println!(
        "4-bit errors with a right CRC: {}; stopped {stops}: {stopped:?}",
        patterns.len()
    );
    println!("not stopped {passes}, by the fields they change: {passed:?}");
    assert_eq!(patterns.len(), 927);
    assert!(f64::from(stops) >= 0.85 * 927.0);
}

/// Which gripper a campaign runs against, and how its status carries the number of the request it
/// answers: gPOA, gPOB, gPOC, or gPO and gCU.
trait Numbered<const X: usize>: Gripper<X, Error = Error> {
    fn new(line: Line) -> Self;
    fn slave() -> Slave;
    fn put(status: &mut [u8; 16], number: u32);
    fn number(status: &Status<X>) -> u32;
    const MASK: u32;
}

impl Numbered<4> for ThreeFinger<Line> {
    const MASK: u32 = 0xFF_FFFF;

    fn new(line: Line) -> Self {
        Self::new(line, Config::default())
    }

    fn slave() -> Slave {
        Slave::three_finger()
    }

    fn put(status: &mut [u8; 16], number: u32) {
        let [_, high, middle, low] = number.to_be_bytes();
        (status[4], status[7], status[10]) = (high, middle, low);
    }

    fn number(status: &Status<4>) -> u32 {
        let [high, middle, low, _] = status.position;
        u32::from_be_bytes([0, high, middle, low])
    }
}

impl Numbered<1> for TwoFinger<Line> {
    const MASK: u32 = 0xFFFF;

    fn new(line: Line) -> Self {
        Self::new(line, two_finger::Model::TwoFinger85, Config::default())
    }

    fn slave() -> Slave {
        Slave::two_finger()
    }

    fn put(status: &mut [u8; 16], number: u32) {
        let [_, _, high, low] = number.to_be_bytes();
        (status[4], status[5]) = (high, low);
    }

    fn number(status: &Status<1>) -> u32 {
        u32::from_be_bytes([0, 0, status.position[0], status.current[0]])
    }
}

/// Runs until `late` replies came late; returns (fresh statuses, late ones taken for fresh, errors).
fn late_campaign<G: Numbered<X>, const X: usize>(
    seed: u64,
    late: u32,
    in_order: bool,
) -> (u32, u32, BTreeMap<String, u32>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let line = Line::default();
    let mut gripper = G::new(line.clone());
    let mut slave = G::slave();
    let (mut number, mut delayed, mut line_busy) = (0_u32, 0, 0);
    let (mut fresh, mut wrong, mut errors) = (0, 0, BTreeMap::new());
    while delayed < late {
        let motion = Motion {
            position: [rng.next_u32() as u8; X],
            speed: [255; X],
            force: [255; X],
        };
        gripper.set_motion((below(&mut rng, 8) != 0).then_some(motion), at(line.now()));
        let outcome = run_gripper(
            &line,
            &mut gripper,
            line.now() + 3_000_000,
            &mut |line, end, request| {
                number = (number + 1) & G::MASK;
                G::put(&mut slave.status, number);
                let reply = slave.answer(request);
                // One in four is late; out of order, one at a time.
                let free = in_order || line_busy <= line.now();
                let mut start = end + 1_750;
                if below(&mut rng, 4) == 0 && free {
                    delayed += 1;
                    // Just late, in the quarantine, into the next transactions, up to the memory's end.
                    start += match below(&mut rng, 4) {
                        0 => 6_000 + below(&mut rng, 6_000),
                        1 => 8_500 + below(&mut rng, 12_000),
                        2 => 8_500 + below(&mut rng, 100_000),
                        _ => 8_500 + below(&mut rng, 1_950_000),
                    };
                    line_busy = line_busy.max(start + reply.len() as u64 * CHARACTER);
                }
                if in_order {
                    // A slave that answers in order: the next reply waits for the late one.
                    start = start.max(line_busy);
                    line_busy = start + reply.len() as u64 * CHARACTER;
                }
                line.send(start, CHARACTER, &reply);
            },
        );
        match outcome.expect("every wait ends") {
            Ok(status) if G::number(&status) == number => fresh += 1,
            Ok(_) => wrong += 1,
            Err(error) => {
                let text = format!("{error:?}");
                let name = text
                    .trim_end_matches(|c: char| c.is_ascii_digit() || c == ')')
                    .to_string();
                *errors.entry(name).or_default() += 1;
            }
        }
    }
    (fresh, wrong, errors)
}

#[test]
fn ten_thousand_late_replies_and_none_is_taken_for_fresh() {
    let campaigns = [
        (
            "3-Finger, in order",
            late_campaign::<ThreeFinger<Line>, 4>(1, 10_000, true),
        ),
        (
            "3-Finger, out of order",
            late_campaign::<ThreeFinger<Line>, 4>(2, 10_000, false),
        ),
        (
            "2F, in order",
            late_campaign::<TwoFinger<Line>, 1>(3, 10_000, true),
        ),
    ];
    for (name, (fresh, wrong, errors)) in &campaigns {
        println!(
            "10000 late replies, {name}: {wrong} taken for fresh, {fresh} fresh ones taken, {errors:?}"
        );
        assert!(*fresh > 5_000, "the link still works");
    }
    assert_eq!(campaigns.map(|(_, (_, wrong, _))| wrong), [0; 3]);
}

#[test]
fn ten_thousand_late_exceptions_and_none_is_taken_for_a_younger_request_s_answer() {
    const LATE: u32 = 10_000;
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let line = Line::default();
    let two_finger = two_finger::Model::TwoFinger85;
    let mut gripper = TwoFinger::new(line.clone(), two_finger, Config::default());
    let mut slave = Slave::two_finger();
    let (mut delayed, mut number, mut busy) = (0, 0_u32, 0);
    let (mut fresh, mut wrong, mut refused, mut stale) = (0, 0, 0, 0);
    while delayed < LATE {
        let motion = Motion {
            position: [rng.next_u32() as u8],
            speed: [255],
            force: [255],
        };
        gripper.set_motion((below(&mut rng, 8) != 0).then_some(motion), at(line.now()));
        let mut own = false;
        let outcome = run_gripper(
            &line,
            &mut gripper,
            line.now() + 3_000_000,
            &mut |line, end, request| {
                number = (number + 1) & 0xFFFF;
                <TwoFinger<Line> as Numbered<1>>::put(&mut slave.status, number);
                let mut start = end + 1_750;
                own = below(&mut rng, 4) == 0;
                let reply = if own {
                    // A refusal, and a late one: from just late to the memory's end.
                    delayed += 1;
                    start += match below(&mut rng, 3) {
                        0 => 7_500 + below(&mut rng, 6_000),
                        1 => 8_500 + below(&mut rng, 30_000),
                        _ => 8_500 + below(&mut rng, 500_000),
                    };
                    let mut reply = vec![9, request[1] | 0x80, 6];
                    reply.extend(crc16(&reply).to_le_bytes());
                    reply
                } else {
                    slave.answer(request)
                };
                // It answers in order.
                start = start.max(busy);
                busy = start + reply.len() as u64 * CHARACTER;
                line.send(start, CHARACTER, &reply);
            },
        );
        match outcome.expect("every wait ends") {
            Ok(status) if <TwoFinger<Line> as Numbered<1>>::number(&status) == number => fresh += 1,
            Ok(_) => wrong += 1,
            Err(Error::Link(link::Error::Exception(_))) if own => refused += 1,
            Err(Error::Link(link::Error::Exception(_))) => wrong += 1,
            Err(Error::Link(link::Error::Stale)) => stale += 1,
            Err(_) => {}
        }
    }
    println!(
        "{LATE} late exceptions: {wrong} taken for a younger request's answer; {fresh} fresh statuses taken, {stale} told as stale, {refused} just in time"
    );
    assert_eq!(wrong, 0);
    assert!(fresh > 2_000 && stale > 0, "the link still works");
}

#[test]
fn after_any_noise_the_next_request_at_the_latest_succeeds() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (mut cases, mut lost, mut believed) = (0, 0, 0);
    for length in 0..=256 {
        for case in 0..100 {
            let line = Line::default();
            let mut gripper = ThreeFinger::new(line.clone(), Config::default());
            let mut slave = Slave::three_finger();
            let mut noise = vec![0; length];
            rng.fill_bytes(&mut noise);
            // At line speed or all at once; before, with or after the start of the reply.
            let spacing = if case % 3 == 0 { 0 } else { CHARACTER };
            let early = below(&mut rng, 3_000);
            let mut requests = 0;
            let mut outcomes = Vec::new();
            for _ in 0..3 {
                let motion = Motion {
                    position: [case as u8; 4],
                    speed: [255; 4],
                    force: [255; 4],
                };
                gripper.set_motion((case % 2 == 0).then_some(motion), at(line.now()));
                outcomes.push(run_gripper(
                    &line,
                    &mut gripper,
                    line.now() + 200_000,
                    &mut |line, end, request| {
                        requests += 1;
                        if requests == 2 {
                            // The reply follows its prefix without a pause.
                            let mut bytes = noise.clone();
                            bytes.extend_from_slice(&slave.answer(request));
                            line.send(end + early, spacing, &bytes);
                        } else {
                            slave.serve(line, end, request);
                        }
                    },
                ));
            }
            let good = outcomes
                .iter()
                .map(|outcome| matches!(outcome, Some(Ok(_))))
                .collect::<Vec<_>>();
            assert!(
                good[0] && good[2],
                "{length} bytes, case {case}: {outcomes:?}"
            );
            assert!(
                good[1] || length > 0,
                "nothing came before it: {outcomes:?}"
            );
            lost += u32::from(!good[1]);
            believed += u32::from(good[1] && length > 0);
            cases += 1;
        }
    }
    println!(
        "prefixes of 0 to 256 random bytes: {cases} cases, {lost} cost that reply, the next one came in all; {believed} passed with noise before it"
    );
    assert_eq!((cases, lost, believed), (25_700, 25_600, 0));
}

#[test]
fn noise_that_looks_like_a_frame_of_another_length_is_not_a_reply() {
    // A valid frame of every length in front of the reply: never an answer, the next one is.
    let bytes = [0x31; 60];
    for registers in (1..=29).filter(|&registers| registers != 8) {
        let frame = frame_of(&Response::ReadHolding(
            Registers::from_bytes(&bytes[..2 * registers]).unwrap(),
        ));
        let line = Line::default();
        let mut gripper = ThreeFinger::new(line.clone(), Config::default());
        let mut slave = Slave::three_finger();
        let mut first = true;
        let mut ask = || {
            run_gripper(
                &line,
                &mut gripper,
                line.now() + 200_000,
                &mut |line, end, request| {
                    if std::mem::take(&mut first) {
                        line.send(end, CHARACTER, &frame);
                    }
                    slave.serve(line, end, request);
                },
            )
        };
        assert!(ask().unwrap().is_err(), "{registers} registers");
        assert!(ask().unwrap().is_ok(), "{registers} registers");
    }
}

#[test]
fn a_shape_error_names_a_field() {
    let mut wrong_unit = REPLY;
    wrong_unit[0] = 10;
    let crc = crc16(&wrong_unit[..9]).to_le_bytes();
    wrong_unit[9..].copy_from_slice(&crc);
    assert_eq!(judge(&wrong_unit).0, Err(link::Error::Shape(Field::Unit)));
}
