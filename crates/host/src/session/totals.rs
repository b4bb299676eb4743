//! What only a home's own counters tell, from when the run began.

use std::time::Instant;

use bridge::protocol::message;
use bridge::telemetry::Counters;
use bridge::timing::PERIOD;
use gripper::{Duration, link};

use super::replies::Failed;
use super::summary::Summary;
use crate::realtime::Scheduling;
use crate::stats::Percentiles;

/// What only a home's own counters tell.
#[derive(Debug, Default)]
#[expect(clippy::large_enum_variant, reason = "there is one in a session")]
pub(super) enum Totals {
    /// Nothing yet.
    #[default]
    None,
    /// Of a bridge in this process.
    InProcess(Box<Here>),
    /// Of a bridge on a chip: what it had counted when the run began, and now; and when it said so.
    OnChip {
        before: (message::Counters, Instant),
        newest: (message::Counters, Instant),
        /// When the run began, until it is known what was counted until then.
        begun: Option<Instant>,
        /// The gripper's line at the same two times, where the chip tells.
        line: Option<[link::Counters; 2]>,
    },
}

/// What a bridge in this process had counted when the run began, and now.
#[derive(Debug)]
pub(super) struct Here {
    before: Counters,
    newest: Counters,
    /// When it was the newest.
    at: Option<gripper::Instant>,
    /// The latest step of the run, µs: the counters know only that since the start.
    worst_late_us: u32,
    /// How late its steps came.
    late: Percentiles,
    scheduling: Scheduling,
}

impl Here {
    fn count(&mut self, counters: &Counters, now: gripper::Instant, late: Option<Duration>) {
        if let Some(late) = late.filter(|_| counters.steps != self.newest.steps) {
            self.late.add(late.as_micros());
        }
        if counters.late_steps != self.newest.late_steps {
            let gap = self.at.and_then(|at| now.checked_duration_since(at));
            let late = gap.map_or(0, |gap| gap.as_micros().saturating_sub(PERIOD.as_micros()));
            let late = u32::try_from(late).unwrap_or(u32::MAX);
            self.worst_late_us = self.worst_late_us.max(late.min(counters.worst_late_us));
        }
        if counters.worst_late_us > self.newest.worst_late_us {
            self.worst_late_us = counters.worst_late_us;
        }
        (self.newest, self.at) = (*counters, Some(now));
    }

    /// What was counted since the run began.
    fn grown(&self) -> Counters {
        let (now, before) = (&self.newest, &self.before);
        Counters {
            steps: now.steps.saturating_sub(before.steps),
            late_steps: now.late_steps.saturating_sub(before.late_steps),
            worst_late_us: self.worst_late_us,
            stalls: now.stalls.saturating_sub(before.stalls),
            gripper_errors: now.gripper_errors.saturating_sub(before.gripper_errors),
            holds: now.holds.saturating_sub(before.holds),
            faults: now.faults.saturating_sub(before.faults),
            ..*now
        }
    }
}

impl Totals {
    /// Of a bridge in this process, from here on.
    pub fn in_process(counters: &Counters) -> Self {
        Self::InProcess(Box::new(Here {
            before: *counters,
            newest: *counters,
            at: None,
            worst_late_us: 0,
            late: Percentiles::default(),
            scheduling: Scheduling::Shared,
        }))
    }

    /// A bridge in this process has counted this after its step at `now`, which came so `late`.
    pub fn here(
        &mut self,
        counters: &Counters,
        now: gripper::Instant,
        late: Option<Duration>,
        scheduling: Scheduling,
    ) {
        if !matches!(self, Self::InProcess(_)) {
            *self = Self::in_process(&Counters::default());
        }
        if let Self::InProcess(here) = self {
            here.count(counters, now, late);
            here.scheduling = scheduling;
        }
    }

    /// Of a bridge on a chip, from here on.
    pub fn on_chip(counters: &message::Counters, at: Instant) -> Self {
        let before = (*counters, at);
        Self::OnChip {
            before,
            newest: before,
            begun: None,
            line: None,
        }
    }

    /// A bridge on a chip said what it has counted. Where a run began since, it began with this or with what was said before it,
    /// whichever is nearer.
    pub fn count(&mut self, counters: &message::Counters, at: Instant) {
        if let Self::OnChip {
            before,
            newest,
            begun,
            ..
        } = self
        {
            *newest = (*counters, at);
            if let Some(begun) = begun.take()
                && at.saturating_duration_since(begun) < begun.saturating_duration_since(before.1)
            {
                *before = *newest;
            }
        }
    }

