//! The demo with the bridge's ARM firmware in QEMU between the virtual devices.

use std::time::Duration;

use anyhow::Result;

use super::args::Demo;
use super::parts::{self, Stage, Started, Virtual};
use super::person;
use crate::commands::{bridge, flash};
use crate::tell::Tell;
use host::chip::emulator::{Emulator, Setup, find_firmware};
use host::failure::Failure;
use host::lines::Model;
use host::next::Command;
use host::session::Devices;
use host::training::model;

/// Whether there can be such a demo.
///
/// # Errors
/// A failure of usage: the firmware is for another gripper.
pub(super) fn check(options: &Demo) -> Result<()> {
    let model = options.gripper_model;
    if model == Model::ThreeFinger {
        return Ok(());
    }
    Err(Failure::usage(
        format!(
            "--on-chip: the firmware is built for the 3-Finger gripper, not for the {}",
            model.name()
        ),
        Command::gauntlet("demo").option("--gripper-model", model.option()),
    )
    .into())
}

/// Starts the devices and the emulated chip, trains, and flashes the map.
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
    // What is missing is said before the training, not after it.
    let firmware = find_firmware(options.firmware.as_deref())?;
    stage.introduce("the bridge is its ARM firmware in QEMU");
    let devices = Virtual::start(stage)?;
    let profile = person::profile(stage, &devices)?;
    let mut emulator = Emulator::new(Setup {
        firmware,
        glove: Some(devices.glove_port.path().to_owned()),
        gripper: Some(devices.gripper_place.clone()),
        debugger: false,
    })?;
    let outcome = parts::trained(stage)?;
    let image = model::image(&outcome.model)?;
    let mut link = emulator.link_unless(interrupt)?;
    tell_parts(&devices, &emulator, tell);
    let flashed = flash::flash(&mut link, &image, tell, interrupt)?;
    // The emulated chip is gone when somebody could look at it.
    let run = bridge::start(link, None, Devices::Unknown, interrupt)?;
    let (run, person) = parts::worn(run, profile, &devices);
    if person.is_some() {
        tell.say(format_args!("profile    goes into the chip's store"));
    }
    Ok(Started {
        run,
        outcome,
        person,
        drives: None,
        flashed: Some(flashed),
        home: Box::new((emulator, devices)),
        framed: |seen| seen.glove_answers,
        frame_wait: Duration::from_secs(20),
    })
}

fn tell_parts(devices: &Virtual, emulator: &Emulator, tell: &Tell) {
    tell.say(format_args!(
        "devices    virtual glove on {}, virtual gripper on {}",
        devices.glove_port.path().display(),
        devices.gripper_place.display()
    ));
    tell.say(format_args!(
        "bridge     Cortex-M4F (mps2-an386), host protocol on {}",
        emulator.address()
    ));
}
