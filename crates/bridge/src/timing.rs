//! Every time the bridge waits for, and the sum behind it.

use crate::{Duration, Instant};

pub use gripper::timing::is_within;

/// Period of the supervisor: one step at least this often.
///
/// A gripper cycle (FC23 at 115200 baud) takes 7.8 ms, so a step has a new status nearly every time.
pub const PERIOD: Duration = Duration::from_ticks(10_000);

/// A step may come this much after its due time; a later one is counted and told.
pub const LATE: Duration = Duration::from_ticks(2_000);

/// Longest time between two steps that the supervisor takes as one stretch of motion. After a longer gap nobody knows
/// what happened meanwhile: it holds and settles anew.
pub const LONGEST_GAP: Duration = Duration::from_ticks(100_000);

/// Oldest sample a command may rest on (rule 2): the hand's and the gripper's alike.
///
/// A scan at 115200 baud takes 27 ms; just before the next frame the oldest sample is 58 ms old.
pub const MAX_AGE: Duration = Duration::from_ticks(100_000);

/// The host sends the clutch's heartbeat this often.
pub const HEARTBEAT: Duration = Duration::from_ticks(100_000);

/// Without a heartbeat for this long motion is held: one may be lost, with half a period to spare.
pub const HEARTBEAT_TIMEOUT: Duration = Duration::from_ticks(250_000);

/// Without a heartbeat for this long the clutch has opened by itself: only an act of a person closes it again.
pub const CLUTCH_EXPIRES: Duration = Duration::from_ticks(1_000_000);

/// Motion that has been held for this long gives way to the configured safe action.
pub const SAFE_AFTER: Duration = Duration::from_ticks(500_000);

/// A gripper that is written to for this long and does not report gGTO is not following.
pub const IGNORED_AFTER: Duration = Duration::from_ticks(500_000);

/// A gripper that echoes one and the same position for this long while it is told others is not following.
pub const ECHO_AFTER: Duration = Duration::from_ticks(1_000_000);

/// An axis that stands for this long although it is told to move is told of.
pub const STANDS_AFTER: Duration = Duration::from_ticks(1_500_000);

/// A joint that was held for longer than this, for want of its sensor, goes back to what the sensor says within [`JOINT_BACK`].
pub const JOINT_AWAY: Duration = Duration::from_ticks(100_000);

/// Time a joint that was held takes from there to what its sensor says, with no jump in speed.
pub const JOINT_BACK: Duration = Duration::from_ticks(1_000_000);

/// A sensor whose reads do not agree for this long after it was away is told to be lost.
pub const RETURNING: Duration = Duration::from_ticks(1_000_000);

/// Longest time one step of the loop may take, whatever the devices do.
pub const STEP_BUDGET: Duration = Duration::from_ticks(1_000);

/// A device that has said nothing for this long is told to be silent. (Motion ended long before, after [`MAX_AGE`].)
pub const SILENT: Duration = Duration::from_ticks(500_000);

/// Whether what is stamped `stamp` may still be used: at most [`MAX_AGE`] old.
pub fn is_fresh(now: Instant, stamp: Instant) -> bool {
    is_within(now, stamp, MAX_AGE)
}
