//! The end of a log that was finished: the sum over its data, and its index, which says what should be there.

use std::collections::BTreeMap;
use std::ops::Range;

use mcap::MAGIC;
use mcap::records::{Record, op};

use super::frames::{CRC, FRAME, framed, parsed};
use super::told::{Channel, channel_of};

/// The length of the records "data end" and "footer".
const DATA_END: usize = FRAME + 4;
const FOOTER: usize = FRAME + 20;

/// The end of a file, whole.
#[derive(Debug, Default)]
pub(super) struct End {
    /// Where the data end, and with them what holds messages.
    pub data: usize,
    /// The checksum over them; 0 is none.
    pub sum: u32,
    /// What should be there; `None` of a file without an index.
    pub index: Option<Index>,
}

/// What a log's index says.
#[derive(Debug, Default)]
pub(super) struct Index {
    /// The channels, whose beginnings may be lost in the data.
    pub channels: BTreeMap<u16, Channel>,
    /// Where chunks begin: where they end, and when their messages were logged, ns since 1970.
    pub chunks: BTreeMap<usize, (usize, Range<u64>)>,
    /// Messages by channel, where they were counted.
    pub counts: BTreeMap<u16, u64>,
}

impl End {
    /// The end of `file`, if all of it fits together.
    pub(super) fn of(file: &[u8]) -> Option<Self> {
        let footer = file.len().checked_sub(FOOTER + MAGIC.len())?;
        let (op::FOOTER, body) = framed(file, footer)? else {
            return None;
        };
        let Some(Record::Footer(said)) = parsed(op::FOOTER, file.get(body.clone())?) else {
            return None;
        };
        if file.get(body.end..)? != MAGIC {
            return None;
        }
        let start = match usize::try_from(said.summary_start).ok()? {
            0 if said.summary_offset_start == 0 => footer,
            0 => return None,
            start => start,
        };
        // The checksum stands for the footer up to itself, too.
        let summed = file.get(start..body.end - 4)?;
        if said.summary_crc != 0 && CRC.checksum(summed) != said.summary_crc {
            return None;
        }
        let data = start.checked_sub(DATA_END)?;
        let (op::DATA_END, sum) = framed(file, data)? else {
            return None;
        };
        if sum.end != start {
            return None;
        }
        let index = match start < footer {
            true => Some(Index::of(file.get(..footer)?, start)?),
            false => None,
        };
        let sum = u32::from_le_bytes(file.get(sum)?.try_into().ok()?);
        Some(Self { data, sum, index })
    }
}

impl Index {
    /// The records from `offset` to the end of `file`.
    fn of(file: &[u8], mut offset: usize) -> Option<Self> {
        let mut index = Self::default();
        let mut schemas = BTreeMap::new();
        while offset < file.len() {
            let (code, body) = framed(file, offset)?;
            offset = body.end;
            match parsed(code, file.get(body)?) {
                Some(Record::Schema { header, .. }) => {
                    schemas.insert(header.id, header.name);
                }
                Some(Record::Channel(channel)) => {
                    let id = channel.id;
                    index.channels.insert(id, channel_of(channel, &schemas));
                }
                Some(Record::ChunkIndex(chunk)) => {
                    let start = usize::try_from(chunk.chunk_start_offset).ok()?;
                    let length = usize::try_from(chunk.chunk_length).ok()?;
                    let times = chunk.message_start_time..chunk.message_end_time;
                    let end = start.checked_add(length)?;
                    index.chunks.insert(start, (end, times));
                }
                Some(Record::Statistics(statistics)) => {
                    index.counts = statistics.channel_message_counts;
                }
                _ => {}
            }
        }
        Some(index)
    }
}
