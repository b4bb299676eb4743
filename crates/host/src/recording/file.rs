//! The file of a session log, and what of it is whole.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::RecvTimeoutError;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use gripper::Instant as Moment;
use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{MAGIC, McapResult, WriteOptions, Writer};

use super::channels::{CHANNELS, Channel, Decoder};
use super::drawing::Drawn;
use crate::clock::Clock;
use crate::session::record::{Record, Records};
use crate::trace::Block;
use crate::words::disk;

/// Bytes to a chunk at most; most are closed by time.
const CHUNK: u64 = 1 << 20;
/// A chunk that has so many bytes is closed: those of the bring-up come all at once, and a full disk leaves whole chunks only.
const FULL: usize = 64 << 10;
/// Records to a chunk at most.
const RECORDS: usize = 128;
/// The topic of the trace's blocks, and their coding: the clock's reading before the block and its newest one in the block,
/// µs, u64 little-endian; then entries as [`bridge::trace`] codes them.
pub const TRACE_TOPIC: &str = "/bridge/trace";
/// The name of that coding.
pub const TRACE_ENCODING: &str = "gauntlet.trace";
/// Pause between two closed chunks: a program that is killed loses no more.
const CLOSE_EVERY: Duration = Duration::from_millis(500);
/// Pause between two looks whether the log is to end.
const LOOK: Duration = Duration::from_millis(50);
/// Pause between two requests to the system to put it on the disk: a power cut loses little more.
const SYNC_EVERY: Duration = Duration::from_secs(2);

/// What of a log can be read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Whole {
    /// Messages in closed chunks.
    pub messages: u64,
    /// Times of the first and the last message, ns.
    span: Option<(u64, u64)>,
    /// Where the last closed chunk ends.
    bytes: u64,
    /// Bytes of the trace that found no room before the file was there.
    pub trace_lost: u64,
}

impl Whole {
    /// From the first message to the last.
    pub(super) fn covers(&self) -> Duration {
        let span = self.span.map(|(first, last)| last.saturating_sub(first));
        Duration::from_nanos(span.unwrap_or(0))
    }
}

/// A file that takes nothing more after its first error: what a library writes when it is dropped stays away.
struct Sink {
    file: File,
    failed: Arc<AtomicBool>,
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.failed.load(Ordering::Relaxed) {
            return Err(io::Error::other("it failed before"));
        }
        let written = self.file.write(bytes);
        if let Err(error) = &written {
            let failed = error.kind() != io::ErrorKind::Interrupted;
            self.failed.store(failed, Ordering::Relaxed);
        }
        written
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A log file.
pub(super) struct LogFile {
    writer: Writer<NoSeek<Sink>>,
    /// The same file, to mend its end.
    file: File,
    trace_lost: u64,
    /// It takes nothing more.
    failed: Arc<AtomicBool>,
    /// Another program removed it or cut it short: what is left is not ours to mend.
    is_taken: bool,
    ids: [u16; CHANNELS.len()],
    sequence: [u32; CHANNELS.len()],
    decoder: Decoder,
    /// The trace's channel, and its next number.
    trace: (u16, u32),
    /// Blocks of the trace that wait for the records from before their end: a log time stands for when something happened.
    blocks: VecDeque<Block>,
    /// When the newest record happened, µs.
    recorded: u64,
    /// Bytes of messages in the chunk that is not closed.
    open: usize,
    /// Log time of the newest message: it never goes back, and is never 0.
    newest: u64,
    clock: Clock,
    /// What was written, and what of that is closed.
    written: Whole,
    whole: Whole,
    fault: Arc<OnceLock<String>>,
}

impl LogFile {
    /// Creates the file; never over one that is there. `fault` is told what ends it.
    pub(super) fn create(
        path: &Path,
        drawn: Drawn,
        clock: Clock,
        fault: Arc<OnceLock<String>>,
    ) -> anyhow::Result<Self> {
        let file = File::create_new(path)?;
        let log = Self::start(file, drawn, clock, fault);
        if log.is_err() {
            // Nothing is in it: it would only be in the way of the next try.
            let _ = std::fs::remove_file(path);
        }
        log
    }

