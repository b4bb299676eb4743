//! Results of verbs that read a glove by itself.

use std::fmt::Write;

use host::chip::scans::Counted;
use host::failure::Told;
use host::glove::hand::SEGMENT_NAMES;
use host::glove::imu;
use host::next::{NextStep, Warning};
use host::scanning::Snapshot;
use host::training::recorded::Seen;
use serde::Serialize;

use super::headings::Joint;
use super::runs::Poses;

/// `glove watch`.
#[derive(Debug, Serialize)]
pub struct Watched {
    /// The glove's port.
    pub place: String,
    /// How long it was watched, s.
    pub took_s: f64,
    /// Whether it was calibrated at the end.
    pub calibrated: bool,
    /// How often it was read.
    #[serde(flatten)]
    pub scanned: Scanned,
    /// How sure its joints' headings were at the end; `null` without a profile.
    pub joints: Option<Vec<Joint>>,
    /// Its sensors, in the order of the segments.
    pub sensors: Vec<Sensor>,
    /// What was found out about them meanwhile, in words.
    pub found: Vec<String>,
    /// Why it failed; `null` where it did not.
    pub failure: Option<Told>,
}

/// How often a glove was read.
#[derive(Debug, Default, Serialize)]
pub struct Scanned {
    /// Speed of its line; `null` on an I²C port, and where a bridge on a chip reads it.
    pub baud: Option<u32>,
    /// Scans of all 16 sensors.
    pub scans: u64,
    /// From the first to the last.
    pub scans_per_s: f64,
    /// From one scan to the next: half of all were shorter.
    pub interval_p50_us: Option<u64>,
    /// The same for 99 of 100.
    pub interval_p99_us: Option<u64>,
    /// The longest.
    pub interval_max_us: Option<u64>,
    /// How far 99 of 100 intervals stay from the one before.
    pub jitter_us: Option<u64>,
    /// Scans that this computer was too busy to take, or that the line from a bridge on a chip lost.
    pub not_taken: u64,
    /// How often the port went away.
    pub unplugged: u64,
}

impl From<&Snapshot> for Scanned {
    fn from(seen: &Snapshot) -> Self {
        Self {
            baud: seen.baud,
            scans: seen.frames,
            scans_per_s: seen.mean_rate,
            interval_p50_us: seen.interval_us.map(|[median, ..]| median),
            interval_p99_us: seen.interval_us.map(|[_, most, _]| most),
            interval_max_us: seen.interval_us.map(|[.., longest]| longest),
            jitter_us: seen.jitter_us,
            not_taken: seen.not_taken,
            unplugged: seen.unplugged,
        }
    }
}

impl From<&Counted> for Scanned {
    fn from(seen: &Counted) -> Self {
        Self {
            baud: None,
            scans: seen.scans,
            scans_per_s: seen.mean_rate,
            interval_p50_us: seen.interval_us.map(|[median, ..]| median),
            interval_p99_us: seen.interval_us.map(|[_, most, _]| most),
            interval_max_us: seen.interval_us.map(|[.., longest]| longest),
            jitter_us: None,
            not_taken: seen.lost,
            unplugged: 0,
        }
    }
}

/// One sensor of a glove.
#[derive(Debug, Serialize)]
pub struct Sensor {
    /// The segment it is wired for.
    pub segment: &'static str,
    /// The multiplexer's channel.
    pub channel: u8,
    /// Its address, hexadecimal.
    pub address: String,
    /// Its unique id, hexadecimal; `null` where none was read.
    pub id: Option<String>,
    /// What the newest scan found, in words.
    pub state: String,
    /// Age of its newest good sample.
    pub age_us: Option<u64>,
    /// Good samples.
    pub good: u64,
    /// Scans without one.
    pub lost: u64,
    /// How often it came up.
    pub starts: u16,
}

/// The sensors of a glove.
pub fn sensors(seen: &Snapshot) -> Vec<Sensor> {
    let of = |(k, segment): (usize, &'static str)| {
        let sensor = &seen.sensors[k];
        Sensor {
            segment,
            channel: imu::channel(k),
            address: format!("{:#04X}", imu::address(k)),
            id: sensor.id.map(|id| hex(&id)),
            state: sensor.health.to_string(),
            age_us: sensor.age.map(|age| age.as_micros() as u64),
            good: sensor.good,
            lost: sensor.lost,
            starts: sensor.starts,
        }
    };
    SEGMENT_NAMES.into_iter().enumerate().map(of).collect()
}

/// Bytes as hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        // A string takes everything.
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// `record`.
#[derive(Debug, Serialize)]
pub struct Recorded<'a> {
    /// The glove's port.
    pub place: String,
    /// The poses file; `null` where no pose came.
    pub poses: Option<Poses<'a>>,
    /// From the first pose to the last, s.
    pub covers_s: f64,
    /// Scans that gave no whole pose and are no row.
    pub passed_over: u64,
    /// How often the glove was read.
    #[serde(flatten)]
    pub scanned: Scanned,
    /// How often each movement was seen.
    pub movements: Vec<Seen>,
    /// Whether it is good enough to train on.
    pub good: bool,
    /// What it lacks, in words; empty where it is good.
    pub lacks: Vec<String>,
    /// What a training would say of the data.
    pub warnings: Vec<Warning>,
    /// What to do with it.
    #[serde(flatten)]
    pub next: NextStep,
    /// Why it failed; `null` where it did not.
    pub failure: Option<Told>,
}
