//! Motion of a hand for the virtual glove, in real time.

use host::glove::hand::{JOINT_COUNT, LIMITS};
use host::trainer::data::Poses;
use host::trainer::hand::motion::Generator;
use host::training::motion::{ASSUMED_RATE_HZ, Motion};
use rig::{FlatFirst, PoseSource};

/// Time over which the end of a recording is led back to its start, seconds.
const RETURN_S: f64 = 1.0;

/// The hand in a virtual glove: it lies flat when the glove's port is opened, to be calibrated, then moves as
/// [`source`] does.
pub fn virtual_hand(motion: &Motion) -> Box<dyn PoseSource> {
    Box::new(FlatFirst::new(source(motion)))
}

/// The motion in real time and for ever.
pub fn source(motion: &Motion) -> Box<dyn PoseSource> {
    match motion {
        Motion::Generated { seed } => {
            let generator = Generator::new(&LIMITS, *seed);
            Box::new(move |time_s: f64| generator.pose_at(time_s))
        }
        Motion::Recorded { poses, .. } => Box::new(Played::new(poses)),
    }
}

/// A recording that plays for ever: linear between frames, and led back to its start in [`RETURN_S`], for a jump there
/// would be a motion that no hand makes.
struct Played {
    times: Vec<f64>,
    rows: Vec<[f32; JOINT_COUNT]>,
}

impl Played {
    fn new(poses: &Poses) -> Self {
        let mut rows: Vec<[f32; JOINT_COUNT]> = poses
            .rows
            .iter_rows()
            .filter_map(|row| row.try_into().ok())
            .collect();
        let mut times: Vec<f64> = match &poses.time_s {
            Some(times) => {
                let start = times.first().copied().unwrap_or(0.0);
                times.iter().map(|time| time - start).collect()
            }
            None => (0..rows.len())
                .map(|index| index as f64 / ASSUMED_RATE_HZ)
                .collect(),
        };
        if let (Some(first), Some(end)) = (rows.first().copied(), times.last().copied()) {
            rows.push(first);
            times.push(end + RETURN_S);
        }
        Self { times, rows }
    }
}

impl PoseSource for Played {
    fn pose_at(&mut self, time_s: f64) -> [f32; JOINT_COUNT] {
        let length = self.times.last().copied().unwrap_or(0.0);
        let t = if time_s.is_finite() && length > 0.0 {
            time_s.max(0.0) % length
        } else {
            0.0
        };
        let next = self.times.partition_point(|time| *time <= t);
        let at = |index: usize| Some((*self.times.get(index)?, self.rows.get(index)?));
        match (at(next.saturating_sub(1)), at(next)) {
            (Some((from, a)), Some((to, b))) if to > from => {
                let part = ((t - from) / (to - from)) as f32;
                core::array::from_fn(|joint| a[joint] + (b[joint] - a[joint]) * part)
            }
            (Some((_, row)), _) => *row,
            _ => [0.0; JOINT_COUNT],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use host::trainer::data::Matrix;

    fn recording(time_s: Option<Vec<f64>>) -> Poses {
        Poses {
            time_s,
            rows: Matrix::from_rows(&[[0.0; JOINT_COUNT], [1.0; JOINT_COUNT], [0.4; JOINT_COUNT]]),
        }
    }

    #[test]
    fn a_recording_plays_between_its_frames_and_is_led_back_to_its_start() {
        let mut played = Played::new(&recording(Some(vec![5.0, 6.0, 8.0])));
        for (time, angle) in [
            (0.0, 0.0),
            (0.5, 0.5),
            (2.0, 0.7),
            (3.0, 0.4),
            (3.5, 0.2),
            (4.5, 0.5),
        ] {
            let pose = played.pose_at(time);
            assert!((pose[7] - angle).abs() < 1e-6, "{time}: {}", pose[7]);
        }
    }

    #[test]
    fn no_moment_of_a_loop_jumps() {
        let mut played = Played::new(&recording(None));
        let mut before = played.pose_at(0.0)[0];
        for step in 1..5_000 {
            let now = played.pose_at(f64::from(step) / 1_000.0)[0];
            assert!((now - before).abs() < 0.04, "{step}");
            before = now;
        }
    }

    #[test]
    fn one_frame_is_a_still_hand() {
        let poses = Poses {
            time_s: None,
            rows: Matrix::from_rows(&[[0.3; JOINT_COUNT]]),
        };
        assert_eq!(Played::new(&poses).pose_at(123.4), [0.3; JOINT_COUNT]);
    }
}
