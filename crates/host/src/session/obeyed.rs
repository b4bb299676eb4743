//! Whether the gripper went where it was told, over a whole run: one that takes every command, says that all is well and
//! stands (its motors off, its fingers jammed) is no gripper that works.

use gripper::Contact;

use super::axes::MOST as AXES;
use super::snapshot::Status;
use crate::words::axis_words;

/// Counts of position that are a motion: more than noise of the measured position.
pub const MOVED_COUNTS: u8 = 4;
/// Told to be so many counts away a finger has somewhere to go: its software limits lie nearer than this to its range's ends.
const AWAY_COUNTS: u8 = 30;
/// Told so for so long in all a gripper that works has moved, µs.
const LONG_US: u64 = 2_000_000;
/// Between two looks that are farther apart nobody knows what happened, µs.
const GAP_US: u64 = 250_000;
/// Its range follows the fingers: where it stands, it may have to.
const SCISSOR: usize = 3;

/// What the gripper was told and what it did.
#[derive(Debug, Clone, Default)]
pub struct Obeyed {
    /// Where it was when it was first told to follow.
    start: [Option<u8>; AXES],
    moved: bool,
    /// How long each axis was told to be elsewhere, µs.
    told_us: [u64; AXES],
    /// When that was looked at last, µs.
    looked_us: Option<u64>,
    /// An axis that stood although it was told to move, and where.
    stood: Option<(usize, Option<u8>)>,
}

impl Obeyed {
    /// Looks at where the gripper is (`position`) while it is `told` to follow the hand; counts. `blocked`: whether an axis
    /// says that something is in its way.
    pub fn look(
        &mut self,
        at_us: u64,
        told: &[u8],
        position: &[u8],
        blocked: impl Fn(usize) -> bool,
    ) {
        let passed = self
            .looked_us
            .replace(at_us)
            .map(|before| at_us.saturating_sub(before))
            .filter(|passed| *passed <= GAP_US)
            .unwrap_or(0);
        for (axis, (told, position)) in told.iter().zip(position).enumerate().take(AXES) {
            let start = *self.start[axis].get_or_insert(*position);
            self.moved |= start.abs_diff(*position) >= MOVED_COUNTS;
            let away = told.abs_diff(*position) >= AWAY_COUNTS;
            if away && axis != SCISSOR && !blocked(axis) {
                self.told_us[axis] += passed;
            }
        }
        self.look_at_stood(position);
    }

    /// The same with a whole status.
    pub fn status(&mut self, status: &Status, told: Option<&[u8]>) {
        match told {
            Some(told) => {
                let at = status.stamp.as_ticks();
                self.look(at, told, &status.position, |axis| {
                    matches!(
                        status.contact(axis),
                        Some(Contact::ContactOpening | Contact::ContactClosing)
                    )
                });
            }
            None => {
                self.looked_us = None;
                self.look_at_stood(&status.position);
            }
        }
    }

    /// The bridge says that this axis stands although it is told to move; it may say so again and again.
    pub fn stands(&mut self, axis: u8) {
        let axis = usize::from(axis);
        if self.stood.is_none_or(|(known, _)| known != axis) {
            self.stood = Some((axis, None));
        }
    }

    /// Whether the axis that stood has moved since.
    fn look_at_stood(&mut self, position: &[u8]) {
        if let Some((axis, stood)) = &mut self.stood
            && let Some(position) = position.get(*axis)
        {
            let stood = *stood.get_or_insert(*position);
            if stood.abs_diff(*position) >= MOVED_COUNTS {
                self.stood = None;
            }
        }
    }

    /// What a person should know, where the gripper did not do what it was told until the end.
    pub fn fault(&self) -> Option<String> {
        let told = self.told_us.iter().any(|us| *us >= LONG_US);
        if !self.moved && (told || self.stood.is_some()) {
            return Some("the gripper was told to move and never moved".to_owned());
        }
        let axes = self.start.iter().flatten().count();
        let name = axis_words(axes).get(self.stood?.0).unwrap_or(&"an axis");
        Some(format!(
            "the gripper's {name} stood although it was told to move, and has not moved since"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn looks(obeyed: &mut Obeyed, ms: u64, told: [u8; AXES], position: [u8; AXES], blocked: bool) {
        let start = obeyed.looked_us.unwrap_or(0);
        for k in 1..=ms / 10 {
            obeyed.look(start + k * 10_000, &told, &position, |_| blocked);
        }
    }

    #[test]
    fn a_gripper_that_never_moved_is_told_and_one_that_was_not_told_to_is_not() {
        let at = [7; AXES];
        for (told, blocked, faulty) in [
            ([40, 7, 7, 7], false, true),
            ([40, 7, 7, 7], true, false),
            // As far as a software limit may lie from the range's end.
            ([0; AXES], false, false),
            // The scissor may have to stand.
            ([7, 7, 7, 47], false, false),
        ] {
            let mut obeyed = Obeyed::default();
            looks(&mut obeyed, 3_000, told, at, blocked);
            assert_eq!(obeyed.fault().is_some(), faulty, "{told:?} {blocked}");
        }
        let mut obeyed = Obeyed::default();
        looks(&mut obeyed, 1_500, [40; AXES], at, false);
        assert_eq!(obeyed.fault(), None, "too early to say");
        looks(&mut obeyed, 1_000, [40; AXES], [7, 11, 7, 7], false);
        assert_eq!(obeyed.fault(), None, "an axis moved");
    }

    #[test]
    fn an_axis_that_stood_is_told_until_it_moves() {
        let mut obeyed = Obeyed::default();
        looks(&mut obeyed, 100, [9; AXES], [7; AXES], false);
        looks(&mut obeyed, 100, [90; AXES], [60, 60, 60, 7], false);
        obeyed.stands(1);
        looks(&mut obeyed, 100, [90; AXES], [90, 61, 90, 7], false);
        let told = obeyed.fault().unwrap();
        assert!(told.contains("finger B"), "{told}");
        looks(&mut obeyed, 100, [90; AXES], [90, 66, 90, 7], false);
        assert_eq!(obeyed.fault(), None);
    }
}
