//! What is counted during a run.

use std::time::Duration;

use bridge::event::Kind;
use bridge::protocol::message::{Counters, Sample};
use gripper::Instant;

use super::axes::Axes;
use super::driven::Driven;
use super::obeyed::{MOVED_COUNTS, Obeyed};
use super::record::{Record, Sort};
use super::summary::Summary;
use super::summary::rounded;
use crate::stats::{Percentiles, Rate};

/// Counters of a run, in bounded memory.
#[derive(Debug, Default)]
pub struct Numbers {
    /// Frames of the glove.
    pub frames: Rate,
    /// Statuses of the gripper.
    pub cycles: Rate,
    /// From the oldest sample to the command.
    pub latency: Percentiles,
    /// When the run began, µs.
    begun: u64,
    commands: u64,
    /// A frame to be answered, and no command that rests on it yet.
    unanswered: bool,
    frames_answered: u64,
    frames_passed_over: u64,
    sequence_gaps: u64,
    last_sequence: Option<u32>,
    following: bool,
    /// What became of the time in which it was to follow.
    pub driven: Driven,
    /// Positions when following began.
    start_positions: Option<Axes<u8>>,
    first_motion: Option<Instant>,
    /// What the gripper was told last, where that followed the hand.
    told: Option<Axes<u8>>,
    /// Whether it went there.
    pub obeyed: Obeyed,
    last_fault: Option<String>,
    /// Telemetry samples of a bridge on a chip.
    samples: Option<u64>,
    /// Cycles of the gripper in the last second, as a chip counted them.
    chip_cycles_per_s: Option<f64>,
}

impl Numbers {
    /// Forgets what was counted while things were brought up; the run begins at `now`.
    pub fn begin(&mut self, now: Instant) {
        *self = Self {
            begun: now.as_ticks(),
            last_sequence: self.last_sequence,
            ..Self::default()
        };
    }

    /// Counts one record in.
    pub fn count(&mut self, record: &Record) {
        match record {
            Record::Frame(frame) => {
                self.frames.add(frame.at.as_ticks());
                if let Some(last) = self.last_sequence.replace(frame.sequence) {
                    self.sequence_gaps +=
                        u64::from(frame.sequence.wrapping_sub(last).saturating_sub(1));
                }
                self.frames_passed_over += u64::from(self.unanswered && frame.following);
                self.following = frame.following;
                self.unanswered = frame.following;
            }
            Record::Command(command) => {
                self.commands += 1;
                self.told = command.age_us.map(|_| command.motion.position);
                if command.first && core::mem::take(&mut self.unanswered) {
                    self.frames_answered += 1;
                }
                if let Some(us) = command.age_us.filter(|_| command.first) {
                    self.latency.add(us);
                }
            }
            Record::Status(status) => {
                self.cycles.add(status.stamp.as_ticks());
                self.look_for_motion(status.stamp, status.position);
                self.obeyed.status(status, self.told.as_deref());
            }
            // A chip's numbers are counted as they come.
            Record::Told(_) => {}
            Record::Event {
                sort, text, kind, ..
            } => {
                if let Kind::AxisStands { axis } = kind {
                    self.obeyed.stands(*axis);
                }
                if *sort == Sort::Fault {
                    self.last_fault = Some(text.clone());
                }
            }
        }
    }

    /// Counts in a telemetry sample of a bridge on a chip. `blocked`: whether an axis says that something is in its way.
    pub fn sample(&mut self, sample: &Sample, blocked: impl Fn(usize) -> bool) {
        let now_us = sample.now_us;
        let last = self.last_sequence.replace(sample.frame_sequence);
        let fresh = last.map_or(0, |last| sample.frame_sequence.wrapping_sub(last));
        for _ in 0..fresh.min(16) {
            self.frames.add(now_us);
        }
        self.samples = Some(self.samples.unwrap_or(0) + 1);
        self.following = sample.state.is_moving();
        if !self.following {
            return;
        }
        self.obeyed
            .look(now_us, &sample.command, &sample.position, blocked);
        if let Some(us) = sample.latency_us {
            self.latency.add(us.into());
        }
        if let Some(position) = Axes::new(&sample.position) {
            self.look_for_motion(Instant::from_ticks(now_us), position);
        }
    }

    /// What a bridge on a chip counted has `grown` so much in the last `time`.
    pub fn chip(&mut self, grown: &Counters, time: Duration) {
        let cycles = f64::from(grown.statuses) / time.as_secs_f64().max(1e-3);
        self.chip_cycles_per_s = Some(cycles);
    }

