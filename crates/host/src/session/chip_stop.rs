//! Opening the clutch of a bridge on a chip, and seeing that the gripper is held.

use std::time::{Duration, Instant};

use bridge::State;
use bridge::protocol::message::{Refusal, Status};
use gripper::Activation;

use super::stopped::{HOLD_WAIT, Standing, Stopped};
use crate::chip::link::{Error, HostLink};

/// Pause between two telemetry samples of a session, ms.
pub const SAMPLE_MS: u16 = 50;
/// Between two looks.
const PAUSE: Duration = Duration::from_millis(30);
/// Statuses of the gripper that must have come since: one may have been under way, the next rests on the hold.
const STATUSES: u32 = 3;

/// What is known of a bridge from when it was last heard: one whose clock reads less, or that counts fewer commands, has started
/// anew, and knows nothing of what it commanded.
#[derive(Debug, Clone, Copy)]
pub(super) struct Known {
    /// Its clock, µs since it started.
    pub us: u64,
    /// Commands that left.
    pub commands: u32,
    /// This session told the gripper to activate, and it has not followed the hand since.
    pub activation_asked: bool,
    /// What the gripper said last of its activation.
    pub activation: Option<Activation>,
}

impl Known {
    /// Whether an activation may go on, as a bridge in this process judges it: it was asked for, and the gripper did not say
    /// since that it is ready; or it says itself that one goes on, whoever asked for it.
    fn is_activating(&self, status: &Status) -> bool {
        let said = status.gripper.as_ref().map(|gripper| gripper.activation);
        let ready = said.or(self.activation) == Some(Activation::Ready);
        (self.activation_asked && !ready) || said == Some(Activation::Activating)
    }
}

/// Opens the clutch and waits until the gripper has confirmed the hold, or the wait is over. Needs telemetry to be on.
pub(super) fn stop(link: &mut HostLink, known: Known) -> Stopped {
    match confirmed(link, known) {
        Ok(stopped) => stopped,
        Err(_) => Stopped::Unheard,
    }
}

/// Asks; where this program stood still for so long that the bridge ended its session, in a new one.
fn ask<T>(
    link: &mut HostLink,
    call: impl Fn(&mut HostLink) -> Result<T, Error>,
) -> Result<T, Error> {
    match call(link) {
        Err(Error::Refused(Refusal::NoSession)) => {
            renew(link)?;
            call(link)
        }
        answer => answer,
    }
}

/// Begins a session anew, with telemetry.
pub(super) fn renew(link: &mut HostLink) -> Result<(), Error> {
    link.renew()?;
    link.telemetry(SAMPLE_MS)
}

fn confirmed(link: &mut HostLink, known: Known) -> Result<Stopped, Error> {
    // Obeyed without a session, too.
    let released_us = link.release()?.now_us;
    let at_release = ask(link, HostLink::counters)?;
    if released_us < known.us || at_release.commands < known.commands {
        return Ok(Stopped::Restarted);
    }
    if at_release.commands == 0 {
        let status = ask(link, HostLink::status)?;
        if status.now_us < released_us {
            return Ok(Stopped::Restarted);
        }
        return Ok(match known.is_activating(&status) {
            true => Stopped::Activating,
            false => Stopped::Untouched,
        });
    }
    let end = Instant::now() + Duration::from_micros(HOLD_WAIT.as_micros());
    let mut command = None;
    let mut standing = Standing::default();
    loop {
        for sample in link.listen(PAUSE)? {
            // What the gripper is told now that the clutch is open.
            let now = sample.state == State::Idle && sample.now_us > released_us;
            command = now.then_some(sample.command);
        }
        let status = ask(link, HostLink::status)?;
        if status.now_us < released_us {
            return Ok(Stopped::Restarted);
        }
        if known.activation_asked && known.is_activating(&status) {
            return Ok(Stopped::Activating);
        }
        let counters = link.counters()?;
        let answered = counters.statuses.wrapping_sub(at_release.statuses) >= STATUSES;
        if let (Some(gripper), State::Idle, true) = (&status.gripper, status.state, answered) {
            if gripper.activation == Activation::Activating {
                return Ok(Stopped::Activating);
            }
            if command.as_ref() == Some(&gripper.echo) {
                return Ok(Stopped::Held);
            }
            let told_nothing = command.as_ref().is_some_and(|command| command.is_empty());
            if standing.look(counters.statuses, &gripper.position) && told_nothing {
                return Ok(Stopped::NothingWritten);
            }
        }
        if Instant::now() >= end {
            return Ok(Stopped::NotConfirmed);
        }
    }
}
