//! `gauntlet gripper move`: to a position, until it is there, holds something, or the time is over.
//!
//! No axis is ever told to be more than [`LEAD`] counts from where it is, and every cycle tells it anew: a cut wire, a
//! killed program or a switched-off PC leaves the gripper at most that far from standing still.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use anyhow::Result;
use bridge::supervisor::limits;
use gripper::driver::Control;
use gripper::registers::Severity;
use gripper::{Activation, Contact, Motion, Status, space};

use super::bench::Bench;
use super::{Doing, Move, table};
use crate::failure::Failure;

/// Most counts a command may be from the measured position.
const LEAD: u8 = 40;
/// The slowest full stroke takes 7 s; one that needs longer is stuck.
const MOVE_WAIT: Duration = Duration::from_secs(15);
/// Without a status for this long the move is given up.
const SILENCE: Duration = Duration::from_secs(1);
/// For the hold after a move that did not end by itself: some fifty cycles.
const HOLD_WAIT: Duration = Duration::from_millis(500);
/// Statuses in a row that must say "standing" before the motion counts as over.
const CALM: u32 = 3;
/// The same for an axis that says it is where it was told to be, and is not: a software limit. Longer, because an axis
/// about to start looks like that.
const LIMIT_CALM: u32 = 30;

/// Which axes the numbers on the command line are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Axes {
    /// One number for each axis.
    Each,
    /// One number for all fingers; the scissor stays where the mode has it.
    Fingers,
    /// One number in scissor mode: the scissor's.
    Scissor,
}