    fn look_for_motion(&mut self, at: Instant, position: Axes<u8>) {
        if !self.following || self.first_motion.is_some() {
            return;
        }
        let start = *self.start_positions.get_or_insert(position);
        let moved = start
            .iter()
            .zip(&*position)
            .any(|(start, now)| start.abs_diff(*now) >= MOVED_COUNTS);
        if moved {
            self.first_motion = Some(at);
        }
    }

    /// Frames of which no command left before the next one came, while following, and frames that never arrived here.
    pub fn dropped(&self) -> u64 {
        self.frames_passed_over + self.sequence_gaps
    }

    /// How it goes at `now`; what only counters tell, and the latencies, are left at nothing.
    pub fn progress(&mut self, now: Instant) -> Progress {
        Progress {
            frames_per_s: self.frames.now(now.as_ticks()),
            cycles_per_s: self
                .chip_cycles_per_s
                .unwrap_or_else(|| self.cycles.now(now.as_ticks())),
            latency_p50: None,
            latency_p99: None,
            dropped: self.dropped(),
            gripper_faults: 0,
        }
    }

    /// Since the run began, at `now`, s.
    pub fn seconds(&self, now: Instant) -> f64 {
        now.as_ticks().saturating_sub(self.begun) as f64 / 1e6
    }

    /// The sum of the run; what only counters tell is left at nothing.
    pub fn summary(&self, now: Instant) -> Summary {
        Summary {
            seconds: rounded(self.seconds(now)),
            glove_frames: self.frames.count(),
            glove_frames_per_s: rounded(self.frames.mean()),
            frames_following: self.frames_answered + self.frames_passed_over,
            frames_answered: self.frames_answered,
            frames_dropped: Some(self.dropped()),
            gripper_cycles: self.cycles.count(),
            gripper_cycles_per_s: rounded(self.cycles.mean()),
            commands: self.commands,
            latency_p50_us: self.latency.at(0.5),
            latency_p99_us: self.latency.at(0.99),
            latency_max_us: self.latency.longest(),
            last_fault: self.last_fault.clone(),
            moving_s: rounded(self.driven.moving().as_secs_f64()),
            held_s: rounded(self.driven.held().as_secs_f64()),
            samples: self.samples,
            first_motion_s: self.first_motion.map(|at| rounded(self.seconds(at))),
            ..Summary::default()
        }
    }
}

