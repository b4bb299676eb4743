//! Numbers of a run in bounded memory: latency percentiles, rates.

use std::collections::VecDeque;
use std::time::Duration;

use hdrhistogram::Histogram;
use serde::Serializer;

/// Values up to 2^24 µs, 16.8 s; anything longer counts as that.
const LONGEST_US: u64 = (1 << 24) - 1;
/// Decimal digits that a percentile is right to: 1 %.
const DIGITS: u8 = 2;

/// Percentiles of durations with 1 % resolution in some kilobytes, however long the run.
#[derive(Debug, Clone, Default)]
pub struct Percentiles {
    /// From the first duration on.
    counts: Option<Histogram<u64>>,
    longest_us: u64,
}

impl Percentiles {
    /// Counts one duration in.
    pub fn add(&mut self, us: u64) {
        if self.counts.is_none() {
            self.counts = Histogram::new_with_bounds(1, LONGEST_US, DIGITS).ok();
        }
        if let Some(counts) = &mut self.counts {
            counts.saturating_record(us);
        }
        self.longest_us = self.longest_us.max(us);
    }

    /// The duration, in µs, that a share `share` (0 to 1) of all stay within; `None` before the first.
    pub fn at(&self, share: f64) -> Option<u64> {
        let counts = self.counts.as_ref()?;
        Some(counts.value_at_quantile(share).min(self.longest_us))
    }

    /// How many durations were counted.
    pub fn count(&self) -> u64 {
        self.counts.as_ref().map_or(0, Histogram::len)
    }

    /// The longest, µs.
    pub fn longest(&self) -> Option<u64> {
        self.counts.is_some().then_some(self.longest_us)
    }
}

/// Events a second: over the last second, and over the whole run.
#[derive(Debug, Clone, Default)]
pub struct Rate {
    /// Times of the last second's events, µs.
    recent: VecDeque<u64>,
    first_us: Option<u64>,
    last_us: u64,
    count: u64,
}

/// More events than this in one second are not kept one by one.
const RECENT: usize = 1024;
/// The window of the momentary rate.
const WINDOW_US: u64 = 1_000_000;

impl Rate {
    /// Counts one event at `us`.
    pub fn add(&mut self, us: u64) {
        self.first_us.get_or_insert(us);
        self.last_us = self.last_us.max(us);
        self.count += 1;
        if self.recent.len() == RECENT {
            self.recent.pop_front();
        }
        self.recent.push_back(us);
        self.forget(us);
    }

    fn forget(&mut self, now_us: u64) {
        while self
            .recent
            .front()
            .is_some_and(|first| now_us.saturating_sub(*first) > WINDOW_US)
        {
            self.recent.pop_front();
        }
    }

    /// Events a second over the last second before `now_us`; 0 with fewer than two events in it.
    pub fn now(&mut self, now_us: u64) -> f64 {
        self.forget(now_us);
        let (Some(first), Some(last)) = (self.recent.front(), self.recent.back()) else {
            return 0.0;
        };
        // A stream that stopped is divided by the time since, so that its rate falls to zero and does not freeze.
        let quiet = now_us.saturating_sub(*last);
        let mean = (last - first) / (self.recent.len() as u64 - 1).max(1);
        let span = if quiet > 2 * mean.max(1) {
            now_us - first
        } else {
            last - first
        };
        ratio(self.recent.len() as u64 - 1, span)
    }

    /// Events a second from the first event to the last.
    pub fn mean(&self) -> f64 {
        self.first_us.map_or(0.0, |first| {
            ratio(self.count - 1, self.last_us.saturating_sub(first))
        })
    }

    /// All events.
    pub fn count(&self) -> u64 {
        self.count
    }
}

fn ratio(events: u64, span_us: u64) -> f64 {
    if span_us == 0 {
        return 0.0;
    }
    events as f64 / (span_us as f64 / 1e6)
}

/// For a field of a result: JSON has no NaN, and `null` would say nothing. A number that is none is a word: "NaN", "inf".
///
/// # Errors
/// Those of `to`.
pub fn number<S: Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
    match value.is_finite() {
        true => to.serialize_f64(*value),
        false => to.serialize_str(&value.to_string()),
    }
}

