//! What a person asks for besides motions: activation, reset, automatic release, mode change.
//!
//! A task inspects first (a fresh status), then writes if it has to, then watches until the gripper
//! says it is done. Every task has a deadline ([`timing`]).

use super::family::{Action, Snapshot};
use crate::registers::Severity;
use crate::registers::three_finger::Mode;
use crate::{Activation, Duration, Fault, Instant, timing};

/// Something a gripper can be asked to do besides a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// Activate. Clears rACT first only if a major fault or a finished release needs it.
    Activate,
    /// Clear rACT.
    Reset,
    /// Release automatically.
    Release,
    /// Change the grasping mode (3-Finger only).
    Mode(Mode),
}

impl Task {
    pub(super) fn limit(self) -> Duration {
        match self {
            Self::Activate => timing::ACTIVATION,
            Self::Reset => timing::RESET,
            Self::Release => timing::RELEASE,
            Self::Mode(_) => timing::MODE_CHANGE,
        }
    }
}

impl core::fmt::Display for Task {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Activate => write!(f, "activation"),
            Self::Reset => write!(f, "reset"),
            Self::Release => write!(f, "automatic release"),
            Self::Mode(mode) => write!(f, "change to {} mode", mode.name()),
        }
    }
}

/// How a task ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The gripper says it is done.
    Done,
    /// It did not happen.
    Failed(Failure),
    /// Another task took its place.
    Replaced,
}

/// Why a task failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// The gripper did not say "done" in time.
    Deadline,
    /// The gripper answers, but its status does not show what was written: its registers read back
    /// otherwise.
    NotTaken,
    /// The gripper is not ready for it: activate it first, or wait for what it is busy with.
    NotReady(Activation),
    /// The gripper reports a fault.
    Fault(Fault),
}

impl core::fmt::Display for Failure {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Deadline => write!(
                f,
                "the gripper did not finish in time; read its status, clear its way, try again"
            ),
            Self::NotTaken => write!(
                f,
                "the gripper answers but does not take what is written: its status reads back otherwise; look for another program or a gateway that writes to it"
            ),
            Self::NotReady(Activation::Reset) => {
                write!(f, "the gripper is not activated; activate it first")
            }
            Self::NotReady(_) => write!(
                f,
                "the gripper is busy activating or changing its mode; wait and try again"
            ),
            Self::Fault(fault) => write!(f, "{fault}"),
        }
    }
}

/// Where a task is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// Waiting for a fresh status to decide.
    Inspect,
    /// Writing this until the status shows it.
    Write(Action),
    /// Reading until the gripper is done.
    Watch,
}

/// A task under way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Running {
    pub(super) task: Task,
    pub(super) stage: Stage,
    /// Set by the first poll.
    pub(super) deadline: Option<Instant>,
    /// Statuses in a row that said "ready" since the mode was written.
    calm: u8,
    /// Since when statuses came that do not show what is being written.
    untaken: Option<(Action, Instant)>,
}

impl Running {
    pub(super) fn new(task: Task) -> Self {
        Self {
            task,
            stage: Stage::Inspect,
            deadline: None,
            calm: 0,
            untaken: None,
        }
    }

    /// What a status that was believed makes of it.
    pub(super) fn next<const X: usize>(&mut self, snapshot: &Snapshot<X>) -> Next {
        match self.task {
            Task::Activate => activation(self.stage, snapshot),
            Task::Reset => reset(self.stage, snapshot),
            Task::Release => release(self.stage, snapshot),
            Task::Mode(mode) => mode_change(self, mode, snapshot),
        }
    }

    /// Its times do not run while nobody looks: the gripper may have ended it long ago.
    pub(super) fn postpone(&mut self, gap: Duration) {
        self.deadline = self.deadline.map(|due| timing::after(due, gap));
        self.untaken = None;
    }

