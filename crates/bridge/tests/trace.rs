//! The coding of a trace: every entry comes back as it was, and no bytes make the reader panic or go round.
#![allow(missing_docs)]

use std::cell::RefCell;

use bridge::trace::{
    Call, Damage, Difference, Entry, GLOVE, GRIPPER, HOST, Loose, Note, Order, Part, Port, Reader,
    Recorder, Seen, Sink, Source, Strict, Tapped, What,
};
use bridge::{Config, Instant, Settings};
use embedded_io::{ErrorKind, Read, ReadReady, Write};
use glove::sc18im::BaudRefused;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

#[derive(Default)]
struct Bytes(Vec<u8>);

impl Sink for Bytes {
    fn put(&mut self, head: &[u8], body: &[u8]) {
        self.0.extend_from_slice(head);
        self.0.extend_from_slice(body);
    }
}

fn coded(entries: &[Entry<'_>]) -> Vec<u8> {
    let mut recorder = Recorder::new(Bytes::default());
    entries.iter().for_each(|entry| recorder.note(entry));
    recorder.release().0
}

fn entries() -> Vec<Entry<'static>> {
    let clock = |turn, at| Entry::Clock { turn, at };
    let mut all = vec![Entry::Head { axes: 4 }];
    for part in [Part::Image, Part::Profile, Part::Settings, Part::Home] {
        let bytes = &[7; 300];
        all.push(Entry::Part { part, bytes });
    }
    all.extend([
        clock(true, 0),
        clock(false, 0),
        clock(false, 31),
        clock(true, 63),
        clock(true, 5_000),
        clock(false, u64::MAX),
    ]);
    for port in [HOST, GLOVE, GRIPPER] {
        let bytes = &[1, 2, 3, 255];
        all.push(Entry::Read { port, bytes });
        all.push(Entry::Write { port, bytes: &[] });
        all.push(Entry::Ready { port });
        for call in [Call::Ready, Call::Read, Call::Write] {
            let kind = ErrorKind::NotConnected;
            all.push(Entry::Failed { port, call, kind });
        }
        for refused in [
            None,
            Some(BaudRefused::Fixed),
            Some(BaudRefused::Unsupported(460_800)),
        ] {
            let baud = 460_800;
            all.push(Entry::Speed {
                port,
                baud,
                refused,
            });
        }
    }
    all.extend(
        [
            Order::Engage,
            Order::Heartbeat(u32::MAX),
            Order::Release,
            Order::Activate,
            Order::FlatPose(30_000_000),
            Order::CalibrateStraight(0),
            Order::UndoCalibration,
            Order::FindFlat(true),
            Order::FindFlat(false),
            Order::Profile(&[]),
            Order::Settings(&[1, 2, 3]),
        ]
        .map(Entry::Order),
    );
    let (state, digest) = (4, 0xDEAD_BEEF);
    all.push(Entry::Seen(Seen { state, digest }));
    all.push(Entry::Lost { bytes: 1 << 40 });
    all
}

/// What can be read, and why no more.
fn read(bytes: &[u8]) -> (Vec<Entry<'_>>, Option<Damage>) {
    let mut reader = Reader::new(bytes);
    let mut all = Vec::new();
    loop {
        let before = reader.offset();
        match reader.read() {
            Ok(Some(entry)) => all.push(entry),
            Ok(None) => return (all, None),
            Err(damage) => return (all, Some(damage)),
        }
        assert!(reader.offset() > before, "it goes on");
    }
}

#[test]
fn every_entry_comes_back_as_it_was() {
    let all = entries();
    assert_eq!(read(&coded(&all)), (all, None));
}

#[test]
fn a_trace_cut_anywhere_gives_its_whole_entries_and_says_that_it_is_cut() {
    let all = entries();
    let bytes = coded(&all);
    let ends: Vec<usize> = (0..=all.len()).map(|n| coded(&all[..n]).len()).collect();
    for cut in 0..bytes.len() {
        let (found, damage) = read(&bytes[..cut]);
        let whole = ends.iter().filter(|end| **end <= cut).count() - 1;
        assert_eq!(found, all[..whole], "cut at {cut}");
        let expected = (!ends.contains(&cut)).then_some(Damage::Cut);
        assert_eq!(damage, expected, "cut at {cut}");
    }
}

