//! The options of `simulate`.

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;
use host::glove::hand::Side;

use crate::options::model_parser;
use crate::wearer::Wearer;
use host::failure::Failure;
use host::lines::Model;

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

impl Simulate {
    /// The virtual person; `None` for ideal sensors.
    pub(super) fn wearer(&self) -> Option<Wearer> {
        let side = match self.left {
            true => Side::Left,
            false => Side::Right,
        };
        (!self.ideal).then(|| Wearer {
            side,
            swapped: self.swap,
            ..Wearer::new(self.seed)
        })
    }

    /// Where to make the glove and the gripper: what was said, or both at their default places.
    pub(super) fn places(&self) -> Result<[Option<&Path>; 2]> {
        let unused = |option: &str, device: &str| {
            let what = format!("{option} is of no use without a {device}");
            let next = format!("add --{device} PATH, or leave both paths out to make both devices");
            Err(Failure::usage(what, next).into())
        };
        match (self.glove.as_deref(), self.gripper.as_deref()) {
            (None, None) => Ok([Some(Path::new(GLOVE)), Some(Path::new(GRIPPER))]),
            (None, _) if self.poses.is_some() => unused("--poses", "glove"),
            (_, None) if self.gripper_model.is_some() => unused("--gripper-model", "gripper"),
            (glove, gripper) => Ok([glove, gripper]),
        }
    }
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
            options
                .places()
                .map(|places| places.map(|place| place.map(Path::to_owned)))
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
