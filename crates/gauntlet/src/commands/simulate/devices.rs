//! The virtual devices, and the ways by which a program finds them.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Result;
use rig::Device;
use rig::glove::VirtualGlove;
use rig::gripper::tcp::TcpHandle;
use rig::gripper::{Family, VirtualGripper};
use rig::pty::{Handle, PtyDevice};

use crate::heard::Ear;
use crate::played;
use crate::say;
use crate::wearer::Wearer;
use host::failure::{Failure, OrFail};
use host::interrupt::Interrupt;
use host::lines::Model;
use host::lines::port::BAUD;
use host::lines::tcp;
use host::probe;
use host::realtime;
use host::training::motion::Motion;

/// How often the sensors are looked at while they boot (650 ms).
const LOOK: Duration = Duration::from_millis(20);

/// The hand's x is level and its y up, w x y z.
const PALM_DOWN: [f32; 4] = [
    std::f32::consts::FRAC_1_SQRT_2,
    std::f32::consts::FRAC_1_SQRT_2,
    0.0,
    0.0,
];

/// A virtual glove behind a pseudo-terminal.
pub(super) struct Glove {
    pub device: VirtualGlove,
    handle: Handle,
    /// Of the virtual person, or of a hand that can lie flat.
    pub ear: Option<Ear>,
}

impl Glove {
    /// Makes one that `link` leads to.
    pub fn start(motion: &Motion, wearer: Option<&Wearer>, link: &Path) -> Result<Self> {
        let device = match wearer {
            Some(wearer) => wearer.playing(played::source(motion)),
            None => {
                let config = rig::glove::Config {
                    world: PALM_DOWN,
                    ..rig::glove::Config::at_baud(BAUD)
                };
                VirtualGlove::new(played::virtual_hand(motion), config)
            }
        };
        let handle = spawn(Box::new(device.clone()), link)?;
        // A path may be too long for a socket; the rest works without.
        let ear = match Ear::of(&device, link) {
            Ok(ear) => Some(ear),
            Err(error) => {
                say!("warning: {error:#}; the hand hears Enter alone");
                None
            }
        };
        Ok(Self {
            device,
            handle,
            ear,
        })
    }

    /// Where a program finds it, and what its hand does.
    pub fn describe(&self, sensors: &str, motion: &Motion) -> String {
        let place = self.handle.path().display();
        format!("{place}  {BAUD} baud, {sensors}, {}", motion.describe())
    }

    /// Waits until its sensors have booted, and asks its serial multiplexer.
    pub fn answers(&self, interrupt: &Interrupt) -> Result<()> {
        while !self.device.booted(self.handle.clock().now()) && !interrupt.sleep(LOOK) {}
        probe::open_glove(self.handle.path(), interrupt).map(drop)
    }
}

/// A virtual gripper and the way to it.
pub(super) enum Gripper {
    Terminal(Handle),
    Network(TcpHandle),
}

impl Gripper {
    pub fn start(place: &Path, model: Model) -> Result<Self> {
        let device = VirtualGripper::new(rig::gripper::Config::of(family(model)));
        let Some(address) = tcp::Address::parse_to_listen(place)? else {
            return Ok(Self::Terminal(spawn(Box::new(device), place)?));
        };
        if model != Model::ThreeFinger {
            return Err(probe::only_three_finger_on_tcp().into());
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
    pub fn place(&self) -> PathBuf {
        match self {
            Self::Terminal(handle) => handle.path().to_owned(),
            Self::Network(server) => format!("tcp:{}", server.address()).into(),
        }
    }

    pub fn describe(&self, model: Model) -> String {
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

/// The virtual device of a model.
pub(in crate::commands) fn family(model: Model) -> Family {
    match model {
        Model::ThreeFinger => Family::ThreeFinger,
        Model::TwoFinger85 => Family::TwoFinger85,
        Model::TwoFinger140 => Family::TwoFinger140,
        Model::HandE => Family::HandE,
    }
}

fn spawn(device: Box<dyn Device>, link: &Path) -> Result<Handle> {
    let spawned = realtime::starting(|| PtyDevice::spawn(device, Some(link)));
    spawned.and_then(|(handle, _)| handle).map_err(|error| {
        let (what, next) = match error.kind() {
            ErrorKind::AlreadyExists if link.is_symlink() && link.exists() => (
                format!(
                    "{} leads to a terminal: a simulate runs there",
                    link.display()
                ),
                "ending that one (Ctrl-C), or other paths for --glove and --gripper",
            ),
            ErrorKind::AlreadyExists => (
                format!(
                    "{} exists and is not a dead link to a terminal",
                    link.display()
                ),
                "choose another path or remove it",
            ),
            _ => (
                error.to_string(),
                "a path that does not exist yet, in a folder that you may write to",
            ),
        };
        Failure::new(format!("no virtual device there: {what}"), next).into()
    })
}
