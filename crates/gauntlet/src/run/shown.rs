//! What a person is shown of a run: the numbers of one moment, what is wrong now, and for as long as it is.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use host::bridge::calibration::{Refusal, Try};
use host::bridge::clutch::Position;
use host::bridge::event::Kind;
use host::bridge::{GripperFault, HoldReason, State};
use host::glove::hand::{LIMITS, SEGMENT_COUNT, SEGMENT_NAMES};
use host::glove::scan::{Finding, Health};
use host::gripper::{Activation, Contact};

use crate::live::{Axis, Bindings, Finger};
use host::next::Command;
use host::realtime::Scheduling;
use host::session::axes::MOST;
use host::session::replies::Replies;
use host::session::snapshot::Status;
use host::session::{Devices, Snapshot};
use host::words;

/// Faults shown at once.
const SHOWN_FAULTS: usize = 5;
/// How long a fault stays on the view after it happened, unless its reason goes before.
const FAULT_SHOWN: Duration = Duration::from_secs(4);
/// What is older is marked as old, µs.
const OLD_US: u64 = 250_000;
/// An axis whose position stays the same for so long stands.
const STANDS: Duration = Duration::from_millis(300);
/// Late steps of so many last seconds say that the computer is busy.
const BUSY: Duration = Duration::from_secs(5);

/// What is remembered from moment to moment.
#[derive(Debug, Default)]
pub(super) struct Shown {
    recent: VecDeque<(Instant, String, Kind)>,
    replies: Replies,
    /// Each axis' position, and when it changed last.
    positions: [Option<(u8, Instant)>; MOST],
    /// Late steps as they were when they last grew.
    late: (u32, Option<Instant>),
}

impl Shown {
    /// A fault, or what became of a calibration. The same thing again only renews what is shown.
    pub(super) fn happened(&mut self, text: &str, kind: Kind) {
        self.recent.retain(|(_, known, _)| known != text);
        self.recent
            .push_back((Instant::now(), text.to_owned(), kind));
        if self.recent.len() > SHOWN_FAULTS {
            self.recent.pop_front();
        }
    }

    /// A status came.
    pub(super) fn status(&mut self, status: &Status, now: Instant) {
        for (known, position) in self
            .positions
            .iter_mut()
            .zip(status.position.iter().copied())
        {
            if known.is_none_or(|(before, _)| before != position) {
                *known = Some((position, now));
            }
        }
    }

    /// What is wrong, and what was a moment ago.
    pub(super) fn faults(
        &mut self,
        snapshot: &Snapshot,
        scheduling: Option<Scheduling>,
        hands: &Hands,
        now: Instant,
    ) -> Vec<String> {
        let mut faults = standing(snapshot, hands);
        let line = snapshot.line.as_ref();
        faults.extend(line.and_then(|line| self.replies.look(now, line)));
        faults.extend(scheduling.and_then(|known| self.busy(snapshot, known, now)));
        self.recent.retain(|(at, _, kind)| {
            now.saturating_duration_since(*at) < FAULT_SHOWN && !over(kind, snapshot)
        });
        faults.extend(self.recent.iter().map(|(_, text, _)| text.clone()));
        faults
    }

    /// A word for the person whose motion is held because this computer is busy.
    fn busy(
        &mut self,
        snapshot: &Snapshot,
        scheduling: Scheduling,
        now: Instant,
    ) -> Option<String> {
        let steps = snapshot.late_steps;
        let (known, grew) = &mut self.late;
        if steps != *known {
            // What came late before anybody looked is no news.
            *grew = (*known > 0 || steps > 0).then_some(now);
            *known = steps;
        }
        let held = matches!(snapshot.state, State::Holding(_) | State::SafeAction(_));
        let recently = grew.is_some_and(|at| now.saturating_duration_since(at) < BUSY);
        (held && recently).then(|| {
            format!(
                "this computer is too busy: {steps} steps came late so far; {}",
                scheduling.less_to_do()
            )
        })
    }

