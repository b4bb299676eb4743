//! A hand and a gripper as the two domains: motion of a hand, an operator that shows hand poses for gripper poses, the pairs a
//! person begins with, the poses of Table 3.

pub mod motion;
mod person;
mod scripted;
pub mod table3;

pub use scripted::Scripted;

use crate::data::Pairs;
use crate::operator::{Error, Operator};

/// The gripper's resting pose in counts, finger A, B, C and scissor, that belongs to the open hand.
pub const OPEN_HAND: [f32; 4] = [0.0, 0.0, 0.0, 130.0];
/// The gripper's pose in counts that belongs to the fist.
pub const FIST: [f32; 4] = [255.0, 255.0, 255.0, 130.0];

/// The two pairs that start a person's session: the open hand and the fist, as `operator` shows them. With the paper's empty start
/// set an open hand need not end as an open gripper.
///
/// # Errors
/// Those of the operator.
pub fn start_pairs(operator: &mut dyn Operator) -> Result<Pairs, Error> {
    let mut pairs = Pairs::default();
    for target in [OPEN_HAND, FIST] {
        let shown = operator.demonstrate(&target)?;
        pairs.inputs.push(&shown);
        pairs.targets.push(&target);
    }
    Ok(pairs)
}
