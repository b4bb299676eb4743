//! What is told of a log: its channels, and what of it cannot be read.

use std::collections::BTreeMap;
use std::ops::Range;

use mcap::records;

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

/// A channel, whose schema is one of these.
pub(super) fn channel_of(channel: records::Channel, schemas: &BTreeMap<u16, String>) -> Channel {
    Channel {
        topic: channel.topic,
        encoding: channel.message_encoding,
        schema: schemas.get(&channel.schema_id).cloned().unwrap_or_default(),
        metadata: channel.metadata,
    }
}
