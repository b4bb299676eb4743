use std::path::Path;

use bridge::trace::{Entry, GLOVE, Note as _};
use gripper::Instant;

use super::frames::FRAME;
use super::*;
use crate::clock::Clock;
use crate::recording::{Drawn, SessionLog};
use crate::session::record::queue;

/// A log with a trace of some blocks, of so many bytes for each of 40 turns; and what it holds.
fn log(path: &Path, bytes: usize) -> Vec<u8> {
    let (feed, records) = queue(1);
    let trace = feed.trace();
    trace.note(&Entry::Head { axes: 4 });
    for turn in 0..40 {
        trace.waited();
        trace.clock(Instant::from_ticks(1_000 * turn));
        trace.note(&Entry::Read {
            port: GLOVE,
            bytes: &vec![turn as u8; bytes],
        });
    }
    let log = SessionLog::create(path, Drawn::USUAL, Clock::start(), records).unwrap();
    log.finish();
    std::fs::read(path).unwrap()
}

/// From the beginning of a chunk to its first record.
const CHUNK_START: usize = FRAME + 40;

/// Topic, times and data of a message.
type Read = (String, u64, u64, Vec<u8>);

/// The messages.
fn messages(file: &[u8]) -> (Vec<Read>, Found) {
    let mut all = Vec::new();
    let found = read(file, |message| {
        let (logged, happened) = (message.log_time, message.publish_time);
        let topic = message.channel.topic.clone();
        all.push((topic, logged, happened, message.data.to_vec()));
    });
    (all, found.unwrap())
}

/// Where the data of a chunk are.
fn chunks(file: &[u8]) -> Vec<Range<usize>> {
    let mut all = Vec::new();
    let mut offset = MAGIC.len();
    while let Some((code, body)) = framed(file, offset) {
        offset = body.end;
        if code == op::CHUNK {
            all.push(chunk(file, &body).unwrap().1);
        }
    }
    all
}

/// That `some` is `all` without some messages: nothing is made up, twice there or in another order.
fn is_part(some: &[Read], all: &[Read]) -> bool {
    let mut rest = all.iter();
    some.iter().all(|one| rest.any(|other| other == one))
}

#[test]
fn a_whole_log_is_read_with_times_that_go_on_and_one_cut_anywhere_as_far_as_it_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let file = log(&folder.path().join("run.mcap"), 4_000);
    let (all, found) = messages(&file);
    assert!(found.finished && found.damage.is_empty(), "{found:?}");
    assert_eq!(found.program, crate::trace::PROGRAM);
    assert!(all.len() >= 4, "{} blocks", all.len());
    assert!(all.is_sorted_by_key(|(_, time, ..)| *time) && all[0].1 > 0);
    for cut in (MAGIC.len()..file.len()).step_by(97) {
        let (some, found) = messages(&file[..cut]);
        assert_eq!(some, all[..some.len()], "cut at {cut}");
        assert!(!found.finished, "cut at {cut}: {found:?}");
    }
    assert_eq!(read(b"no log", |_| {}), Err(NoLog));
}

#[test]
fn a_small_log_cut_at_every_length_gives_its_whole_chunks_and_says_that_it_was_not_finished() {
    let folder = tempfile::tempdir().unwrap();
    let file = log(&folder.path().join("run.mcap"), 1_000);
    let (all, _) = messages(&file);
    assert!(all.len() >= 2, "{} blocks", all.len());
    let ends: Vec<usize> = chunks(&file).iter().map(|chunk| chunk.end).collect();
    for cut in 0..file.len() {
        if cut < MAGIC.len() {
            assert_eq!(read(&file[..cut], |_| {}), Err(NoLog), "cut at {cut}");
            continue;
        }
        let (some, found) = messages(&file[..cut]);
        assert_eq!(some, all[..some.len()], "cut at {cut}");
        assert!(!found.finished, "cut at {cut}: {found:?}");
        // The first one has no message.
        let whole = ends.iter().skip(1).filter(|end| **end <= cut).count();
        assert_eq!(some.len(), whole, "cut at {cut}");
    }
}