    fn start(
        file: File,
        drawn: Drawn,
        clock: Clock,
        fault: Arc<OnceLock<String>>,
    ) -> anyhow::Result<Self> {
        let failed = Arc::new(AtomicBool::new(false));
        let sink = Sink {
            file: file.try_clone()?,
            failed: Arc::clone(&failed),
        };
        let mut writer = WriteOptions::new()
            .compression(None)
            .chunk_size(Some(CHUNK))
            // A chunk is put together in memory: what is in the file is whole.
            .disable_seeking(true)
            .library(crate::trace::PROGRAM)
            .create(NoSeek::new(sink))?;
        let mut ids = [0; CHANNELS.len()];
        for (channel, id) in CHANNELS.iter().zip(&mut ids) {
            let schema = writer.add_schema(
                channel.schema_name,
                channel.schema_encoding(),
                &channel.schema(drawn.gripper.axes()),
            )?;
            let encoding = channel.message_encoding();
            let metadata = channel.metadata(drawn);
            *id = writer.add_channel(schema, channel.topic, encoding, &metadata)?;
        }
        let version = bridge::trace::VERSION.to_string();
        let metadata = [("version".to_owned(), version)].into();
        let trace = writer.add_channel(0, TRACE_TOPIC, TRACE_ENCODING, &metadata)?;
        writer.flush()?;
        let mut log = Self {
            writer,
            file,
            trace_lost: 0,
            failed,
            is_taken: false,
            ids,
            sequence: [0; CHANNELS.len()],
            decoder: Decoder::new(drawn),
            trace: (trace, 0),
            blocks: VecDeque::new(),
            recorded: 0,
            open: 0,
            newest: 1,
            clock,
            written: Whole::default(),
            whole: Whole::default(),
            fault,
        };
        log.close_chunk()?;
        Ok(log)
    }

    /// Writes what comes, until nothing can come any more, or `closing` is set and what waited is written, or the file takes
    /// nothing.
    pub(super) fn write_all(&mut self, records: &Records, closing: &AtomicBool) {
        let result = self
            .write_until_end(records, closing)
            .and_then(|()| self.write_trace(records, true));
        self.trace_lost = records.trace.lost();
        records.trace.close();
        self.note(&result);
    }