/// How a run goes.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Progress {
    /// Frames of the glove in the last second.
    pub frames_per_s: f64,
    /// Cycles of the gripper in the last second.
    pub cycles_per_s: f64,
    /// From the oldest sample used to the command, µs: half of all commands were faster.
    pub latency_p50: Option<u64>,
    /// The same for 99 of 100.
    pub latency_p99: Option<u64>,
    /// Frames that no command answered while following, and frames that never arrived.
    pub dropped: u64,
    /// How often a fault of the gripper ended motion.
    pub gripper_faults: u32,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::realtime::Scheduling;
    use crate::session::driven::Moment;
    use crate::session::record::{AXES, Command, Frame, Imu};
    use bridge::clutch::Position;
    use bridge::telemetry::Counters;
    use bridge::{HoldReason, State};
    use gripper::{Activation, Contact, Fault, Motion, Status};

    fn at(us: u64) -> Instant {
        Instant::from_ticks(us)
    }

    fn frame(us: u64, sequence: u32, following: bool) -> Record {
        let imu = Imu {
            quaternion: [1.0, 0.0, 0.0, 0.0],
            stamp: at(us),
            health: glove::scan::Health::Good,
        };
        Record::Frame(Box::new(Frame {
            at: at(us),
            sequence,
            imus: [imu; glove::hand::SEGMENT_COUNT],
            angles: [0.0; glove::hand::JOINT_COUNT],
            angles_valid: true,
            held_joints: 0,
            map_output: None,
            following,
            headings: None,
        }))
    }

    fn motion() -> crate::session::snapshot::Motion {
        Motion {
            position: [0; AXES],
            speed: [0; AXES],
            force: [0; AXES],
        }
        .into()
    }

    fn command(first: bool) -> Record {
        Record::Command(Command {
            at: at(0),
            motion: motion(),
            age_us: Some(40_000),
            first,
        })
    }

    fn status(us: u64, position: u8) -> Record {
        let status = Status {
            stamp: at(us),
            activation: Activation::Ready,
            going_to: true,
            contact: [Contact::Moving; AXES],
            echo: [0; AXES],
            position: [position; AXES],
            current: [0; AXES],
            fault: Fault::None,
        };
        Record::Status(status.into())
    }

    #[test]
    fn unanswered_and_missing_frames_are_dropped_ones() {
        let mut numbers = Numbers::default();
        numbers.count(&frame(0, u32::MAX, false));
        numbers.count(&frame(40_000, 0, true));
        numbers.count(&command(true));
        numbers.count(&command(false));
        numbers.count(&frame(80_000, 1, true));
        numbers.count(&command(false));
        numbers.count(&frame(160_000, 3, true));
        numbers.count(&command(true));
        assert_eq!(numbers.dropped(), 2);
        let summary = numbers.summary(at(0));
        assert_eq!((summary.frames_following, summary.frames_answered), (3, 2));
    }

    #[test]
    fn motion_counts_only_while_following_the_hand() {
        let mut numbers = Numbers::default();
        numbers.count(&status(1, 6));
        numbers.count(&status(2, 100));
        assert_eq!(numbers.first_motion, None);
        numbers.count(&frame(3, 0, true));
        numbers.count(&status(4, 100));
        numbers.count(&status(5, 103));
        assert_eq!(numbers.first_motion, None);
        numbers.count(&status(6, 104));
        assert_eq!(numbers.first_motion, Some(at(6)));
    }

    #[test]
    fn time_held_counts_from_the_first_following_and_with_the_clutch_closed() {
        let mut numbers = Numbers::default();
        let second = Duration::from_secs(1);
        let settling = State::Holding(HoldReason::Settling);
        let mut before = Moment {
            clutch: Position::Closed,
            state: settling,
        };
        for (clutch, state) in [
            (Position::Closed, settling),
            (Position::Closed, State::Following),
            (Position::Closed, settling),
            (Position::Open, State::Idle),
            (Position::Closed, State::Following),
        ] {
            let now = Moment { clutch, state };
            numbers.driven.pass(second, before, now);
            before = now;
        }
        let summary = numbers.summary(at(0));
        assert_eq!((summary.moving_s, summary.held_s), (2.0, 1.0));
    }

    #[test]
    fn late_steps_blame_the_computer() {
        let blamed = |late_steps, worst_late_us| {
            let counters = Counters {
                late_steps,
                worst_late_us,
                stalls: u32::from(worst_late_us > 100_000),
                steps: 1000,
                holds: 1,
                ..Default::default()
            };
            let summary = Numbers::default()
                .summary(at(0))
                .with(&counters, Scheduling::Shared);
            summary.lines().iter().any(|line| line.contains("too busy"))
        };
        assert!(!blamed(20, 3_000));
        assert!(blamed(21, 3_000));
        assert!(blamed(1, 20_000));
        // A stop, which is told as one.
        assert!(!blamed(1, 2_000_000));
    }

    #[test]
    fn a_stop_of_two_seconds_is_told_as_one() {
        let counters = Counters {
            late_steps: 1,
            worst_late_us: 2_013_000,
            stalls: 1,
            steps: 1000,
            ..Default::default()
        };
        let summary = Numbers::default()
            .summary(at(0))
            .with(&counters, Scheduling::Shared);
        let said = summary.lines().join("\n");
        assert!(said.contains("stood still once, for up to 2.0 s"), "{said}");
    }

    #[test]
    fn a_run_in_which_nothing_came_has_numbers_and_no_nan_in_json() {
        let summary = Numbers::default().summary(at(0));
        let json = serde_json::to_value(&summary).unwrap();
        for name in [
            "glove_frames_per_s",
            "gripper_cycles_per_s",
            "moving_s",
            "held_s",
        ] {
            assert_eq!(json[name].as_f64(), Some(0.0), "{name}");
        }
    }

    #[test]
    fn only_the_first_command_on_a_frame_is_its_latency() {
        let mut numbers = Numbers::default();
        for (age_us, first) in [(None, false), (Some(31_000), true), (Some(39_000), false)] {
            numbers.count(&Record::Command(Command {
                at: at(0),
                motion: motion(),
                age_us,
                first,
            }));
        }
        assert_eq!(
            (numbers.latency.count(), numbers.latency.at(0.5)),
            (1, Some(31_000))
        );
    }
}