    /// The gripper's axes, and what each does.
    pub(super) fn axes(&self, snapshot: &Snapshot, now: Instant) -> Vec<Axis> {
        let known = |axes: &host::session::axes::Axes<u8>| axes.len();
        let reached = snapshot.status.as_ref().map(|status| &status.position);
        let count = reached.or(snapshot.command.as_ref()).map_or(0, known);
        words::axis_words(count)
            .iter()
            .take(count)
            .enumerate()
            .map(|(axis, name)| Axis {
                name,
                asked: snapshot
                    .command
                    .as_ref()
                    .and_then(|asked| asked.get(axis).copied()),
                reached: reached.and_then(|reached| reached.get(axis).copied()),
                word: self.word(snapshot, axis, now),
            })
            .collect()
    }

    fn word(&self, snapshot: &Snapshot, axis: usize, now: Instant) -> &'static str {
        let Some(status) = &snapshot.status else {
            return "silent";
        };
        if gripper_age(snapshot).is_some() {
            return "silent, position old";
        }
        let known = self.positions.get(axis).copied().flatten();
        let stands = known.is_none_or(|(_, since)| now.saturating_duration_since(since) >= STANDS);
        match status.contact(axis) {
            // The gripper says so of an axis, too, that it was never told to move.
            Some(Contact::Moving) if stands => "stands",
            Some(contact) => words::contact(contact),
            None => "",
        }
    }
}

/// Age of the gripper's newest status in seconds, where it is old.
pub(super) fn gripper_age(snapshot: &Snapshot) -> Option<f32> {
    let status = snapshot.status.as_ref()?;
    old(snapshot
        .now
        .checked_duration_since(status.stamp)?
        .as_ticks())
}

/// Age of the glove's newest sample in seconds, where it is old.
pub(super) fn glove_age(snapshot: &Snapshot) -> Option<f32> {
    let newest = snapshot.sensors?.newest;
    old(snapshot.now.checked_duration_since(newest)?.as_ticks())
}

fn old(us: u64) -> Option<f32> {
    (us >= OLD_US).then_some(us as f32 / 1e6)
}

/// Whether the reason of a fault is gone.
fn over(kind: &Kind, snapshot: &Snapshot) -> bool {
    match kind {
        Kind::State { to, .. } => snapshot.state.name() != to.name(),
        Kind::SensorLost { segment } => is_good(snapshot, *segment),
        // As long as it is so, `standing` says it.
        Kind::AxisStands { .. } => true,
        Kind::SensorRestarted { segment }
        | Kind::SensorSlipped {
            segment,
            held: true,
        } => snapshot.distrusted >> segment & 1 == 0,
        Kind::Sensors(Finding::Jumped { segment, .. }) => snapshot.distrusted >> segment & 1 == 0,
        // As long as it is so, `standing` says it.
        Kind::Sensors(Finding::Impossible { .. }) => true,
        Kind::Sensors(Finding::Frozen { segment }) => is_good(snapshot, (*segment).into()),
        Kind::Sensors(Finding::AllFrozen) => (0..SEGMENT_COUNT).any(|k| is_good(snapshot, k)),
        // Where none is in use, `standing` says why as long as it is so.
        Kind::Calibration(end) => {
            snapshot.calibration.newest != *end || snapshot.lacks_calibration()
        }
        Kind::Glove { .. } => snapshot.glove_answers,
        Kind::Gripper { .. } => snapshot.gripper_answers,
        Kind::GripperFault(_) => snapshot
            .status
            .is_some_and(|status| status.fault == host::gripper::Fault::None),
        _ => false,
    }
}

fn is_good(snapshot: &Snapshot, segment: usize) -> bool {
    match &snapshot.sensors {
        Some(sensors) => sensors.health.get(segment) == Some(&Health::Good),
        // A chip of an older firmware does not tell.
        None => snapshot.on_chip,
    }
}

/// What whoever watches can do from here.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Hands {
    /// Press keys.
    Keys(Bindings),
    /// Only start the run anew: there is no terminal.
    Options,
    /// First make the glove's profile, which is not there, with this command.
    Profile(Command),
    /// Nothing: the bridge is only watched. The command that calibrates its glove.
    None(Option<Command>),
}

impl Hands {
    /// `keys`: they can be pressed; `drives`: they do something.
    pub(super) fn of(keys: bool, drives: bool, devices: &Devices) -> Self {
        match (keys, drives) {
            (true, true) => Self::Keys(Bindings::load()),
            (false, true) => Self::Options,
            (_, false) => Self::None(devices.bridge("bridge calibrate")),
        }
    }