    fn write_until_end(&mut self, records: &Records, closing: &AtomicBool) -> McapResult<()> {
        let mut close = Instant::now() + CLOSE_EVERY;
        let mut sync = Instant::now() + SYNC_EVERY;
        let mut waiting = 0;
        // What came before there was a file.
        self.blocks.extend(records.trace.take());
        loop {
            let ends = closing.load(Ordering::Relaxed);
            let wait = match ends {
                true => Duration::ZERO,
                false => LOOK.min(close.saturating_duration_since(Instant::now())),
            };
            match records.records.recv_timeout(wait) {
                Ok(record) => {
                    self.write(&record)?;
                    waiting += 1;
                }
                Err(RecvTimeoutError::Timeout) if ends => return Ok(()),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
            let now = Instant::now();
            if now >= close || waiting >= RECORDS {
                let all = self.write_waiting(records)?;
                self.write_trace(records, all)?;
                self.close_chunk()?;
                waiting = 0;
                close = now + CLOSE_EVERY;
            }
            if now >= sync {
                self.file.sync_data()?;
                sync = Instant::now() + SYNC_EVERY;
            }
        }
    }

    /// Writes the records that wait, as many as a chunk takes; whether none is left.
    fn write_waiting(&mut self, records: &Records) -> McapResult<bool> {
        for _ in 0..RECORDS {
            match records.records.try_recv() {
                Ok(record) => self.write(&record)?,
                Err(_) => return Ok(true),
            }
        }
        Ok(false)
    }

    fn write(&mut self, record: &Record) -> McapResult<()> {
        self.recorded = self.recorded.max(record.at().as_ticks());
        self.write_blocks(self.recorded)?;
        let at = self.clock.wall_ns(record.at());
        for (channel, message) in self.decoder.messages(record, at) {
            self.write_message(channel, record, &message)?;
        }
        match self.open {
            FULL.. => self.close_chunk(),
            _ => Ok(()),
        }
    }

    fn write_message(&mut self, channel: Channel, record: &Record, text: &[u8]) -> McapResult<()> {
        let index = channel as usize;
        let at = self.clock.wall_ns(record.at());
        let header = MessageHeader {
            channel_id: self.ids[index],
            sequence: self.sequence[index],
            log_time: self.log_time(at),
            publish_time: at,
        };
        self.sequence[index] = self.sequence[index].wrapping_add(1);
        self.writer.write_to_known_channel(&header, text)?;
        self.open += text.len();
        self.count(at);
        Ok(())
    }

    /// The log time of a message of `at`: what is read one after the other was logged so.
    fn log_time(&mut self, at: u64) -> u64 {
        self.newest = self.newest.max(at);
        self.newest
    }

    /// Writes what waits of the trace, a message a block: `all`, or what came before the newest record.
    fn write_trace(&mut self, records: &Records, all: bool) -> McapResult<()> {
        self.blocks.extend(records.trace.take());
        self.write_blocks(if all { u64::MAX } else { self.recorded })
    }

    /// Writes the blocks that end by `until`, µs.
    fn write_blocks(&mut self, until: u64) -> McapResult<()> {
        let mut is_first = true;
        while self.blocks.front().is_some_and(|block| block.at <= until) {
            let Some(block) = self.blocks.pop_front() else {
                break;
            };
            if !is_first {
                // Those of the bring-up come all at once.
                self.close_chunk()?;
            }
            is_first = false;
            let at = self.clock.wall_ns(Moment::from_ticks(block.at));
            let header = MessageHeader {
                channel_id: self.trace.0,
                sequence: self.trace.1,
                log_time: self.log_time(at),
                publish_time: at,
            };
            self.trace.1 = self.trace.1.wrapping_add(1);
            let mut message = [block.since, block.at].map(u64::to_le_bytes).concat();
            message.extend_from_slice(&block.bytes);
            self.writer.write_to_known_channel(&header, &message)?;
            self.open += message.len();
            self.count(at);
        }
        Ok(())
    }

    /// One more message, of `at`.
    fn count(&mut self, at: u64) {
        self.written.messages += 1;
        let (first, last) = self.written.span.unwrap_or((at, at));
        self.written.span = Some((first.min(at), last.max(at)));
    }

    fn close_chunk(&mut self) -> McapResult<()> {
        if let Some(what) = self.taken()? {
            self.whole = Whole::default();
            self.is_taken = true;
            self.failed.store(true, Ordering::Relaxed);
            return Err(io::Error::other(what).into());
        }
        self.writer.flush()?;
        self.open = 0;
        self.whole = self.written;
        self.whole.bytes = self.file.stream_position()?;
        Ok(())
    }

    /// What another program did to what is written.
    fn taken(&self) -> io::Result<Option<&'static str>> {
        let found = self.file.metadata()?;
        Ok(if found.nlink() == 0 {
            Some("another program removed it")
        } else if found.len() < self.whole.bytes {
            Some("another program cut it short")
        } else {
            None
        })
    }

    /// Writes the index; where the file takes nothing more, lets it end after its last whole chunk.
    pub(super) fn finish(mut self) -> Whole {
        if self.fault.get().is_none() {
            let result = self.close_chunk().and_then(|()| {
                self.writer.finish()?;
                Ok(())
            });
            self.note(&result);
        }
        if self.fault.get().is_some() && !self.is_taken {
            // What cannot be mended stays as it is: readers take whole records from the start.
            let _ = self.end_after_last_chunk();
        }
        Whole {
            trace_lost: self.trace_lost,
            ..self.whole
        }
    }

    fn note(&self, result: &McapResult<()>) {
        if let Err(error) = result {
            let _ = self.fault.set(words(error));
        }
    }

    fn end_after_last_chunk(&mut self) -> io::Result<()> {
        self.file.set_len(self.whole.bytes)?;
        self.file.seek(SeekFrom::Start(self.whole.bytes))?;
        // The records "data end" and "footer" of a file without a summary.
        let mut end = vec![0x0f, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        end.extend([0x02, 20, 0, 0, 0, 0, 0, 0, 0]);
        end.extend([0; 20]);
        end.extend(MAGIC);
        if self.file.write_all(&end).is_err() {
            // Not even for that is there room.
            self.file.set_len(self.whole.bytes)?;
        }
        Ok(())
    }
}

/// The fault in a person's words.
fn words(error: &mcap::McapError) -> String {
    match error {
        mcap::McapError::Io(error) => disk(error),
        error => error.to_string(),
    }
}
