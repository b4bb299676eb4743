//! Where a session says what is so: many watch, and the newest wins.
//!
//! The bridge's thread writes, whoever likes reads, and nobody waits for anybody but for the moment of a copy. Of the
//! state only the newest is kept, of what happened the newest [`EVENTS`]; counting is done where things happen, so that no
//! watcher can miss a number.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use bridge::clutch::Position;
use bridge::event::Kind;
use bridge::protocol::message::Sample;
use bridge::{HoldReason, State};

use super::driven::{Driven, Moment};
use super::ending::{Driver, Ending};
use super::lasting::Lasting;
use super::numbers::{Numbers, Progress};
use super::record::Sort;
use super::snapshot::Snapshot;
use super::summary::Summary;
use super::totals::Totals;

/// Events kept for watchers.
pub const EVENTS: usize = 32;

/// Something that happened.
#[derive(Debug, Clone, PartialEq)]
pub struct Happened {
    /// Which sort of thing.
    pub sort: Sort,
    /// What, in words.
    pub text: String,
    /// The same for the program.
    pub kind: Kind,
}

/// What a session says. Clones watch the same one.
#[derive(Debug, Clone, Default)]
pub struct Hub(Arc<Mutex<Said>>);

/// What was said so far.
#[derive(Debug, Default)]
pub(super) struct Said {
    newest: Option<Snapshot>,
    pub numbers: Numbers,
    pub totals: Totals,
    events: VecDeque<Happened>,
    /// Events so far.
    happened: u64,
    held: Lasting<HoldReason>,
    useless: Lasting<()>,
    /// Until when it is counted what became of the time.
    seen: Option<(gripper::Instant, Moment)>,
}

impl Said {
    /// The newest state. `useless`: no frame of the glove can be used.
    pub fn say(&mut self, now: Snapshot, useless: bool) {
        let (clutch, state) = (now.clutch, now.state);
        self.pass(now.now, Moment { clutch, state });
        self.held.look(now.state.hold_reason(), now.now);
        self.useless.look(useless.then_some(()), now.now);
        self.newest = Some(now);
    }

    /// A telemetry sample of a bridge on a chip, `clutch` as this program knows it. Samples of a time in which this program stood
    /// still tell what the bridge made of it: the newest state alone would not, where it follows again by then.
    pub fn sample(&mut self, sample: &Sample, clutch: Position, blocked: impl Fn(usize) -> bool) {
        let state = sample.state;
        let at = gripper::Instant::from_ticks(sample.now_us);
        self.pass(at, Moment { clutch, state });
        self.numbers.sample(sample, blocked);
    }

    /// Counts what became of the time until `at`, where it is not counted yet.
    fn pass(&mut self, at: gripper::Instant, now: Moment) {
        if let Some((until, before)) = self.seen {
            let Some(passed) = at.checked_duration_since(until) else {
                return;
            };
            let time = Duration::from_micros(passed.as_micros());
            self.numbers.driven.pass(time, before, now);
        }
        self.seen = Some((at, now));
    }

    /// The sum of the run, at `now`.
    fn summary(&self, now: gripper::Instant) -> Summary {
        self.totals.sum(self.numbers.summary(now))
    }

    /// Something happened.
    pub fn happened(&mut self, event: Happened) {
        if self.events.len() == EVENTS {
            self.events.pop_front();
        }
        self.events.push_back(event);
        self.happened += 1;
    }
}

impl Hub {
    pub(super) fn lock(&self) -> MutexGuard<'_, Said> {
        // Nothing panics while holding it; a poisoned lock still holds a valid value.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The state now; `None` before the bridge first told it.
    pub fn snapshot(&self) -> Option<Snapshot> {
        self.lock().newest
    }

    /// How the run goes. The bridge's thread does not wait while the latencies are looked through.
    pub fn progress(&self) -> Progress {
        let mut said = self.lock();
        let Some(now) = said.newest.map(|newest| newest.now) else {
            return Progress::default();
        };
        let progress = Progress {
            gripper_faults: said.totals.faults(),
            ..said.numbers.progress(now)
        };
        let latency = said.numbers.latency.clone();
        drop(said);
        Progress {
            latency_p50: latency.at(0.5),
            latency_p99: latency.at(0.99),
            ..progress
        }
    }

