//! A log's writer that is killed: how much of what had happened by then can be read.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use bridge::trace::{Entry, GLOVE, Note};
use host::clock::Clock;
use host::recording::{Drawn, QUEUE, SessionLog, salvage};
use host::session::record::queue;

/// What the child is called with.
pub const CHILD: &str = "log-writer";

/// Writes a log at `path` for ever, with a trace as a session has it: 17 kB and 400 turns a second.
///
/// # Panics
/// The file cannot be made.
pub fn write_for_ever(path: &Path) {
    let clock = Clock::start();
    let (feed, records) = queue(QUEUE);
    let trace = feed.trace();
    trace.note(&Entry::Head { axes: 4 });
    let _log = SessionLog::create(path, Drawn::USUAL, clock, records).expect("a log");
    let bytes = [0x5A; 43];
    loop {
        trace.waited();
        trace.clock(clock.now());
        trace.note(&Entry::Read {
            port: GLOVE,
            bytes: &bytes,
        });
        std::thread::sleep(Duration::from_micros(2_500));
    }
}

/// Starts a writer, kills it after `time`, and how long before that the newest message was logged, s. `None` where nothing could
/// be read.
///
/// # Panics
/// The writer cannot be started, or its file is not there.
pub fn kill_after(time: Duration, path: &Path) -> Option<f64> {
    let program = std::env::current_exe().expect("this program");
    let mut child = Command::new(program)
        .arg(CHILD)
        .arg(path)
        .stdin(Stdio::null())
        .spawn()
        .expect("a process");
    std::thread::sleep(time);
    child.kill().expect("it runs");
    let killed = SystemTime::now();
    child.wait().expect("it ends");
    let file = std::fs::read(path).expect("the log");
    let mut newest = 0;
    let found = salvage::read(&file, |message| newest = newest.max(message.log_time)).ok()?;
    assert!(!found.finished);
    let killed = killed.duration_since(UNIX_EPOCH).expect("after 1970");
    let lost = killed.as_secs_f64() - newest as f64 * 1e-9;
    (newest > 1).then_some(lost)
}
