//! What the gripper was told: an echo that is none of it is not ours to repeat.

use super::limits;
use gripper::Status;
use heapless::Deque;

/// Commands remembered: more than a quarter of a second of motion. An echo lags by two cycles of 8 ms, and by the requests that
/// were lost.
const KEPT: usize = 24;

/// The newest commands since the gripper became ready, each once in a row.
#[derive(Debug, Clone)]
pub(super) struct Told<const X: usize>(Deque<[u8; X], KEPT>);

/// The position that changes nothing.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place<const X: usize> {
    /// Axis by axis: the echo where the axis is in contact, else where it is.
    pub position: [u8; X],
    /// Every echo in it can be true; else `position` has the measured one there, and writing nothing changes less.
    pub is_sure: bool,
}

impl<const X: usize> Told<X> {
    pub const fn new() -> Self {
        Self(Deque::new())
    }

    /// The gripper is told this.
    pub fn note(&mut self, position: [u8; X]) {
        if self.0.back() == Some(&position) {
            return;
        }
        if self.0.is_full() {
            self.0.pop_front();
        }
        // There is room now.
        let _ = self.0.push_back(position);
    }

    /// The gripper has forgotten what it was told.
    pub fn forget(&mut self) {
        self.0.clear();
    }

    /// The position that changes nothing, as far as the echoes in `status` are believed.
    pub fn place(&self, status: &Status<X>) -> Place<X> {
        let mut place = Place {
            position: status.hold(),
            is_sure: true,
        };
        for axis in 0..X {
            if limits::touches(status.contact[axis]) && !self.can_echo(axis, status) {
                place.position[axis] = status.position[axis];
                place.is_sure = false;
            }
        }
        place
    }

    /// Before anything was told the echo is somebody else's.
    fn can_echo(&self, axis: usize, status: &Status<X>) -> bool {
        self.0.is_empty() || self.0.iter().any(|told| told[axis] == status.echo[axis])
    }
}
