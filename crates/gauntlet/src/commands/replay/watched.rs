//! A replay with the view that the run had.

use anyhow::Result;

use crate::run::{Options, Run};
use host::clock::Clock;
use host::interrupt::Interrupt;
use host::recording::traced::Traced;
use host::replay::Same;
use host::session::{Devices, Replayed};

/// Shows the log at `speed` times its own pace.
///
/// # Errors
/// What ended it.
pub(super) fn run(traced: Traced, speed: f64, quiet: bool, interrupt: &Interrupt) -> Result<Same> {
    let clock = Clock::start();
    let session = Replayed::start(traced, speed, clock)?;
    let result = session.result();
    let mut run = Run::new(session, None, clock, interrupt.clone(), Devices::Unknown);
    let driven = run.drive(&Options {
        title: "gauntlet replay",
        seconds: None,
        engage: false,
        drives: false,
        quiet,
    });
    // Its end is the end of the log; how the gripper was left is no matter of a replay.
    let _ = run.finish();
    match result.take() {
        Some(same) => same,
        None => driven.and_then(|_| anyhow::bail!("the replay has no result")),
    }
}
