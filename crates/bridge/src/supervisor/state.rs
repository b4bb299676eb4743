//! The supervisor's states and the one function that moves between them.
//!
//! `docs/safety.md` draws the same table; [`next`] is the only place where a state changes.

use crate::clutch::Position;
use gripper::{Activation, registers::Fault};

/// What the bridge is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// The clutch is open. Before the first motion nothing is written to the gripper, after it the hold is repeated.
    Idle,
    /// Something forbids motion, or the clutch opened by itself: the gripper is held where it is.
    Holding(HoldReason),
    /// Motion has been held for 500 ms for want of data or heartbeat: the configured safe action runs.
    SafeAction(HoldReason),
    /// The clutch closed a moment ago: commands blend from where the gripper is to where the hand is.
    Blending,
    /// The gripper follows the hand.
    Following,
    /// The gripper has a fault. Stays, heartbeat or none, until somebody opens the clutch.
    Faulted(GripperFault),
}

/// Why motion is held while the clutch is closed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HoldReason {
    /// The heartbeat of the clutch stopped without a release.
    HeartbeatLost,
    /// Everything is there; the fresh frames in a row are not enough yet.
    Settling,
    /// The oldest sample of the newest usable frame is older than 100 ms, or there is none.
    SamplesStale,
    /// The `hand` sensor, or two or more sensors, are lost (bit k: segment k).
    SensorsLost(u16),
    /// No weights image in the store.
    NoWeights,
    /// A weights image is being written.
    StoreBusy,
    /// The map refused the joint angles: not finite or out of range.
    InputRefused,
    /// The map's output was not finite or more than a stroke outside 0 to 255.
    OutputRefused,
    /// The gripper's newest status is older than 100 ms, or there is none.
    GripperSilent,
    /// The gripper answers and is not ready to move: not activated, or changing its mode.
    GripperNotReady(Activation),
    /// No step for more than 100 ms, or the clock ran backwards.
    ClockGap,
    /// The glove was not calibrated, or its calibration is worth nothing any more:
    /// [`Telemetry::lacks`](crate::Telemetry::lacks) says what it lacks.
    NotCalibrated,
}

/// A fault of the gripper that ends motion until the clutch is opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GripperFault {
    /// It reports a fault (gFLT).
    Reported(Fault),
    /// It was ready, and has lost its activation.
    ActivationLost(Activation),
    /// It answers commands and does not go to them: gGTO stays 0 for 500 ms, or what it echoes is not what it was told
    /// for 1 s.
    CommandIgnored,
    /// What it says of where it is cannot be: an axis jumped farther than it can move, several times in a row, or was found
    /// elsewhere than it was left.
    Implausible {
        /// The axis.
        axis: u8,
    },
}

impl HoldReason {
    /// Whether holding for this reason, after motion, leads to the safe action: the hand's side is gone and the gripper
    /// still obeys.
    pub fn leads_to_safe_action(self) -> bool {
        !matches!(
            self,
            HoldReason::GripperSilent | HoldReason::GripperNotReady(_)
        )
    }
}

impl State {
    /// The state's name for a person, without its reason.
    pub fn name(&self) -> &'static str {
        match self {
            State::Idle => "idle",
            State::Holding(_) => "holding",
            State::SafeAction(_) => "safe action",
            State::Blending => "blending",
            State::Following => "following",
            State::Faulted(_) => "faulted",
        }
    }

    /// Why motion is held, where it is.
    pub fn hold_reason(&self) -> Option<HoldReason> {
        match self {
            State::Holding(reason) | State::SafeAction(reason) => Some(*reason),
            State::Idle | State::Blending | State::Following | State::Faulted(_) => None,
        }
    }

    /// Whether commands follow the hand.
    pub fn is_moving(&self) -> bool {
        matches!(self, State::Blending | State::Following)
    }
}

impl core::fmt::Display for State {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            State::Holding(reason) => write!(f, "holding: {reason}"),
            State::SafeAction(reason) => write!(f, "safe action: {reason}"),
            State::Faulted(fault) => write!(f, "faulted: {fault}"),
            State::Idle | State::Blending | State::Following => f.write_str(self.name()),
        }
    }
}

impl core::fmt::Display for HoldReason {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            HoldReason::HeartbeatLost => "the clutch's heartbeat stopped",
            HoldReason::Settling => "waiting for enough fresh frames in a row",
            HoldReason::SamplesStale => "no fresh samples from the glove",
            HoldReason::SensorsLost(mask) => return sensors(*mask, f),
            HoldReason::NotCalibrated => {
                "the glove is not calibrated: open the clutch, lay the hand flat, calibrate"
            }
            HoldReason::NoWeights => "no weights: flash an image",
            HoldReason::StoreBusy => "a weights image is being written",
            HoldReason::InputRefused => "the map refused the joint angles",
            HoldReason::OutputRefused => "the map's output is out of range",
            HoldReason::GripperSilent => "the gripper does not answer",
            HoldReason::GripperNotReady(Activation::Reset) => "the gripper is not activated",
            HoldReason::GripperNotReady(Activation::Activating) => "the gripper is activating",
            HoldReason::GripperNotReady(_) => "the gripper is changing its mode",
            HoldReason::ClockGap => "the loop or the clock stood still",
        })
    }
}

