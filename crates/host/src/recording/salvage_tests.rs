use std::path::Path;

use bridge::trace::{Entry, GLOVE, Note as _};
use gripper::Instant;

use super::*;
use crate::clock::Clock;
use crate::recording::{Drawn, SessionLog};
use crate::session::record::queue;

/// A log with a trace of some blocks; and what it holds.
fn log(path: &Path) -> Vec<u8> {
    let (feed, records) = queue(1);
    let trace = feed.trace();
    trace.note(&Entry::Head { axes: 4 });
    for turn in 0..40 {
        trace.waited();
        trace.clock(Instant::from_ticks(1_000 * turn));
        trace.note(&Entry::Read {
            port: GLOVE,
            bytes: &[turn as u8; 4_000],
        });
    }
    let log = SessionLog::create(path, Drawn::USUAL, Clock::start(), records).unwrap();
    log.finish();
    std::fs::read(path).unwrap()
}

/// Times and data of the messages.
fn messages(file: &[u8]) -> (Vec<(u64, Vec<u8>)>, Found) {
    let mut all = Vec::new();
    let found = read(file, |message| {
        all.push((message.log_time, message.data.to_vec()));
    });
    (all, found.unwrap())
}

#[test]
fn a_whole_log_is_read_with_times_that_go_on_and_a_damaged_one_as_far_as_it_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let file = log(&folder.path().join("run.mcap"));
    let (all, found) = messages(&file);
    assert!(found.finished && found.damage.is_empty(), "{found:?}");
    assert_eq!(found.program, crate::trace::PROGRAM);
    assert!(all.len() >= 4, "{} blocks", all.len());
    assert!(all.is_sorted_by_key(|(time, _)| *time) && all[0].0 > 0);
    for cut in (MAGIC.len()..file.len()).step_by(97) {
        let (some, found) = messages(&file[..cut]);
        assert_eq!(some, all[..some.len()], "cut at {cut}");
        assert!(
            !found.finished || some.len() == all.len(),
            "cut at {cut}: {found:?}"
        );
    }
    for place in (MAGIC.len()..file.len()).step_by(61) {
        let mut other = file.clone();
        other[place] ^= 1 << (place % 8);
        let (some, found) = messages(&other);
        let known = |message: &(u64, Vec<u8>)| all.iter().any(|(_, data)| *data == message.1);
        assert!(some.iter().all(known), "bit at {place}: nothing is made up");
        let lost = all.len() - some.len();
        assert!(lost <= 1 || !found.damage.is_empty(), "bit at {place}");
    }
    assert_eq!(read(b"no log", |_| {}), Err(NoLog));
}

#[test]
fn beginnings_of_chunks_that_are_none_cost_no_more_than_a_few_times_the_file() {
    // Each claims the rest of the file, and has a wrong checksum.
    let mut file = MAGIC.to_vec();
    file.push(0xFF);
    file.extend([0xFF; 8]);
    let length = 2_000_000;
    while file.len() < length {
        let body = (length + 64 - file.len() - FRAME) as u64;
        file.push(op::CHUNK);
        file.extend(body.to_le_bytes());
        let records = body - 40;
        file.extend([[0; 8], [0; 8], records.to_le_bytes()].concat());
        file.extend(1_u32.to_le_bytes());
        file.extend(0_u32.to_le_bytes());
        file.extend(records.to_le_bytes());
    }
    file.resize(length + 64, 0);
    let mut reading = Reading {
        file: &file,
        found: Found::default(),
        schemas: BTreeMap::new(),
        channels: BTreeMap::new(),
        each: &mut |_| {},
        search: 5_000_000,
    };
    assert_eq!(reading.next_chunk(MAGIC.len() + 1), None);
    // Two of them fit, and the last ones, which are short.
    assert!(reading.search < 1_000_000, "{}", reading.search);
    let found = read(&file, |_| {}).unwrap();
    assert_eq!((found.messages, found.damage.len()), (0, 1));
}

#[test]
fn what_a_file_says_of_its_program_commands_no_terminal() {
    let clean = printable("evil \u{1b}]0;owned\u{7}\u{1b}[2J");
    assert_eq!(clean, "evil ]0;owned[2J");
    assert_eq!(printable(&"x".repeat(500)).len(), 80);
}
