//! Which axes a move's numbers are for, and the next step of each.

use host::bridge::supervisor::limits;
use host::gripper::driver::Control;
use host::gripper::{Activation, Status};

/// Which axes the numbers on the command line are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Axes {
    /// One number for each axis.
    Each,
    /// One number for all fingers; the scissor stays where the mode has it.
    Fingers,
    /// One number in scissor mode: the scissor's.
    Scissor,
}

impl Axes {
    pub(super) fn control(self) -> Control {
        match self {
            Self::Each => Control::INDIVIDUAL,
            Self::Fingers => Control {
                fingers: true,
                scissor: false,
            },
            Self::Scissor => Control::SIMPLIFIED,
        }
    }

    /// Whether these numbers move axis `axis`.
    pub(super) fn moves(self, axis: usize) -> bool {
        match self {
            Self::Each => true,
            Self::Fingers => axis != SCISSOR,
            Self::Scissor => axis == SCISSOR,
        }
    }

    /// Whether a move to `target` opens every axis that it moves, or leaves it: what frees fingers that are in each other's way.
    pub(super) fn only_open<const X: usize>(self, target: &[u8; X], here: &[u8; X]) -> bool {
        (0..X).all(|axis| !self.moves(axis) || target[axis] <= here[axis])
    }

    /// The axes whose echoes repeat the command block: in scissor mode the scissor's number goes where finger A's is.
    pub(super) fn echoes(self, axis: usize) -> bool {
        match self {
            Self::Each => true,
            Self::Fingers => axis != SCISSOR,
            Self::Scissor => axis == 0,
        }
    }

    /// Whether the gripper puts its scissor where the mode has it: it does so by itself when a scissor that was moved on
    /// its own is left to the mode again, and says that it changes its mode meanwhile.
    pub(super) fn gives_the_scissor_back<const X: usize>(self, status: &Status<X>) -> bool {
        self != Self::Each && status.activation == Activation::ChangingMode
    }

    /// A position for each axis as the command block carries it: in scissor mode the scissor's goes where finger A's is.
    pub(super) fn block<const X: usize>(self, mut position: [u8; X]) -> [u8; X] {
        if self == Self::Scissor
            && let Some(&scissor) = position.get(SCISSOR)
        {
            position[0] = scissor;
        }
        position
    }
}

/// The scissor's place among four axes.
const SCISSOR: usize = 3;

/// The next position to ask for: towards `target`, at most `lead` from where each axis is, and such that no finger can
/// meet the scissor on the way. `told` is the command before, which the status may not show yet.
pub(super) fn next_command<const X: usize>(
    target: [u8; X],
    status: &Status<X>,
    axes: Axes,
    lead: [u8; X],
    told: Option<[u8; X]>,
) -> [u8; X] {
    let wanted = core::array::from_fn(|axis| {
        let here = status.position[axis];
        if axes.moves(axis) {
            let lead = lead[axis];
            target[axis].clamp(here.saturating_sub(lead), here.saturating_add(lead))
        } else {
            here
        }
    });
    match axes {
        Axes::Each => {
            // By now it may be as far as what it was told before.
            let told = told.unwrap_or(status.position);
            let ceiling = core::array::from_fn(|axis| {
                status.position[axis].max(status.echo[axis]).max(told[axis])
            });
            limits::keep_inside(wanted, &ceiling, &status.position, &target.map(f32::from))
        }
        // The mode keeps fingers and scissor apart; in pinch mode what could meet is led axis by axis.
        Axes::Fingers | Axes::Scissor => wanted,
    }
}
