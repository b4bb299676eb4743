//! Where the virtual hand's joint angles come from.

use thiserror::Error;

use crate::person::Task;

/// Gives the 25 joint angles of the virtual hand at any time.
///
/// The 16 sensors sample at moments of their own, so times are asked for out of order by up to one
/// sensor period (10 ms). The answer must depend on the time alone.
pub trait PoseSource: Send {
    /// Joint angles in radians, in the order of `glove::hand::JOINT_NAMES`, at `time_s` seconds
    /// after the clock's start.
    fn pose_at(&mut self, time_s: f64) -> [f32; 25];

    /// The hand's own orientation at that time (w, x, y, z) in a world whose z is up; `None` where the source knows fingers
    /// only, and the glove's own [`world`](crate::glove::Config::world) counts.
    fn attitude_at(&mut self, _time_s: f64) -> Option<[f64; 4]> {
        None
    }

    /// A client has opened the glove's port, which nobody had open.
    fn opened(&mut self) {}

    /// Somebody asks the hand to lie flat until it is asked to move again, or to move.
    fn lie_flat(&mut self, _flat: bool) {}

    /// Somebody asks the person whose hand it is for something, from now on; a hand that only plays its motion does not hear.
    fn ask(&mut self, _task: Task) {}
}

/// How long [`FlatFirst`] lies flat, seconds: a calibration needs one of them.
pub const FLAT_S: f64 = 3.0;
/// How long it takes from there to the motion's beginning, seconds.
pub const RISE_S: f64 = 1.0;

/// A hand that first lies flat, so that it can be calibrated, and then moves.
///
/// It lies flat from when the glove's port is opened until the first sensor has been read for [`FLAT_S`], goes to the
/// motion's beginning in [`RISE_S`], and plays the motion from there. When the port is opened anew it lies flat anew. Asked to
/// lie flat, or for a posture, it goes there in [`RISE_S`], and stays until it is asked to move.
pub struct FlatFirst {
    motion: Box<dyn PoseSource>,
    /// When its motion begins or began; `None` before it was first asked since the port was opened.
    begins: Option<f64>,
    /// The posture that was asked for (flat: zeros), or to move.
    asked: Option<Option<[f32; 25]>>,
    lying: Option<Lying>,
}

/// Asked to lie flat, or for a posture.
struct Lying {
    since: f64,
    from: [f32; 25],
    to: [f32; 25],
    /// When it may move again.
    until: f64,
}

impl FlatFirst {
    /// The hand that `motion` moves, flat at first.
    #[must_use]
    pub fn new(motion: Box<dyn PoseSource>) -> Self {
        Self {
            motion,
            begins: None,
            asked: None,
            lying: None,
        }
    }

    fn pose(&mut self, time_s: f64) -> [f32; 25] {
        if let Some(lying) = self.lying.as_ref().filter(|lying| time_s < lying.until) {
            let there = smooth((time_s - lying.since) / RISE_S);
            return std::array::from_fn(|joint| {
                lying.from[joint] + (lying.to[joint] - lying.from[joint]) * there
            });
        }
        let time = time_s - *self.begins.get_or_insert(time_s + FLAT_S);
        if !time.is_finite() || time <= 0.0 {
            return [0.0; 25];
        }
        let pose = self.motion.pose_at((time - RISE_S).max(0.0));
        let there = smooth(time / RISE_S);
        pose.map(|angle| angle * there)
    }

    fn turn(&mut self, asked: Option<[f32; 25]>, now: f64) {
        const FLAT: [f32; 25] = [0.0; 25];
        let from = self.pose(now);
        match (&mut self.lying, asked) {
            // From a posture it goes by way of the flat hand, where the motion begins.
            (Some(lying), None) if lying.until.is_infinite() && lying.to != FLAT => {
                (lying.since, lying.from, lying.to) = (now, from, FLAT);
                lying.until = now + RISE_S;
                self.begins = Some(lying.until);
            }
            (Some(lying), None) if lying.until.is_infinite() => {
                // Not before it lies.
                lying.until = now.max(lying.since + RISE_S);
                self.begins = Some(lying.until);
            }
            (Some(lying), Some(to)) if lying.until > now && lying.to == to => {
                lying.until = f64::INFINITY;
            }
            (_, Some(to)) => {
                self.lying = Some(Lying {
                    since: now,
                    from,
                    to,
                    until: f64::INFINITY,
                });
            }
            _ => {}
        }
    }
}

/// From 0 to 1, beginning and ending gently.
fn smooth(t: f64) -> f32 {
    let t = t.clamp(0.0, 1.0) as f32;
    t * t * (3.0 - 2.0 * t)
}

impl PoseSource for FlatFirst {
    fn pose_at(&mut self, time_s: f64) -> [f32; 25] {
        if let Some(asked) = self.asked.take() {
            self.turn(asked, time_s);
        }
        self.pose(time_s)
    }

    fn opened(&mut self) {
        self.begins = None;
        self.motion.opened();
    }

