//! The free motion before the poses: movement after movement is asked for, in a minute, and what was not seen once more.

use std::time::Duration as Time;

use glove::hand::JOINT_COUNT;
use glove::{Duration, Instant};

use crate::clock::{since, ticks};
use crate::recording::poses::Row;
use crate::training::movements::{Movement, Movements};
use crate::training::prompts::{GUIDED, Prompt, again};

/// A guided recording of 80 s in a minute.
const PACE: f64 = 0.75;
/// Rows that are kept at most: ten minutes of the fastest glove.
const MOST_ROWS: usize = 100_000;

/// Between the last pose of a session that ended and the first of the one that goes on, µs: in less a hand does not get from one pose to
/// any other.
const BETWEEN_US: u64 = 1_000_000;
/// A movement of which less than this is left is over, µs.
const OVER_US: u64 = 500_000;

/// What is asked now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeAsk {
    /// In words.
    pub ask: &'static str,
    /// Which, from 1.
    pub number: usize,
    /// Of how many.
    pub of: usize,
    /// How long.
    pub time: Time,
    /// What is left of it.
    pub left: Time,
    /// What is left of all.
    pub all_left: Time,
}

/// The free motion.
#[derive(Debug)]
pub struct Free {
    prompts: Vec<Prompt>,
    place: usize,
    began: Instant,
    started: Instant,
    repeats: bool,
    movements: Movements,
    /// On the clock of the rows, when it was started.
    started_us: u64,
    rows: Vec<Row>,
}

impl Free {
    /// Begins now.
    pub fn new(now: Instant) -> Self {
        Self {
            prompts: GUIDED.map(paced).to_vec(),
            place: 0,
            began: now,
            started: now,
            repeats: false,
            movements: Movements::default(),
            started_us: 0,
            rows: Vec::new(),
        }
    }

    /// Goes on now after the rows of a session that ended: the movement in which it did is asked anew.
    pub fn going_on(rows: Vec<Row>, now: Instant) -> Self {
        let mut free = Self::new(now);
        let Some(last) = rows.last().map(|row| row.at_us) else {
            return free;
        };
        // On the rows' clock: when a movement began, and the row before.
        let (mut began, mut before) = (0, 0);
        for row in &rows {
            if row.at_us >= before + BETWEEN_US {
                began = row.at_us;
            }
            began = free.pass_to(row.at_us, began, now);
            free.movements.take(&row.angles);
            before = row.at_us;
        }
        free.pass_to(last + OVER_US, began, now);
        free.rows = rows;
        free.started_us = last + BETWEEN_US;
        free
    }

    /// Past the movements that are over at `at_us`, of which the first began at `began`: when the one then began.
    fn pass_to(&mut self, at_us: u64, mut began: u64, now: Instant) -> u64 {
        while let Some(prompt) = self.prompts.get(self.place) {
            let end = began + ticks(prompt.time).as_ticks();
            if end > at_us {
                break;
            }
            began = end;
            self.go_on(now);
        }
        began
    }

    /// Takes a scan of the whole hand, radians. The row that it became; none where there are enough, or it is no newer.
    pub fn take(&mut self, angles: &[f32; JOINT_COUNT], at: Instant) -> Option<Row> {
        let row = Row {
            at_us: self.started_us + since(at, self.started).as_ticks(),
            angles: *angles,
        };
        let is_newer = (self.rows.last()).is_none_or(|last| last.at_us < row.at_us);
        if self.rows.len() >= MOST_ROWS || self.is_over() || !is_newer {
            return None;
        }
        self.movements.take(angles);
        self.rows.push(row);
        Some(row)
    }

    /// Time passes. Whether something new is asked.
    pub fn pass(&mut self, now: Instant) -> bool {
        let is_over = (self.prompts.get(self.place))
            .is_some_and(|prompt| since(now, self.began) >= ticks(prompt.time));
        if is_over {
            self.go_on(now);
        }
        is_over
    }