/// The same for one that may not be there.
///
/// # Errors
/// Those of `to`.
pub fn number_or_null<S: Serializer>(value: &Option<f64>, to: S) -> Result<S::Ok, S::Error> {
    match value {
        Some(value) => number(value, to),
        None => to.serialize_none(),
    }
}

/// A short duration as a person reads it: `3.4 ms`, `870 µs`, `1.20 s`.
pub fn short(us: u64) -> String {
    match us {
        0..1_000 => format!("{us} µs"),
        1_000..1_000_000 => format!("{:.1} ms", us as f64 / 1e3),
        _ => format!("{:.2} s", us as f64 / 1e6),
    }
}

/// The same for an optional one; `–` where there is none.
pub fn short_or_dash(us: Option<u64>) -> String {
    us.map_or_else(|| "–".to_owned(), short)
}

/// A time as a person reads it, of whatever length: `30.0 ms`, `3.2 s`, `1 min 05 s`.
pub fn time(time: Duration) -> String {
    match u64::try_from(time.as_micros()) {
        Ok(us) if us < 100_000 => short(us),
        _ => seconds(time),
    }
}

/// How many: `1 byte`, `7 bytes`.
pub fn bytes(count: usize) -> String {
    match count {
        1 => "1 byte".to_owned(),
        _ => format!("{count} bytes"),
    }
}

/// How often: `once`, `7 times`.
pub fn times(count: u32) -> String {
    match count {
        1 => "once".to_owned(),
        count => format!("{count} times"),
    }
}

/// Seconds as a person reads them: `3.2 s`, `1 min 05 s`.
pub fn seconds(time: Duration) -> String {
    let s = time.as_secs_f64();
    if s < 60.0 {
        format!("{s:.1} s")
    } else {
        format!("{} min {:02} s", s as u64 / 60, s as u64 % 60)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_within_two_percent_of_sorted_values() {
        let mut percentiles = Percentiles::default();
        let mut values: Vec<u64> = (0..20_000u64).map(|i| (i * i * 7919) % 900_001).collect();
        values.iter().for_each(|value| percentiles.add(*value));
        values.sort_unstable();
        for share in [0.5, 0.9, 0.99, 1.0] {
            let exact = values[(share * values.len() as f64).ceil() as usize - 1] as f64;
            let found = percentiles.at(share).unwrap() as f64;
            assert!(
                (found - exact).abs() <= 0.02 * exact,
                "{share}: {found} {exact}"
            );
        }
        assert_eq!(percentiles.longest(), values.last().copied());
    }

    #[test]
    fn one_value_is_told_as_it_is_and_beyond_the_longest_as_that() {
        for us in (0..5_000).chain([1 << 20, LONGEST_US, u64::MAX]) {
            let mut one = Percentiles::default();
            one.add(us);
            let told = one.at(0.5).unwrap();
            assert!(told <= us && told >= us.min(LONGEST_US), "{us}: {told}");
            assert_eq!((one.count(), one.longest()), (1, Some(us)));
        }
    }

    #[test]
    fn nothing_counted_gives_no_percentile() {
        assert_eq!(Percentiles::default().at(0.5), None);
    }

    #[test]
    fn rate_of_a_steady_stream_is_its_frequency_and_falls_when_it_stops() {
        let mut rate = Rate::default();
        for i in 0..200 {
            rate.add(i * 10_000);
        }
        let last = 199 * 10_000;
        assert!((rate.now(last) - 100.0).abs() < 1.5);
        assert!((rate.mean() - 100.0).abs() < 0.01);
        assert!(rate.now(last + 500_000) < 60.0);
        assert_eq!(rate.now(last + 2_000_000), 0.0);
    }

    #[test]
    fn durations_read_as_people_say_them() {
        assert_eq!(short(870), "870 µs");
        assert_eq!(short(3_440), "3.4 ms");
        assert_eq!(seconds(Duration::from_secs(65)), "1 min 05 s");
    }
}