    fn lie_flat(&mut self, flat: bool) {
        self.asked = Some(flat.then_some([0.0; 25]));
    }

    /// It knows three things: to lie flat, to show a posture, and to move.
    fn ask(&mut self, task: Task) {
        match task {
            Task::Flat => self.lie_flat(true),
            Task::Use(_) => self.lie_flat(false),
            Task::Posture(angles) => self.asked = Some(Some(angles.map(|angle| angle as f32))),
            _ => {}
        }
    }
}

impl<F: FnMut(f64) -> [f32; 25] + Send> PoseSource for F {
    fn pose_at(&mut self, time_s: f64) -> [f32; 25] {
        self(time_s)
    }
}

/// Why a recording cannot be used.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RecordedError {
    /// No row at all.
    #[error("the recording has no rows: give at least one pose")]
    Empty,
    /// Times and rows differ in number.
    #[error("the recording has {times} times for {rows} rows: give one time for each row")]
    Length {
        /// Number of times.
        times: usize,
        /// Number of rows.
        rows: usize,
    },
    /// A time that is not finite or does not grow.
    #[error("time {value} s of row {row} does not follow the row before: times must grow")]
    Time {
        /// Index of the row, from 0.
        row: usize,
        /// Its time, in seconds.
        value: f64,
    },
}

/// A recorded motion: linear interpolation between rows, from the top again after the last row.
#[derive(Debug, Clone)]
pub struct Recorded {
    times: Vec<f64>,
    rows: Vec<[f32; 25]>,
    looping: bool,
    held: bool,
}

impl Recorded {
    /// From times (seconds, growing) and as many rows of 25 angles (radians). Repeats for ever;
    /// the jump from the last row to the first is spread over the mean time between rows.
    ///
    /// # Errors
    /// [`RecordedError`] names the row at fault.
    pub fn new(times: Vec<f64>, rows: Vec<[f32; 25]>) -> Result<Self, RecordedError> {
        if rows.is_empty() {
            return Err(RecordedError::Empty);
        }
        if times.len() != rows.len() {
            return Err(RecordedError::Length {
                times: times.len(),
                rows: rows.len(),
            });
        }
        for (row, &value) in times.iter().enumerate() {
            let follows = row == 0 || times.get(row - 1).is_some_and(|before| value > *before);
            if !value.is_finite() || !follows {
                return Err(RecordedError::Time { row, value });
            }
        }
        Ok(Self {
            times,
            rows,
            looping: true,
            held: false,
        })
    }

    /// From rows a fixed `rate_hz` apart.
    ///
    /// # Errors
    /// [`RecordedError`] where there is no row or the rate is not positive.
    pub fn at_rate(rows: Vec<[f32; 25]>, rate_hz: f64) -> Result<Self, RecordedError> {
        let times = (0..rows.len()).map(|i| i as f64 / rate_hz).collect();
        Self::new(times, rows)
    }

    /// Stays at the last row instead of starting again.
    #[must_use]
    pub fn once(mut self) -> Self {
        self.looping = false;
        self
    }

    /// Holds each row still until the time of the next: no pose between rows is ever shown.
    #[must_use]
    pub fn held(mut self) -> Self {
        self.held = true;
        self
    }

    /// Length in seconds, the step from the last row back to the first included.
    #[must_use]
    pub fn length_s(&self) -> f64 {
        let span = self.times.last().unwrap_or(&0.0) - self.times.first().unwrap_or(&0.0);
        match self.times.len() {
            0 | 1 => 1.0,
            n => span * n as f64 / (n - 1) as f64,
        }
    }
}