    /// What happened since `seen` events had; `seen` is how many have now. What is older than the newest 32 is gone.
    pub fn happened(&self, seen: &mut u64) -> Vec<Happened> {
        let said = self.lock();
        let fresh = said.happened.saturating_sub(*seen);
        *seen = said.happened;
        let old = said
            .events
            .len()
            .saturating_sub(usize::try_from(fresh).unwrap_or(EVENTS));
        said.events.iter().skip(old).cloned().collect()
    }

    /// How everything is, to judge a run by that ends now: before its clutch is opened.
    pub fn ending(&self, driver: Driver) -> Option<Ending> {
        let said = self.lock();
        let seen = said.newest.as_ref()?;
        // Who only watches is not to blame for what another host's run came to.
        let ours = driver.closed;
        // A glove that is not calibrated gives no angles either, and no sensor is to blame.
        let useless = said.useless.lasted(seen.now);
        let uncalibrated = useless.is_some() && seen.lacks_calibration();
        Some(Ending {
            state: seen.state,
            driver,
            held: (said.held.lasted(seen.now).filter(|_| ours))
                .or(uncalibrated.then_some(HoldReason::NotCalibrated)),
            driven: match ours {
                true => said.numbers.driven.clone(),
                false => Driven::default(),
            },
            too_busy: said.summary(seen.now).too_busy(),
            glove_answers: seen.glove_answers,
            useless: useless
                .filter(|()| !uncalibrated)
                .map(|()| seen.why_useless()),
            gripper_answers: seen.gripper_answers,
            disobeyed: said.numbers.obeyed.fault().filter(|_| ours),
        })
    }

    /// The sum of the run.
    pub fn summary(&self) -> Summary {
        let said = self.lock();
        let now = said.newest.map(|newest| newest.now);
        now.map_or_else(Summary::default, |now| said.summary(now))
    }

    /// Forgets what was counted while things were brought up: the run begins now.
    pub fn begin(&self) {
        let mut said = self.lock();
        if let Some(now) = said.newest.map(|newest| newest.now) {
            said.numbers.begin(now);
            said.totals.begin();
        }
    }

    /// Whether the gripper follows the hand.
    pub fn is_moving(&self) -> bool {
        self.snapshot().is_some_and(|seen| seen.state.is_moving())
    }