/// One flipped bit: what can be read is what was there, no more than a chunk of it is missing, and it is named.
fn flipped(file: &[u8], all: &[Read], place: usize, bit: u8) {
    let mut other = file.to_vec();
    other[place] ^= 1 << bit;
    let at = format!("bit {bit} of byte {place}");
    if place < MAGIC.len() {
        assert_eq!(read(&other, |_| {}), Err(NoLog), "{at}");
        return;
    }
    let (some, found) = messages(&other);
    assert!(is_part(&some, all), "{at}: {found:?}");
    // Of a log without an end no checksum stands for the beginning of its header, nor does it hold a message.
    let is_named = !found.damage.is_empty();
    assert!(
        is_named || some == all && !found.finished,
        "{at}: {found:?}"
    );
    // The channels are in the first chunk and in the index.
    let is_first = all.len() - some.len() == all.len() && !found.finished;
    assert!(some.len() + 1 >= all.len() || is_first, "{at}: {found:?}");
    if some.len() < all.len() {
        let named = found
            .damage
            .iter()
            .any(|damage| damage.bytes.contains(&place));
        assert!(named, "{at}: {found:?}");
    }
}

/// Seeded numbers.
struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % end
    }
}

/// A bit of each byte that is no message, each bit of each record's kind and length, and a thousand others. Of a finished log,
/// and of one whose program was killed.
#[test]
fn a_flipped_bit_anywhere_is_named_and_costs_one_chunk_at_most() {
    let folder = tempfile::tempdir().unwrap();
    let file = log(&folder.path().join("run.mcap"), 1_000);
    let (all, _) = messages(&file);
    let chunks = chunks(&file);
    let end = End::of(&file).unwrap();
    let mut frames = Vec::new();
    let mut offset = MAGIC.len();
    while let Some((_, body)) = framed(&file, offset) {
        frames.extend(offset..body.start);
        offset = body.end;
    }
    let mut random = Random(14);
    for file in [&file[..], &file[..end.data]] {
        let is_outside = |place: &usize| !chunks.iter().any(|data| data.contains(place));
        for place in (0..file.len()).filter(is_outside) {
            flipped(file, &all, place, (place % 8) as u8);
        }
        for place in frames.iter().filter(|place| **place < file.len()) {
            (0..8).for_each(|bit| flipped(file, &all, *place, bit));
        }
        for _ in 0..1_000 {
            let place = random.below(file.len());
            flipped(file, &all, place, random.below(8) as u8);
        }
    }
}

/// A log of so many frames, in several chunks.
fn of_frames(path: &Path) -> Vec<u8> {
    let frames = (0..600).map(|k| super::super::tests::moved(10_000 * k, |_| {}));
    super::super::tests::log(path, frames).0.finish();
    std::fs::read(path).unwrap()
}

#[test]
fn the_messages_of_a_lost_chunk_are_counted_by_channel_with_the_times_between_which_they_are_missing()
 {
    let folder = tempfile::tempdir().unwrap();
    let file = of_frames(&folder.path().join("run.mcap"));
    let (all, _) = messages(&file);
    let whole = chunks(&file);
    let end = End::of(&file).unwrap();
    let is_imu = |messages: &[Read]| messages.iter().filter(|one| one.0 == "/glove/imu").count();
    for (number, data) in whole.iter().enumerate().skip(1) {
        let mut other = file.clone();
        other[data.start + 30] ^= 4;
        let is_last = number + 1 == whole.len();
        let (some, found) = messages(&other);
        let missing = is_imu(&all) - is_imu(&some);
        let lost = format!("{missing} messages of /glove/imu ");
        let named = found.damage.iter().map(ToString::to_string);
        let named: Vec<String> = named.filter(|what| what.contains(&lost)).collect();
        assert_eq!(named.len(), 1, "chunk {number}: {:?}", found.damage);
        let place = match number {
            1 => " before ",
            _ if is_last => " after ",
            _ => " between ",
        };
        assert!(named[0].contains(place), "chunk {number}: {named:?}");
        // Where the log has no end nobody knows of those after it.
        let (_, found) = messages(&other[..end.data]);
        let is_counted = found
            .damage
            .iter()
            .any(|damage| damage.what.contains(&lost));
        assert_eq!(is_counted, !is_last, "chunk {number}: {:?}", found.damage);
    }
}

