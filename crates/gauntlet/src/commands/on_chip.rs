//! `gauntlet demo --on-chip`: the demo with the bridge's ARM firmware in QEMU between the virtual devices.

use std::time::{Duration, Instant};

use anyhow::Result;
use rig::pty::Handle;
use serde_json::json;

use super::{bridge, demo, flash};
use crate::chip::{Options, Watch, Watched};
use crate::cli::Demo;
use crate::progress::Person;
use crate::run::End;
use crate::tell::Tell;
use crate::{out, reading};
use host::chip::emulator::{Emulator, Setup, find_firmware};
use host::chip::link::HostLink;
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::stats::seconds;
use host::training::model;
use host::training::motion::Motion;

/// The virtual sensors boot in 650 ms and are brought up within a few seconds.
const FRAME_WAIT: Duration = Duration::from_secs(20);
const PAUSE: Duration = Duration::from_millis(100);

/// Runs the demo on the emulated chip.
///
/// # Errors
/// A failure that says which of its steps did not succeed.
pub(super) fn run(options: &Demo, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.json);
    let motion = reading::ended_by(interrupt, "the recording", || {
        Motion::open_for_training(options.poses.as_deref(), options.seed, &Person)
    })?;
    // What is missing is said before the training, not after it.
    let firmware = find_firmware(options.firmware.as_deref())?;
    tell.say(format_args!(
        "gauntlet demo: glove and gripper are virtual, the bridge is its ARM firmware in QEMU"
    ));
    tell.say(format_args!("motion     {}", motion.describe()));
    let devices = demo::virtual_devices(&motion)?;
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
    let driven = drive(options, &mut link, &tell, interrupt)?;
    emulator.power_off();
    let Some(watched) = driven else {
        return Ok(());
    };
    let moved = watched.summary.first_motion_s.is_some();
    if options.json {
        out::json(&json!({
            "motion": motion.describe(),
            "training_s": outcome.took.as_secs_f64(),
            "epochs": outcome.epochs,
            "pairs": outcome.pairs,
            "quality": outcome.quality,
            "flash": flashed,
            "gripper": watched.stopped,
            "run": watched.summary,
        }))?;
    } else {
        if let Some(left) = watched.left() {
            tell.say(format_args!("summary    {left}"));
        }
        watched
            .summary
            .lines()
            .iter()
            .for_each(|line| tell.say(format_args!("{line}")));
        tell.say(format_args!("map        {}", outcome.quality.line()));
    }
    match watched.judge()? {
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

/// Waits for frames, activates, engages. `None` when somebody asked for the end before.
fn drive(
    options: &Demo,
    link: &mut HostLink,
    tell: &Tell,
    interrupt: &Interrupt,
) -> Result<Option<Watched>> {
    if !wait_for_frames(link, interrupt)?
        || !bridge::calibrated(link, tell, interrupt)?
        || !bridge::activated(link, tell, interrupt)?
    {
        return Ok(None);
    }
    tell.say(format_args!(
        "engaged    the gripper follows the hand for {} (Ctrl-C holds it and ends)",
        seconds(options.seconds)
    ));
    let watch = Options {
        title: "gauntlet demo --on-chip",
        seconds: Some(options.seconds),
        engage: true,
        quiet: options.json,
    };
    Watch::new(link, interrupt)
        .run(&watch, &mut |_| Ok(()))
        .map(Some)
}

fn wait_for_frames(link: &mut HostLink, interrupt: &Interrupt) -> Result<bool> {
    let end = Instant::now() + FRAME_WAIT;
    while !link.status().map_err(Failure::from)?.glove_answers {
        if Instant::now() >= end {
            return Err(Failure::new(
                format!(
                    "the virtual glove sent no frame in {} s",
                    FRAME_WAIT.as_secs()
                ),
                "the same on a machine with less to do",
            )
            .into());
        }
        if interrupt.sleep(PAUSE) {
            return Ok(false);
        }
    }
    Ok(true)
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