    /// Whether nothing is wanted of the gripper and the newest command that left holds it, decided after `since`.
    pub fn is_idle_since(&self, since: gripper::Instant) -> bool {
        self.snapshot().is_some_and(|seen| {
            let holds = |sent: super::snapshot::Sent| !sent.follows && sent.decided > since;
            seen.state == State::Idle && seen.sent.is_none_or(holds)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::realtime::Scheduling;
    use crate::session::Devices;
    use bridge::calibration::Try;
    use bridge::protocol::message;
    use bridge::telemetry::Counters;
    use std::time::Instant;

    /// Longer after a run's beginning than what was counted before it.
    const AFTER: Duration = Duration::from_secs(1);

    #[test]
    fn a_glove_that_is_not_calibrated_is_not_said_to_send_what_cannot_be_used() {
        let hub = Hub::default();
        for ms in (0..=2_000).step_by(10) {
            let seen = Snapshot {
                angles_valid: false,
                ..Snapshot::at(ms, Position::Open, State::Idle)
            };
            hub.lock().say(seen, true);
        }
        let judged = |attended| {
            let driver = Driver {
                attended,
                ..Driver::default()
            };
            hub.ending(driver).unwrap().judge(&Devices::Unknown)
        };
        let told = judged(false).unwrap_err().to_string();
        assert!(told.contains("not calibrated"), "{told}");
        assert!(!told.contains("cannot be used"), "{told}");
        // Who is at the keys chose to wait.
        assert!(judged(true).is_ok());
    }

    /// A run of 12 s that ends while it follows. Of each 400 ms it was held for 250 ms, until enough frames had come in a row.
    fn held_in_pieces(totals: Totals) -> anyhow::Result<()> {
        let hub = Hub::default();
        hub.lock().totals = totals;
        for ms in (0..=12_000).step_by(10) {
            let state = match ms % 400 {
                0..250 => State::Holding(HoldReason::Settling),
                _ => State::Following,
            };
            let seen = Snapshot::at(ms, Position::Closed, state);
            hub.lock().say(seen, false);
        }
        let driver = Driver {
            engages: true,
            closed: true,
            ..Driver::default()
        };
        hub.ending(driver).unwrap().judge(&Devices::Unknown)
    }

    #[test]
    fn a_run_that_was_held_for_most_of_its_time_in_pieces_has_failed_in_both_homes() {
        let counters = message::Counters::default();
        for totals in [
            Totals::in_process(&Counters::default()),
            Totals::on_chip(&counters, Instant::now()),
        ] {
            let told = held_in_pieces(totals).unwrap_err().to_string();
            assert!(told.contains("held for 7.5 s of the 12.0 s"), "{told}");
            assert!(told.contains("fresh frames in a row"), "{told}");
        }
    }

    #[test]
    fn a_stop_of_this_program_after_which_a_chip_follows_again_was_held_for_what_its_samples_say() {
        let hub = Hub::default();
        let say = |ms| {
            let now = Snapshot::at(ms, Position::Closed, State::Following);
            hub.lock().say(now, false);
        };
        say(0);
        say(1_000);
        // Nobody sends a heartbeat for 800 ms; the samples wait, and are read after the newest status.
        let lost = State::Holding(HoldReason::HeartbeatLost);
        let sample = |ms: u64, state| {
            let sample = Sample {
                now_us: 1_000 * ms,
                state,
                frame_sequence: 1,
                angles: [0.0; glove::hand::JOINT_COUNT],
                target: message::PerAxis::new(),
                command: message::PerAxis::new(),
                position: message::PerAxis::new(),
                latency_us: None,
                not_shown: None,
            };
            hub.lock().sample(&sample, Position::Closed, |_| false);
        };
        for ms in (1_050..=1_800).step_by(50) {
            sample(ms, if ms < 1_250 { State::Following } else { lost });
        }
        say(1_850);
        // What comes later than something newer tells nothing more.
        sample(1_840, lost);
        say(2_000);
        let summary = hub.summary();
        assert_eq!((summary.moving_s, summary.held_s), (1.4, 0.6));
    }

    #[test]
    fn faults_of_the_gripper_are_the_same_number_in_the_view_and_the_summary_of_both_homes() {
        let grown = message::Counters {
            faults: 7,
            ..Default::default()
        };
        let before = message::Counters {
            faults: 5,
            ..Default::default()
        };
        let here = |faults| Counters {
            faults,
            ..Default::default()
        };
        for totals in [
            Totals::in_process(&here(5)),
            Totals::on_chip(&before, Instant::now()),
        ] {
            let hub = Hub::default();
            hub.lock().totals = totals;
            hub.lock()
                .say(Snapshot::at(1, Position::Open, State::Idle), false);
            hub.begin();
            let mut said = hub.lock();
            let now = gripper::Instant::from_ticks(10_000);
            match said.totals {
                Totals::OnChip { .. } => said.totals.count(&grown, Instant::now() + AFTER),
                _ => said.totals.here(&here(7), now, None, Scheduling::Shared),
            }
            drop(said);
            let shown = hub.progress().gripper_faults;
            assert_eq!((shown, hub.summary().gripper_faults), (2, 2));
        }
    }

    #[test]
    fn each_watcher_hears_every_event_once_and_of_a_flood_the_newest() {
        let hub = Hub::default();
        let say = |count: usize| {
            for number in 0..count {
                hub.lock().happened(Happened {
                    sort: Sort::Note,
                    text: number.to_string(),
                    kind: Kind::Calibration(Try::Taken),
                });
            }
        };
        let (mut first, mut second) = (0, 0);
        say(3);
        assert_eq!(hub.happened(&mut first).len(), 3);
        assert_eq!(hub.happened(&mut first).len(), 0);
        say(EVENTS + 5);
        let heard = hub.happened(&mut first);
        assert_eq!((heard.len(), heard[0].text.as_str()), (EVENTS, "5"));
        assert_eq!(hub.clone().happened(&mut second), heard);
    }
}
