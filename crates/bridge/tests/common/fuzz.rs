//! Fuzz targets as plain functions: any bytes in, a panic only when something is wrong. Run by `tests/fuzz.rs` on stable; a
//! coverage-guided fuzzer calls the same functions.

use super::bench::{Bench, MS};
use super::host::{Host, framed};
use bridge::Settings;
use bridge::protocol::frame::{Decoder, MAX_FRAME, MAX_MESSAGE, SCRATCH, encode};
use bridge::protocol::message::{Answer, Call, FromBridge, Request, VERSION};
use std::fmt::Debug;

/// Bytes of a line: what the decoder gives is what was framed, within the longest message; and each message of host or bridge
/// that bytes make is the same after it was written and read again.
pub fn frames(data: &[u8]) {
    let mut decoder = Decoder::new();
    let mut messages = 0;
    for &byte in data {
        if let Some(message) = decoder.push(byte, <[u8]>::to_vec) {
            messages += 1;
            assert!(message.len() <= MAX_MESSAGE);
            assert_eq!(through_a_frame(&message), message);
            one(&message);
        }
    }
    assert_eq!(decoder.counters().good, messages);
    one(data);
}

fn through_a_frame(message: &[u8]) -> Vec<u8> {
    let (mut scratch, mut out) = ([0; SCRATCH], [0; MAX_FRAME]);
    scratch[..message.len()].copy_from_slice(message);
    let frame = encode(&mut scratch, message.len(), &mut out).expect("it came in a frame");
    let mut decoder = Decoder::new();
    let back = frame
        .iter()
        .find_map(|&byte| decoder.push(byte, <[u8]>::to_vec));
    back.expect("its own frame")
}

fn one(message: &[u8]) {
    if let Ok(request) = postcard::from_bytes::<Request<'_>>(message) {
        let mut bytes = vec![0; message.len()];
        let bytes = written(&request, &mut bytes);
        let again = postcard::from_bytes::<Request<'_>>(bytes).expect("it was written");
        same(&request, &again);
    }
    if let Ok(told) = postcard::from_bytes::<FromBridge>(message) {
        let mut bytes = vec![0; message.len()];
        let bytes = written(&told, &mut bytes);
        let again = postcard::from_bytes::<FromBridge>(bytes).expect("it was written");
        same(&told, &again);
    }
}

/// Numbers may have been written longer than they need be; never shorter.
fn written<'b>(value: &impl serde::Serialize, out: &'b mut [u8]) -> &'b [u8] {
    postcard::to_slice(value, out).expect("no longer than what it was read from")
}

/// By what they print: a NaN is not equal to itself.
fn same(one: &impl Debug, other: &impl Debug) {
    assert_eq!(format!("{one:?}"), format!("{other:?}"));
}

/// A call made of bytes.
fn call(kind: u8, value: u32, bytes: &[u8]) -> Call<'_> {
    match kind % 16 {
        0 | 1 => Call::Hello { version: VERSION },
        2 => Call::Status,
        3 => Call::Counters,
        4 => Call::Slots,
        5 => Call::WeightsBegin {
            length: value,
            crc: value,
        },
        6 => Call::WeightsChunk {
            offset: value % 2_048,
            bytes,
        },
        7 => Call::WeightsCommit,
        8 => Call::WeightsAbort,
        9 => Call::SelectSlot { slot: value as u8 },
        10 => Call::ConfigurationGet,
        11 => Call::Engage,
        12 => Call::Release,
        13 => Call::Telemetry {
            period_ms: value as u16,
        },
        14 => Call::Health,
        _ => match value % 9 {
            0 => Call::CalibrateStraight,
            1 => Call::ProfileChunk {
                offset: value % 2_048,
                bytes,
            },
            2 => Call::ProfileCommit {
                length: 748,
                crc: value,
            },
            3 => Call::ProfileErase,
            4 => Call::ProfileGet { offset: value },
            5 => Call::Scans { on: true },
            6 => Call::SensorIds,
            7 => Call::Headings,
            _ if value % 2 == 1 => Call::Devices,
            _ => Call::CalibrateUndo,
        },
    }
}

/// The bridge with a host whose line carries anything: raw bytes, framed ones, calls in any order and of any session. What the
/// bridge says is always whole messages (the host's end checks each), it never moves without a person's calls, and when
/// the noise has ended and its lease is over the next host is heard. Returns how many messages it said.
pub fn server(data: &[u8]) -> u32 {
    let bench = Bench::with(Settings::default(), None, rig::gripper::Config::default());
    let mut host = Host::new(bench);
    let (mut said, mut sequence) = (0, 0_u16);
    let mut script = data.iter().copied();
    while let Some(operation) = script.next() {
        let mut byte = || script.next().unwrap_or(0);
        let mut some = |most: u8| -> Vec<u8> {
            let count = byte() % most;
            (0..count).map(|_| byte()).collect()
        };
        match operation % 4 {
            0 => host.say(&some(24)),
            1 => host.say(&framed(&some(24))),
            2 => {
                let kind = operation / 4;
                let bytes = if kind % 16 == 6 { some(64) } else { Vec::new() };
                let value = u32::from_le_bytes([byte(), byte(), operation, 0]);
                // Most come in the order of one session.
                sequence = match value % 8 {
                    7 => value as u16,
                    _ => sequence.wrapping_add(1),
                };
                let session = u32::from(value % 8 == 6);
                host.send(session, sequence, call(kind, value, &bytes));
            }
            _ => host.run(u64::from(operation) * MS),
        }
        host.turn();
        host.line.block(operation == 0xFF);
        said += std::iter::from_fn(|| host.hear()).count() as u32;
    }
    host.line.block(false);
    // A zero ends whatever half of a frame is there; the lease of a vanished host is 2 s.
    host.say(&[0]);
    host.run(2_500 * MS);
    said += std::iter::from_fn(|| host.hear()).count() as u32;
    let answer = host.ask_as(0xFFFF_0000, Call::Hello { version: VERSION });
    assert!(matches!(answer, Ok(Answer::Hello(_))), "{answer:?}");
    assert!(!host.bench.state().is_moving(), "{:?}", host.bench.state());
    said
}
