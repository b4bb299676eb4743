//! What is counted during a run.

use std::time::Duration;

use bridge::event::Kind;
use gripper::Instant;

use super::replies::Failed;
use super::summary::rounded;
use super::{MOVED_COUNTS, Obeyed, Summary};
use host::realtime::Scheduling;
use host::session::record::{AXES, Record, Sort};
use host::stats::{Percentiles, Rate};

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
    faults: u64,
    following: bool,
    /// Time with the clutch closed since it first followed, moving and held.
    moving: Duration,
    held: Duration,
    /// Positions when following began.
    start_positions: Option<[u8; AXES]>,
    first_motion: Option<Instant>,
    /// What the gripper was told last, where that followed the hand.
    told: Option<[u8; AXES]>,
    /// Whether it went there.
    pub obeyed: Obeyed,
    last_fault: Option<String>,
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
                self.obeyed.status(status, self.told);
            }
            Record::Event {
                sort, text, kind, ..
            } => {
                if let Kind::AxisStands { axis } = kind {
                    self.obeyed.stands(*axis);
                }
                if *sort == Sort::Fault {
                    self.faults += 1;
                    self.last_fault = Some(text.clone());
                }
            }
        }
    }

    /// `time` passed, in which the clutch was closed or not, and the gripper followed or not.
    pub fn pass(&mut self, time: Duration, clutch: bool, moving: bool) {
        match (clutch, moving) {
            (true, true) => self.moving += time,
            // What comes before it first follows is bringing up, not holding.
            (true, false) if !self.moving.is_zero() => self.held += time,
            _ => {}
        }
    }

    fn look_for_motion(&mut self, at: Instant, position: [u8; AXES]) {
        if !self.following || self.first_motion.is_some() {
            return;
        }
        let start = *self.start_positions.get_or_insert(position);
        let moved = start
            .iter()
            .zip(position)
            .any(|(start, now)| start.abs_diff(now) >= MOVED_COUNTS);
        if moved {
            self.first_motion = Some(at);
        }
    }

    /// Frames of which no command left before the next one came, while following, and frames that never arrived here.
    pub fn dropped(&self) -> u64 {
        self.frames_passed_over + self.sequence_gaps
    }

    /// Faults so far.
    pub fn faults(&self) -> u64 {
        self.faults
    }

    /// When the gripper first moved with the hand.
    pub fn first_motion(&self) -> Option<Instant> {
        self.first_motion
    }

    /// The sum of the run.
    pub fn summary(
        &self,
        counters: Option<bridge::telemetry::Counters>,
        scheduling: Scheduling,
    ) -> Summary {
        Summary {
            glove_frames: self.frames.count(),
            glove_frames_per_s: rounded(self.frames.mean()),
            frames_following: self.frames_answered + self.frames_passed_over,
            frames_answered: self.frames_answered,
            frames_dropped: self.dropped(),
            gripper_cycles: self.cycles.count(),
            gripper_cycles_per_s: rounded(self.cycles.mean()),
            commands: self.commands,
            latency_p50_us: self.latency.at(0.5),
            latency_p99_us: self.latency.at(0.99),
            latency_max_us: self.latency.longest(),
            faults: self.faults,
            last_fault: self.last_fault.clone(),
            gripper_failed: counters.map_or_else(Failed::default, |c| {
                Failed::between(&gripper::link::Counters::default(), &c.gripper)
            }),
            steps: counters.map_or(0, |c| c.steps),
            late_steps: counters.map_or(0, |c| c.late_steps),
            worst_late_us: counters.map_or(0, |c| c.worst_late_us),
            stalls: counters.map_or(0, |c| c.stalls),
            gripper_errors: counters.map_or(0, |c| c.gripper_errors),
            holds: counters.map_or(0, |c| c.holds),
            moving_s: rounded(self.moving.as_secs_f64()),
            held_s: rounded(self.held.as_secs_f64()),
            scheduling,
            first_motion_s: self.first_motion.map(|at| {
                let since = at.as_ticks().saturating_sub(self.begun);
                rounded(since as f64 / 1e6)
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gripper::{Activation, Contact, Fault, Motion, Status};
    use host::session::record::{Command, Frame, Imu};

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
            map_output: None,
            following,
        }))
    }

    fn command(first: bool) -> Record {
        Record::Command(Command {
            at: at(0),
            motion: Motion {
                position: [0; AXES],
                speed: [0; AXES],
                force: [0; AXES],
            },
            age_us: Some(40_000),
            first,
        })
    }

    fn status(us: u64, position: u8) -> Record {
        Record::Status(Status {
            stamp: at(us),
            activation: Activation::Ready,
            going_to: true,
            contact: [Contact::Moving; AXES],
            echo: [0; AXES],
            position: [position; AXES],
            current: [0; AXES],
            fault: Fault::None,
        })
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
        let summary = numbers.summary(None, Scheduling::Shared);
        assert_eq!((summary.frames_following, summary.frames_answered), (3, 2));
    }

    #[test]
    fn motion_counts_only_while_following_the_hand() {
        let mut numbers = Numbers::default();
        numbers.count(&status(1, 6));
        numbers.count(&status(2, 100));
        assert_eq!(numbers.first_motion(), None);
        numbers.count(&frame(3, 0, true));
        numbers.count(&status(4, 100));
        numbers.count(&status(5, 103));
        assert_eq!(numbers.first_motion(), None);
        numbers.count(&status(6, 104));
        assert_eq!(numbers.first_motion(), Some(at(6)));
    }

    #[test]
    fn time_held_counts_from_the_first_following_and_with_the_clutch_closed() {
        let mut numbers = Numbers::default();
        let second = Duration::from_secs(1);
        for (clutch, moving) in [
            (true, false),
            (true, true),
            (true, false),
            (false, false),
            (true, true),
        ] {
            numbers.pass(second, clutch, moving);
        }
        let summary = numbers.summary(None, Scheduling::Shared);
        assert_eq!((summary.moving_s, summary.held_s), (2.0, 1.0));
    }

    #[test]
    fn late_steps_blame_the_computer() {
        let blamed = |late_steps, worst_late_us| {
            let counters = bridge::telemetry::Counters {
                late_steps,
                worst_late_us,
                stalls: u32::from(worst_late_us > 100_000),
                steps: 1000,
                holds: 1,
                ..Default::default()
            };
            let summary = Numbers::default().summary(Some(counters), Scheduling::Shared);
            summary.lines().iter().any(|line| line.contains("too busy"))
        };
        assert!(!blamed(20, 3_000));
        assert!(blamed(21, 3_000));
        assert!(blamed(1, 20_000));
    }

    #[test]
    fn a_stop_of_two_seconds_is_told_as_one() {
        let counters = bridge::telemetry::Counters {
            late_steps: 1,
            worst_late_us: 2_013_000,
            stalls: 1,
            steps: 1000,
            ..Default::default()
        };
        let summary = Numbers::default().summary(Some(counters), Scheduling::Shared);
        let said = summary.lines().join("\n");
        assert!(said.contains("stood still 1 times, up to 2.0 s"), "{said}");
    }

    #[test]
    fn a_run_in_which_nothing_came_has_numbers_and_no_nan_in_json() {
        let summary = Numbers::default().summary(None, Scheduling::Shared);
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
        let motion = Motion {
            position: [0; AXES],
            speed: [0; AXES],
            force: [0; AXES],
        };
        for (age_us, first) in [(None, false), (Some(31_000), true), (Some(39_000), false)] {
            numbers.count(&Record::Command(Command {
                at: at(0),
                motion,
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