impl Axes {
    fn control(self) -> Control {
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
    fn moves(self, axis: usize) -> bool {
        match self {
            Self::Each => true,
            Self::Fingers => axis != SCISSOR,
            Self::Scissor => axis == SCISSOR,
        }
    }

    /// Whether the gripper puts its scissor where the mode has it: it does so by itself when a scissor that was moved on
    /// its own is left to the mode again, and says that it changes its mode meanwhile.
    fn gives_the_scissor_back<const X: usize>(self, status: &Status<X>) -> bool {
        self != Self::Each && status.activation == Activation::ChangingMode
    }

    /// A position for each axis as the command block carries it: in scissor mode the scissor's goes where finger A's is.
    fn block<const X: usize>(self, mut position: [u8; X]) -> [u8; X] {
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

/// How a move ended.
enum End {
    /// Every axis stands where it should, or touches something.
    Stands,
    /// The gripper says why it does not move.
    Refused(Failure),
    /// No status came for [`SILENCE`].
    Silent,
}

/// Moves.
///
/// # Errors
/// A failure where the gripper cannot, or does not.
pub(super) fn run<B: Bench<X>, const X: usize>(
    doing: &mut Doing<'_, B>,
    options: &Move,
    status: &Status<X>,
) -> Result<()> {
    let target = positions::<X>(&options.to, doing.driver.names().0)?;
    may_move(status)?;
    let axes = match (options.to.len() == X, doing.driver.is_in_scissor_mode()) {
        (true, _) => Axes::Each,
        (false, false) => Axes::Fingers,
        (false, true) => Axes::Scissor,
    };
    doing.driver.set_control(axes.control());
    doing.tell.say(format_args!(
        "moving to {}, speed {}, force {}",
        words(&options.to),
        options.speed,
        options.force
    ));
    let mut newest = *status;
    let written = doing.driver.counters().writes;
    let ended = approach(doing, options, axes, target, &mut newest);
    doing.driver.set_motion(None, doing.waiter.clock.now());
    match ended {
        Some(End::Stands) => {
            let (_, names) = doing.driver.names();
            for (axis, name) in names.iter().enumerate() {
                let (here, there) = (newest.position[axis], target[axis]);
                let limited = newest.contact[axis] == Contact::AtPosition && axes.moves(axis);
                if limited && here.abs_diff(there) > table::LIMITS {
                    doing.tell.say(format_args!(
                        "{name} stands at {here} and goes no further towards {there}: its software limit lies there"
                    ));
                }
            }
            Ok(())
        }
        Some(End::Refused(failure)) => {
            // The last command may lie ahead of the axes still.
            if newest.activation == Activation::Ready {
                hold(doing, &newest, options, axes);
            }
            Err(failure.into())
        }
        Some(End::Silent) => Err(unsure("the gripper stopped answering during the move").into()),
        None => {
            let interrupted = doing.waiter.interrupt.asked();
            if doing.driver.counters().writes == written {
                let what = "interrupted before the gripper was told to move";
                return Err(Failure::new(what, "the same again").into());
            }
            if newest.activation == Activation::ChangingMode {
                let what = "the gripper is still putting its scissor where its mode has it, which no command stops";
                return Err(unsure(what).into());
            }
            let why = if interrupted {
                "interrupted".to_owned()
            } else {
                let seconds = MOVE_WAIT.as_secs();
                format!("the gripper was not there {seconds} s after it was told to move")
            };
            Err(if !hold(doing, &newest, options, axes) {
                unsure(&format!("{why}; the hold was not confirmed"))
            } else if interrupted {
                let what = "interrupted: the gripper is held where it is";
                Failure::new(what, "`gauntlet gripper status`")
            } else {
                let what = format!("{why}; it is held where it is");
                Failure::new(what, "`gauntlet doctor --gripper …`")
            }
            .into())
        }
    }
}

/// Leads the gripper to `target`; `None` when the time is over or the end was asked for.
fn approach<B: Bench<X>, const X: usize>(
    doing: &mut Doing<'_, B>,
    options: &Move,
    axes: Axes,
    target: [u8; X],
    newest: &mut Status<X>,
) -> Option<End> {
    let waiter = doing.waiter.clone();
    let (mut calm, mut heard_at) = (0, Instant::now());
    let mut command = next_command(target, newest, axes);
    let mut limited = Limited::new(newest, &command);
    waiter.pump(&mut doing.driver, MOVE_WAIT, |driver, now, heard| {
        if let Some(Ok(status)) = heard {
            (*newest, heard_at) = (status, Instant::now());
            if !axes.gives_the_scissor_back(&status)
                && let Err(failure) = may_move(&status)
            {
                return ControlFlow::Break(End::Refused(failure));
            }
            limited.note(&status, &command, driver.accepted());
            let stands = |axis: usize| match status.contact[axis] {
                Contact::Moving => false,
                Contact::AtPosition => command[axis] == target[axis] || limited.is_at_limit(axis),
                Contact::ContactOpening | Contact::ContactClosing => true,
            };
            let all = (0..X).filter(|axis| axes.moves(*axis)).all(stands);
            let ready = status.activation == Activation::Ready;
            calm = if driver.accepted() && ready && all {
                calm + 1
            } else {
                0
            };
            if calm >= CALM {
                return ControlFlow::Break(End::Stands);
            }
            command = next_command(target, &status, axes);
        } else if heard_at.elapsed() >= SILENCE {
            return ControlFlow::Break(End::Silent);
        }
        driver.set_motion(Some(motion(axes.block(command), options)), now);
        ControlFlow::Continue(())
    })
}

/// For how many statuses in a row each axis has stood short of what it was told, saying that it is there.
struct Limited<const X: usize> {
    position: [u8; X],
    told: [u8; X],
    calm: [u32; X],
}

impl<const X: usize> Limited<X> {
    fn new(status: &Status<X>, command: &[u8; X]) -> Self {
        Self {
            position: status.position,
            told: *command,
            calm: [0; X],
        }
    }

    /// `accepted`: the gripper repeats this command; before that its contacts speak of an earlier one. An axis told
    /// something else has its time to start again: it may have waited for the scissor until now.
    fn note(&mut self, status: &Status<X>, command: &[u8; X], accepted: bool) {
        for (axis, told) in command.iter().enumerate() {
            let here = status.position[axis];
            let short = status.contact[axis] == Contact::AtPosition
                && here != *told
                && here == self.position[axis]
                && *told == self.told[axis];
            self.calm[axis] = match accepted && short {
                true => self.calm[axis].saturating_add(1),
                false => 0,
            };
            (self.position[axis], self.told[axis]) = (here, *told);
        }
    }

    fn is_at_limit(&self, axis: usize) -> bool {
        self.calm.get(axis).is_some_and(|calm| *calm >= LIMIT_CALM)
    }
}

/// The next position to ask for: towards `target`, at most [`LEAD`] from where each axis is, and such that no finger can
/// meet the scissor on the way.
fn next_command<const X: usize>(target: [u8; X], status: &Status<X>, axes: Axes) -> [u8; X] {
    let wanted = core::array::from_fn(|axis| {
        let here = status.position[axis];
        if axes.moves(axis) {
            target[axis].clamp(here.saturating_sub(LEAD), here.saturating_add(LEAD))
        } else {
            here
        }
    });
    match axes {
        Axes::Each => {
            // By now it may be as far as what it was told before.
            let ceiling = core::array::from_fn(|axis| status.position[axis].max(status.echo[axis]));
            limits::keep_inside(wanted, &ceiling, &status.position, &target.map(f32::from))
        }
        // The mode keeps fingers and scissor apart.
        Axes::Fingers | Axes::Scissor => wanted,
    }
}

fn motion<const X: usize>(position: [u8; X], options: &Move) -> Motion<X> {
    Motion {
        position,
        speed: [options.speed; X],
        force: [options.force; X],
    }
}

/// Nobody can say what the gripper does; how far it may go is known.
fn unsure(what: &str) -> Failure {
    Failure::new(
        what,
        format!(
            "look at the gripper: an axis comes to rest at most {LEAD} counts from where it was; in danger switch off its \
             24 V supply; then `gauntlet doctor --gripper …`"
        ),
    )
}

/// Tells the gripper to stay where it is; whether it confirmed that. The Ctrl-C that led here must not cut this wait
/// short, so it does not look at it.
fn hold<B: Bench<X>, const X: usize>(
    doing: &mut Doing<'_, B>,
    status: &Status<X>,
    options: &Move,
    axes: Axes,
) -> bool {
    let motion = motion(axes.block(status.hold()), options);
    let written = doing.driver.counters().writes;
    let end = Instant::now() + HOLD_WAIT;
    let held = |driver: &B| driver.counters().writes != written && driver.accepted();
    while Instant::now() < end && !held(&doing.driver) {
        let now = doing.waiter.clock.now();
        doing.driver.set_motion(Some(motion), now);
        // Whatever it says: the time is bounded, and there is nothing else to do.
        let _ = doing.driver.poll(now);
        std::thread::sleep(Duration::from_millis(1));
    }
    doing.driver.set_motion(None, doing.waiter.clock.now());
    held(&doing.driver)
}

/// The numbers on the command line as one position an axis.
fn positions<const X: usize>(to: &[u8], name: &str) -> Result<[u8; X], Failure> {
    if let [all] = to {
        return Ok([*all; X]);
    }
    let Ok(position) = <[u8; X]>::try_from(to) else {
        return Err(Failure::usage(
            format!("--to {}: {} numbers for a {name}", words(to), to.len()),
            if X == 1 {
                "one number"
            } else {
                "one number for all fingers, or four: A,B,C,SCISSOR"
            },
        ));
    };
    if let Ok(hand) = <[u8; space::AXES]>::try_from(to)
        && !space::contains_counts(&hand)
    {
        let near = space::nearest(&hand.map(f32::from)).map(|count| count as u8);
        return Err(Failure::usage(
            format!("--to {}: there fingers and scissor meet", words(to)),
            format!("--to {} (the nearest where they do not)", words(&near)),
        ));
    }
    Ok(position)
}

fn may_move<const X: usize>(status: &Status<X>) -> Result<(), Failure> {
    if status.fault.severity() == Severity::Major || status.fault == gripper::Fault::Releasing {
        return Err(Failure::new(
            format!(
                "it cannot move: fault {:02X}: {}",
                status.fault.code(),
                status.fault.sentence()
            ),
            status.fault.action(),
        ));
    }
    match status.activation {
        Activation::Ready => Ok(()),
        Activation::Reset => Err(Failure::new(
            "it cannot move: the gripper is not activated",
            "`gauntlet gripper activate`: the fingers move through their whole range",
        )),
        Activation::Activating | Activation::ChangingMode => Err(Failure::new(
            "it cannot move: the gripper is busy activating or changing its mode",
            "again in a few seconds",
        )),
    }
}

fn words(positions: &[u8]) -> String {
    let numbers: Vec<String> = positions.iter().map(u8::to_string).collect();
    numbers.join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status<const X: usize>(position: [u8; X]) -> Status<X> {
        Status {
            stamp: gripper::Instant::from_ticks(0),
            activation: Activation::Ready,
            going_to: true,
            contact: [Contact::AtPosition; X],
            echo: position,
            position,
            current: [0; X],
            fault: gripper::Fault::None,
        }
    }

    #[test]
    fn no_command_is_more_than_forty_counts_from_where_an_axis_is() {
        for here in 0..=255 {
            for target in 0..=255 {
                let [next] = next_command([target], &status([here]), Axes::Each);
                assert!(next.abs_diff(here) <= LEAD);
                assert!(next.abs_diff(target) <= here.abs_diff(target));
                assert!(next != here || here == target);
            }
        }
        let next = next_command([250; 4], &status([10, 20, 30, 137]), Axes::Fingers);
        assert_eq!(next, [50, 60, 70, 137]);
        let next = next_command([250; 4], &status([10, 20, 30, 137]), Axes::Scissor);
        assert_eq!(Axes::Scissor.block(next), [177, 20, 30, 177]);
    }

    #[test]
    fn an_axis_that_says_it_is_there_and_is_not_is_at_its_limit_only_after_a_while() {
        let mut limited = Limited::new(&status([150]), &[190]);
        for _ in 1..LIMIT_CALM {
            limited.note(&status([150]), &[190], true);
        }
        assert!(!limited.is_at_limit(0));
        limited.note(&status([150]), &[190], true);
        assert!(limited.is_at_limit(0));
        // It stood a count short while the scissor was in its way, and may go on only now.
        let mut waiting = Limited::new(&status([150]), &[151]);
        (0..=LIMIT_CALM).for_each(|_| waiting.note(&status([150]), &[151], true));
        assert!(waiting.is_at_limit(0));
        waiting.note(&status([150]), &[190], true);
        assert!(!waiting.is_at_limit(0));
        // Not accepted, on its way, touching something, or where it was told to be: no limit.
        let mut moving = status([150]);
        moving.contact = [Contact::Moving];
        let mut touching = status([150]);
        touching.contact = [Contact::ContactClosing];
        for (status, command, accepted) in [
            (status([150]), [190], false),
            (status([151]), [191], true),
            (moving, [190], true),
            (touching, [190], true),
            (status([150]), [150], true),
        ] {
            limited.note(&status, &command, accepted);
            assert!(!limited.is_at_limit(0));
            for _ in 0..LIMIT_CALM {
                limited.note(&super::tests::status([150]), &[190], true);
            }
        }
    }

    #[test]
    fn a_way_that_ends_where_fingers_and_scissor_are_apart_never_leads_through_where_they_meet() {
        // The scissor is closed and must open before the fingers may close.
        let (mut here, target) = ([20, 20, 20, 230], [250, 250, 250, 100]);
        for _ in 0..200 {
            let next = next_command(target, &status(here), Axes::Each);
            let corner = core::array::from_fn(|axis| next[axis].max(here[axis]));
            assert!(space::contains_counts(&corner), "{here:?} {next:?}");
            // The fingers are the faster ones.
            for (axis, speed) in [9, 7, 8, 2].into_iter().enumerate() {
                here[axis] = next[axis].clamp(
                    here[axis].saturating_sub(speed),
                    here[axis].saturating_add(speed),
                );
            }
        }
        assert_eq!(here, target);
    }

    #[test]
    fn one_number_is_for_all_and_four_are_checked_for_interference() {
        assert_eq!(positions::<4>(&[9], "").ok(), Some([9; 4]));
        assert_eq!(positions::<4>(&[1, 2, 3, 4], "").ok(), Some([1, 2, 3, 4]));
        assert!(positions::<4>(&[1, 2], "").is_err());
        assert!(positions::<1>(&[1, 2, 3, 4], "").is_err());
        let refused = positions::<4>(&[200, 200, 200, 200], "").unwrap_err();
        assert_eq!(refused.exit_code(), crate::failure::EXIT_USAGE);
        let near: Vec<u8> = refused.next_step()[5..]
            .split_once(" (")
            .unwrap()
            .0
            .split(',')
            .map(|n| n.parse().unwrap())
            .collect();
        assert!(positions::<4>(&near, "").is_ok(), "{near:?}");
    }
}
