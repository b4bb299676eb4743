//! The demo with the bridge in this process.

use std::time::Duration;

use anyhow::Result;
use glove::hand::Side;
use rig::pty::Handle;

use super::parts::{self, Stage, Started};
use crate::progress::Person;
use crate::run::{LogTo, Run};
use crate::tell::Tell;
use host::clock::Clock;
use host::interrupt::Interrupt;
use host::lines::Model;
use host::lines::port::BAUD;
use host::probe;
use host::session::record::Feed;
use host::session::{Devices, InProcess, Parts};
use host::training::model;
use host::training::motion::Motion;

/// Trains, starts the devices, and the bridge between them.
///
/// # Errors
/// A failure that says which of its steps did not succeed.
pub(super) fn start(stage: Stage<'_>) -> Result<Started> {
    let Stage {
        options,
        motion,
        tell,
        interrupt,
    } = stage;
    let clock = Clock::start();
    stage.introduce("everything between them is real");
    let outcome = parts::trained(stage)?;
    let image = model::image(&outcome.model)?;
    let length = image.len();
    let model = options.gripper_model;
    let log = options.log.clone();
    let (log, feed) = log.map(|path| LogTo::new(path, model.axes())).unzip();
    let (devices, parts) = devices(motion, model, image, feed, tell, interrupt)?;
    let session = InProcess::start(parts, clock, interrupt)?;
    tell.say(format_args!(
        "weights    an image of {length} bytes is stored and checked in the bridge's weights store"
    ));
    Ok(Started {
        run: Run::new(session, log, clock, interrupt.clone(), Devices::Unknown),
        outcome,
        flashed: None,
        home: Box::new(devices),
        framed: |seen| seen.frame_sequence > 0,
        frame_wait: Duration::from_secs(15),
    })
}

/// Starts both devices and opens the ports to them.
fn devices(
    motion: &Motion,
    model: Model,
    image: Vec<u8>,
    feed: Option<Feed>,
    tell: &Tell,
    interrupt: &Interrupt,
) -> Result<([Handle; 2], Parts)> {
    let [glove, gripper] = parts::virtual_devices(motion, model)?;
    tell.say(format_args!(
        "devices    virtual glove on {}, virtual gripper on {}, {BAUD} baud",
        glove.path().display(),
        gripper.path().display()
    ));
    let (gripper_port, _) = probe::open_gripper(gripper.path(), model, &Person, interrupt)?;
    let parts = Parts {
        glove: probe::open_glove(glove.path(), interrupt)?.port,
        gripper: gripper_port,
        model,
        line: host::lines::Settings::default(),
        image,
        side: Side::Right,
        profile: None,
        feed,
    };
    Ok(([glove, gripper], parts))
}
