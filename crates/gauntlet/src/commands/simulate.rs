//! `gauntlet simulate`: virtual devices behind pseudo-terminals, or a gripper behind a TCP port, for any program that
//! speaks to the real ones.

use std::io::{ErrorKind, IsTerminal};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use anyhow::Result;
use clap::Args;
use glove::calibration::{Bound, Profile};
use glove::hand::Side;
use rig::Device;
use rig::glove::VirtualGlove;
use rig::gripper::tcp::TcpHandle;
use rig::gripper::{Family, VirtualGripper};
use rig::pty::{Handle, PtyDevice};

use crate::flat_hand::Hand;
use crate::heard::Ear;
use crate::options::model_parser;
use crate::played;
use crate::progress::Person;
use crate::say;
use crate::wearer::{Wearer, ids};
use host::calibration::profile_file::Quality;
use host::calibration::{Kept, ProfileStore};
use host::clock::rfc3339;
use host::failure::{Failure, OrFail};
use host::interrupt::Interrupt;
use host::lines::Model;
use host::lines::port::BAUD;
use host::lines::tcp;
use host::probe;
use host::realtime;
use host::training::motion::Motion;

/// How often the wait for Ctrl-C looks for a line on standard input, and for what the virtual person is asked.
const WATCH: Duration = Duration::from_millis(50);
/// How often the sensors are looked at while they boot (650 ms).
const LOOK: Duration = Duration::from_millis(20);
/// The hand's x is level and its y up, w x y z.
const PALM_DOWN: [f32; 4] = [
    std::f32::consts::FRAC_1_SQRT_2,
    std::f32::consts::FRAC_1_SQRT_2,
    0.0,
    0.0,
];
/// Where the devices are linked when no path is given.
const GLOVE: &str = "/tmp/glove";
const GRIPPER: &str = "/tmp/gripper";

/// Options of `simulate`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet simulate                                                  both, at /tmp/glove and /tmp/gripper
  gauntlet simulate --glove /tmp/glove --poses my_hand.csv
  gauntlet simulate --gripper tcp:127.0.0.1:1502                     the 3-Finger's Modbus TCP variant
  gauntlet simulate --gripper /tmp/gripper --gripper-model 2f85
  gauntlet simulate --seed 7 --left --swap 8,11                      another person, a left hand, two sensors exchanged

and, once `ready` is there, in another terminal:
  gauntlet glove watch --glove /tmp/glove
  gauntlet calibrate --glove /tmp/glove
  gauntlet teleop --glove /tmp/glove --gripper /tmp/gripper --model model.safetensors --calibrate-flat

Each device sits behind a pseudo-terminal; the path becomes a link to it. They speak the bytes of the real \
ones at 115200 baud, and noise at any other speed. A gripper at tcp:HOST:PORT listens there instead; port 0 \
takes any free one and tells which. `ready` on a line of its own says that they answer, the glove's sensors, too. \
The glove's sensors are as real ones: powered on at 9600 baud (and set to 115200 before `ready`), sewn on any way, each with a \
heading of its own that drifts, noise, flipped bits. Its virtual person is calibrated on a clock of its own before that, and the \
profile written where `teleop` finds it by the sensors' ids. The person does by itself what other verbs ask for at this path. \
The hand lies flat for 3 s when the glove's port is opened, then it moves; \
Enter lays it flat at any time, and Enter again lets it move. \
With --ideal the sensors sit straight and share a heading, as no real ones do; their profile says so. \
Runs until interrupted (Ctrl-C) and takes the links away.")]
pub struct Simulate {
    /// Link the virtual glove here. Without a path for either device both are made, at /tmp/glove and /tmp/gripper.
    #[arg(long, value_name = "PATH")]
    pub glove: Option<PathBuf>,
    /// Link the virtual gripper here, or let it listen at tcp:HOST:PORT.
    #[arg(long, value_name = "PATH")]
    pub gripper: Option<PathBuf>,
    /// Which gripper it is; the 3-Finger if not said.
    #[arg(long, value_name = "MODEL", value_parser = model_parser())]
    pub gripper_model: Option<Model>,
    /// The glove plays this recording of a hand instead of generated motion.
    #[arg(long, value_name = "FILE.csv")]
    pub poses: Option<PathBuf>,
    /// Seed of the generated motion, the virtual person and the glove.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Sensors that sit straight and share one heading, as no real ones do.
    #[arg(long)]
    pub ideal: bool,
    /// The glove is a left one.
    #[arg(long, conflicts_with = "ideal")]
    pub left: bool,
    /// Two of its sensors, as they are wired, sit on each other's segment: 8,11.
    #[arg(long, value_name = "A,B", conflicts_with = "ideal", value_parser = swapped)]
    pub swap: Option<(usize, usize)>,
}