    /// For how long the gripper has not shown what is being written.
    pub(super) fn goes_untaken(&mut self, now: Instant) -> Duration {
        let Stage::Write(action) = self.stage else {
            self.untaken = None;
            return Duration::from_ticks(0);
        };
        match self.untaken {
            Some((same, since)) if same == action => timing::since(now, since),
            _ => {
                self.untaken = Some((action, now));
                Duration::from_ticks(0)
            }
        }
    }
}

/// Statuses in a row that must agree before an unchanged mode counts as changed: the registers lag
/// by up to one refresh.
const CALM: u8 = 4;

/// What becomes of a task.
pub(super) enum Next {
    Stay(Stage),
    Done,
    Fail(Failure),
}

fn is_major<const X: usize>(snapshot: &Snapshot<X>) -> bool {
    snapshot.status.fault.severity() == Severity::Major
}

fn activation<const X: usize>(stage: Stage, snapshot: &Snapshot<X>) -> Next {
    let fault = snapshot.status.fault;
    match (stage, snapshot.status.activation) {
        (Stage::Write(Action::Clear), _) if snapshot.activated => Next::Stay(stage),
        (Stage::Write(Action::Clear), _) => Next::Stay(Stage::Write(Action::Set)),
        (Stage::Write(_), _) if !snapshot.activated => Next::Stay(stage),
        (Stage::Watch, _) if is_major(snapshot) => Next::Fail(Failure::Fault(fault)),
        // It lost its power, perhaps because somebody switched it off in danger: not a second time unasked.
        (Stage::Watch, _) if !snapshot.activated => {
            Next::Fail(Failure::NotReady(Activation::Reset))
        }
        (_, Activation::Ready) if !is_major(snapshot) => Next::Done,
        (Stage::Write(_) | Stage::Watch, _) if snapshot.activated => Next::Stay(Stage::Watch),
        // Inspecting.
        _ if !snapshot.activated => Next::Stay(Stage::Write(Action::Set)),
        _ if is_major(snapshot) => Next::Stay(Stage::Write(Action::Clear)),
        _ if fault == Fault::Releasing => Next::Stay(Stage::Inspect),
        (_, Activation::Reset) => Next::Stay(Stage::Write(Action::Clear)),
        _ => Next::Stay(Stage::Watch),
    }
}

fn reset<const X: usize>(stage: Stage, snapshot: &Snapshot<X>) -> Next {
    match stage {
        // Written even when gACT is 0 already: the rest of the block is cleared too.
        Stage::Write(_) if !snapshot.activated => Next::Done,
        _ => Next::Stay(Stage::Write(Action::Clear)),
    }
}

fn release<const X: usize>(stage: Stage, snapshot: &Snapshot<X>) -> Next {
    if !snapshot.activated {
        return Next::Fail(Failure::NotReady(Activation::Reset));
    }
    match (stage, snapshot.status.fault) {
        (_, Fault::Released) => Next::Done,
        (_, Fault::Releasing) | (Stage::Watch, _) => Next::Stay(Stage::Watch),
        _ => Next::Stay(Stage::Write(Action::Release)),
    }
}

fn mode_change<const X: usize>(running: &mut Running, mode: Mode, snapshot: &Snapshot<X>) -> Next {
    let status = &snapshot.status;
    let (there, ready) = (
        snapshot.mode == mode,
        status.activation == Activation::Ready,
    );
    if is_major(snapshot) {
        return Next::Fail(Failure::Fault(status.fault));
    }
    match running.stage {
        Stage::Inspect if !ready => Next::Fail(Failure::NotReady(status.activation)),
        Stage::Inspect => Next::Stay(Stage::Write(Action::Mode(mode))),
        _ if !snapshot.activated => Next::Fail(Failure::NotReady(Activation::Reset)),
        // Seen changing to it, then seen ready; or ready for so long that there was nothing to do.
        Stage::Watch if there && ready => Next::Done,
        _ if there && status.activation == Activation::ChangingMode => Next::Stay(Stage::Watch),
        stage if there && ready => {
            running.calm += 1;
            if running.calm >= CALM {
                Next::Done
            } else {
                Next::Stay(stage)
            }
        }
        stage => Next::Stay(stage),
    }
}