impl PoseSource for Recorded {
    fn pose_at(&mut self, time_s: f64) -> [f32; 25] {
        let count = self.rows.len();
        let start = self.times.first().copied().unwrap_or(0.0);
        let offset = if time_s.is_finite() {
            time_s.max(0.0)
        } else {
            0.0
        };
        let t = start
            + if self.looping {
                offset % self.length_s()
            } else {
                offset
            };
        let next = self.times.partition_point(|&x| x <= t);
        let from = next.saturating_sub(1);
        let (to, end) = if next < count {
            (next, self.times[next])
        } else if self.looping {
            (0, start + self.length_s())
        } else {
            (from, t + 1.0)
        };
        if self.held {
            return self.rows[from];
        }
        let part =
            ((t - self.times[from]) / (end - self.times[from]).max(1e-9)).clamp(0.0, 1.0) as f32;
        let (a, b) = (&self.rows[from], &self.rows[to]);
        core::array::from_fn(|j| a[j] + (b[j] - a[j]) * part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(value: f32) -> [f32; 25] {
        [value; 25]
    }

    #[test]
    fn a_hand_lies_flat_when_its_port_is_opened_and_goes_gently_to_its_motion() {
        let mut hand = FlatFirst::new(Box::new(|t: f64| row(1.0 + t as f32)));
        for _ in 0..2 {
            assert_eq!(hand.pose_at(70.0), row(0.0));
            assert_eq!(
                hand.pose_at(69.99),
                row(0.0),
                "a period of the fusion before"
            );
            assert_eq!(hand.pose_at(73.0), row(0.0));
            let mut before = hand.pose_at(73.0)[0];
            for step in 1..=1_000 {
                let angle = hand.pose_at(73.0 + f64::from(step) * 1e-3)[0];
                assert!((0.0..0.002).contains(&(angle - before)), "{step}");
                before = angle;
            }
            assert_eq!(hand.pose_at(74.5), row(1.5));
            hand.opened();
        }
    }

    #[test]
    fn asked_for_a_posture_it_goes_there_and_from_there_to_its_motion_without_a_jump() {
        let mut hand = FlatFirst::new(Box::new(|_: f64| row(1.0)));
        hand.pose_at(0.0);
        assert_eq!(hand.pose_at(10.0), row(1.0));
        hand.ask(Task::Posture([0.3; 25]));
        hand.pose_at(10.0);
        assert_eq!(hand.pose_at(11.5), row(0.3));
        hand.ask(Task::Use(crate::person::Attitude::PalmDown));
        let mut before = hand.pose_at(20.0)[0];
        for step in 1..=3_000 {
            let angle = hand.pose_at(20.0 + f64::from(step) * 1e-3)[0];
            assert!((angle - before).abs() < 0.002, "{step}");
            before = angle;
        }
        assert_eq!(before, 1.0);
    }

    #[test]
    fn a_recording_is_interpolated_between_its_rows_and_starts_again() {
        let mut r =
            Recorded::new(vec![10.0, 11.0, 12.0], vec![row(0.0), row(1.0), row(0.5)]).unwrap();
        assert_eq!(r.pose_at(0.0), row(0.0));
        assert_eq!(r.pose_at(0.25), row(0.25));
        assert_eq!(r.pose_at(1.5), row(0.75));
        assert_eq!(r.pose_at(2.5), row(0.25), "from the last row to the first");
        assert_eq!(r.pose_at(3.25), row(0.25));
    }

    #[test]
    fn a_held_recording_shows_only_its_rows() {
        let mut r = Recorded::at_rate(vec![row(0.0), row(1.0)], 1.0)
            .unwrap()
            .held()
            .once();
        assert_eq!(r.pose_at(0.99), row(0.0));
        assert_eq!(r.pose_at(1.0), row(1.0));
        assert_eq!(r.pose_at(99.0), row(1.0));
        assert_eq!(r.pose_at(f64::NAN), row(0.0));
    }

    #[test]
    fn a_recording_at_fault_names_the_row() {
        assert_eq!(
            Recorded::new(vec![], vec![]).unwrap_err(),
            RecordedError::Empty
        );
        let e = Recorded::new(vec![0.0, 1.0, 1.0], vec![row(0.0); 3]).unwrap_err();
        assert_eq!(e, RecordedError::Time { row: 2, value: 1.0 });
    }

    #[test]
    fn a_hand_that_is_asked_to_lie_flat_goes_there_gently_and_stays_until_it_is_asked_to_move() {
        let mut hand = FlatFirst::new(Box::new(|_: f64| row(1.0)));
        for at in [0.0, 10.0] {
            hand.pose_at(at);
        }
        hand.lie_flat(true);
        let on_the_way: Vec<f32> = (0..=10)
            .map(|tenth| hand.pose_at(10.0 + 0.1 * f64::from(tenth))[0])
            .collect();
        assert!(on_the_way.windows(2).all(|two| two[0] - two[1] < 0.16));
        assert_eq!(on_the_way.last(), Some(&0.0));
        // Also where a program opens the port meanwhile.
        hand.opened();
        assert_eq!(hand.pose_at(300.0), row(0.0));
        hand.lie_flat(false);
        assert_eq!(hand.pose_at(300.1), row(0.0));
        assert_eq!(hand.pose_at(301.2), row(1.0));
        // Asked twice, it goes on.
        hand.lie_flat(false);
        assert_eq!(hand.pose_at(301.3), row(1.0));
        hand.lie_flat(true);
        hand.pose_at(302.0);
        assert_eq!(hand.pose_at(303.1), row(0.0));
    }

    #[test]
    fn a_hand_that_is_asked_twice_to_move_before_it_lies_moves() {
        let mut hand = FlatFirst::new(Box::new(|_: f64| row(1.0)));
        for (at, flat) in [(10.0, true), (10.2, false), (10.4, false)] {
            hand.pose_at(at - 10.0);
            hand.lie_flat(flat);
            hand.pose_at(at);
        }
        assert_eq!(hand.pose_at(11.0), row(0.0));
        assert_eq!(hand.pose_at(12.1), row(1.0));
        // And one that is asked to lie flat after all stays.
        for (at, flat) in [(20.0, true), (20.2, false), (20.4, true)] {
            hand.lie_flat(flat);
            hand.pose_at(at);
        }
        assert_eq!(hand.pose_at(300.0), row(0.0));
    }
}