#[test]
fn chunks_taken_out_of_a_log_whole_are_missed_by_their_numbers_and_by_the_index() {
    let folder = tempfile::tempdir().unwrap();
    let file = of_frames(&folder.path().join("run.mcap"));
    let (all, _) = messages(&file);
    let end = End::of(&file).unwrap();
    let places = chunks(&file);
    let start = |number: usize| places[number].start - CHUNK_START;
    // Without an end, in which the numbers alone tell.
    let cut = [&file[..start(2)], &file[start(3)..end.data]].concat();
    let (some, found) = messages(&cut);
    assert!(is_part(&some, &all) && some.len() < all.len());
    assert!(!found.damage.is_empty());
    let is_hole = |damage: &Damage| damage.what.contains("of the log are missing");
    assert!(found.damage.iter().all(is_hole), "{found:?}");
}

#[test]
fn a_few_bytes_of_something_else_before_a_chunk_cost_none_of_its_messages() {
    let folder = tempfile::tempdir().unwrap();
    let file = of_frames(&folder.path().join("run.mcap"));
    let (all, _) = messages(&file);
    let end = End::of(&file).unwrap();
    let start = chunks(&file)[2].start - CHUNK_START;
    for count in 1..=20 {
        let odd = vec![0xFF; count];
        let file = [&file[..start], &odd, &file[start..end.data]].concat();
        let (some, found) = messages(&file);
        assert!(
            some == all,
            "{count} bytes: {} of {}",
            some.len(),
            all.len()
        );
        assert_eq!(found.damage[0].bytes, start..start + count, "{found:?}");
    }
}

/// Some programs number no messages: what is missing of theirs the index knows.
#[test]
fn a_chunk_of_another_program_that_reads_as_something_else_is_missed_by_the_index() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.mcap");
    let file = std::io::BufWriter::new(std::fs::File::create(&path).unwrap());
    let options = mcap::WriteOptions::new().compression(None);
    let mut writer = options.create(file).unwrap();
    let channel = writer.add_channel(0, "/other", "json", &BTreeMap::new());
    let channel_id = channel.unwrap();
    for time in [1_000_000_000, 3_500_000_000] {
        let header = MessageHeader {
            channel_id,
            sequence: 0,
            log_time: time,
            publish_time: time,
        };
        writer.write_to_known_channel(&header, b"{}").unwrap();
        writer.flush().unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    let mut file = std::fs::read(&path).unwrap();
    let (all, found) = messages(&file);
    assert_eq!((all.len(), found.damage), (2, Vec::new()));
    let places = chunks(&file);
    file[places[1].start - CHUNK_START] = op::METADATA;
    file[places[1].start] ^= 1;
    let (some, found) = messages(&file);
    assert_eq!(some, all[..1]);
    let says = |what: &str| found.damage.iter().any(|damage| damage.what.contains(what));
    assert!(
        says("2.500 s of the log that is in its index and not there"),
        "{found:?}"
    );
    assert!(
        says("1 message of /other after 0.000 s of the log is missing"),
        "{found:?}"
    );
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
    let mut each = |_: Message<'_>| {};
    let mut reading = Reading {
        search: 5_000_000,
        ..Reading::of(&file, &mut each)
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
