//! `gauntlet bridge calibrate`: the flat hand is taken, or the newest one taken back.

use anyhow::Result;
use bridge::calibration::{Refusal, Try};
use bridge::protocol::message::Health;

use super::args::BridgeAt;
use super::drive::start;
use crate::results::{self, devices};
use crate::tell::Tell;
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::session::refused;

pub(super) fn calibrate(at: &BridgeAt, undo: bool, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(at.json);
    let mut link = at.connect()?;
    if undo {
        at.told(link.undo_calibration())?;
        let health = at.told(link.health())?;
        if let Try::Refused(why @ Refusal::NothingBefore) = health.calibration.newest {
            return Err(refused(why, &at.devices()).into());
        }
        tell.say(format_args!("the newest calibration was taken back"));
        if at.json {
            return results::print("bridge calibrate", devices::Calibrated { health: &health });
        }
        return Ok(());
    }
    // An older bridge is refused by name.
    let health = at.told(link.health())?;
    let mut run = start(link, None, at.devices(), interrupt)?;
    let taken = run.calibrate(&tell).and_then(|taken| match taken {
        true => Ok(()),
        false => Err(Failure::interrupted("before the hand was taken").into()),
    });
    let now = run.snapshot().map(|seen| seen.calibration);
    run.finish().judge_prepared(taken)?;
    if at.json {
        let calibration = now.unwrap_or(health.calibration);
        let health = Health {
            calibration,
            ..health
        };
        return results::print("bridge calibrate", devices::Calibrated { health: &health });
    }
    Ok(())
}
