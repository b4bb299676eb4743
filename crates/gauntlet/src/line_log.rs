//! The log of one line: of a glove that is read by itself, by `record` and `calibrate`.

use std::path::{Path, PathBuf};

use anyhow::Result;

use crate::tell::Tell;
use crate::{note, outputs};
use host::clock::Clock;
use host::glove::hand::Side;
use host::interrupt::Interrupt;
use host::recording::{Drawn, QUEUE, SessionLog};
use host::session::record::{Feed, Records, queue};
use host::trace::TraceLog;

/// Where it goes, if anywhere.
#[derive(Debug, Default)]
pub struct LineLog {
    path: PathBuf,
    feed: Option<Feed>,
    trace: TraceLog,
    records: Option<Records>,
    log: Option<SessionLog>,
}

impl LineLog {
    /// A log at `path`, which is made once the glove is up; what comes before waits.
    ///
    /// # Errors
    /// A failure of usage: something is there, or no log can be.
    pub fn new(path: Option<&Path>) -> Result<Self> {
        let Some(path) = path else {
            return Ok(Self::default());
        };
        outputs::check_new(path, "a log")?;
        let (feed, records) = queue(QUEUE);
        Ok(Self {
            path: path.to_owned(),
            trace: feed.trace(),
            feed: Some(feed),
            records: Some(records),
            log: None,
        })
    }

    /// What the reading writes.
    pub fn trace(&self) -> TraceLog {
        self.trace.clone()
    }

    /// Where the scans go, of which there are decoded channels; once.
    pub fn feed(&mut self) -> Option<Feed> {
        self.feed.take()
    }

    /// Makes the file, of such a hand. Once it takes nothing more, whoever watches is told; the reading goes on.
    ///
    /// # Errors
    /// A failure that names it.
    pub fn begin(&mut self, clock: Clock, side: Side, interrupt: &Interrupt) -> Result<()> {
        if let Some(records) = self.records.take() {
            let place = self.path.display().to_string();
            let tell = move |fault: &str| {
                note!("the log {place} ended: {fault}; the rest goes on without it");
            };
            let drawn = Drawn {
                side,
                ..Drawn::USUAL
            };
            let log = SessionLog::create_telling(&self.path, drawn, clock, records, tell)?;
            self.log = Some(log);
            // A file that grew to its limit is told so, and ends nothing.
            interrupt.look_after_file_limit();
        }
        Ok(())
    }

    /// Finishes it and says what became of it; a failure where it ends before its time.
    ///
    /// # Errors
    /// That one.
    pub fn finish(mut self, tell: &Tell) -> Result<()> {
        let Some(log) = self.log.take() else {
            return Ok(());
        };
        let written = log.finish();
        tell.log(Some(&written));
        written.judge()
    }
}
