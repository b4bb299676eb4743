//! A gripper follows a hand for a minute: `follow GLOVE GRIPPER IMAGE PROFILE`, two ports, the weights image of a 3-Finger
//! gripper's map (`gauntlet export`) and the glove's profile (`gauntlet calibrate`).

use std::path::Path;
use std::time::Duration;

use host::bridge::calibration::Try;
use host::calibration::Kept;
use host::clock::Clock;
use host::gripper::Activation;
use host::interrupt::Interrupt;
use host::lines::{Model, Settings, glove::Reading};
use host::probe;
use host::report::Nobody;
use host::session::{Devices, Driving, InProcess, Order, Parts, Session, refused};

/// A closed clutch needs a heartbeat this often; after 250 ms without one the gripper is held.
const BEAT: Duration = Duration::from_millis(100);

fn main() -> anyhow::Result<()> {
    let names: Vec<String> = std::env::args().skip(1).collect();
    let [glove, gripper, image, profile] = names.as_slice() else {
        anyhow::bail!("follow GLOVE GRIPPER IMAGE PROFILE");
    };
    // Ctrl-C ends the waits below, so that the gripper is held before the program ends.
    let (clock, interrupt, model) = (Clock::start(), Interrupt::install()?, Model::ThreeFinger);
    // How the sensors sit on this hand. Without a profile, and with another glove's, nothing moves.
    let profile = Kept::read(Path::new(profile))?.bound;
    let (gripper, activation) =
        probe::open_gripper(Path::new(gripper), model, &Nobody, &interrupt)?;
    if activation != Activation::Ready {
        anyhow::bail!("`gauntlet gripper activate` comes first: it moves the fingers");
    }
    let parts = Parts {
        glove: probe::open_glove_line(Path::new(glove), &interrupt)?.line,
        reading: Reading::default(),
        gripper,
        model,
        line: Settings::default(),
        image: std::fs::read(image)?,
        side: profile.profile.side,
        profile: Some(profile),
        driving: Driving::default(),
        feed: None,
    };
    let mut session = InProcess::start(parts, clock, &interrupt)?;
    // After each power-on the sensors' headings are unknown: one flat pose gives them.
    println!("lay the hand flat, fingers together, and hold it still for a second");
    session.order(Order::FlatPose(host::bridge::Duration::from_millis(30_000)));
    let mut newest = Try::None;
    while newest != Try::Taken && session.running() && !interrupt.sleep(BEAT) {
        let seen = session.snapshot();
        newest = seen.map_or(newest, |seen| seen.calibration.newest);
        if let Try::Refused(why) = newest {
            return Err(refused(why, &Devices::Unknown).into());
        }
    }
    // Closing the clutch is an act of a person, here of who started this program: the gripper moves from now on. A heartbeat keeps
    // it closed and never closes it: after a second without one it has opened by itself.
    if newest == Try::Taken && session.order(Order::Engage) {
        println!("the gripper follows the hand for a minute; Ctrl-C holds it and ends");
        for _ in 0..600 {
            if !session.running() || interrupt.sleep(BEAT) {
                break;
            }
            session.order(Order::Heartbeat);
        }
    }
    // Holds the gripper where it is. An error says that it may still move.
    println!("{}", session.stop()?.judge(&Devices::Unknown)?);
    Ok(())
}
