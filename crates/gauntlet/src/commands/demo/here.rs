//! The demo with the bridge in this process.

use std::time::Duration;

use anyhow::Result;
use host::glove::hand::Side;

use super::args::Demo;
use super::parts::{self, Stage, Started, Virtual};
use super::person;
use crate::progress::Person;
use crate::run::{LogTo, Run};
use host::clock::Clock;
use host::failure::Failure;
use host::lines::Model;
use host::lines::port::BAUD;
use host::next::Command;
use host::probe;
use host::recording::Drawn;
use host::session::record::Feed;
use host::session::{Devices, InProcess, Parts};
use host::training::model;

/// Whether there can be such a demo.
///
/// # Errors
/// A failure of usage: a gripper that has no network variant.
pub(super) fn check(options: &Demo) -> Result<()> {
    let model = options.gripper_model;
    if !options.gripper_tcp || model == Model::ThreeFinger {
        return Ok(());
    }
    Err(Failure::usage(
        format!(
            "--gripper-tcp: only the 3-Finger gripper speaks Modbus TCP, not the {}",
            model.name()
        ),
        Command::gauntlet("demo").option("--gripper-model", model.option()),
    )
    .into())
}

/// Starts the devices, calibrates, trains, and starts the bridge between them.
///
/// # Errors
/// A failure that says which of its steps did not succeed.
pub(super) fn start(stage: Stage<'_>) -> Result<Started> {
    let Stage {
        options,
        tell,
        interrupt,
        ..
    } = stage;
    let clock = Clock::start();
    stage.introduce("everything between them is real");
    let devices = Virtual::start(stage)?;
    let profile = person::profile(stage, &devices)?;
    let outcome = parts::trained(stage)?;
    let image = model::image(&outcome.model)?;
    let length = image.len();
    let model = options.gripper_model;
    let log = options.log.clone();
    let drawn = Drawn {
        side: Side::Right,
        gripper: model.kinematics(),
    };
    let (log, feed) = log.map(|path| LogTo::new(path, drawn)).unzip();
    let parts = opened(stage, &devices, image, feed)?;
    let session = InProcess::start(parts, clock, interrupt)?;
    tell.say(format_args!(
        "weights    an image of {length} bytes is stored and checked in the bridge's weights store"
    ));
    let run = Run::new(session, log, clock, interrupt.clone(), Devices::Unknown);
    let (run, person) = parts::worn(run, profile, &devices);
    Ok(Started {
        run,
        outcome,
        person,
        drives: None,
        flashed: None,
        home: Box::new(devices),
        framed: |seen| seen.frame_sequence > 0,
        frame_wait: Duration::from_secs(15),
    })
}

/// Opens the ports to both devices.
fn opened(
    stage: Stage<'_>,
    devices: &Virtual,
    image: Vec<u8>,
    feed: Option<Feed>,
) -> Result<Parts> {
    let Stage {
        options,
        tell,
        interrupt,
        ..
    } = stage;
    let model = options.gripper_model;
    let (glove, gripper) = (devices.glove_port.path(), devices.gripper_place.as_path());
    let speaks = match options.gripper_tcp {
        true => "Modbus TCP".to_owned(),
        false => format!("{BAUD} baud"),
    };
    tell.say(format_args!(
        "devices    virtual glove on {}, to be raised to {} baud, virtual gripper on {}, {speaks}",
        glove.display(),
        options.reading.glove_baud,
        gripper.display()
    ));
    let (gripper, _) = probe::open_gripper(gripper, model, &Person, interrupt)?;
    Ok(Parts {
        glove: probe::open_glove(glove, interrupt)?.port.into(),
        reading: options.reading.given(),
        gripper,
        model,
        line: host::lines::Settings::default(),
        image,
        side: Side::Right,
        profile: None,
        driving: host::session::Driving::default(),
        feed,
    })
}