    /// Whether what a chip has counted is wanted now: a run began.
    pub fn awaits(&self) -> bool {
        matches!(self, Self::OnChip { begun: Some(_), .. })
    }

    /// The same of its gripper's line.
    pub fn line(&mut self, counters: &link::Counters) {
        if let Self::OnChip { line, .. } = self {
            let [before, _] = line.unwrap_or([*counters; 2]);
            *line = Some([before, *counters]);
        }
    }

    /// The run begins now.
    pub fn begin(&mut self) {
        match self {
            Self::None => {}
            Self::InProcess(here) => {
                here.before = here.newest;
                (here.worst_late_us, here.late) = (0, Percentiles::default());
            }
            Self::OnChip {
                before,
                newest,
                begun,
                line,
            } => {
                *before = *newest;
                *begun = Some(Instant::now());
                *line = line.map(|[_, now]| [now; 2]);
            }
        }
    }

    /// How often a fault of the gripper ended motion.
    pub fn faults(&self) -> u32 {
        match self {
            Self::None => 0,
            Self::InProcess(here) => here.grown().faults,
            Self::OnChip { before, newest, .. } => newest.0.since(&before.0).faults,
        }
    }

    /// The sum of a run with what is counted here.
    pub fn sum(&self, summary: Summary) -> Summary {
        match self {
            Self::None => summary,
            Self::InProcess(here) => Summary {
                gripper_failed: Some(Failed::between(&here.before.gripper, &here.newest.gripper)),
                step_late_p99_us: here.late.at(0.99),
                ..summary.with(&here.grown(), here.scheduling)
            },
            Self::OnChip {
                before,
                newest,
                line,
                ..
            } => {
                let time = newest.1.saturating_duration_since(before.1);
                Summary {
                    gripper_failed: line.map(|[before, now]| Failed::between(&before, &now)),
                    ..summary.on_chip(&newest.0.since(&before.0), time)
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration as WallTime;

    fn counters(late_steps: u32, worst_late_us: u32) -> Counters {
        Counters {
            steps: 100 * late_steps,
            late_steps,
            worst_late_us,
            gripper_errors: late_steps,
            ..Counters::default()
        }
    }

    #[test]
    fn what_came_late_while_things_were_brought_up_is_none_of_the_run() {
        let at = |ms: u64| gripper::Instant::from_ticks(1_000 * ms);
        let mut totals = Totals::default();
        let us = |us| Some(Duration::from_micros(us));
        totals.here(&counters(1, 60_000), at(70), us(60_000), Scheduling::Shared);
        totals.begin();
        let sum = |totals: &Totals| totals.sum(Summary::default());
        let begun = sum(&totals);
        assert_eq!(
            (begun.steps, begun.late_steps, begun.worst_late_us),
            (0, 0, 0)
        );
        assert!(!begun.too_busy());
        // Less late than before, and later than ever.
        totals.here(&counters(2, 60_000), at(85), us(5_000), Scheduling::Shared);
        let now = sum(&totals);
        assert_eq!(
            (now.worst_late_us, now.step_late_p99_us),
            (5_000, Some(5_000))
        );
        // The same step looked at twice, and one that came with a frame, before its time.
        totals.here(&counters(2, 60_000), at(85), us(5_000), Scheduling::Shared);
        totals.here(
            &counters(3, 80_000),
            at(175),
            us(80_000),
            Scheduling::Shared,
        );
        totals.here(&counters(4, 80_000), at(180), None, Scheduling::Shared);
        let now = sum(&totals);
        assert_eq!((now.late_steps, now.worst_late_us), (3, 80_000));
        let p99 = now.step_late_p99_us.unwrap();
        assert!((79_000..=80_000).contains(&p99), "{p99}");
        assert_eq!(now.gripper_errors, 3);
    }

    #[test]
    fn a_run_on_a_chip_begins_with_what_was_counted_nearest_to_its_beginning() {
        let frames = |frames| message::Counters {
            frames,
            ..Default::default()
        };
        let now = Instant::now();
        let ago = now.checked_sub(WallTime::from_millis(900)).unwrap();
        for (after_ms, counted) in [(50, 4), (5_000, 29)] {
            let mut totals = Totals::on_chip(&frames(0), ago);
            totals.begin();
            assert!(totals.awaits());
            totals.count(&frames(25), now + WallTime::from_millis(after_ms));
            assert!(!totals.awaits());
            totals.count(&frames(29), now + WallTime::from_secs(6));
            assert_eq!(totals.sum(Summary::default()).glove_frames, counted);
        }
    }
}