    /// How a glove is calibrated from here, and how the clutch is opened before it.
    fn calibrate(&self, closed: bool) -> String {
        match (self, closed) {
            (Self::Keys(keys), false) => format!(
                "lay the hand flat and still, press {}",
                Bindings::name(keys.calibrate)
            ),
            (Self::Keys(keys), true) => format!(
                "open the clutch ({}), lay the hand flat and still, press {}",
                Bindings::name(keys.clutch),
                Bindings::name(keys.calibrate)
            ),
            (Self::Options, _) => {
                "the same with --calibrate-flat, the hand flat and still".to_owned()
            }
            (Self::Profile(command), _) => {
                format!("there is no profile of this glove: `{command}` makes one")
            }
            (Self::None(Some(command)), _) => format!("`{command}` does it"),
            (Self::None(None), _) => "whoever drives calibrates it".to_owned(),
        }
    }

    /// How a gripper that lost its activation is activated from here.
    fn activate(&self) -> String {
        match self {
            Self::None(_) => "whoever drives does it".to_owned(),
            Self::Keys(keys) => format!(
                "end this ({}) and start it again with --activate: its fingers move",
                Bindings::name(keys.end)
            ),
            Self::Options | Self::Profile(_) => {
                "the same again with --activate: its fingers move".to_owned()
            }
        }
    }

    fn open(&self) -> String {
        match self {
            Self::Keys(keys) => format!("open the clutch ({})", Bindings::name(keys.clutch)),
            Self::Options | Self::Profile(_) | Self::None(_) => "open the clutch".to_owned(),
        }
    }
}

/// What a glove without a calibration needs, and why the newest try was refused.
fn not_calibrated(snapshot: &Snapshot, hands: &Hands) -> Option<String> {
    let closed = matches!(snapshot.clutch, Position::Closed | Position::Lost);
    let calibrate = hands.calibrate(closed);
    match snapshot.calibration.newest {
        _ if !snapshot.lacks_calibration() => None,
        // Said below.
        Try::Waiting => None,
        Try::Refused(why) if why != Refusal::Engaged => {
            Some(format!("not calibrated: {why}; {calibrate}"))
        }
        _ => Some(format!("not calibrated: {calibrate}")),
    }
}

/// What is wrong now and stays so.
fn standing(snapshot: &Snapshot, hands: &Hands) -> Vec<String> {
    let mut faults = Vec::new();
    match snapshot.state {
        State::Holding(HoldReason::NotCalibrated) if snapshot.lacks_calibration() => {
            faults.extend(not_calibrated(snapshot, hands).map(|what| format!("held: {what}")));
        }
        State::Holding(reason) | State::SafeAction(reason) => {
            faults.push(format!("held: {reason}"));
        }
        // No key activates: the fingers move.
        State::Faulted(GripperFault::ActivationLost(_)) => {
            faults.push(format!("{}: {}", snapshot.state, hands.activate()))
        }
        State::Faulted(_) => faults.push(format!(
            "{}: mend it, {}, and close the clutch again",
            snapshot.state,
            hands.open()
        )),
        State::Idle | State::Blending | State::Following => {
            faults.extend(not_calibrated(snapshot, hands));
        }
    }
    if snapshot.calibration.newest == Try::Waiting {
        faults.push(Kind::Calibration(Try::Waiting).to_string());
    }
    faults.extend(snapshot.unused_sensors());
    faults.extend(unsure(snapshot));
    if snapshot.on_chip {
        // Of a bridge on a chip no events come.
        let silent = |answers: bool, what: &str| (!answers).then(|| what.to_owned());
        faults.extend(silent(snapshot.glove_answers, "the glove sends no frames"));
        faults.extend(silent(
            snapshot.gripper_answers,
            "the gripper does not answer",
        ));
    }
    if let Some(axis) = snapshot.stands {
        let kind = Kind::AxisStands { axis };
        faults.push(kind.to_string());
    }
    if let Some(status) = &snapshot.status {
        if status.fault != host::gripper::Fault::None {
            faults.push(words::fault(status.fault));
        }
        if status.activation != Activation::Ready {
            faults.push(format!(
                "the gripper is {}",
                words::activation(status.activation)
            ));
        }
    }
    faults
}

