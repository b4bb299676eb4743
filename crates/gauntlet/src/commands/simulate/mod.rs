//! `gauntlet simulate`: virtual devices behind pseudo-terminals, or a gripper behind a TCP port, for any program that
//! speaks to the real ones.

mod args;
mod devices;

use std::io::IsTerminal;
use std::time::Duration;

use anyhow::Result;

pub use args::Simulate;
pub(super) use devices::family;

use crate::flat_hand::Hand;
use crate::progress::Person;
use crate::say;
use crate::wearer::Wearer;
use devices::{Glove, Gripper};
use host::calibration::ProfileStore;
use host::interrupt::Interrupt;
use host::lines::Model;
use host::probe;
use host::training::motion::Motion;

/// How often the wait for Ctrl-C looks for a line on standard input, and for what the virtual person is asked.
const WATCH: Duration = Duration::from_millis(50);

/// Runs until interrupted.
///
/// # Errors
/// A failure where a link cannot be made or a device does not answer, or an option belongs to a device that is not made.
pub(crate) fn run(options: &Simulate, interrupt: &Interrupt) -> Result<()> {
    let [glove_place, gripper_place] = options.places()?;
    let model = options.gripper_model.unwrap_or(Model::ThreeFinger);
    let motion = Motion::open(options.poses.as_deref(), options.seed, &Person)?;
    let wearer = options.wearer();
    let glove = glove_place
        .map(|path| Glove::start(&motion, wearer.as_ref(), path))
        .transpose()?;
    if let Some(glove) = &glove {
        let sensors = match wearer {
            Some(_) => format!("a virtual person (seed {})", options.seed),
            None => "ideal sensors".to_owned(),
        };
        say!("glove    {}", glove.describe(&sensors, &motion));
    }
    if let (Some(wearer), Some(_)) = (&wearer, &glove) {
        keep_profile(wearer, interrupt)?;
    }
    let gripper = gripper_place
        .map(|place| Gripper::start(place, model))
        .transpose()?;
    if let Some(device) = &gripper {
        say!("gripper  {}", device.describe(model));
    }
    if let Some(glove) = &glove {
        glove.answers(interrupt)?;
    }
    if let Some(device) = &gripper {
        probe::open_gripper(&device.place(), model, &Person, interrupt)?;
    }
    if !interrupt.asked() {
        say!("ready");
    }
    let mut hand = glove.as_ref().map(|glove| Hand::of(&glove.device));
    if hand.is_some() && std::io::stdin().is_terminal() {
        say!("Enter lays the virtual hand flat, to be calibrated; Enter again lets it move");
    }
    while !interrupt.sleep(WATCH) {
        if let Some(hand) = &mut hand {
            hand.listen();
        }
        if let Some(ear) = glove.as_ref().and_then(|glove| glove.ear.as_ref()) {
            ear.listen();
        }
    }
    // Taking the handles down removes the links.
    drop((glove, gripper));
    Ok(())
}

/// Calibrates the virtual person, and writes the profile where other verbs find it. Where that cannot be written the devices are of use
/// all the same.
fn keep_profile(wearer: &Wearer, interrupt: &Interrupt) -> Result<()> {
    let done = wearer.calibrated(interrupt)?;
    let saved = ProfileStore::usual().and_then(|store| store.save(&done.kept));
    match saved {
        Ok(path) => say!(
            "profile  {}  of its person: {}",
            path.display(),
            done.line()
        ),
        Err(failure) => {
            say!("warning: the virtual person's profile is not kept: {failure}");
            say!("  try: {}", failure.next_step());
        }
    }
    Ok(())
}
