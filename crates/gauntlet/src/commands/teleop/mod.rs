//! `gauntlet teleop`: a gripper driven by a glove, over any two serial ports.

mod args;
mod bringup;

use std::path::Path;

use anyhow::Result;
use host::glove::hand::Side;

use crate::commands::glove::speed;
use crate::options::OnOff;
use crate::outputs;
use crate::progress::Person;
use crate::results;
use crate::run::{LogTo, Options, Run, drawn};
use crate::tell::Tell;
use crate::wearer::Listener;
use crate::web::Page;
use host::calibration::virtual_person::VirtualPerson;
use host::clock::Clock;
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::lines::list;
use host::next::{Command, NextStep};
use host::probe;
use host::recording::Drawn;
use host::session::{Devices, InProcess, Parts, check_image};
use host::training::model;
use host::words;

use bringup::{Prepared, no_frames, prepare};

pub use args::{Hand, Teleop};

/// Runs until its time is over or somebody ends it.
///
/// # Errors
/// A failure that names the file, the port or the device.
pub(crate) fn run(options: &Teleop, interrupt: &Interrupt) -> Result<()> {
    let tell = Tell::new(options.json);
    check_ports(options)?;
    if options.engage && !options.calibrate_flat {
        return Err(Failure::usage(
            "--engage closes the clutch from the start, and a glove that is not calibrated does not drive",
            NextStep::same(Command::more().word("--calibrate-flat"))
                .then(" as well: it waits until the hand lies flat and still"),
        )
        .into());
    }
    let model = options.gripper_model;
    let line = options.line.settings(&options.gripper)?;
    if let Some(path) = &options.log {
        outputs::check_new(path, "a log")?;
    }
    let page = Page::start(&options.view, &tell)?;
    let image = model::weights(&options.model, None, &Person)?.image;
    check_image(&image, model)?;
    for path in [&options.glove, &options.gripper] {
        if let Some(warning) = list::latency_warning(path) {
            tell.say(format_args!("warning: {}: {warning}", path.display()));
        }
    }
    let (gripper, activation) =
        probe::open_gripper_with(&options.gripper, model, line, &Person, interrupt)?;
    tell.say(format_args!(
        "gripper  {}  answers, {}",
        options.gripper.display(),
        words::activation(activation)
    ));
    let glove = probe::open_glove_line(&options.glove, interrupt)?;
    speed::found(&tell, &options.glove, glove.found);
    let clock = Clock::start();
    let log = options.log.clone();
    let shape = Drawn {
        side: side(options.hand),
        gripper: model.kinematics(),
    };
    let (log, feed) = log.map(|path| LogTo::new(path, shape)).unzip();
    let parts = Parts {
        glove: glove.line,
        reading: options.reading.given(),
        gripper,
        model,
        line,
        image,
        side: side(options.hand),
        profile: None,
        driving: options.driving.given(),
        feed,
    };
    let session = InProcess::start(parts, clock, interrupt)?;
    let devices = Devices::Here {
        glove: options.glove.clone(),
        gripper: options.gripper.clone(),
        model,
        settings: line,
    };
    let mut run = Run::new(session, log, clock, interrupt.clone(), devices);
    run.finds_flat(options.find_flat == OnOff::On)?;
    run.is_hand(side(options.hand));
    run.shows(page, Some(drawn(model)));
    run.has(VirtualPerson::at(&options.glove).map(Listener::There));
    let prepared = prepare(options, &mut run, &tell, activation);
    let frames = !matches!(prepared, Ok(Prepared::NoFrames));
    let driven = match prepared {
        Ok(Prepared::Ready) => drive(options, &mut run),
        Ok(Prepared::Ended | Prepared::NoFrames) => Ok(()),
        Err(error) => Err(error),
    };
    let mut finished = run.finish();
    let driven = match frames {
        true => driven,
        // The port is free now.
        false => Err(no_frames(&options.glove, interrupt)),
    };
    if !options.json {
        finished.tell(&tell, "summary    ");
    }
    let (judgement, failure) = results::judged(finished.judge(driven));
    if options.json && finished.ending.is_some() {
        results::print("teleop", finished.result(failure))?;
    }
    judgement
}

fn check_ports(options: &Teleop) -> Result<()> {
    let same = |a: &Path, b: &Path| {
        a == b || std::fs::canonicalize(a).ok() == std::fs::canonicalize(b).ok()
    };
    if options.glove.exists() && same(&options.glove, &options.gripper) {
        return Err(Failure::usage(
            format!(
                "glove and gripper are on the same port, {}",
                options.glove.display()
            ),
            Command::gauntlet("ports").then(" to tell them apart"),
        )
        .into());
    }
    Ok(())
}

fn side(hand: Hand) -> Side {
    match hand {
        Hand::Right => Side::Right,
        Hand::Left => Side::Left,
    }
}

fn drive(options: &Teleop, run: &mut Run) -> Result<()> {
    run.drive(&Options {
        title: "gauntlet teleop",
        seconds: options.seconds,
        engage: options.engage,
        drives: true,
        quiet: options.json,
    })?;
    Ok(())
}
