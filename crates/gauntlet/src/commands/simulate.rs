//! `gauntlet simulate`: virtual devices behind pseudo-terminals, for any program that speaks to the real ones.

use std::path::Path;
use std::time::Duration;

use anyhow::Result;
use rig::Device;
use rig::glove::VirtualGlove;
use rig::gripper::VirtualGripper;
use rig::pty::{Handle, PtyDevice};

use crate::cli::Simulate;
use crate::failure::Failure;
use crate::interrupt::Interrupt;
use crate::port::BAUD;
use crate::poses::Motion;
use crate::{probe, realtime, say};

/// How often the wait for Ctrl-C looks around.
const WATCH: Duration = Duration::from_secs(3600);

/// Runs until interrupted.
///
/// # Errors
/// A failure where a link cannot be made or a device does not answer.
pub(super) fn run(options: &Simulate, interrupt: &Interrupt) -> Result<()> {
    let motion = Motion::open(options.poses.as_deref(), options.seed)?;
    let mut devices = Vec::new();
    if let Some(path) = &options.glove {
        let device = glove(&motion, path)?;
        say!(
            "glove    {}  {BAUD} baud, {}",
            path.display(),
            motion.describe()
        );
        devices.push(device);
    }
    if let Some(path) = &options.gripper {
        let device = gripper(path)?;
        say!("gripper  {}  {BAUD} baud, unit 9", path.display());
        devices.push(device);
    }
    if let Some(path) = &options.glove {
        probe::open_glove(path, interrupt)?;
    }
    if let Some(path) = &options.gripper {
        probe::open_gripper(path, interrupt)?;
    }
    if !interrupt.asked() {
        say!("ready");
    }
    while !interrupt.sleep(WATCH) {}
    // Taking the handles down removes the links.
    drop(devices);
    Ok(())
}

/// A virtual glove behind a pseudo-terminal that `link` leads to.
pub(super) fn glove(motion: &Motion, link: &Path) -> Result<Handle> {
    let device = VirtualGlove::new(motion.source(), rig::glove::Config::at_baud(BAUD));
    spawn(Box::new(device), link)
}

/// A virtual gripper, not activated, behind a pseudo-terminal that `link` leads to.
pub(super) fn gripper(link: &Path) -> Result<Handle> {
    let device = VirtualGripper::new(rig::gripper::Config::default());
    spawn(Box::new(device), link)
}

fn spawn(device: Box<dyn Device>, link: &Path) -> Result<Handle> {
    let spawned = realtime::starting(|| PtyDevice::spawn(device, Some(link)));
    spawned.and_then(|(handle, _)| handle).map_err(|error| {
        // The rig's texts end with the next step after their last colon.
        let text = error.to_string();
        let (what, next) = text.rsplit_once(": ").unwrap_or((
            &text,
            "a path that does not exist yet, in a folder that you may write to",
        ));
        Failure::new(format!("no virtual device there: {what}"), next).into()
    })
}
