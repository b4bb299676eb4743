//! What a bridge has counted.

use serde::{Deserialize, Serialize};

/// Counts since start. On the wire they have no names; in JSON they have those of every summary.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counters {
    /// Frames taken from the glove.
    #[serde(rename = "glove_frames")]
    pub frames: u32,
    /// Frames that the gripper was to follow.
    #[serde(rename = "frames_following")]
    pub following_frames: u32,
    /// Of those, frames of which a command left.
    #[serde(rename = "frames_answered")]
    pub answered_frames: u32,
    /// Frames that gave no angles or were refused by the map.
    pub unusable_frames: u32,
    /// Commands that left.
    pub commands: u32,
    /// Statuses of the gripper.
    #[serde(rename = "gripper_cycles")]
    pub statuses: u32,
    /// Cycles of the gripper that ended in an error.
    pub gripper_errors: u32,
    /// Steps of the supervisor.
    pub steps: u32,
    /// Steps that came more than 2 ms late.
    pub late_steps: u32,
    /// The latest one, microseconds.
    pub worst_late_us: u32,
    /// How often motion was held.
    pub holds: u32,
    /// How often the gripper's fault ended motion.
    #[serde(rename = "gripper_faults")]
    pub faults: u32,
    /// Frames of the host protocol: whole, wrong CRC, no COBS, too long.
    pub host_frames: [u32; 4],
    /// Messages of the host with a right CRC that were no requests.
    pub host_malformed: u32,
    /// Bytes that each port lost because a queue was full: host, glove, gripper.
    pub bytes_lost: [u32; 3],
    /// Most bytes of stack that were ever in use; 0 where nobody looks.
    pub stack_used: u32,
}

impl Counters {
    /// What was counted since `before`. The latest step, the lost bytes and the stack stay what they are since the start.
    pub const fn since(&self, before: &Self) -> Self {
        let [good, crc, coding, oversized] = self.host_frames;
        let [good_before, crc_before, coding_before, oversized_before] = before.host_frames;
        Self {
            frames: self.frames.wrapping_sub(before.frames),
            following_frames: self.following_frames.wrapping_sub(before.following_frames),
            answered_frames: self.answered_frames.wrapping_sub(before.answered_frames),
            unusable_frames: self.unusable_frames.wrapping_sub(before.unusable_frames),
            commands: self.commands.wrapping_sub(before.commands),
            statuses: self.statuses.wrapping_sub(before.statuses),
            gripper_errors: self.gripper_errors.wrapping_sub(before.gripper_errors),
            steps: self.steps.wrapping_sub(before.steps),
            late_steps: self.late_steps.wrapping_sub(before.late_steps),
            holds: self.holds.wrapping_sub(before.holds),
            faults: self.faults.wrapping_sub(before.faults),
            host_frames: [
                good.wrapping_sub(good_before),
                crc.wrapping_sub(crc_before),
                coding.wrapping_sub(coding_before),
                oversized.wrapping_sub(oversized_before),
            ],
            host_malformed: self.host_malformed.wrapping_sub(before.host_malformed),
            ..*self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Counters;

    #[test]
    fn counters_since_are_what_was_added_and_the_extremes_stay() {
        let before = Counters {
            frames: u32::MAX,
            holds: 3,
            host_frames: [10, 1, 2, 3],
            host_malformed: 4,
            bytes_lost: [1, 2, 3],
            worst_late_us: 500,
            stack_used: 1_000,
            ..Counters::default()
        };
        let after = Counters {
            frames: 4,
            following_frames: 3,
            answered_frames: 2,
            unusable_frames: 1,
            commands: 9,
            statuses: 8,
            gripper_errors: 7,
            steps: 6,
            late_steps: 5,
            holds: 5,
            faults: 1,
            host_frames: [15, 2, 4, 6],
            host_malformed: 8,
            bytes_lost: [1, 5, 3],
            worst_late_us: 600,
            stack_used: 1_200,
        };
        let since = Counters {
            frames: 5,
            holds: 2,
            host_frames: [5, 1, 2, 3],
            host_malformed: 4,
            ..after
        };
        assert_eq!(after.since(&before), since);
    }
}
