//! How often frames, commands and statuses come, and how old a frame is when its first command leaves.

use crate::session::record::Record;

/// One second, µs.
const SECOND: u64 = 1_000_000;

/// What came in the last second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rates {
    pub frames_hz: f64,
    pub commands_hz: f64,
    pub statuses_hz: f64,
    /// Mean and longest; of no command `None`.
    pub latency_ms: Option<(f64, f64)>,
}

/// Counts what comes, and sums up once a second.
#[derive(Debug, Clone, Default)]
pub(super) struct Counting {
    since: Option<u64>,
    frames: u32,
    commands: u32,
    statuses: u32,
    first: u32,
    sum_us: u64,
    max_us: u64,
}

impl Counting {
    /// Takes a record; once a second or later, by the records' time, what came since the last sum.
    pub(super) fn take(&mut self, record: &Record) -> Option<Rates> {
        let at = record.at().as_ticks();
        let since = *self.since.get_or_insert(at);
        let sum = (at >= since + SECOND).then(|| self.sum(at - since));
        if sum.is_some() {
            *self = Self {
                since: Some(at),
                ..Self::default()
            };
        }
        match record {
            Record::Frame(_) => self.frames += 1,
            Record::Status(_) => self.statuses += 1,
            Record::Command(command) => {
                self.commands += 1;
                if let Some(age) = command.age_us.filter(|_| command.first) {
                    self.first += 1;
                    self.sum_us += age;
                    self.max_us = self.max_us.max(age);
                }
            }
            // What a chip tells comes as often as it is asked to tell it.
            Record::Told(_) | Record::Event { .. } => {}
        }
        sum
    }

    fn sum(&self, span_us: u64) -> Rates {
        let span_s = span_us as f64 / 1e6;
        let hz = |count: u32| f64::from(count) / span_s;
        let mean = self.sum_us as f64 / f64::from(self.first) / 1e3;
        Rates {
            frames_hz: hz(self.frames),
            commands_hz: hz(self.commands),
            statuses_hz: hz(self.statuses),
            latency_ms: (self.first > 0).then_some((mean, self.max_us as f64 / 1e3)),
        }
    }
}