/// The joints that are held because their heading is not sure enough; while the glove is calibrated at all.
fn unsure(snapshot: &Snapshot) -> Option<String> {
    let headings = snapshot
        .headings
        .filter(|_| !snapshot.lacks_calibration())?;
    let named = |mask: u16| -> Vec<&str> {
        let held = (0..SEGMENT_COUNT).filter(|k| mask >> k & 1 == 1);
        held.map(|k| SEGMENT_NAMES[k]).collect()
    };
    let degraded = named(headings.degraded & !headings.unknown);
    (!degraded.is_empty()).then(|| {
        format!(
            "held, their heading is not sure enough: the joints at {}; a flat hand mends it",
            degraded.join(", ")
        )
    })
}

/// The fingers of the hand.
pub(super) fn fingers(snapshot: &Snapshot) -> Vec<Finger> {
    let good: [bool; SEGMENT_COUNT] = core::array::from_fn(|segment| {
        let unused = snapshot.distrusted | snapshot.impossible;
        is_good(snapshot, segment) && unused >> segment & 1 == 0
    });
    let good = words::fingers_good(&good);
    words::FINGER_NAMES
        .iter()
        .enumerate()
        .map(|(finger, name)| Finger {
            name,
            angles: core::array::from_fn(|joint| snapshot.angles[5 * finger + joint]),
            limits: core::array::from_fn(|joint| LIMITS[5 * finger + joint]),
            good: good[finger],
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use host::bridge::calibration::CalibrationState;
    use host::gripper::Instant as Time;

    /// Of a bridge with devices that work, whose glove is not calibrated.
    fn uncalibrated(clutch: Position, state: State) -> Snapshot {
        Snapshot {
            glove_baud: None,
            now: Time::from_ticks(0),
            state,
            clutch,
            calibration: CalibrationState::default(),
            calibration_known: true,
            profile: None,
            headings: None,
            ids: [None; SEGMENT_COUNT],
            frame_sequence: 1,
            on_chip: false,
            frame: None,
            sensors: None,
            angles: [0.0; host::glove::hand::JOINT_COUNT],
            angles_valid: true,
            distrusted: 0,
            impossible: 0,
            command: None,
            sent: None,
            status: None,
            stands: None,
            glove_answers: true,
            gripper_answers: true,
            line: None,
            late_steps: 0,
        }
    }

    #[test]
    fn a_glove_that_is_not_calibrated_is_said_with_what_this_person_can_do() {
        let chip = Devices::Chip("/dev/ttyACM0".parse().unwrap());
        let idle = uncalibrated(Position::Open, State::Idle);
        for (hands, words) in [
            (Hands::Keys(Bindings::default()), "press c"),
            (Hands::Options, "--calibrate-flat"),
            (
                Hands::of(true, false, &chip),
                "gauntlet bridge calibrate --bridge /dev/ttyACM0",
            ),
        ] {
            let told = standing(&idle, &hands).join("; ");
            assert!(
                told.starts_with("not calibrated: ") && told.contains(words),
                "{told}"
            );
        }
        let held = State::Holding(HoldReason::NotCalibrated);
        let told = standing(
            &uncalibrated(Position::Closed, held),
            &Hands::Keys(Bindings::default()),
        )
        .join("; ");
        assert!(told.contains("open the clutch (space)"), "{told}");
        let mut calibrated = idle;
        calibrated.calibration.is_calibrated = true;
        assert!(standing(&calibrated, &Hands::Keys(Bindings::default())).is_empty());
        // A bridge of an older version never says.
        let unknown = Snapshot {
            calibration_known: false,
            ..idle
        };
        assert!(standing(&unknown, &Hands::None(None)).is_empty());
    }

    #[test]
    fn why_a_try_was_refused_is_said_as_long_as_there_is_no_calibration() {
        let mut snapshot = uncalibrated(Position::Open, State::Idle);
        let refused = Try::Refused(Refusal::Moving {
            segment: 4,
            by: 0.3,
        });
        snapshot.calibration.newest = refused;
        let told = standing(&snapshot, &Hands::Keys(Bindings::default())).join("; ");
        assert!(
            told.contains("index_proximal") && told.contains("press c"),
            "{told}"
        );
        assert!(over(&Kind::Calibration(refused), &snapshot), "said twice");
        snapshot.calibration.is_calibrated = true;
        assert!(!over(&Kind::Calibration(refused), &snapshot));
    }
}
