//! Whether the helper threads are worth it: where cores share no cache, or are taken by others, handing small pieces of work over costs
//! more than it saves. Steps are tried both ways now and then. Results do not depend on it.

use core::time::Duration;

/// Steps of a trial each way, and steps from the start of one trial to the next.
const TRIAL: usize = 16;
const ROUND: usize = 1024;

/// What is known of one kind of step.
#[derive(Debug, Default)]
pub(super) struct Pace {
    /// Steps since the newest trial began.
    steps: usize,
    /// How long the steps of the trial took, together and alone.
    took: [Vec<Duration>; 2],
    /// What the newest whole trial said.
    alone_is_faster: bool,
}

impl Pace {
    /// Whether the coming step is to be done by the calling thread alone.
    pub(super) fn is_alone(&self) -> bool {
        match self.steps {
            0..TRIAL => false,
            steps if steps < 2 * TRIAL => true,
            _ => self.alone_is_faster,
        }
    }

    /// That the step took so long.
    pub(super) fn done(&mut self, took: Duration) {
        if self.steps < 2 * TRIAL {
            self.took[usize::from(self.is_alone())].push(took);
        }
        self.steps += 1;
        if self.steps == 2 * TRIAL {
            let [together, alone] = self.took.each_mut().map(median);
            self.alone_is_faster = alone < together;
        } else if self.steps == ROUND {
            self.steps = 0;
        }
    }
}

/// The median, which a step that the system interrupted does not move. Forgets the values.
fn median(values: &mut Vec<Duration>) -> Option<Duration> {
    values.sort_unstable();
    let middle = values.get(values.len() / 2).copied();
    values.clear();
    middle
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps of a pace whose steps take so long together, alone; how many were done alone.
    fn steps(pace: &mut Pace, count: usize, [together, alone]: [u64; 2]) -> usize {
        let mut done_alone = 0;
        for n in 0..count {
            let is_alone = pace.is_alone();
            done_alone += usize::from(is_alone);
            // Every seventh is interrupted.
            let interrupted = if n % 7 == 0 { 1000 } else { 0 };
            let took = interrupted + if is_alone { alone } else { together };
            pace.done(Duration::from_micros(took));
        }
        done_alone
    }

    #[test]
    fn the_faster_way_is_taken_but_for_trials() {
        let others = ROUND - 2 * TRIAL;
        assert_eq!(steps(&mut Pace::default(), ROUND, [10, 20]), TRIAL);
        assert_eq!(steps(&mut Pace::default(), ROUND, [20, 10]), TRIAL + others);
    }

    #[test]
    fn a_trial_is_repeated_when_a_round_is_over() {
        let mut pace = Pace::default();
        steps(&mut pace, ROUND, [20, 10]);
        assert!(!pace.is_alone(), "the next trial begins");
        assert_eq!(steps(&mut pace, ROUND, [10, 20]), TRIAL);
    }
}
