//! How the gripper's replies come: late, refused, foreign, corrupt, or not at all. Silence and a slow line need different hands.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use gripper::link::Counters;
use serde::Serialize;

/// What is called "now".
const WINDOW: Duration = Duration::from_secs(2);
/// Pause between two looks.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// Requests that got no right answer, by what came instead.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Failed {
    /// Nothing whole in time.
    pub unanswered: u32,
    /// The answer came, after its time.
    pub late: u32,
    /// The gripper said no.
    pub refused: u32,
    /// A whole frame that answers something else.
    pub foreign: u32,
    /// A frame whose checksum is wrong.
    pub corrupt: u32,
}

impl Failed {
    /// Between two looks at the line's counters.
    pub fn between(before: &Counters, after: &Counters) -> Self {
        let late = after.stale.wrapping_sub(before.stale);
        Self {
            // A late reply was missed first.
            unanswered: after
                .timeouts
                .wrapping_sub(before.timeouts)
                .saturating_sub(late),
            late,
            refused: after.exceptions.wrapping_sub(before.exceptions),
            foreign: after.shape.wrapping_sub(before.shape),
            corrupt: after.crc.wrapping_sub(before.crc),
        }
    }

    /// Whether something came that was no right answer: then the line is not merely silent.
    fn more_than_silence(self) -> bool {
        self.late + self.refused + self.foreign + self.corrupt > 0
    }

    /// In words; `None` where every request was answered.
    pub fn words(self) -> Option<String> {
        let parts: Vec<String> = [
            (self.unanswered, "without an answer"),
            (self.late, "late"),
            (self.refused, "refused"),
            (
                self.foreign,
                "answered by a frame that belongs to another request",
            ),
            (self.corrupt, "corrupt"),
        ]
        .into_iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, what)| format!("{count} {what}"))
        .collect();
        (!parts.is_empty()).then(|| parts.join(", "))
    }
}

/// The last seconds of a line.
#[derive(Debug, Default)]
pub struct Replies {
    looks: VecDeque<(Instant, Counters)>,
}

impl Replies {
    /// Looks at the counters now. Returns what is to be told of the last two seconds.
    pub fn look(&mut self, now: Instant, counters: &Counters) -> Option<String> {
        let due = |(at, _): &(Instant, Counters)| now.duration_since(*at) >= LOOK_EVERY;
        if self.looks.back().is_none_or(due) {
            self.looks.push_back((now, *counters));
        }
        while self
            .looks
            .get(1)
            .is_some_and(|(at, _)| now.duration_since(*at) >= WINDOW)
        {
            self.looks.pop_front();
        }
        let (_, before) = self.looks.front()?;
        let failed = Failed::between(before, counters);
        let words = failed.words().filter(|_| failed.more_than_silence())?;
        let advice = if failed.late >= failed.corrupt + failed.foreign + failed.refused {
            "the line takes longer than a reply is waited for"
        } else if failed.corrupt >= failed.foreign + failed.refused {
            "check cable, ground and termination"
        } else if failed.foreign >= failed.refused {
            "is there another master on the line?"
        } else {
            "is it the right gripper?"
        };
        Some(format!(
            "gripper line, requests of the last 2 s: {words}; {advice}"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_of_wrong_reply_is_told_apart_from_silence() {
        let silent = Counters {
            timeouts: 7,
            ..Counters::default()
        };
        for (counters, word) in [
            (
                Counters {
                    timeouts: 5,
                    stale: 5,
                    ..Counters::default()
                },
                "5 late",
            ),
            (
                Counters {
                    exceptions: 3,
                    ..Counters::default()
                },
                "3 refused",
            ),
            (
                Counters {
                    shape: 2,
                    ..Counters::default()
                },
                "2 answered by a frame",
            ),
            (
                Counters {
                    crc: 4,
                    ..Counters::default()
                },
                "4 corrupt",
            ),
        ] {
            let now = Instant::now();
            let mut replies = Replies::default();
            assert_eq!(replies.look(now, &Counters::default()), None);
            assert_eq!(
                replies.look(now, &silent),
                None,
                "silence is told elsewhere"
            );
            let told = replies.look(now, &counters).unwrap();
            assert!(told.contains(word) && !told.contains("without"), "{told}");
        }
    }

    #[test]
    fn what_is_over_for_two_seconds_is_told_no_more() {
        let start = Instant::now();
        let mut replies = Replies::default();
        let counters = Counters {
            crc: 4,
            ..Counters::default()
        };
        replies.look(start, &Counters::default());
        let told = |replies: &mut Replies, ms| {
            replies
                .look(start + Duration::from_millis(ms), &counters)
                .is_some()
        };
        assert!((1..=8).all(|k| told(&mut replies, 240 * k)));
        assert!(
            !(9..=20)
                .map(|k| told(&mut replies, 250 * k))
                .last()
                .unwrap()
        );
    }
}