    /// To the next thing to do.
    pub fn go_on(&mut self, now: Instant) {
        self.place += 1;
        self.began = now;
        if self.place == self.prompts.len() && !std::mem::replace(&mut self.repeats, true) {
            let more = again(&self.movements.missing());
            self.prompts.extend(more.into_iter().map(paced));
        }
    }

    /// Whether all was asked for.
    pub fn is_over(&self) -> bool {
        self.place >= self.prompts.len()
    }

    /// What is asked now; `None` once it is over.
    pub fn ask(&self, now: Instant) -> Option<FreeAsk> {
        let prompt = self.prompts.get(self.place)?;
        let gone = Time::from_micros(since(now, self.began).as_ticks());
        let left = prompt.time.saturating_sub(gone);
        let later: Time = self
            .prompts
            .iter()
            .skip(self.place + 1)
            .map(|p| p.time)
            .sum();
        Some(FreeAsk {
            ask: prompt.ask,
            number: self.place + 1,
            of: self.prompts.len(),
            time: prompt.time,
            left,
            all_left: left + later,
        })
    }

    /// Movements that were not seen.
    pub fn missing(&self) -> Vec<Movement> {
        self.movements.missing()
    }

    /// How long it has been going on.
    pub fn lasted(&self, now: Instant) -> Duration {
        since(now, self.started)
    }

    /// The poses.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }
}

fn paced(prompt: Prompt) -> Prompt {
    Prompt {
        time: prompt.time.mul_f64(PACE),
        ..prompt
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glove::hand::LIMITS;
    use trainer::hand::motion::Generator;

    #[test]
    fn it_goes_on_with_the_movement_in_which_it_ended_and_is_over_where_it_was() {
        let generator = Generator::new(&LIMITS, 2);
        let at = |us: u64| Instant::from_ticks(us);
        let mut free = Free::new(at(0));
        let mut now = 0;
        let mut play = |free: &mut Free, until: u64| {
            while now < until && !free.is_over() {
                now += 28_000;
                let _ = free.take(&generator.pose_at(now as f64 * 1e-6), at(now));
                free.pass(at(now));
            }
        };
        play(&mut free, 20_000_000);
        let (rows, asked) = (
            free.rows().to_vec(),
            free.ask(at(20_000_000)).unwrap().number,
        );
        // Other programs, each from the beginning of that movement, killed again before its end.
        let mut again = Free::going_on(rows.clone(), at(20_000_000));
        for until in [21_000_000, 22_000_000, 23_000_000, 200_000_000] {
            let ask = again.ask(at(until - 1_000_000)).unwrap();
            assert_eq!(ask.number, asked, "{until}");
            play(&mut again, until);
            if until < 200_000_000 {
                again = Free::going_on(again.rows().to_vec(), at(until));
            }
        }
        assert!(asked > 2);
        assert_eq!(again.rows()[..rows.len()], rows);
        let times: Vec<u64> = again.rows().iter().map(|row| row.at_us).collect();
        assert!(times.windows(2).all(|two| two[0] < two[1]));
        let over = Free::going_on(again.rows().to_vec(), at(0));
        assert!(over.is_over(), "{:?}", over.ask(at(0)));
    }

    #[test]
    fn it_lasts_a_minute_and_asks_again_for_what_was_not_seen() {
        let played = |still: bool| {
            let generator = Generator::new(&LIMITS, 2);
            let mut free = Free::new(Instant::from_ticks(0));
            let mut now = Instant::from_ticks(0);
            while !free.is_over() {
                now += Duration::from_ticks(28_000);
                let t = now.as_ticks() as f64 * 1e-6;
                let angles = if still {
                    [0.0; JOINT_COUNT]
                } else {
                    generator.pose_at(t)
                };
                let _ = free.take(&angles, now);
                free.pass(now);
            }
            (free.lasted(now).as_ticks() as f64 * 1e-6, free)
        };
        let (lasted, free) = played(false);
        assert!((60.0..75.0).contains(&lasted), "{lasted}");
        assert!(free.rows().len() > 2_000);
        let (lasted, free) = played(true);
        assert!(lasted > 100.0, "{lasted}");
        assert_eq!(free.missing(), Movement::ALL[1..]);
    }
}