#[test]
fn no_bytes_make_a_reader_or_a_replay_panic_or_go_round() {
    let bytes = coded(&entries());
    let seed = 7;
    println!("seed {seed}");
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for round in 0..20_000 {
        let mut other = bytes.clone();
        if round < 8 * bytes.len() {
            other[round / 8] ^= 1 << (round % 8);
        } else {
            for _ in 0..random.random_range(1..40) {
                let place = random.random_range(0..other.len());
                other[place] = random.random();
            }
        }
        read(&other);
        let (strict, loose) = (Strict::new(&other), Loose::new(&other));
        for _ in 0..200 {
            touch(&strict, &mut random);
            touch(&loose, &mut random);
        }
    }
}

fn touch(source: &impl Source, random: &mut ChaCha8Rng) {
    let port = random.random_range(0..5);
    match random.random_range(0..7) {
        0 => drop(source.now()),
        1 => source.wait_until(Instant::from_ticks(random.random_range(0..10_000))),
        2 => drop(source.ready(port)),
        3 => drop(source.read(port, &mut [0; 3])),
        4 => drop(source.write(port, &[1, 2, 3, 255])),
        5 => drop(source.set_baud(port, 460_800)),
        _ => drop(source.order().is_some() || source.is_over()),
    }
}

#[test]
fn a_trace_of_another_version_says_which() {
    let mut bytes = coded(&[Entry::Head { axes: 4 }]);
    bytes[7] = 9;
    let (_, damage) = read(&bytes);
    assert_eq!(damage, Some(Damage::Version(9)));
    let words = damage.map(|damage| damage.to_string()).unwrap_or_default();
    assert!(
        words.contains("version 9") && words.contains("version 1"),
        "{words}"
    );
}

#[test]
fn a_port_that_is_written_down_gives_the_same_bytes_again_and_another_write_is_named() {
    let world = coded(&[Entry::Read {
        port: GLOVE,
        bytes: &[1, 2, 3],
    }]);
    let recorder = RefCell::new(Recorder::new(Bytes::default()));
    let strict = Strict::new(&world);
    let mut port = Tapped::new(Port::new(&strict, GLOVE), GLOVE, &recorder);
    (&recorder).clock(Instant::from_ticks(1_000));
    assert_eq!(port.read_ready(), Ok(true));
    let mut two = [0; 2];
    assert_eq!(port.read(&mut two), Ok(2));
    assert_eq!(port.read_ready(), Ok(true), "one is left, and not read");
    assert_eq!(port.write(&[7, 8]), Ok(2));
    let trace = recorder.into_inner().release().0;
    let at = 1_000;
    let (found, _) = read(&trace);
    let written = Entry::Write {
        port: GLOVE,
        bytes: &[7, 8],
    };
    let read = Entry::Read {
        port: GLOVE,
        bytes: &[1, 2],
    };
    let clock = Entry::Clock { turn: true, at };
    assert_eq!(found, [clock, read, Entry::Ready { port: GLOVE }, written]);

    let again = |bytes: &[u8]| {
        let strict = Strict::new(&trace);
        strict.now();
        let mut port = Port::new(&strict, GLOVE);
        let _ = port.read_ready();
        let _ = port.read(&mut two.clone());
        let _ = port.read_ready();
        let _ = port.write(bytes);
        strict.difference()
    };
    assert_eq!(again(&[7, 8]), None);
    let (byte, expected, got) = (1, 8, 9);
    let other = Difference::Byte {
        port: GLOVE,
        byte,
        expected,
        got,
    };
    assert_eq!(again(&[7, 9]), Some((1_000, other)));
    let strict = Strict::new(&trace);
    strict.now();
    let _ = strict.write(GRIPPER, &[1]);
    let (expected, got) = (What::Read(GLOVE), What::Write(GRIPPER));
    let call = Difference::Call { expected, got };
    assert_eq!(strict.difference(), Some((1_000, call)));
}

#[test]
fn settings_come_back_as_they_were() {
    let settings = Settings::<4> {
        rate: 123.456,
        speed: [1, 2, 3, 4],
        ..Settings::default()
    };
    let bytes = bridge::trace::configuration(&settings);
    let back = bridge::trace::settings(&bytes, Settings::<4>::default());
    assert_eq!(back, Config::new(settings).ok());
    assert_eq!(bridge::trace::settings(&[], Settings::<4>::default()), None);
}
