//! What is so with a glove at one moment, and what was counted until then.

use std::collections::VecDeque;
use std::time::Duration;

use glove::hand::SEGMENT_COUNT;
use glove::imu::UniqueId;
use glove::scan::{self, Counters, Finding, Frame, Health};
use glove::{Instant, sc18im};

use crate::stats::{Percentiles, Rate};

/// Findings kept for whoever asks.
const FINDINGS: usize = 32;

/// How one sensor is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sensor {
    /// What the newest scan found.
    pub health: Health,
    /// Since its newest good sample was asked for; `None` before the first.
    pub age: Option<Duration>,
    /// Good samples.
    pub good: u64,
    /// Scans without a good sample of it, from its first good one on.
    pub lost: u64,
    /// How often it came up: more than once means that it started anew, with another heading.
    pub starts: u16,
    /// Its unique id as it was read first; `None` before that, and where it has none.
    pub id: Option<UniqueId>,
}

/// The state of a glove at one moment.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    /// When.
    pub now: Instant,
    /// What the scanner is doing.
    pub state: scan::State,
    /// Speed of the serial line, baud; `None` on an I²C port.
    pub baud: Option<u32>,
    /// Whether the port is there.
    pub is_plugged: bool,
    /// How often it went away.
    pub unplugged: u64,
    /// The 16 sensors.
    pub sensors: [Sensor; SEGMENT_COUNT],
    /// The newest frame.
    pub frame: Option<Frame>,
    /// The scanner's counts since it started.
    pub counters: Counters,
    /// The serial bridge's counts since it started; `None` on an I²C port.
    pub link: Option<sc18im::Counters>,
    /// Frames.
    pub frames: u64,
    /// Frames that nobody took in time.
    pub not_taken: u64,
    /// Scans a second, over the last second.
    pub rate: f64,
    /// Scans a second, from the first to the last.
    pub mean_rate: f64,
    /// From one scan to the next, µs: the median, what 99 of 100 stay within, the longest.
    pub interval_us: Option<[u64; 3]>,
    /// How far 99 of 100 intervals stay from the one before, µs.
    pub jitter_us: Option<u64>,
}

impl Snapshot {
    /// The sensors' unique ids, as they are wired.
    pub fn ids(&self) -> [Option<UniqueId>; SEGMENT_COUNT] {
        self.sensors.map(|sensor| sensor.id)
    }

    /// What the newest scan found at each sensor.
    pub fn health(&self) -> [Health; SEGMENT_COUNT] {
        self.sensors.map(|sensor| sensor.health)
    }

    /// Sensors whose newest sample is good.
    pub fn good(&self) -> usize {
        let good = |sensor: &&Sensor| sensor.health.is_good();
        self.sensors.iter().filter(good).count()
    }
}

/// What was counted of one sensor.
#[derive(Debug, Clone, Copy, Default)]
struct Counted {
    stamp: Option<Instant>,
    good: u64,
    lost: u64,
}

/// What the scanner is like now, where no frame tells.
pub(super) struct Here {
    pub state: scan::State,
    pub baud: Option<u32>,
    pub health: [Health; SEGMENT_COUNT],
    pub counters: Counters,
    pub link: Option<sc18im::Counters>,
    pub ids: [Option<UniqueId>; SEGMENT_COUNT],
}

/// What was said so far, in bounded memory.
#[derive(Debug, Default)]
pub(super) struct Said {
    now: Option<Snapshot>,
    sensors: [Counted; SEGMENT_COUNT],
    rate: Rate,
    intervals: Percentiles,
    changes: Percentiles,
    last: Option<(Instant, Option<u64>)>,
    not_taken: u64,
    frame: Option<Frame>,
    findings: VecDeque<Finding>,
    found: u64,
}

impl Said {
    /// A scan was complete at `at`, and was taken over or not.
    pub fn frame(&mut self, frame: &Frame, at: Instant, taken: bool) {
        for (counted, sample) in self.sensors.iter_mut().zip(&frame.samples) {
            if sample.health.is_good() {
                counted.good += 1;
                counted.stamp = Some(sample.stamp);
            } else if counted.stamp.is_some() {
                counted.lost += 1;
            }
        }
        self.rate.add(at.as_ticks());
        let interval = self.last.map(|(last, _)| since(at, last));
        if let Some(us) = interval {
            self.intervals.add(us);
            if let Some((_, Some(before))) = self.last {
                self.changes.add(us.abs_diff(before));
            }
        }
        self.last = Some((at, interval));
        self.not_taken += u64::from(!taken);
        self.frame = Some(*frame);
    }

