use std::path::Path;

use bridge::trace::{Entry, GLOVE, GRIPPER, Note as _};

use super::*;
use crate::clock::Clock;
use crate::recording::{Drawn, SessionLog};
use crate::session::record::queue;
use crate::trace::{Home, TraceLog};

/// A log with such a trace.
fn log(path: &Path, begin: impl FnOnce(&TraceLog)) -> Traced {
    let (feed, records) = queue(1);
    begin(&feed.trace());
    let log = SessionLog::create(path, Drawn::USUAL, Clock::start(), records).unwrap();
    assert_eq!(log.finish().fault, None);
    Traced::read(path).unwrap()
}

fn begun(trace: &TraceLog, glove: &str) {
    let driver = gripper::driver::Config::for_pc();
    let scan = glove::scan::Config::default();
    let home = Home::new("3f", false, &driver, &scan, glove);
    trace.begin(&home, &Settings::<4>::default(), &[1, 2, 3], None);
}

#[test]
fn a_log_whose_ports_bytes_are_not_in_it_is_refused_by_name_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hand.mcap");
    let traced = log(&path, |trace| begun(trace, "i2c"));
    let error = same(&traced, &mut ()).unwrap_err().to_string();
    assert!(
        error.contains("hand.mcap") && error.contains("I²C"),
        "{error}"
    );
    let path = folder.path().join("chip.mcap");
    let traced = log(&path, TraceLog::begin_monitor);
    let error = same(&traced, &mut ()).unwrap_err().to_string();
    assert!(
        error.contains("chip.mcap") && error.contains("on a chip"),
        "{error}"
    );
    let error = compare(&traced, &Changes::default(), &mut ())
        .unwrap_err()
        .to_string();
    assert!(error.contains("chip.mcap"), "{error}");
}

#[test]
fn a_trace_of_another_version_is_refused_with_the_name_of_the_program_that_wrote_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new.mcap");
    let file = std::fs::File::create(&path).unwrap();
    let mut writer = mcap::WriteOptions::new()
        .compression(None)
        .library("gauntlet 7.8.9")
        .create(file)
        .unwrap();
    let metadata = [("version".to_owned(), "2".to_owned())].into();
    let channel = writer
        .add_channel(0, "/bridge/trace", "gauntlet.trace", &metadata)
        .unwrap();
    let header = mcap::records::MessageHeader {
        channel_id: channel,
        sequence: 0,
        log_time: 1,
        publish_time: 1,
    };
    writer.write_to_known_channel(&header, &[0; 20]).unwrap();
    writer.finish().unwrap();
    let error = Traced::read(&path).unwrap_err().to_string();
    for word in ["new.mcap", "version 2", "version 1", "gauntlet 7.8.9"] {
        assert!(error.contains(word), "{word}: {error}");
    }
}

#[test]
fn what_was_written_to_the_gripper_is_found_with_its_times_and_nothing_of_the_glove() {
    let folder = tempfile::tempdir().unwrap();
    let traced = log(&folder.path().join("run.mcap"), |trace| {
        begun(trace, "serial");
        for (us, port) in [(1_000, GLOVE), (2_000, GRIPPER), (3_500, GRIPPER)] {
            trace.waited();
            trace.clock(Instant::from_ticks(us));
            let bytes = &[us as u8, port];
            trace.note(&Entry::Write { port, bytes });
        }
    });
    assert_eq!(traced.end, 3_500);
    let line = gripper_line(&traced, &mut ());
    let written = |us: u64| (us, vec![us as u8, GRIPPER]);
    assert_eq!(line.requests, [written(2_000), written(3_500)]);
}

/// Ends a replay after so many looks.
struct Until(u32);

impl Follow for Until {
    fn turn<B: Board<X>, const X: usize>(&mut self, _: &mut App<B, X>, _: u64) -> bool {
        self.reading(0)
    }

    fn reading(&mut self, _: u64) -> bool {
        self.0 = self.0.saturating_sub(1);
        self.0 > 0
    }
}

#[test]
fn who_looks_at_a_glove_that_is_read_again_ends_it() {
    let folder = tempfile::tempdir().unwrap();
    let traced = log(&folder.path().join("run.mcap"), |trace| {
        trace.begin_scan("serial", &glove::scan::Config::default());
        for turn in 1..100 {
            trace.waited();
            trace.clock(Instant::from_ticks(1_000 * turn));
        }
    });
    assert!(traced.is_scan());
    // Nothing was written in it, and a scanner writes at once.
    let whole = same(&traced, &mut Until(2)).unwrap();
    assert!(whole.difference.is_some(), "{whole:?}");
    let ended = same(&traced, &mut Until(1)).unwrap();
    assert_eq!((ended.difference, ended.turns), (None, 1));
}
