//! A gripper follows a hand for a minute: `follow GLOVE GRIPPER IMAGE`, two serial ports and a weights image.

use std::path::Path;
use std::time::Duration;

use host::clock::Clock;
use host::interrupt::Interrupt;
use host::lines::glove::Reading;
use host::lines::{Model, Settings};
use host::probe;
use host::report::Nobody;
use host::session::{Devices, InProcess, Order, Parts, Session};

const BEAT: Duration = Duration::from_millis(100);

fn main() -> anyhow::Result<()> {
    let names: Vec<String> = std::env::args().skip(1).collect();
    let [glove, gripper, image] = names.as_slice() else {
        anyhow::bail!("follow GLOVE GRIPPER IMAGE");
    };
    let (clock, interrupt, model) = (Clock::start(), Interrupt::install()?, Model::ThreeFinger);
    let (gripper, _) = probe::open_gripper(Path::new(gripper), model, &Nobody, &interrupt)?;
    let parts = Parts {
        glove: probe::open_glove(Path::new(glove), &interrupt)?.port.into(),
        reading: Reading::default(),
        gripper,
        model,
        line: Settings::default(),
        image: std::fs::read(image)?,
        side: glove::hand::Side::Right,
        profile: None,
        driving: host::session::Driving::default(),
        feed: None,
    };
    let mut session = InProcess::start(parts, clock, &interrupt)?;
    // The hand lies flat, fingers together, until it has been still for a second.
    session.order(Order::CalibrateStraight(bridge::Duration::from_millis(
        30_000,
    )));
    let flat = |seen: host::session::Snapshot| seen.calibration.is_calibrated;
    while !session.snapshot().is_some_and(flat) && session.running() && !interrupt.sleep(BEAT) {}
    session.order(Order::Engage);
    for _ in 0..600 {
        session.order(Order::Heartbeat);
        if !session.running() || interrupt.sleep(BEAT) {
            break;
        }
    }
    println!("{}", session.stop()?.judge(&Devices::Unknown)?);
    Ok(())
}