fn sensors(mask: u16, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
    f.write_str("sensors lost:")?;
    for (segment, name) in glove::hand::SEGMENT_NAMES.iter().enumerate() {
        if mask & (1 << segment) != 0 {
            write!(f, " {name}")?;
        }
    }
    Ok(())
}

impl core::fmt::Display for GripperFault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            GripperFault::Reported(fault) => write!(f, "{fault}"),
            GripperFault::ActivationLost(_) => {
                f.write_str("the gripper lost its activation: activate it again")
            }
            GripperFault::Implausible { axis } => write!(
                f,
                "the gripper says that {} is where it cannot have come: look at it, open the clutch; if it stays so, activate it anew",
                crate::axis::name(*axis)
            ),
            GripperFault::CommandIgnored => f.write_str("the gripper does not go to its commands"),
        }
    }
}

/// All that decides the next state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Conditions {
    /// The clutch.
    pub clutch: Position,
    /// A fault of the gripper at this moment.
    pub fault: Option<GripperFault>,
    /// What forbids motion at this moment.
    pub obstacle: Option<HoldReason>,
    /// The blend has run its time.
    pub blended: bool,
    /// Motion that began under this clutch has been held for 500 ms.
    pub held_long: bool,
}

/// The transition table.
pub fn next(state: State, c: &Conditions) -> State {
    match (c.clutch, state, c.fault) {
        (Position::Open, ..) => State::Idle,
        (_, State::Faulted(old), fault) => State::Faulted(fault.unwrap_or(old)),
        (Position::Lost | Position::Expired, State::Idle, _) => State::Idle,
        (_, _, Some(fault)) => State::Faulted(fault),
        (Position::Lost | Position::Expired, ..) => hold(
            c,
            c.obstacle
                .filter(|r| !r.leads_to_safe_action())
                .unwrap_or(HoldReason::HeartbeatLost),
        ),
        (Position::Closed, ..) => match c.obstacle {
            Some(reason) => hold(c, reason),
            None => advance(state, c),
        },
    }
}

fn hold(c: &Conditions, reason: HoldReason) -> State {
    if c.held_long && reason.leads_to_safe_action() {
        State::SafeAction(reason)
    } else {
        State::Holding(reason)
    }
}

/// Nothing forbids motion.
fn advance(state: State, c: &Conditions) -> State {
    match state {
        State::Following => State::Following,
        State::Blending if c.blended => State::Following,
        _ => State::Blending,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SILENT: HoldReason = HoldReason::GripperSilent;
    const STALE: HoldReason = HoldReason::SamplesStale;
    const FAULT: GripperFault = GripperFault::CommandIgnored;

    const STATES: [State; 7] = [
        State::Idle,
        State::Holding(STALE),
        State::SafeAction(STALE),
        State::Blending,
        State::Following,
        State::Faulted(FAULT),
        State::Faulted(GripperFault::ActivationLost(Activation::Reset)),
    ];

    /// The table of docs/safety.md, row by row, first row that fits.
    fn table(from: State, c: &Conditions) -> State {
        let gripper = c.obstacle == Some(SILENT);
        let unattended = matches!(c.clutch, Position::Lost | Position::Expired);
        match (c.clutch, from, c.fault, c.obstacle) {
            (Position::Open, ..) => State::Idle,
            (_, State::Faulted(old), new, _) => State::Faulted(new.unwrap_or(old)),
            (_, State::Idle, ..) if unattended => State::Idle,
            (_, _, Some(fault), _) => State::Faulted(fault),
            (_, _, _, Some(SILENT)) => State::Holding(SILENT),
            _ if unattended && c.held_long => State::SafeAction(HoldReason::HeartbeatLost),
            _ if unattended => State::Holding(HoldReason::HeartbeatLost),
            (_, _, _, Some(obstacle)) if c.held_long && !gripper => State::SafeAction(obstacle),
            (_, _, _, Some(obstacle)) => State::Holding(obstacle),
            (_, State::Following, ..) => State::Following,
            (_, State::Blending, ..) if c.blended => State::Following,
            _ => State::Blending,
        }
    }

    #[test]
    fn every_transition_is_the_one_of_the_documented_table() {
        for from in STATES {
            for clutch in [
                Position::Open,
                Position::Lost,
                Position::Expired,
                Position::Closed,
            ] {
                for fault in [None, Some(FAULT)] {
                    for obstacle in [None, Some(STALE), Some(SILENT)] {
                        for (blended, held_long) in
                            [(false, false), (false, true), (true, false), (true, true)]
                        {
                            let c = Conditions {
                                clutch,
                                fault,
                                obstacle,
                                blended,
                                held_long,
                            };
                            assert_eq!(next(from, &c), table(from, &c), "{from:?} {c:?}");
                        }
                    }
                }
            }
        }
    }
}