    /// Everything else, at `now`.
    pub fn say(&mut self, here: &Here, now: Instant) {
        let sensor = |k: usize| {
            let Counted { stamp, good, lost } = self.sensors[k];
            Sensor {
                health: here.health[k],
                age: stamp.map(|stamp| Duration::from_micros(since(now, stamp))),
                good,
                lost,
                starts: here.counters.starts[k],
                id: here.ids[k],
            }
        };
        let sensors = std::array::from_fn(sensor);
        let [median, most, longest] = [
            self.intervals.at(0.5),
            self.intervals.at(0.99),
            self.intervals.longest(),
        ];
        self.now = Some(Snapshot {
            now,
            state: here.state,
            baud: here.baud,
            is_plugged: true,
            unplugged: 0,
            sensors,
            frame: self.frame,
            counters: here.counters,
            link: here.link,
            frames: self.rate.count(),
            not_taken: self.not_taken,
            rate: self.rate.now(now.as_ticks()),
            mean_rate: self.rate.mean(),
            interval_us: median.zip(most).zip(longest).map(|((a, b), c)| [a, b, c]),
            jitter_us: self.changes.at(0.99),
        });
    }

    pub fn found(&mut self, finding: Finding) {
        if self.findings.len() == FINDINGS {
            self.findings.pop_front();
        }
        self.findings.push_back(finding);
        self.found += 1;
    }

    pub fn findings(&self, seen: &mut u64) -> Vec<Finding> {
        let fresh = self.found.saturating_sub(*seen);
        *seen = self.found;
        let fresh = usize::try_from(fresh).unwrap_or(FINDINGS);
        let old = self.findings.len().saturating_sub(fresh);
        self.findings.iter().skip(old).copied().collect()
    }

    pub fn snapshot(&self) -> Option<Snapshot> {
        self.now.clone()
    }

    /// Counts anew.
    pub fn begin(&mut self) {
        for counted in &mut self.sensors {
            (counted.good, counted.lost) = (0, 0);
        }
        self.rate = Rate::default();
        self.intervals = Percentiles::default();
        self.changes = Percentiles::default();
        self.last = None;
        self.not_taken = 0;
    }
}

fn since(now: Instant, then: Instant) -> u64 {
    now.as_ticks().saturating_sub(then.as_ticks())
}

#[cfg(test)]
mod tests {
    use super::*;
    use glove::hand::Quaternion;
    use glove::scan::Sample;

    fn frame(stamp: u64, lost: Option<usize>) -> Frame {
        Frame {
            samples: std::array::from_fn(|k| Sample {
                orientation: Quaternion::identity(),
                stamp: Instant::from_ticks(stamp),
                health: match lost == Some(k) {
                    true => Health::Starting,
                    false => Health::Good,
                },
            }),
            sequence: 0,
        }
    }

    fn here() -> Here {
        Here {
            state: scan::State::Scanning,
            baud: Some(115_200),
            health: [Health::Good; SEGMENT_COUNT],
            counters: Counters::default(),
            link: None,
            ids: [None; SEGMENT_COUNT],
        }
    }

    #[test]
    fn a_sensor_s_lost_scans_count_from_its_first_good_one_on() {
        let mut said = Said::default();
        for (at, lost) in [
            (0, Some(3)),
            (10_000, None),
            (20_000, Some(3)),
            (30_000, Some(3)),
        ] {
            said.frame(&frame(at, lost), Instant::from_ticks(at + 9_000), true);
        }
        said.say(&here(), Instant::from_ticks(40_000));
        let seen = said.snapshot().unwrap();
        let (lost, other) = (seen.sensors[3], seen.sensors[4]);
        assert_eq!((lost.good, lost.lost), (1, 2));
        assert_eq!(lost.age, Some(Duration::from_millis(30)));
        assert_eq!((other.good, other.lost), (4, 0));
    }

    #[test]
    fn jitter_is_of_the_intervals_and_not_of_their_length() {
        let jitter = |times: &[u64]| {
            let mut said = Said::default();
            for at in times {
                said.frame(&frame(*at, None), Instant::from_ticks(*at), true);
            }
            said.say(&here(), Instant::from_ticks(1_000_000));
            said.snapshot().unwrap().jitter_us
        };
        let even: Vec<u64> = (0..40).map(|k| 25_000 * k).collect();
        assert_eq!(jitter(&even), Some(0));
        let uneven: Vec<u64> = (0..40).map(|k| 25_000 * k + 3_000 * (k % 2)).collect();
        let found = jitter(&uneven).unwrap();
        assert!((5_900..=6_100).contains(&found), "{found}");
        assert_eq!(jitter(&[0, 25_000]), None);
    }

    #[test]
    fn after_a_new_beginning_nothing_of_before_is_counted_and_the_age_goes_on() {
        let mut said = Said::default();
        said.frame(&frame(0, None), Instant::from_ticks(9_000), false);
        said.begin();
        said.say(&here(), Instant::from_ticks(50_000));
        let seen = said.snapshot().unwrap();
        assert_eq!(
            (seen.frames, seen.not_taken, seen.sensors[0].good),
            (0, 0, 0)
        );
        assert_eq!(seen.sensors[0].age, Some(Duration::from_millis(50)));
    }
}
