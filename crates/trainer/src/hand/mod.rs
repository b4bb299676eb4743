//! A hand and a gripper as the two domains: motion of a hand, an operator that shows hand poses for gripper poses, the pairs a
//! person begins with, the poses of Table 3.

pub mod motion;
mod person;
mod scripted;
mod space;
pub mod table3;

pub use scripted::Scripted;
pub use space::{Draw, Space};

use crate::data::Pairs;
use crate::operator::{Error, Operator};

/// The two pairs that start a person's session: the open hand and the fist, as `operator` shows them. With the paper's empty start
/// set an open hand need not end as an open gripper.
///
/// # Errors
/// Those of the operator.
pub fn start_pairs(space: Space, operator: &mut dyn Operator) -> Result<Pairs, Error> {
    let mut pairs = Pairs::default();
    for target in space.start() {
        let shown = operator.demonstrate(target)?;
        pairs.inputs.push(&shown);
        pairs.targets.push(target);
    }
    Ok(pairs)
}
