//! Whether messages are missing: those of a channel are numbered.

use std::collections::BTreeMap;
use std::ops::Range;

use mcap::records::MessageHeader;

use super::end::Index;
use super::frames::printable;
use super::told::{Channel, Damage};

/// What was read of one channel.
#[derive(Debug, Clone, Copy)]
struct Read {
    /// The number of the newest message, and when it was logged, ns since 1970.
    sequence: u32,
    time: u64,
    /// Where it ends in the file.
    end: usize,
    /// Messages that were read, or are known to be missing.
    accounted: u64,
}

/// The messages of a log, counted.
#[derive(Debug, Default)]
pub(super) struct Counted {
    by_channel: BTreeMap<u16, Read>,
    /// When the first message was logged, ns since 1970.
    start: Option<u64>,
    /// A channel's first message has number 0: so this program numbers them, and others as they like.
    pub from_zero: bool,
    /// Messages of channels of which nothing is known: how many, and between which bytes.
    unknown: BTreeMap<u16, (u64, Range<usize>)>,
}

/// So many messages of a topic, `between` which times.
fn missing(count: u64, topic: &str, between: &str) -> String {
    let (count, are) = match count {
        1 => ("1 message".to_owned(), "is"),
        count => (format!("{count} messages"), "are"),
    };
    format!("{count} of {}{between} {are} missing", printable(topic))
}

impl Counted {
    /// One more message, in these bytes of the file; what is missing before it.
    pub(super) fn take(
        &mut self,
        header: &MessageHeader,
        channel: &Channel,
        bytes: &Range<usize>,
    ) -> Option<Damage> {
        let (sequence, time) = (header.sequence, header.log_time);
        self.start.get_or_insert(time);
        let last = self.by_channel.get(&header.channel_id).copied();
        let expected = match last {
            Some(last) => last.sequence.wrapping_add(1),
            None if self.from_zero => 0,
            None => sequence,
        };
        // Numbers that go back are not numbers of messages: some programs write 0 for all.
        let gap = sequence.wrapping_sub(expected);
        let gap = u64::from(if gap > u32::MAX / 2 { 0 } else { gap });
        let accounted = last.map_or(0, |last| last.accounted) + gap + 1;
        let now = Read {
            sequence,
            time,
            end: bytes.end,
            accounted,
        };
        self.by_channel.insert(header.channel_id, now);
        if gap == 0 {
            return None;
        }
        let (start, between) = match last {
            Some(last) => (
                last.end,
                format!(
                    " between {} and {} of the log",
                    self.seconds(last.time),
                    self.seconds(time)
                ),
            ),
            None => (0, format!(" before {} of the log", self.seconds(time))),
        };
        Some(Damage {
            bytes: start..bytes.start,
            what: missing(gap, &channel.topic, &between),
        })
    }

    /// A message of a channel of which nothing is known.
    pub(super) fn take_unknown(&mut self, channel: u16, bytes: &Range<usize>) {
        let (count, all) = self.unknown.entry(channel).or_insert((0, bytes.clone()));
        *count += 1;
        all.end = bytes.end;
    }

    /// A time of the log.
    pub(super) fn seconds(&self, time: u64) -> String {
        let since = time.saturating_sub(self.start.unwrap_or(time));
        format!("{:.3} s", since as f64 * 1e-9)
    }

    /// What is missing of data that have so many bytes; `index` says what should be there.
    pub(super) fn missing(&self, index: Option<&Index>, end: usize) -> Vec<Damage> {
        let unknown = self.unknown.iter().map(|(channel, (count, bytes))| Damage {
            bytes: bytes.clone(),
            what: format!(
                "channel {channel} is nowhere described: of its messages {count} are not read"
            ),
        });
        let index = index.into_iter();
        let at_end = index.flat_map(|index| {
            index.counts.iter().filter_map(|(id, count)| {
                let read = self.by_channel.get(id);
                let gone = count.saturating_sub(read.map_or(0, |read| read.accounted));
                let topic = &index.channels.get(id)?.topic;
                let (start, after) = match read {
                    Some(read) => (
                        read.end,
                        format!(" after {} of the log", self.seconds(read.time)),
                    ),
                    None => (0, String::new()),
                };
                (gone > 0).then(|| Damage {
                    bytes: start..end,
                    what: missing(gone, topic, &after),
                })
            })
        });
        unknown.chain(at_end).collect()
    }
}
