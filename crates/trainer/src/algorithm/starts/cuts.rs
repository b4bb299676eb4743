//! When starts are judged, and how many go on.

use super::Several;
use crate::algorithm::Plan;
use core::ops::Range;

/// A look at all starts in the running, after which only the best go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cut {
    /// After this epoch of each.
    pub epoch: usize,
    /// So many go on.
    pub keep: usize,
    /// Whether the attraction counts: not before λ3 has begun to rise, when nothing has worked on it yet.
    pub attraction: bool,
    /// Whether the one that goes on is fitted to the mean of those that cost about as little and are alike.
    pub joins: bool,
}

impl Cut {
    /// The cuts of a training with this plan, `pairs` early stages and several starts; the last at its end, where one is kept.
    ///
    /// Where λ3 is about to rise, reconstruction and distortion show the maps that the pairs have creased. Half risen, the whole cost begins to say which will be cheap; at the full λ3 the order is nearly that of the end
    /// (docs/measurements/starts.md), and the finalists go on, at most half of all, until they are joined.
    #[must_use]
    pub fn all(plan: &Plan, pairs: usize, several: &Several) -> Vec<Self> {
        let count = several.count.max(1);
        let last = plan.stage_epochs * pairs;
        let total = last + plan.last_epochs;
        let before = (last + plan.ramp_start).min(total);
        let rising = (last + plan.ramp_start + plan.ramp_epochs / 2).min(total);
        let risen = (last + plan.ramp_start + plan.ramp_epochs).min(total);
        let joined = risen + (several.joined * (total - risen) as f64) as usize;
        let joined = joined.max(risen + 1).min(total);
        let half = count.div_ceil(2).max(1);
        let cuts = [
            (before, (2 * count).div_ceil(3), false),
            (rising, half, false),
            (risen, several.finalists.clamp(1, half), false),
            (joined, 1, true),
            (total, 1, true),
        ];
        let mut live = count.max(1);
        let mut kept: Vec<Self> = Vec::new();
        for (epoch, keep, to_one) in cuts {
            let follows = kept.last().is_none_or(|cut| cut.epoch < epoch);
            if (keep < live && follows && epoch > 0) || epoch == total {
                kept.retain(|cut| cut.epoch < epoch);
                let running = kept.last().map_or(count, |cut| cut.keep);
                kept.push(Self {
                    epoch,
                    keep,
                    attraction: epoch > before,
                    joins: to_one && running > 1,
                });
                live = keep;
            }
        }
        kept
    }
}

/// Epochs and starts of each stretch between two cuts.
fn stretches(cuts: &[Cut], count: usize) -> impl Iterator<Item = (Range<usize>, usize)> {
    let mut before = (0, count);
    cuts.iter().map(move |cut| {
        let (from, count) = core::mem::replace(&mut before, (cut.epoch, cut.keep));
        (from..cut.epoch, count)
    })
}

/// Epochs of all starts together, from the first to the last.
pub(super) fn epochs(cuts: &[Cut], count: usize) -> usize {
    stretches(cuts, count)
        .map(|(epochs, count)| count * epochs.len())
        .sum()
}

/// A second thread of a start is worth so much of the first (docs/measurements/trainer.md: 5.2 s for 9.1).
const HELPER: f64 = 0.75;

