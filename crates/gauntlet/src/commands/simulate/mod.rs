//! `gauntlet simulate`: virtual devices behind pseudo-terminals, or a gripper behind a TCP port, for any program that
//! speaks to the real ones.

mod args;
mod devices;

use std::io::IsTerminal;
use std::time::{Duration, SystemTime};

use anyhow::Result;
use host::glove::calibration::{Bound, Profile};
use host::glove::hand::Side;
use rig::glove::VirtualGlove;

pub use args::Simulate;
pub(super) use devices::family;

use crate::flat_hand::Hand;
use crate::progress::Person;
use crate::say;
use crate::wearer::{Wearer, ids};
use devices::{Glove, Gripper};
use host::calibration::profile_file::{MadeBy, Quality};
use host::calibration::{Kept, ProfileStore};
use host::clock::rfc3339;
use host::interrupt::Interrupt;
use host::lines::Model;
use host::probe;
use host::settings::place::OVERRIDE;
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
    if let Some(glove) = &glove {
        keep_profile(wearer.as_ref(), &glove.device, interrupt)?;
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

/// Calibrates the virtual person, and writes the profile where other verbs find it; that of ideal sensors says that they sit straight.
/// Where it cannot be written the devices are of use all the same.
fn keep_profile(
    wearer: Option<&Wearer>,
    glove: &VirtualGlove,
    interrupt: &Interrupt,
) -> Result<()> {
    let (kept, words) = match wearer {
        Some(wearer) => {
            let done = wearer.calibrated(interrupt)?;
            let words = format!("of its person: {}", done.line());
            let kept = Kept {
                made_by: MadeBy::Simulate,
                ..done.kept
            };
            (kept, words)
        }
        None => (straight(glove), "of sensors that sit straight".to_owned()),
    };
    let saved = ProfileStore::usual().and_then(|store| store.save_simulated(&kept));
    match saved {
        Ok(Ok(path)) => say!("profile  {}  {words}", path.display()),
        Ok(Err((path, other))) => say!(
            "profile  {}  of {} stays: gauntlet calibrate made it for this person",
            path.display(),
            other.calibrated
        ),
        Err(failure) => {
            say!("warning: the glove's profile is not kept: {failure}");
            // Where a profile goes is no option of this verb.
            say!("  try: a settings folder that you may write in, named by {OVERRIDE}");
        }
    }
    Ok(())
}

/// How ideal sensors sit.
fn straight(glove: &VirtualGlove) -> Kept {
    Kept {
        bound: Bound {
            profile: Profile::straight(Side::Right),
            ids: ids(glove),
        },
        calibrated: rfc3339(SystemTime::now()),
        quality: Quality {
            verdict: "good".to_owned(),
            fit_deg: 0.0,
            ratio: 0.0,
            tilt_deg: 0.0,
            heading_deg: 0.0,
            findings: Vec::new(),
        },
        made_by: MadeBy::Simulate,
    }
}
