//! The free motion before the poses: movement after movement is asked for, in a minute, and what was not seen once more.

use std::time::Duration as Time;

use glove::hand::JOINT_COUNT;
use glove::{Duration, Instant};

use crate::clock::{since, ticks};
use crate::training::movements::{Movement, Movements};
use crate::training::prompts::{GUIDED, Prompt, again};

/// A guided recording of 80 s in a minute.
const PACE: f64 = 0.75;
/// Rows that are kept at most: ten minutes of the fastest glove.
const MOST_ROWS: usize = 100_000;

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
    rows: Vec<(Instant, [f32; JOINT_COUNT])>,
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
            rows: Vec::new(),
        }
    }

    /// Takes a scan of the whole hand, radians.
    pub fn take(&mut self, angles: &[f32; JOINT_COUNT], at: Instant) {
        if self.rows.len() < MOST_ROWS && !self.is_over() {
            self.movements.take(angles);
            self.rows.push((at, *angles));
        }
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

    /// The poses, with their times from the first on.
    pub fn rows(&self) -> &[(Instant, [f32; JOINT_COUNT])] {
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
                free.take(&angles, now);
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
