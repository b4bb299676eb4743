//! The records of a log: where they are, and whether all that a record says of itself fits together.

use std::ops::Range;

use crc::{CRC_32_ISO_HDLC, Crc, Digest, Table};
use mcap::records::{ChunkHeader, Record, op};

/// Sixteen bytes at a time: a log is hours long.
pub(super) type Sum = Digest<'static, u32, Table<16>>;
pub(super) static CRC: Crc<u32, Table<16>> = Crc::<u32, Table<16>>::new(&CRC_32_ISO_HDLC);
/// Opcode and length.
pub(super) const FRAME: usize = 9;
/// A chunk's bytes besides its records and the name of its compression.
const CHUNK_FIXED: usize = 40;

/// The record at `offset`: opcode and where its body is; `None` where none fits.
pub(super) fn framed(bytes: &[u8], offset: usize) -> Option<(u8, Range<usize>)> {
    let frame = bytes.get(offset..offset.checked_add(FRAME)?)?;
    let (&code, length) = frame.split_first()?;
    let length = u64::from_le_bytes(length.try_into().ok()?);
    let start = offset + FRAME;
    let end = start.checked_add(usize::try_from(length).ok()?)?;
    (end <= bytes.len()).then_some((code, start..end))
}

/// The record of such a body, which it fills; `None` where it is none.
///
/// Only of kinds that [`length`] knows: the library expects of others what a damaged file does not hold.
pub(super) fn parsed(code: u8, body: &[u8]) -> Option<Record<'_>> {
    if !(op::HEADER..=op::CHUNK_INDEX).contains(&code) && code != op::STATISTICS {
        return None;
    }
    let record = mcap::parse_record(code, body).ok()?;
    (length(&record)? == body.len()).then_some(record)
}

/// The length that a record of such content has.
fn length(record: &Record<'_>) -> Option<usize> {
    Some(match record {
        Record::Header(header) => 8 + header.profile.len() + header.library.len(),
        Record::Footer(_) => 20,
        Record::Schema { header, data } => {
            14 + header.name.len() + header.encoding.len() + data.len()
        }
        Record::Channel(channel) => {
            let metadata = channel.metadata.iter();
            let metadata: usize = metadata.map(|(k, v)| 8 + k.len() + v.len()).sum();
            16 + channel.topic.len() + channel.message_encoding.len() + metadata
        }
        Record::Message { data, .. } => 22 + data.len(),
        Record::Chunk { header, data } => CHUNK_FIXED + header.compression.len() + data.len(),
        Record::MessageIndex(index) => 6 + 16 * index.records.len(),
        Record::ChunkIndex(index) => {
            64 + 10 * index.message_index_offsets.len() + index.compression.len()
        }
        Record::Statistics(statistics) => 46 + 10 * statistics.channel_message_counts.len(),
        _ => return None,
    })
}

/// What a chunk says of its messages, and where its records are; or what is wrong with it.
pub(super) fn chunk(
    file: &[u8],
    body: &Range<usize>,
) -> Result<(ChunkHeader, Range<usize>), String> {
    let bytes = file.get(body.clone()).unwrap_or_default();
    let Some(Record::Chunk { header, data }) = parsed(op::CHUNK, bytes) else {
        return Err("a chunk that contradicts itself".to_owned());
    };
    if !header.compression.is_empty() {
        return Err(format!(
            "a chunk compressed with {}, which is not read here",
            printable(&header.compression)
        ));
    }
    if header.uncompressed_size != data.len() as u64 {
        return Err("a chunk that contradicts itself".to_owned());
    }
    if header.uncompressed_crc != 0 && CRC.checksum(&data) != header.uncompressed_crc {
        return Err("a chunk whose checksum is wrong".to_owned());
    }
    // The records end the body.
    let start = body.end.saturating_sub(data.len());
    Ok((header, start..body.end))
}

/// Whether a chunk with a right checksum is there: what is found behind damage must show that it is one.
pub(super) fn is_proved(file: &[u8], body: &Range<usize>) -> bool {
    chunk(file, body).is_ok_and(|(header, _)| header.uncompressed_crc != 0)
}

/// What a file says of itself, without what would command a terminal.
pub(super) fn printable(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(80).collect()
}
