//! A session log read, whole or damaged: what can be read is read, and the rest is named.

mod counted;
mod end;
mod frames;
mod told;

use std::collections::BTreeMap;
use std::ops::Range;

use mcap::MAGIC;
use mcap::records::{MessageHeader, Record, op};

pub use told::{Channel, Damage};

use counted::Counted;
use end::End;
use frames::{CRC, Sum, chunk, framed, is_proved, parsed, printable};
use told::channel_of;

/// How many times its length a damaged file is looked through at most.
const SEARCH: usize = 8;
/// Damage that is named; what comes after it is put together.
const NAMED: usize = 1_000;

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
    let mut reading = Reading::of(file, &mut each);
    reading.all(End::of(file), go_on);
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
    counted: Counted,
    /// Where chunks were read: where they begin and end.
    chunks: BTreeMap<usize, usize>,
    /// What the index that follows the newest chunk must say: by channel, log times and offsets of the messages.
    index: BTreeMap<u16, Vec<(u64, u64)>>,
    /// The sum over the data so far, and how far that is.
    sum: (Sum, usize),
}

impl<'f, 'e> Reading<'f, 'e> {
    fn of(file: &'f [u8], each: &'e mut dyn FnMut(Message<'_>)) -> Self {
        Self {
            file,
            found: Found::default(),
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            each,
            search: file.len().saturating_mul(SEARCH),
            counted: Counted::default(),
            chunks: BTreeMap::new(),
            index: BTreeMap::new(),
            sum: (CRC.digest(), 0),
        }
    }

    /// Reads all there is before `end`, and compares it with that.
    fn all(&mut self, end: Option<End>, mut go_on: impl FnMut(usize) -> bool) {
        if let Some(end) = &end {
            // From here on it is the data.
            self.file = self.file.get(..end.data).unwrap_or_default();
            self.found.finished = end.index.is_some();
            let channels = end.index.iter().flat_map(|index| &index.channels);
            self.channels
                .extend(channels.map(|(id, channel)| (*id, channel.clone())));
        }
        let mut offset = MAGIC.len();
        while offset < self.file.len() {
            if !go_on(offset) {
                return;
            }
            offset = self.record(offset);
            let (sum, summed) = &mut self.sum;
            sum.update(self.file.get(*summed..offset).unwrap_or_default());
            *summed = offset;
        }
        self.compare(end.unwrap_or_default());
    }

    /// Reads the record at `offset`; where the next one is.
    fn record(&mut self, offset: usize) -> usize {
        let Some((code, body)) = framed(self.file, offset) else {
            return self.lost(offset, "no record");
        };
        let next = body.end;
        let is_first = offset == MAGIC.len();
        let read = match code {
            _ if (code == op::HEADER) != is_first => {
                Err("no header, or one in the midst".to_owned())
            }
            op::CHUNK => self.chunk(offset, &body),
            op::MESSAGE_INDEX => self.message_index(&body),
            // A log that has chunks has messages in chunks only: no checksum stands for others.
            op::MESSAGE if !self.chunks.is_empty() => {
                Err("a message outside of a chunk".to_owned())
            }
            op::HEADER | op::SCHEMA | op::CHANNEL | op::MESSAGE => {
                self.described(code, &body).map(|_| ())
            }
            ..=op::DATA_END if !matches!(code, op::ATTACHMENT | op::METADATA) => {
                Err("a record that belongs to the end of a log".to_owned())
            }
            _ if is_proved(self.file, &body) => {
                Err("a chunk that says it is something else".to_owned())
            }
            _ if !self.goes_on(next) => Err("a record that leads nowhere".to_owned()),
            // This program writes none.
            op::ATTACHMENT | op::METADATA => Ok(()),
            _ => {
                self.damaged(offset..next, "a record of an unknown kind");
                Ok(())
            }
        };
        match read {
            Ok(()) => next,
            Err(what) if code != op::CHUNK && is_proved(self.file, &body) => {
                // All but its first byte is right.
                self.damaged(
                    offset..next,
                    format!("{what}; it is a whole chunk, and was read"),
                );
                let _ = self.chunk(offset, &body);
                next
            }
            Err(what) => self.lost(offset, &what),
        }
    }

    /// Whether something that can be read is at `offset`: only then the length of what is not looked into may be believed.
    fn goes_on(&self, offset: usize) -> bool {
        let next = framed(self.file, offset);
        let is_known = next.is_some_and(|(code, body)| match code {
            op::CHUNK => is_proved(self.file, &body),
            op::ATTACHMENT | op::METADATA | op::DATA_END => true,
            _ => self
                .file
                .get(body)
                .is_some_and(|bytes| parsed(code, bytes).is_some()),
        });
        offset == self.file.len() || is_known
    }

    /// Nothing can be read at `offset`; where it can again.
    fn lost(&mut self, offset: usize, what: &str) -> usize {
        // Its length may be wrong: from the next byte on.
        let found = self.next_chunk(offset + 1);
        let next = found.unwrap_or(self.file.len());
        let until = match found {
            Some(_) => "the next chunk",
            None => "the end",
        };
        self.damaged(
            offset..next,
            format!("{what}, and everything up to {until}"),
        );
        next
    }

    fn damaged(&mut self, bytes: Range<usize>, what: impl Into<String>) {
        let what = what.into();
        self.name(Damage { bytes, what });
    }

    fn name(&mut self, damage: Damage) {
        match self.found.damage.get_mut(NAMED) {
            None => self.found.damage.push(damage),
            Some(last) => {
                last.bytes.end = last.bytes.end.max(damage.bytes.end);
                "and more".clone_into(&mut last.what);
            }
        }
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
            is_proved(self.file, &body)
        })
    }

    fn chunk(&mut self, offset: usize, body: &Range<usize>) -> Result<(), String> {
        let (header, records) = chunk(self.file, body)?;
        self.chunks.insert(offset, body.end);
        self.index.clear();
        let (mut offset, start) = (records.start, records.start);
        let inside = self.file.get(..records.end).unwrap_or_default();
        let mut times: Option<(u64, u64)> = None;
        while let Some((code, body)) = framed(inside, offset) {
            let known = matches!(code, op::SCHEMA | op::CHANNEL | op::MESSAGE);
            match known.then(|| self.described(code, &body)) {
                Some(Ok(Some((id, time)))) => {
                    let (first, last) = times.unwrap_or((time, time));
                    times = Some((first.min(time), last.max(time)));
                    let entry = (time, (offset - start) as u64);
                    self.index.entry(id).or_default().push(entry);
                }
                Some(Ok(None)) => {}
                _ => self.damaged(offset..body.end, "a record that cannot be read"),
            }
            offset = body.end;
        }
        if offset != records.end {
            self.damaged(
                offset..records.end,
                "the end of a chunk, which is no record",
            );
        }
        if times.unwrap_or((0, 0)) != (header.message_start_time, header.message_end_time) {
            self.damaged(
                body.clone(),
                "a chunk whose times are not those of its messages; they are read",
            );
        }
        Ok(())
    }

    /// The index of one channel behind a chunk.
    fn message_index(&mut self, body: &Range<usize>) -> Result<(), String> {
        let bytes = self.file.get(body.clone()).unwrap_or_default();
        let Some(Record::MessageIndex(index)) = parsed(op::MESSAGE_INDEX, bytes) else {
            return Err("an index of a chunk that contradicts itself".to_owned());
        };
        let said = index
            .records
            .iter()
            .map(|entry| (entry.log_time, entry.offset));
        let found = self.index.remove(&index.channel_id).unwrap_or_default();
        match said.eq(found) {
            true => Ok(()),
            false => Err("an index that is not that of the chunk before it".to_owned()),
        }
    }

    /// Takes a record that says something of the log; of a message its channel and log time.
    fn described(&mut self, code: u8, body: &Range<usize>) -> Result<Option<(u16, u64)>, String> {
        let bytes = self.file.get(body.clone()).unwrap_or_default();
        match parsed(code, bytes) {
            Some(Record::Header(header)) => {
                self.found.program = printable(&header.library);
                self.counted.from_zero = header.library.starts_with("gauntlet ");
            }
            Some(Record::Schema { header, .. }) => {
                self.schemas.insert(header.id, header.name);
            }
            Some(Record::Channel(channel)) => {
                let id = channel.id;
                self.channels.insert(id, channel_of(channel, &self.schemas));
            }
            Some(Record::Message { header, data }) => {
                self.message(&header, &data, body);
                return Ok(Some((header.channel_id, header.log_time)));
            }
            _ => return Err("a record that contradicts itself".to_owned()),
        }
        Ok(None)
    }

    fn message(&mut self, header: &MessageHeader, data: &[u8], body: &Range<usize>) {
        let Some(channel) = self.channels.get(&header.channel_id) else {
            return self.counted.take_unknown(header.channel_id, body);
        };
        let hole = self.counted.take(header, channel, body);
        self.found.messages += 1;
        (self.each)(Message {
            channel,
            log_time: header.log_time,
            publish_time: header.publish_time,
            data,
        });
        if let Some(hole) = hole {
            self.name(hole);
        }
    }

    /// What should be there, and what was read.
    fn compare(&mut self, end: End) {
        let chunks = end.index.iter().flat_map(|index| &index.chunks);
        for (start, (stop, times)) in chunks {
            let overlaps =
                |damage: &Damage| damage.bytes.start < *stop && *start < damage.bytes.end;
            let read = self.chunks.get(start) == Some(stop);
            if !read && !self.found.damage.iter().any(overlaps) {
                let [from, until] = [times.start, times.end].map(|at| self.counted.seconds(at));
                let what = format!(
                    "a chunk of {from} to {until} of the log that is in its index and not there"
                );
                self.damaged(*start..*stop, what);
            }
        }
        for missing in self.counted.missing(end.index.as_ref(), self.file.len()) {
            self.name(missing);
        }
        let sum = std::mem::replace(&mut self.sum.0, CRC.digest()).finalize();
        if end.sum != 0 && end.sum != sum && self.found.damage.is_empty() {
            self.damaged(
                0..self.file.len(),
                "the checksum over all of it is wrong, and those of the chunks are right",
            );
        }
    }
}

#[cfg(test)]
#[path = "salvage_tests.rs"]
mod tests;
