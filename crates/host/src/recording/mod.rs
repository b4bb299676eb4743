//! The session log: one MCAP file with every frame, command and status of a run, once each.
//!
//! Decoded channels are JSON with named fields and a schema each (`/glove/joint_angles`, `/gripper/command`, …), and what others'
//! viewers draw: transforms, a scene and events as Protocol Buffers, a robot description as CDR. `docs/session-log.md` lists them. The file
//! is written by a thread of its own, which the bridge's thread feeds through a bounded queue, so that a slow disk never slows the loop; what does not fit
//! is counted and said. Every half second a chunk is closed: whatever ends the program, the file can be read from its
//! start until then. A disk that takes no more ends the log and nothing else; [`SessionLog::fault`] says so at once, and
//! the file ends after the last whole chunk.
//!
//! [`poses`] writes what a training reads: a hand's joint angles as CSV.

mod cdr;
mod channels;
mod drawing;
pub mod export;
mod fields;
mod file;
mod foxglove;
pub mod openxr;
pub mod poses;
mod protobuf;
mod rates;
mod robot_description;
pub mod salvage;
pub mod traced;

pub use drawing::Drawn;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::Result;
use serde::{Serialize, Serializer};

use crate::clock::Clock;
use crate::failure::{Failure, OrFail};
use crate::session::record::Records;
use file::{LogFile, Whole};

/// Records that may wait for the disk, or for the file to be made: more than a minute of a run.
pub const QUEUE: usize = 16_384;

const NEXT_STEP: &str = "another name in a folder with room and permission to write";

/// A log being written.
#[derive(Debug)]
pub struct SessionLog {
    path: PathBuf,
    writer: Option<JoinHandle<Whole>>,
    fault: Arc<OnceLock<String>>,
    closing: Arc<AtomicBool>,
    lost: Arc<AtomicU64>,
}

/// What a finished log holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Written {
    /// Where it is.
    pub path: PathBuf,
    /// Messages in it that can be read.
    pub messages: u64,
    /// From the first of them to the last, s.
    #[serde(rename = "covers_s", serialize_with = "as_seconds")]
    pub covers: Duration,
    /// Records that did not fit the queue.
    pub lost: u64,
    /// Why it ends before the run does.
    #[serde(rename = "error")]
    pub fault: Option<String>,
}

fn as_seconds<S: Serializer>(time: &Duration, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64(time.as_secs_f64())
}

impl Written {
    /// One line for a person.
    pub fn line(&self) -> String {
        let (path, messages) = (self.path.display(), self.messages);
        let lost = match self.lost {
            0 => String::new(),
            lost => format!(", {lost} records lost: they waited too long for the file"),
        };
        match &self.fault {
            None => format!("{path} with {messages} messages{lost}"),
            Some(fault) => format!(
                "{path} is incomplete: {fault}; its first {:.1} s, {messages} messages, are whole{lost}",
                self.covers.as_secs_f64()
            ),
        }
    }

    /// A failure where the log ends before the run does.
    ///
    /// # Errors
    /// That one.
    pub fn judge(&self) -> Result<()> {
        match &self.fault {
            None => Ok(()),
            Some(_) => {
                Err(Failure::new(format!("the session log {}", self.line()), NEXT_STEP).into())
            }
        }
    }
}

/// What is wrong with a log whose trace has a hole of so many bytes.
fn without(bytes: u64) -> Option<String> {
    let said = || {
        format!(
            "{bytes} bytes of its trace found no room before the file was there, and a replay ends there"
        )
    };
    (bytes > 0).then(said)
}

impl SessionLog {
    /// Creates the file at `path`, never over one that is there, for `records`, those that wait already at its start.
    ///
    /// # Errors
    /// A failure that names the path.
    pub fn create(path: &Path, drawn: Drawn, clock: Clock, records: Records) -> Result<Self> {
        Self::create_telling(path, drawn, clock, records, |_| {})
    }

    /// The same; `tell` is told at once, by the writer's thread, why nothing is written any more.
    ///
    /// # Errors
    /// As [`SessionLog::create`].
    pub fn create_telling(
        path: &Path,
        drawn: Drawn,
        clock: Clock,
        records: Records,
        tell: impl FnOnce(&str) + Send + 'static,
    ) -> Result<Self> {
        let what = || format!("the session log {} cannot be written", path.display());
        let fault = Arc::new(OnceLock::new());
        let mut file =
            LogFile::create(path, drawn, clock, Arc::clone(&fault)).or_fail(what, NEXT_STEP)?;
        let closing = Arc::new(AtomicBool::new(false));
        let (lost, closed) = (records.lost(), Arc::clone(&closing));
        let ended = Arc::clone(&fault);
        let writer = std::thread::Builder::new()
            .name("session log".to_owned())
            .spawn(move || {
                file.write_all(&records, &closed);
                if let Some(fault) = ended.get() {
                    tell(fault);
                }
                file.finish()
            })
            .or_fail(what, "ending other programs")?;
        Ok(Self {
            path: path.to_owned(),
            writer: Some(writer),
            fault,
            closing,
            lost,
        })
    }

    /// Why nothing is written any more, where that is so.
    pub fn fault(&self) -> Option<&str> {
        self.fault.get().map(String::as_str)
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes what waits and the index, and closes the file.
    pub fn finish(mut self) -> Written {
        let whole = self.join();
        Written {
            path: self.path.clone(),
            messages: whole.messages,
            covers: whole.covers(),
            lost: self.lost.load(Ordering::Relaxed),
            fault: self
                .fault
                .get()
                .cloned()
                .or_else(|| without(whole.trace_lost)),
        }
    }

    fn join(&mut self) -> Whole {
        self.closing.store(true, Ordering::Relaxed);
        match self.writer.take().map(JoinHandle::join) {
            Some(Ok(whole)) => whole,
            Some(Err(_)) => {
                let _ = self.fault.set("its writer stopped".to_owned());
                Whole::default()
            }
            None => Whole::default(),
        }
    }
}

impl Drop for SessionLog {
    /// A run that ends with an error still leaves a whole file.
    fn drop(&mut self) {
        self.join();
    }
}

#[cfg(test)]
mod layout_tests;
#[cfg(test)]
mod peer_tests;
#[cfg(test)]
mod tests;