/// How long `count` starts take from an epoch on, after so many cuts were made, on so many threads; `alone` tells it of one start on
/// `now` threads.
pub(super) fn seconds(
    (cuts, count): (&[Cut], usize),
    (made, epoch): (usize, usize),
    (threads, now): (usize, usize),
    alone: &dyn Fn(Range<usize>) -> f64,
) -> f64 {
    let speed = |threads: usize| 1.0 + HELPER * (threads.max(1) - 1) as f64;
    let stretch = |(epochs, count): (Range<usize>, usize)| {
        let left = epochs.start.max(epoch)..epochs.end.max(epoch);
        // As long as the slowest of the threads takes for its share.
        let turns = count.div_ceil(threads.max(1)) as f64;
        turns * alone(left) * speed(now) / speed(threads / count.max(1))
    };
    stretches(cuts, count).skip(made).map(stretch).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algorithm::starts::Usual;
    use crate::algorithm::{Plan, Schedule};

    fn cuts(plan: &Plan, count: usize) -> Vec<Cut> {
        Cut::all(plan, 4, &Usual::PLANE.several(count))
    }

    #[test]
    fn fewer_starts_go_on_after_each_cut_and_one_is_left_at_the_end() {
        for count in 1..40 {
            for schedule in [Schedule::Fast, Schedule::Paper] {
                let plan = schedule.plan_for(2);
                let cuts = cuts(&plan, count);
                assert!(
                    cuts.windows(2)
                        .all(|w| w[0].epoch < w[1].epoch && w[0].keep >= w[1].keep)
                );
                let total = 4 * plan.stage_epochs + plan.last_epochs;
                assert_eq!(
                    cuts.last(),
                    Some(&Cut {
                        epoch: total,
                        keep: 1,
                        attraction: true,
                        joins: false,
                    })
                );
            }
        }
        assert_eq!(cuts(&Schedule::Fast.plan_for(2), 1).len(), 1);
    }

    #[test]
    fn several_finalists_are_joined_once_also_where_a_training_is_too_short_for_it() {
        for epochs in [1, 2, 8, 100] {
            for count in 1..13 {
                let plan = Schedule::Fast.plan_for(2).with_last_epochs(epochs);
                let cuts = cuts(&plan, count);
                let joins: Vec<&Cut> = cuts.iter().filter(|cut| cut.joins).collect();
                // Two and fewer starts have one finalist.
                let once = usize::from(count > 2);
                assert_eq!(joins.len(), once, "{count} starts, {epochs}: {cuts:?}");
                assert!(joins.iter().all(|cut| cut.keep == 1));
            }
        }
    }

    #[test]
    fn the_finalists_are_left_at_the_full_attraction_but_never_more_than_half_of_all() {
        let last_stretch = |count, finalists| {
            let several = Several {
                finalists,
                ..Usual::SURFACE.several(count)
            };
            let cuts = Cut::all(&Schedule::Fast.plan_for(3), 4, &several);
            cuts.iter().rev().nth(2).map(|cut| cut.keep)
        };
        assert_eq!(last_stretch(12, 6), Some(6));
        assert_eq!(last_stretch(5, 6), Some(3));
        assert_eq!(last_stretch(6, 2), Some(2));
    }

    #[test]
    fn the_cuts_of_the_fast_schedule_are_those_that_were_measured() {
        let told = |cuts: &[Cut]| -> Vec<(usize, usize, bool, bool)> {
            (cuts.iter())
                .map(|cut| (cut.epoch, cut.keep, cut.attraction, cut.joins))
                .collect()
        };
        // 600 early epochs; λ3 rises from 1,000 to 1,500.
        let cuts = cuts(&Usual::PLANE.plan(Schedule::Fast.plan_for(2)), 32);
        let want = [
            (1000, 22, false, false),
            (1250, 16, true, false),
            (1500, 6, true, false),
            (2640, 1, true, true),
            (4350, 1, true, false),
        ];
        assert_eq!(told(&cuts), want);
        // Where a step with attraction costs six without.
        let price = |epochs: Range<usize>| {
            let with = epochs.end.max(1000) - epochs.start.max(1000);
            (epochs.len() - with + 6 * with) as f64
        };
        assert_eq!(seconds((&cuts, 32), (0, 0), (1, 1), &price), 140_300.0);
    }

    #[test]
    fn two_starts_on_two_threads_take_the_first_stretch_at_once_and_help_each_other_in_the_second()
    {
        let cut = |epoch| Cut {
            epoch,
            keep: 1,
            attraction: true,
            joins: false,
        };
        let cuts = [cut(100), cut(300)];
        let alone = |epochs: Range<usize>| epochs.len() as f64;
        let whole = |count, threads| seconds((&cuts, count), (0, 0), (threads, 1), &alone);
        assert_eq!(whole(1, 1), 300.0);
        assert_eq!(whole(2, 1), 400.0);
        assert!((whole(2, 2) - (100.0 + 200.0 / 1.75)).abs() < 1e-9);
        assert_eq!(seconds((&cuts, 2), (1, 250), (1, 1), &alone), 50.0);
        assert_eq!(epochs(&cuts, 2), 400);
    }
}