/// Two different sensors.
fn swapped(text: &str) -> Result<(usize, usize), String> {
    let pair = text
        .split_once(',')
        .and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
    pair.filter(|(a, b): &(usize, usize)| a != b && *a < 16 && *b < 16)
        .ok_or_else(|| format!("{text} is not two sensors from 0 to 15, like 8,11"))
}

/// Runs until interrupted.
///
/// # Errors
/// A failure where a link cannot be made or a device does not answer, or an option belongs to a device that is not made.
pub(crate) fn run(options: &Simulate, interrupt: &Interrupt) -> Result<()> {
    let [glove_place, gripper_place] = places(options)?;
    let model = options.gripper_model.unwrap_or(Model::ThreeFinger);
    let motion = Motion::open(options.poses.as_deref(), options.seed, &Person)?;
    let wearer = (!options.ideal).then(|| Wearer {
        side: if options.left {
            Side::Left
        } else {
            Side::Right
        },
        swapped: options.swap,
        ..Wearer::new(options.seed)
    });
    let glove = glove_place
        .map(|path| Glove::start(&motion, wearer.as_ref(), path))
        .transpose()?;
    if let Some(glove) = &glove {
        let place = glove.handle.path().display();
        let sensors = match wearer {
            Some(_) => format!("a virtual person (seed {})", options.seed),
            None => "ideal sensors".to_owned(),
        };
        say!(
            "glove    {place}  {BAUD} baud, {sensors}, {}",
            motion.describe()
        );
    }
    if let Some(glove) = &glove {
        keep_profile(wearer.as_ref(), &glove.device, interrupt)?;
    }
    let gripper = gripper_place
        .map(|place| Simulated::start(place, model))
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

/// Where to make the glove and the gripper: what was said, or both at their default places.
fn places(options: &Simulate) -> Result<[Option<&Path>; 2]> {
    let unused = |option: &str, device: &str| {
        let what = format!("{option} is of no use without a {device}");
        let next = format!("add --{device} PATH, or leave both paths out to make both devices");
        Err(Failure::usage(what, next).into())
    };
    match (options.glove.as_deref(), options.gripper.as_deref()) {
        (None, None) => Ok([Some(Path::new(GLOVE)), Some(Path::new(GRIPPER))]),
        (None, _) if options.poses.is_some() => unused("--poses", "glove"),
        (_, None) if options.gripper_model.is_some() => unused("--gripper-model", "gripper"),
        (glove, gripper) => Ok([glove, gripper]),
    }
}

/// A virtual glove behind a pseudo-terminal.
struct Glove {
    device: VirtualGlove,
    handle: Handle,
    /// Of the virtual person, or of a hand that can lie flat.
    ear: Option<Ear>,
}

impl Glove {
    /// Makes one that `link` leads to.
    fn start(motion: &Motion, wearer: Option<&Wearer>, link: &Path) -> Result<Self> {
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

    /// Waits until its sensors have booted, and asks its serial multiplexer.
    fn answers(&self, interrupt: &Interrupt) -> Result<()> {
        while !self.device.booted(self.handle.clock().now()) && !interrupt.sleep(LOOK) {}
        probe::open_glove(self.handle.path(), interrupt).map(drop)
    }
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
            (done.kept, words)
        }
        None => (straight(glove), "of sensors that sit straight".to_owned()),
    };
    let saved = ProfileStore::usual().and_then(|store| store.save(&kept));
    match saved {
        Ok(path) => say!("profile  {}  {words}", path.display()),
        Err(failure) => {
            say!("warning: the glove's profile is not kept: {failure}");
            say!("  try: {}", failure.next_step());
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
    }
}

/// A virtual gripper and the way to it.
enum Simulated {
    Terminal(Handle),
    Network(TcpHandle),
}

impl Simulated {
    fn start(place: &Path, model: Model) -> Result<Self> {
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

/// The virtual device of a model.
pub(super) fn family(model: Model) -> Family {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn options(glove: Option<&str>, gripper: Option<&str>) -> Simulate {
        Simulate {
            glove: glove.map(PathBuf::from),
            gripper: gripper.map(PathBuf::from),
            gripper_model: None,
            poses: None,
            seed: 1,
            ideal: false,
            left: false,
            swap: None,
        }
    }

    #[test]
    fn without_a_path_both_devices_are_made_and_with_one_that_device_alone() {
        let paths = |glove, gripper| {
            let options = options(glove, gripper);
            places(&options).map(|places| places.map(|place| place.map(Path::to_owned)))
        };
        let some = |path: &str| Some(PathBuf::from(path));
        assert_eq!(
            paths(None, None).unwrap(),
            [some("/tmp/glove"), some("/tmp/gripper")]
        );
        assert_eq!(paths(Some("a"), None).unwrap(), [some("a"), None]);
        assert_eq!(paths(None, Some("b")).unwrap(), [None, some("b")]);
    }
}
