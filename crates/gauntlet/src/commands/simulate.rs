//! `gauntlet simulate`: virtual devices behind pseudo-terminals, or a gripper behind a TCP port, for any program that
//! speaks to the real ones.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Result;
use rig::Device;
use rig::glove::VirtualGlove;
use rig::gripper::tcp::TcpHandle;
use rig::gripper::{Family, VirtualGripper};
use rig::pty::{Handle, PtyDevice};

use super::gripper::Model;
use crate::cli::Simulate;
use crate::failure::{Failure, OrFail};
use crate::interrupt::Interrupt;
use crate::port::BAUD;
use crate::poses::Motion;
use crate::{probe, realtime, say, tcp};

/// How often the wait for Ctrl-C looks around.
const WATCH: Duration = Duration::from_secs(3600);

/// Runs until interrupted.
///
/// # Errors
/// A failure where a link cannot be made or a device does not answer.
pub(super) fn run(options: &Simulate, interrupt: &Interrupt) -> Result<()> {
    let motion = Motion::open(options.poses.as_deref(), options.seed)?;
    let mut glove_device = None;
    if let Some(path) = &options.glove {
        glove_device = Some(glove(&motion, path)?);
        say!(
            "glove    {}  {BAUD} baud, {}",
            path.display(),
            motion.describe()
        );
    }
    let mut gripper_device = None;
    if let Some(place) = &options.gripper {
        let device = Simulated::start(place, options.gripper_model)?;
        say!("gripper  {}", device.describe(options.gripper_model));
        gripper_device = Some(device);
    }
    if let Some(path) = &options.glove {
        probe::open_glove(path, interrupt)?;
    }
    if let Some(device) = &gripper_device {
        probe_gripper(&device.place(), options.gripper_model, interrupt)?;
    }
    if !interrupt.asked() {
        say!("ready");
    }
    while !interrupt.sleep(WATCH) {}
    // Taking the handles down removes the links.
    drop((glove_device, gripper_device));
    Ok(())
}

/// A virtual gripper and the way to it.
enum Simulated {
    Terminal(Handle),
    Network(TcpHandle),
}

impl Simulated {
    fn start(place: &Path, model: Model) -> Result<Self> {
        let family = match model {
            Model::ThreeFinger => Family::ThreeFinger,
            Model::TwoFinger85 => Family::TwoFinger85,
            Model::TwoFinger140 => Family::TwoFinger140,
            Model::HandE => Family::HandE,
        };
        let device = VirtualGripper::new(rig::gripper::Config::of(family));
        let Some(address) = tcp::Address::parse_to_listen(place)? else {
            return Ok(Self::Terminal(spawn(Box::new(device), place)?));
        };
        if model != Model::ThreeFinger {
            return Err(super::gripper::only_three_finger_on_tcp().into());
        }
        let at = (address.host.as_str(), address.port);
        let serve = || rig::gripper::tcp::serve(&device, at, &rig::Clock::system());
        let served = realtime::starting(serve).and_then(|(server, _)| server);
        Ok(Self::Network(served.or_fail(
            || format!("no virtual gripper can listen at {address}"),
            "another port above 1023, or port 0 for any free one",
        )?))
    }

    /// Where a program finds it.
    fn place(&self) -> PathBuf {
        match self {
            Self::Terminal(handle) => handle.path().to_owned(),
            Self::Network(server) => format!("tcp:{}", server.address()).into(),
        }
    }

    fn describe(&self, model: Model) -> String {
        let place = self.place();
        let place = place.display();
        match self {
            Self::Terminal(_) => format!("{place}  {BAUD} baud, unit 9, {}", model.name()),
            Self::Network(_) => {
                format!("{place}  Modbus TCP, unit {}, {}", tcp::UNIT, model.name())
            }
        }
    }
}

fn probe_gripper(place: &Path, model: Model, interrupt: &Interrupt) -> Result<()> {
    match model {
        Model::ThreeFinger => probe::open_gripper(place, interrupt).map(drop),
        other => super::gripper::probe(place, other, interrupt),
    }
}

/// A virtual glove behind a pseudo-terminal that `link` leads to.
fn glove(motion: &Motion, link: &Path) -> Result<Handle> {
    let device = VirtualGlove::new(motion.source(), rig::glove::Config::at_baud(BAUD));
    spawn(Box::new(device), link)
}

fn spawn(device: Box<dyn Device>, link: &Path) -> Result<Handle> {
    let spawned = realtime::starting(|| PtyDevice::spawn(device, Some(link)));
    spawned.and_then(|(handle, _)| handle).map_err(|error| {
        // The rig's texts end with the next step after their last colon.
        let text = error.to_string();
        let (what, next) = text.rsplit_once(": ").unwrap_or((
            &text,
            "a path that does not exist yet, in a folder that you may write to",
        ));
        Failure::new(format!("no virtual device there: {what}"), next).into()
    })
}
