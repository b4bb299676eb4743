//! A session log read, whole or damaged: what can be read is read, and the rest is named.

use std::collections::BTreeMap;
use std::ops::Range;

use crc::{CRC_32_ISO_HDLC, Crc};
use mcap::MAGIC;
use mcap::records::{MessageHeader, Record, op};

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
/// How many times its length a damaged file is looked through at most.
const SEARCH: usize = 8;
/// Opcode and length.
const FRAME: usize = 9;

/// One channel of a log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Channel {
    /// Its topic.
    pub topic: String,
    /// How its messages are coded: `json`, `protobuf`, `cdr`, `gauntlet.trace`.
    pub encoding: String,
    /// The schema's name; empty without one.
    pub schema: String,
    /// What the channel says besides.
    pub metadata: BTreeMap<String, String>,
}

/// One message.
#[derive(Debug, Clone, Copy)]
pub struct Message<'f> {
    /// Its channel.
    pub channel: &'f Channel,
    /// Log time, ns since 1970.
    pub log_time: u64,
    /// When it happened, ns since 1970.
    pub publish_time: u64,
    /// Its bytes.
    pub data: &'f [u8],
}

/// Something in a log that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damage {
    /// Bytes of the file.
    pub bytes: Range<usize>,
    /// What is wrong there.
    pub what: String,
}

impl std::fmt::Display for Damage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Range { start, end } = self.bytes;
        write!(f, "bytes {start} to {end}: {}", self.what)
    }
}

/// What was found in a log.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Found {
    /// The program that wrote it, with its version.
    pub program: String,
    /// Messages that could be read.
    pub messages: u64,
    /// What could not.
    pub damage: Vec<Damage>,
    /// Whether it ends with its index, as a log does that was finished.
    pub finished: bool,
}

