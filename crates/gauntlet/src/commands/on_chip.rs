//! `gauntlet demo --on-chip`: the demo with the bridge's ARM firmware in QEMU between the virtual devices.

use std::time::Duration;

use anyhow::Result;
use rig::pty::Handle;
use serde_json::json;

use super::{bridge, demo, flash};
use crate::cli::Demo;
use crate::progress::Person;
use crate::run::{End, Options, Run};
use crate::tell::Tell;
use crate::{out, reading};
use host::chip::emulator::{Emulator, Setup, find_firmware};
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::lines::Model;
use host::stats::seconds;
use host::training::model;
use host::training::motion::Motion;

/// The virtual sensors boot in 650 ms and are brought up within a few seconds.
const FRAME_WAIT: Duration = Duration::from_secs(20);

/// Runs the demo on the emulated chip.
///
/// # Errors
/// A failure that says which of its steps did not succeed.
pub(super) fn run(options: &Demo, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.json);
    let gripper_model = options.gripper_model;
    if gripper_model != Model::ThreeFinger {
        return Err(Failure::usage(
            format!(
                "--on-chip: the firmware is built for the 3-Finger gripper, not for the {}",
                gripper_model.name()
            ),
            format!("`gauntlet demo --gripper-model {}`", gripper_model.option()),
        )
        .into());
    }
    let motion = reading::ended_by(interrupt, "the recording", || {
        Motion::open_for_training(options.poses.as_deref(), options.seed, &Person)
    })?;
    // What is missing is said before the training, not after it.
    let firmware = find_firmware(options.firmware.as_deref())?;
    tell.say(format_args!(
        "gauntlet demo: glove and gripper are virtual, the bridge is its ARM firmware in QEMU"
    ));
    tell.say(format_args!("motion     {}", motion.describe()));
    let devices = demo::virtual_devices(&motion, gripper_model)?;
    let mut emulator = Emulator::new(Setup {
        firmware,
        glove: Some(devices[0].path().to_owned()),
        gripper: Some(devices[1].path().to_owned()),
        debugger: false,
    })?;
    let outcome = demo::trained(options, &motion, &tell, interrupt)?;
    let image = model::image(&outcome.model)?;
    let mut link = emulator.link_unless(interrupt)?;
    tell_parts(&devices, &emulator, &tell);
    let flashed = flash::flash(&mut link, &image, &tell, interrupt)?;
    let mut run = bridge::start(link, None, interrupt)?;
    let driven = drive(options, &mut run, &tell);
    let finished = run.finish();
    emulator.power_off();
    if finished.ending.is_none() {
        return finished.judge(driven).map(drop);
    }
    let moved = finished.summary.first_motion_s.is_some();
    if options.json {
        out::json(&json!({
            "motion": motion.describe(),
            "training_s": outcome.took.as_secs_f64(),
            "epochs": outcome.epochs,
            "pairs": outcome.pairs,
            "quality": outcome.quality,
            "flash": flashed,
            "gripper": finished.gripper(),
            "run": finished.summary,
        }))?;
    } else {
        finished.tell(&tell, "summary    ");
        tell.say(format_args!("map        {}", outcome.quality.line()));
    }
    match finished.judge(driven)? {
        End::Time => judge(moved),
        End::Asked => Ok(()),
    }
}

fn tell_parts(devices: &[Handle; 2], emulator: &Emulator, tell: &Tell) {
    tell.say(format_args!(
        "devices    virtual glove on {}, virtual gripper on {}",
        devices[0].path().display(),
        devices[1].path().display()
    ));
    tell.say(format_args!(
        "bridge     Cortex-M4F (mps2-an386), host protocol on {}",
        emulator.address()
    ));
}

/// Waits for frames, activates, engages.
fn drive(options: &Demo, run: &mut Run, tell: &Tell) -> Result<End> {
    let framed = run.wait(FRAME_WAIT, |seen| seen.glove_answers)?;
    if run.asked() {
        return Ok(End::Asked);
    }
    if !framed {
        return Err(Failure::new(
            format!(
                "the virtual glove sent no frame in {} s",
                FRAME_WAIT.as_secs()
            ),
            "the same on a machine with less to do",
        )
        .into());
    }
    if !run.calibrate(tell)? || !run.activate(tell)? {
        return Ok(End::Asked);
    }
    tell.say(format_args!(
        "engaged    the gripper follows the hand for {} (Ctrl-C holds it and ends)",
        seconds(options.seconds)
    ));
    run.drive(&Options {
        title: "gauntlet demo --on-chip",
        seconds: Some(options.seconds),
        engage: true,
        drives: true,
        quiet: options.json,
    })
}

/// A demo in which the gripper did not move has failed, whatever was printed.
fn judge(moved: bool) -> Result<()> {
    if moved {
        return Ok(());
    }
    Err(Failure::new(
        "the gripper did not move with the hand",
        "the same on a machine with less to do, without --json, whose lines say what held it",
    )
    .into())
}
