//! The trace in a session log: its blocks put together again, up to the first one that is missing.

use std::path::{Path, PathBuf};

use anyhow::Result;
use bridge::trace::{Entry, Part, Reader};
use glove::calibration::Bound;

use super::file::{TRACE_ENCODING, TRACE_TOPIC};
use super::salvage::{self, Found};
use crate::failure::{Failure, OrFail};
use crate::lines::Model;
use crate::next::{Command, advice};
use crate::trace::Home;

/// A trace from a log, and what the bridge was made of.
#[derive(Debug, Clone)]
pub struct Traced {
    /// The log.
    pub path: PathBuf,
    /// What was found in the file.
    pub found: Found,
    /// What the bridge's home said of itself.
    pub home: Home,
    /// Which gripper it was.
    pub model: Model,
    /// The settings at the start, as [`bridge::trace::settings`] reads them.
    pub settings: Vec<u8>,
    /// The weights image.
    pub image: Vec<u8>,
    /// The glove's profile at the start.
    pub profile: Option<Bound>,
    /// The entries, without a gap.
    pub bytes: Vec<u8>,
    /// When the clock was read last in them, µs.
    pub end: u64,
    /// The time from which on, and until which, a part of the trace is missing, µs; what comes after it is not replayed.
    pub gap: Option<(u64, u64)>,
}

/// Blocks put together.
#[derive(Debug, Default)]
struct Blocks {
    bytes: Vec<u8>,
    end: u64,
    gap: Option<(u64, u64)>,
    blocks: u64,
    version: Option<String>,
}

impl Blocks {
    fn take(&mut self, message: &[u8]) {
        let Some((since, rest)) = message.split_first_chunk::<8>() else {
            return;
        };
        let Some((at, entries)) = rest.split_first_chunk::<8>() else {
            return;
        };
        let (since, at) = (u64::from_le_bytes(*since), u64::from_le_bytes(*at));
        self.blocks += 1;
        // The first block begins with the trace.
        let is_first = self.blocks == 1;
        let follows = since == self.end && is_first == self.bytes.is_empty();
        match self.gap {
            Some(_) => {}
            None if follows => {
                self.bytes.extend_from_slice(entries);
                self.end = at;
            }
            None => self.gap = Some((self.end, since)),
        }
    }
}

impl Traced {
    /// Whether a glove was read by itself: there was no bridge.
    pub fn is_scan(&self) -> bool {
        self.image.is_empty()
    }

    /// Reads the log at `path`.
    ///
    /// # Errors
    /// A failure that names it: no log, one without a trace, one of another version.
    pub fn read(path: &Path) -> Result<Self> {
        let what = || format!("{} cannot be replayed", path.display());
        let record = "the log of a gauntlet demo --log or gauntlet teleop --log";
        let file = trainer::whole_file::read(path).or_fail(what, "a log that is there")?;
        let mut blocks = Blocks::default();
        let found = salvage::read(&file, |message| {
            if message.channel.topic == TRACE_TOPIC && message.channel.encoding == TRACE_ENCODING {
                blocks.version = message.channel.metadata.get("version").cloned();
                blocks.take(message.data);
            }
        })
        .or_fail(what, record)?;
        let version = bridge::trace::VERSION.to_string();
        if let Some(other) = blocks.version.as_ref().filter(|other| **other != version) {
            return Err(Failure::new(
                format!(
                    "{}: its trace has version {other}, and this program reads version {version}; it was written by {}",
                    what(),
                    found.program
                ),
                "the program that wrote it",
            )
            .into());
        }
        Self::of(path, blocks, found, what)
    }

    fn of(path: &Path, blocks: Blocks, found: Found, what: impl Fn() -> String) -> Result<Self> {
        let Blocks {
            bytes, end, gap, ..
        } = blocks;
        let mut traced = Self {
            path: path.to_owned(),
            found,
            home: Home::unknown(),
            model: Model::ThreeFinger,
            settings: Vec::new(),
            image: Vec::new(),
            profile: None,
            bytes: Vec::new(),
            end,
            gap,
        };
        let mut reader = Reader::new(&bytes);
        let (mut began, mut unreadable) = (false, None);
        while let Some(entry) = reader.peek() {
            match entry {
                Entry::Head { .. } => began = true,
                Entry::Part { part, bytes } => unreadable = unreadable.or(traced.take(part, bytes)),
                _ => break,
            }
            // It was read once.
            let _ = reader.read();
        }
        if !began {
            let missing = match traced.found.damage.first() {
                Some(damage) => format!("its trace has no beginning ({damage})"),
                None => "it has no trace of a bridge".to_owned(),
            };
            let next =
                advice("a log of ").then(Command::gauntlet("demo").option("--log", "session.mcap"));
            return Err(Failure::new(format!("{}: {missing}", what()), next).into());
        }
        if let Some(part) = unreadable {
            let why = format!("{}: {part} in it cannot be read", what());
            return Err(Failure::new(why, "another log: this one is damaged").into());
        }
        let model = traced.home.gripper_model.parse();
        traced.model = model
            .map_err(|error: String| Failure::new(format!("{}: {error}", what()), "another log"))?;
        traced.bytes = bytes;
        Ok(traced)
    }

    /// Returns what of it cannot be read.
    fn take(&mut self, part: Part, bytes: &[u8]) -> Option<&'static str> {
        match part {
            Part::Image => self.image = bytes.to_vec(),
            Part::Settings => self.settings = bytes.to_vec(),
            Part::Profile => match Bound::from_bytes(bytes) {
                Ok(profile) => self.profile = Some(profile),
                Err(_) => return Some("the profile"),
            },
            Part::Home => match serde_json::from_slice(bytes) {
                Ok(home) => self.home = home,
                Err(_) => return Some("what says how glove and gripper were driven"),
            },
        }
        None
    }
}
