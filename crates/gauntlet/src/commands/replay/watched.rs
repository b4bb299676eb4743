//! A replay with the view that the run had.

use anyhow::Result;

use crate::run::{Options, Run, drawn};
use crate::web::Page;
use host::clock::Clock;
use host::interrupt::Interrupt;
use host::recording::traced::Traced;
use host::replay::Same;
use host::session::{Devices, Replayed};

/// How it is shown.
pub(super) struct Shown {
    /// Times the log's own pace.
    pub speed: f64,
    /// Whether the terminal shows nothing.
    pub quiet: bool,
    /// In a browser, too.
    pub page: Option<Page>,
}

/// Shows the log.
///
/// # Errors
/// What ended it.
pub(super) fn run(traced: Traced, shown: Shown, interrupt: &Interrupt) -> Result<Same> {
    let clock = Clock::start();
    let model = drawn(traced.model);
    let side = traced.profile.as_ref().map(|bound| bound.profile.side);
    let session = Replayed::start(traced, shown.speed, clock)?;
    let result = session.result();
    let mut run = Run::new(session, None, clock, interrupt.clone(), Devices::Unknown);
    if let Some(side) = side {
        run.is_hand(side);
    }
    run.shows(shown.page, Some(model));
    let driven = run.drive(&Options {
        title: "gauntlet replay",
        seconds: None,
        engage: false,
        drives: false,
        quiet: shown.quiet,
    });
    // Its end is the end of the log; how the gripper was left is no matter of a replay.
    let _ = run.finish();
    match result.take() {
        Some(same) => same,
        None => driven.and_then(|_| anyhow::bail!("the replay has no result")),
    }
}
