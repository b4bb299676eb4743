//! A recording of a hand from a bridge on a chip: its telemetry samples as rows of a poses file.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use host::bridge::protocol::message::Sample;

use host::recording::poses::Row;

/// Frames that are no row since they do not show every joint, or gave no angles of a calibrated glove; as `record` leaves them out.
#[derive(Debug, Clone, Default)]
pub(super) struct PassedOver(Arc<AtomicU64>);

impl PassedOver {
    /// So far.
    pub fn count(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    fn one_more(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

/// The poses of samples, one after another. A frame of which a row was written already is no new pose. A bridge that does not say
/// which joints a frame shows repeats its last angles, to the bit, for one that gave none.
pub(super) fn rows(passed_over: PassedOver) -> impl FnMut(Sample) -> Option<Row> + Send {
    // Before the first frame there is no pose.
    let (mut last_frame, mut last) = (0, None);
    move |sample| {
        if std::mem::replace(&mut last_frame, sample.frame_sequence) == sample.frame_sequence {
            return None;
        }
        let angles = sample.angles.map(f32::to_bits);
        let is_old = last.replace(angles) == Some(angles);
        if !sample.is_whole().unwrap_or(!is_old) {
            passed_over.one_more();
            return None;
        }
        Some(Row {
            at_us: sample.now_us,
            angles: sample.angles,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use host::bridge::State;
    use host::bridge::telemetry::ALL_JOINTS;
    use host::glove::hand::JOINT_COUNT;

    fn sample(frame_sequence: u32, angle: f32, not_shown: Option<u32>) -> Sample {
        Sample {
            now_us: 40_000 * u64::from(frame_sequence),
            state: State::Idle,
            frame_sequence,
            angles: [angle; JOINT_COUNT],
            target: Default::default(),
            command: Default::default(),
            position: Default::default(),
            latency_us: None,
            not_shown,
        }
    }

    /// The times of the rows, and how many frames are none.
    fn taken(samples: impl IntoIterator<Item = Sample>) -> (Vec<u64>, u64) {
        let passed_over = PassedOver::default();
        let rows = samples.into_iter().filter_map(rows(passed_over.clone()));
        let times = rows.map(|row| row.at_us).collect();
        (times, passed_over.count())
    }

    #[test]
    fn a_frame_that_gave_no_angles_is_no_row_of_old_ones() {
        let samples = [
            (0, 0.0),
            (1, 0.25),
            (1, 0.25),
            (2, 0.25),
            (3, 0.25),
            (4, 0.5),
        ]
        .map(|(sequence, angle)| sample(sequence, angle, None));
        assert_eq!(taken(samples), (vec![40_000, 160_000], 2));
    }

    #[test]
    fn a_frame_with_a_held_joint_or_of_no_calibrated_glove_is_no_row() {
        let samples = [
            (1, 0.25, ALL_JOINTS),
            (2, 0.5, 0),
            (3, 0.75, 0b11 << 8),
            (3, 0.75, 0),
            (4, 0.75, 0),
        ]
        .map(|(sequence, angle, joints)| sample(sequence, angle, Some(joints)));
        assert_eq!(taken(samples), (vec![80_000, 160_000], 2));
    }
}
