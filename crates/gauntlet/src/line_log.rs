//! The log of one line: of a glove that is read by itself, by `record` and `calibrate`, or of a bridge that is watched, by
//! `bridge monitor`.

use std::path::{Path, PathBuf};

use anyhow::Result;

use crate::outputs;
use crate::tell::Tell;
use host::clock::Clock;
use host::recording::{Drawn, SessionLog};
use host::session::record::{Feed, Records, queue};
use host::trace::TraceLog;

/// Where it goes, if anywhere.
#[derive(Debug, Default)]
pub struct LineLog {
    path: PathBuf,
    feed: Option<Feed>,
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
        // The scans are in the trace.
        let (feed, records) = queue(1);
        Ok(Self {
            path: path.to_owned(),
            feed: Some(feed),
            records: Some(records),
            log: None,
        })
    }

    /// What the reading writes.
    pub fn trace(&self) -> TraceLog {
        self.feed.as_ref().map(Feed::trace).unwrap_or_default()
    }

    /// Makes the file.
    ///
    /// # Errors
    /// A failure that names it.
    pub fn begin(&mut self, clock: Clock) -> Result<()> {
        if let Some(records) = self.records.take() {
            // Nothing of it is decoded: the pictures are those of a log whose hand has not moved yet.
            self.log = Some(SessionLog::create(
                &self.path,
                Drawn::USUAL,
                clock,
                records,
            )?);
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
