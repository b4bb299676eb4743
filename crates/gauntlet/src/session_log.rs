//! The session log: one MCAP file with every frame, command and status of a run, once each.
//!
//! Six channels, JSON with a JSON schema each: `/glove/imu`, `/glove/joint_angles`, `/map/output`, `/gripper/command`
//! (field names rPRA, rSPA, …), `/gripper/status` (gPOA, …), `/events`. `docs/session-log.md` lists the fields. The file
//! is written by a thread of its own behind a bounded queue, so that a slow disk never slows the loop; what does not fit
//! is counted and said. [`SessionLog::finish`] writes the index; a file without it (power lost) can still be read from
//! its start.

mod channels;

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

use anyhow::Result;
use mcap::records::MessageHeader;
use mcap::{WriteOptions, Writer};

use crate::failure::OrFail;
use crate::platform::Clock;
use crate::record::Record;
use channels::{CHANNELS, Channel};

/// Records that may wait for the disk: about 15 s of a run.
const QUEUE: usize = 4096;
/// Bytes to a chunk: about 10 s of a run, so that a lost tail is short.
const CHUNK: u64 = 1 << 20;

const NEXT_STEP: &str = "another folder with room and permission to write";

/// A log being written.
#[derive(Debug)]
pub struct SessionLog {
    path: PathBuf,
    sender: Option<SyncSender<Record>>,
    writer: Option<JoinHandle<Result<u64>>>,
    lost: u64,
}

/// What a finished log holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Written {
    /// Where it is.
    pub path: PathBuf,
    /// Messages in it.
    pub messages: u64,
    /// Records that did not fit the queue.
    pub lost: u64,
}

impl SessionLog {
    /// Creates the file at `path`, replacing one that is there.
    ///
    /// # Errors
    /// A failure that names the path.
    pub fn create(path: &Path, clock: Clock) -> Result<Self> {
        let what = || format!("the session log {} cannot be written", path.display());
        let file = File::create(path).or_fail(what, NEXT_STEP)?;
        let mut file = LogFile::new(BufWriter::new(file), clock).or_fail(what, NEXT_STEP)?;
        let (sender, receiver) = sync_channel(QUEUE);
        let writer = std::thread::Builder::new()
            .name("session log".to_owned())
            .spawn(move || file.write_all(&receiver))
            .or_fail(what, "ending other programs")?;
        Ok(Self {
            path: path.to_owned(),
            sender: Some(sender),
            writer: Some(writer),
            lost: 0,
        })
    }

    /// Takes one record. Never waits: with the queue full it is counted as lost.
    pub fn take(&mut self, record: Record) {
        let Some(sender) = &self.sender else { return };
        if let Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) = sender.try_send(record)
        {
            self.lost += 1;
        }
    }

    /// Writes what waits and the index, and closes the file.
    ///
    /// # Errors
    /// A failure that names the path, where the disk refused something on the way.
    pub fn finish(mut self) -> Result<Written> {
        drop(self.sender.take());
        let messages = self.join().or_fail(
            || format!("the session log {} is incomplete", self.path.display()),
            NEXT_STEP,
        )?;
        Ok(Written {
            path: self.path.clone(),
            messages,
            lost: self.lost,
        })
    }

    fn join(&mut self) -> Result<u64> {
        match self.writer.take().map(JoinHandle::join) {
            Some(Ok(result)) => result,
            Some(Err(_)) => anyhow::bail!("its writer stopped"),
            None => Ok(0),
        }
    }
}

impl Drop for SessionLog {
    /// A run that ends with an error still leaves a whole file.
    fn drop(&mut self) {
        drop(self.sender.take());
        let _ = self.join();
    }
}

struct LogFile<W: std::io::Write + std::io::Seek> {
    writer: Writer<W>,
    ids: [u16; CHANNELS.len()],
    sequence: [u32; CHANNELS.len()],
    clock: Clock,
}

impl<W: std::io::Write + std::io::Seek> LogFile<W> {
    fn new(out: W, clock: Clock) -> mcap::McapResult<Self> {
        let mut writer = WriteOptions::new()
            .compression(None)
            .chunk_size(Some(CHUNK))
            .library(concat!("gauntlet ", env!("CARGO_PKG_VERSION")))
            .create(out)?;
        let mut ids = [0; CHANNELS.len()];
        for (channel, id) in CHANNELS.iter().zip(&mut ids) {
            let schema = writer.add_schema(
                channel.schema_name,
                "jsonschema",
                (channel.schema)().to_string().as_bytes(),
            )?;
            *id = writer.add_channel(schema, channel.topic, "json", &Default::default())?;
        }
        Ok(Self {
            writer,
            ids,
            sequence: [0; CHANNELS.len()],
            clock,
        })
    }

    fn write_all(&mut self, records: &Receiver<Record>) -> Result<u64> {
        let mut count = 0;
        for record in records {
            for (channel, message) in channels::messages(&record) {
                self.write(channel, &record, &message)?;
                count += 1;
            }
        }
        self.writer.finish()?;
        Ok(count)
    }

    fn write(
        &mut self,
        channel: Channel,
        record: &Record,
        message: &serde_json::Value,
    ) -> Result<()> {
        let index = channel as usize;
        let at = self.clock.wall_ns(record.at());
        let header = MessageHeader {
            channel_id: self.ids[index],
            sequence: self.sequence[index],
            log_time: at,
            publish_time: at,
        };
        self.sequence[index] = self.sequence[index].wrapping_add(1);
        self.writer
            .write_to_known_channel(&header, &serde_json::to_vec(message)?)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests;