/// Reads `file` from its start to its end and gives every message to `each`, in the file's order.
///
/// # Errors
/// It is no MCAP file.
pub fn read(file: &[u8], each: impl FnMut(Message<'_>)) -> Result<Found, NoLog> {
    read_while(file, each, |_| true)
}

/// The same as long as `go_on` says so, which is told before each chunk how many bytes are behind. What comes after its `false`
/// is no damage.
///
/// # Errors
/// As [`read`].
pub fn read_while(
    file: &[u8],
    mut each: impl FnMut(Message<'_>),
    go_on: impl FnMut(usize) -> bool,
) -> Result<Found, NoLog> {
    if !file.starts_with(MAGIC) {
        return Err(NoLog);
    }
    let mut reading = Reading {
        file,
        found: Found::default(),
        schemas: BTreeMap::new(),
        channels: BTreeMap::new(),
        each: &mut each,
        search: file.len().saturating_mul(SEARCH),
    };
    reading.all(go_on);
    Ok(reading.found)
}

/// A file that is no MCAP file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("it is no MCAP file")]
pub struct NoLog;

struct Reading<'f, 'e> {
    file: &'f [u8],
    found: Found,
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Channel>,
    each: &'e mut dyn FnMut(Message<'_>),
    /// Bytes that may still be looked through for chunks behind damage: beginnings that are none would each cost the rest of the file.
    search: usize,
}

/// What a file says of itself, without what would command a terminal.
fn printable(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(80).collect()
}

/// The record at `offset`: opcode and where its body is; `None` where none fits.
fn framed(bytes: &[u8], offset: usize) -> Option<(u8, Range<usize>)> {
    let frame = bytes.get(offset..offset + FRAME)?;
    let (&code, length) = frame.split_first()?;
    let length = u64::from_le_bytes(length.try_into().ok()?);
    let start = offset + FRAME;
    let end = start.checked_add(usize::try_from(length).ok()?)?;
    (end <= bytes.len()).then_some((code, start..end))
}

impl Reading<'_, '_> {
    fn all(&mut self, mut go_on: impl FnMut(usize) -> bool) {
        let mut offset = MAGIC.len();
        while offset < self.file.len() && go_on(offset) {
            if self.file.get(offset..) == Some(MAGIC) {
                break;
            }
            let Some((code, body)) = framed(self.file, offset) else {
                let next = self.next_chunk(offset + 1);
                let end = next.unwrap_or(self.file.len());
                let what = match next {
                    Some(_) => "no record, and everything up to the next chunk",
                    None => "the file ends within a record",
                };
                self.damaged(offset..end, what);
                offset = end;
                continue;
            };
            let end = body.end;
            match code {
                op::CHUNK => self.chunk(body),
                op::HEADER..=op::DATA_END => self.record(code, body),
                _ => self.damaged(offset..end, "a record of an unknown kind"),
            }
            offset = end;
        }
    }

    fn damaged(&mut self, bytes: Range<usize>, what: impl Into<String>) {
        let what = what.into();
        self.found.damage.push(Damage { bytes, what });
    }

    /// Where the next whole chunk begins, behind something that is no record.
    fn next_chunk(&mut self, from: usize) -> Option<usize> {
        (from..self.file.len()).find(|&offset| {
            if self.file.get(offset) != Some(&op::CHUNK) {
                return false;
            }
            let framed = framed(self.file, offset);
            let Some((_, body)) = framed.filter(|(_, body)| body.len() <= self.search) else {
                return false;
            };
            self.search -= body.len();
            messages_of(self.file, body).is_ok()
        })
    }

    fn chunk(&mut self, body: Range<usize>) {
        match messages_of(self.file, body.clone()) {
            Ok(records) => {
                let mut offset = records.start;
                let inside = &self.file[..records.end];
                while let Some((code, body)) = framed(inside, offset) {
                    offset = body.end;
                    self.record(code, body);
                }
            }
            Err(what) => self.damaged(body, what),
        }
    }

    fn record(&mut self, code: u8, body: Range<usize>) {
        // The other kinds, an index and a summary of it, are not needed.
        if !matches!(
            code,
            op::HEADER | op::FOOTER | op::SCHEMA | op::CHANNEL | op::MESSAGE
        ) {
            return;
        }
        let Some(bytes) = self.file.get(body.clone()) else {
            return;
        };
        match mcap::parse_record(code, bytes) {
            Ok(Record::Header(header)) => self.found.program = printable(&header.library),
            Ok(Record::Footer(_)) => self.found.finished = true,
            Ok(Record::Schema { header, .. }) => {
                self.schemas.insert(header.id, header.name);
            }
            Ok(Record::Channel(channel)) => {
                let schema = self.schemas.get(&channel.schema_id);
                let known = Channel {
                    topic: channel.topic,
                    encoding: channel.message_encoding,
                    schema: schema.cloned().unwrap_or_default(),
                    metadata: channel.metadata,
                };
                self.channels.insert(channel.id, known);
            }
            Ok(Record::Message { header, data }) => self.message(&header, &data, body),
            Ok(_) => {}
            Err(error) => self.damaged(body, error.to_string()),
        }
    }

    fn message(&mut self, header: &MessageHeader, data: &[u8], body: Range<usize>) {
        let Some(channel) = self.channels.get(&header.channel_id) else {
            let what = format!("a message of an unknown channel, {}", header.channel_id);
            return self.damaged(body, what);
        };
        self.found.messages += 1;
        (self.each)(Message {
            channel,
            log_time: header.log_time,
            publish_time: header.publish_time,
            data,
        });
    }
}

/// Where the records of a chunk are, if its checksum is right.
fn messages_of(file: &[u8], body: Range<usize>) -> Result<Range<usize>, String> {
    let bytes = file.get(body.clone()).unwrap_or_default();
    let Ok(Record::Chunk { header, data }) = mcap::parse_record(op::CHUNK, bytes) else {
        return Err("a chunk's beginning".to_owned());
    };
    if !header.compression.is_empty() {
        return Err(format!(
            "a chunk compressed with {}, which is not read here",
            header.compression
        ));
    }
    if header.uncompressed_crc != 0 && CRC.checksum(&data) != header.uncompressed_crc {
        return Err("a chunk whose checksum is wrong".to_owned());
    }
    // The records end the body.
    let start = body.end.saturating_sub(data.len());
    Ok(start..body.end)
}

#[cfg(test)]
#[path = "salvage_tests.rs"]
mod tests;
