//! A recording of a hand from a bridge on a chip: its telemetry samples as rows of a poses file.

use host::bridge::protocol::message::Sample;

use host::recording::poses::Row;

/// The poses of samples, one after another. A frame of which a row was written already, and one that gave no angles (the bridge repeats
/// its last ones then, to the bit), are no new pose.
pub(super) fn rows() -> impl FnMut(Sample) -> Option<Row> + Send {
    // Before the first frame there is no pose.
    let (mut last_frame, mut last) = (0, None);
    move |sample| {
        if std::mem::replace(&mut last_frame, sample.frame_sequence) == sample.frame_sequence {
            return None;
        }
        let angles = sample.angles.map(f32::to_bits);
        if last.replace(angles) == Some(angles) {
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
    use host::glove::hand::JOINT_COUNT;

    #[test]
    fn a_frame_that_gave_no_angles_is_no_row_of_old_ones() {
        let sample = |frame_sequence, angle| Sample {
            now_us: 40_000 * u64::from(frame_sequence),
            state: State::Idle,
            frame_sequence,
            angles: [angle; JOINT_COUNT],
            target: Default::default(),
            command: Default::default(),
            position: Default::default(),
            latency_us: None,
        };
        let samples = [
            (0, 0.0),
            (1, 0.25),
            (1, 0.25),
            (2, 0.25),
            (3, 0.25),
            (4, 0.5),
        ]
        .map(|(sequence, angle)| sample(sequence, angle));
        let times: Vec<u64> = samples
            .into_iter()
            .filter_map(rows())
            .map(|row| row.at_us)
            .collect();
        assert_eq!(times, [40_000, 160_000]);
    }
}
