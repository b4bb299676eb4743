//! The command line: verbs, options, and the help a newcomer reads first.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};

use host::chip::link::Address;
use host::failure::Failure;
use host::lines::Model;
use host::lines::Settings;

/// Operate a Robotiq 3-Finger gripper with a glove of 16 orientation sensors, or try it all without hardware.
///
/// Without a verb, `gauntlet` runs the demo: it trains a map from hand poses to gripper positions, starts a virtual
/// glove and a virtual gripper that speak the real bytes, and drives one with the other for 20 seconds.
#[derive(Debug, Parser)]
#[command(
    name = "gauntlet",
    version,
    after_help = "\
Start here:
  gauntlet                                       the demo: no hardware needed
  gauntlet demo --poses my_hand.csv              the same with your own hand's recording

With hardware:
  gauntlet ports                                 which serial ports are there
  gauntlet doctor --gripper /dev/ttyUSB1 --glove /dev/ttyUSB0
  gauntlet train --poses my_hand.csv --out model.safetensors
  gauntlet teleop --glove /dev/ttyUSB0 --gripper /dev/ttyUSB1 --model model.safetensors

`gauntlet help VERB` explains a verb and shows examples.
Exit codes: 0 done, 1 failed, 2 wrong usage."
)]
pub struct Cli {
    /// What to do; the demo if nothing is said.
    #[command(subcommand)]
    pub verb: Option<Verb>,
}

/// What the tool can do.
#[derive(Debug, Subcommand)]
pub enum Verb {
    /// Train a map, then drive a virtual gripper with a virtual glove in real time.
    Demo(Demo),
    /// Learn the map from hand poses to gripper positions, or between any two domains.
    Train(Box<crate::commands::train::Train>),
    /// Measure how good a trained map is on given poses or samples.
    Eval(crate::commands::eval::Eval),
    /// Make the paper's tables and figures, with its numbers beside ours.
    Reproduce(crate::commands::reproduce::Reproduce),
    /// Make a virtual glove and a virtual gripper behind pseudo-terminals.
    Simulate(Simulate),
    /// Drive a gripper with a glove, through two serial ports.
    Teleop(Teleop),
    /// Write a trained map into a file as the image that a bridge takes.
    Export(crate::commands::export::Export),
    /// Write a trained map into a bridge that runs on a chip.
    Flash(Flash),
    /// Look after a bridge that runs on a chip.
    Bridge(Bridge),
    /// List the serial ports of this machine.
    Ports(Ports),
    /// Read, activate and move a gripper at a bench.
    Gripper(crate::commands::gripper::Gripper),
    /// Find out which layer fails: port, line, unit, device.
    Doctor(crate::commands::doctor::Doctor),
}

/// Options of `demo`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet demo
  gauntlet demo --poses my_hand.csv --log session.mcap
  gauntlet demo --seconds 60 --json > result.json
  gauntlet demo --gripper-model 2f85
  gauntlet demo --on-chip

The poses file is CSV with a header: optional `time_s` first, then the 25 joint angles in radians \
(thumb_cmc_flex, thumb_cmc_abd, … little_dip_flex; docs/tool.md lists them). \
Keys while it runs on a terminal: space opens and closes the clutch, q holds the gripper and ends.")]
pub struct Demo {
    /// Train on and play this recording of a hand instead of generated motion.
    #[arg(long, value_name = "FILE.csv")]
    pub poses: Option<PathBuf>,
    /// Write every frame, command and status into this session log.
    #[arg(long, value_name = "FILE.mcap")]
    pub log: Option<PathBuf>,
    /// How long to drive the gripper, in seconds (1 to 86400).
    #[arg(long, value_name = "N", default_value = "20", value_parser = run_time, allow_negative_numbers = true)]
    pub seconds: Duration,
    /// Seed of everything random: the same seed trains the same map.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Begin with no reference pairs, as the paper's experiments do, instead of with open hand and fist.
    #[arg(long)]
    pub no_start_pairs: bool,
    /// Which gripper follows the hand.
    #[arg(long, value_name = "MODEL", value_parser = crate::commands::gripper::model_parser(), default_value = "3f")]
    pub gripper_model: Model,
    /// Run the bridge's ARM firmware in QEMU instead of on this processor.
    #[arg(long, conflicts_with = "log")]
    pub on_chip: bool,
    /// The firmware for --on-chip, instead of the one that `cargo xtask firmware` built.
    #[arg(long, value_name = "ELF", requires = "on_chip")]
    pub firmware: Option<PathBuf>,
    /// Print the summary as JSON on standard output, and nothing else there.
    #[arg(long)]
    pub json: bool,
}

impl Default for Demo {
    /// What `gauntlet` without a verb does.
    fn default() -> Self {
        Self {
            poses: None,
            log: None,
            seconds: Duration::from_secs(20),
            seed: 1,
            no_start_pairs: false,
            gripper_model: Model::ThreeFinger,
            on_chip: false,
            firmware: None,
            json: false,
        }
    }
}

/// Options of `simulate`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet simulate                                                  both, at /tmp/glove and /tmp/gripper
  gauntlet simulate --glove /tmp/glove --poses my_hand.csv
  gauntlet simulate --gripper tcp:127.0.0.1:1502                     the 3-Finger's Modbus TCP variant
  gauntlet simulate --gripper /tmp/gripper --gripper-model 2f85
  gauntlet teleop --glove /tmp/glove --gripper /tmp/gripper --model model.safetensors   (in another terminal)

Each device sits behind a pseudo-terminal; the path becomes a link to it. They speak the bytes of the real \
ones at 115200 baud, and noise at any other speed. A gripper at tcp:HOST:PORT listens there instead; port 0 \
takes any free one and tells which. `ready` on a line of its own says that they answer, the glove's sensors, too. \
The virtual hand lies flat for 3 s when the glove's port is opened, to be calibrated, then it moves; \
Enter lays it flat at any time, and Enter again lets it move. \
Runs until interrupted (Ctrl-C) and takes the links away.")]
pub struct Simulate {
    /// Link the virtual glove here. Without a path for either device both are made, at /tmp/glove and /tmp/gripper.
    #[arg(long, value_name = "PATH")]
    pub glove: Option<PathBuf>,
    /// Link the virtual gripper here, or let it listen at tcp:HOST:PORT.
    #[arg(long, value_name = "PATH")]
    pub gripper: Option<PathBuf>,
    /// Which gripper it is; the 3-Finger if not said.
    #[arg(long, value_name = "MODEL", value_parser = crate::commands::gripper::model_parser())]
    pub gripper_model: Option<Model>,
    /// The glove plays this recording of a hand instead of generated motion.
    #[arg(long, value_name = "FILE.csv")]
    pub poses: Option<PathBuf>,
    /// Seed of the generated motion.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
}

/// How a gripper's line differs from that of a gripper as delivered.
#[derive(Debug, Clone, Copy, Default, Args)]
pub struct LineOptions {
    /// The gripper's Modbus unit (slave id), if not 9 on a serial line (1 to 247) or 2 over TCP (0 to 255).
    #[arg(long, value_name = "N")]
    pub unit: Option<u8>,
    /// Speed of the gripper's serial line, if not 115200.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1_200..=1_000_000))]
    pub baud: Option<u32>,
    /// Wait so much longer for the gripper's answers, milliseconds (1 to 1000): for a serial tunnel or a slow network.
    #[arg(long, value_name = "MS", value_parser = host::lines::patience)]
    pub patience: Option<Duration>,
}

impl LineOptions {
    /// The same for a line, if it fits `path`.
    ///
    /// # Errors
    /// A failure of usage: a speed for a line that has none.
    pub fn settings(&self, path: &Path) -> Result<Settings, Failure> {
        let settings = Settings {
            unit: self.unit,
            baud: self.baud,
            patience: self.patience,
        };
        settings.check(path)?;
        Ok(settings)
    }
}

/// Which hand wears the glove.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Hand {
    /// The right hand.
    Right,
    /// The left hand.
    Left,
}

/// Options of `teleop`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet teleop --glove /dev/ttyUSB0 --gripper /dev/ttyUSB1 --model model.safetensors
  gauntlet teleop --glove /tmp/glove --gripper /tmp/gripper --model model.safetensors --calibrate-flat --engage --activate --seconds 10

Nothing moves at start. The gripper follows while the clutch is closed: the space bar closes and opens it, \
`--engage` closes it from the start. A gripper that is not activated is activated only by `--activate` or \
by a typed yes: activation moves the fingers. q or Ctrl-C holds the gripper where it is and ends.")]
pub struct Teleop {
    /// The glove's serial port.
    #[arg(long, value_name = "PORT")]
    pub glove: PathBuf,
    /// The gripper's serial port, or `tcp:HOST[:PORT]`.
    #[arg(long, value_name = "PORT")]
    pub gripper: PathBuf,
    /// The trained model, or a weights image.
    #[arg(long, value_name = "MODEL|IMAGE")]
    pub model: PathBuf,
    /// End by itself after this many seconds (1 to 86400).
    #[arg(long, value_name = "N", value_parser = run_time, allow_negative_numbers = true)]
    pub seconds: Option<Duration>,
    /// Close the clutch from the start: the gripper follows as soon as everything is ready.
    #[arg(long)]
    pub engage: bool,
    /// Activate the gripper if it is not: the fingers move.
    #[arg(long)]
    pub activate: bool,
    /// Which hand wears the glove.
    #[arg(long, value_enum, default_value_t = Hand::Right)]
    pub hand: Hand,
    /// Calibrate on the flat hand before the clutch may close: waits up to 30 s until it lies still for a second.
    #[arg(long)]
    pub calibrate_flat: bool,
    /// How the gripper's line differs from that of a gripper as delivered.
    #[command(flatten)]
    pub line: LineOptions,
    /// Which gripper it is; the map gives as many positions as it has axes.
    #[arg(long, value_name = "MODEL", value_parser = crate::commands::gripper::model_parser(), default_value = "3f")]
    pub gripper_model: Model,
    /// Write every frame, command and status into this session log.
    #[arg(long, value_name = "FILE.mcap")]
    pub log: Option<PathBuf>,
    /// Print the summary as JSON on standard output, and nothing else there.
    #[arg(long)]
    pub json: bool,
}

/// Options of `flash`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet flash model.safetensors --bridge /dev/ttyUSB0
  gauntlet flash model.safetensors --bridge unix:/tmp/gauntlet/host.sock --json
  gauntlet flash weights.hae --bridge tcp:localhost:4000
  gauntlet flash model.safetensors --int16 my_hand.csv --bridge /dev/ttyUSB0

The bridge keeps its old weights until the new image is there, whole and checked: power may go at any moment. \
A broken line is waited for and opened again; the transfer goes on where the bridge says it was. At the end \
the bridge reads its flash and the CRC is compared. Refused while the clutch is closed.")]
pub struct Flash {
    /// A trained model (MODEL.safetensors) or a weights image.
    #[arg(value_name = "MODEL|IMAGE")]
    pub file: PathBuf,
    /// The bridge: a serial port, unix:PATH or tcp:HOST:PORT.
    #[arg(long, value_name = "PORT")]
    pub bridge: Address,
    /// Write the model's weights as 16-bit integers, calibrated on these hand poses: faster on a chip, half as long.
    #[arg(long, value_name = "POSES.csv")]
    pub int16: Option<PathBuf>,
    /// Print the result as JSON on standard output, and nothing else there.
    #[arg(long)]
    pub json: bool,
}

/// Options of `bridge`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet bridge status --bridge /dev/ttyUSB0
  gauntlet bridge calibrate --bridge /dev/ttyUSB0
  gauntlet bridge engage --bridge /dev/ttyUSB0 --activate --seconds 30
  gauntlet bridge monitor --bridge unix:/tmp/gauntlet/host.sock
  gauntlet bridge log --bridge /dev/ttyUSB0 --out my_hand.csv --seconds 30
  gauntlet bridge select 1 --bridge /dev/ttyUSB0

One host at a time: a second one is refused while the first keeps the clutch closed or writes weights.")]
pub struct Bridge {
    /// What to do.
    #[command(subcommand)]
    pub what: BridgeVerb,
}

/// What can be done with a bridge on a chip.
#[derive(Debug, Subcommand)]
pub enum BridgeVerb {
    /// Show what the bridge does, what its slots hold, and its counters.
    Status {
        /// Where it is.
        #[command(flatten)]
        at: BridgeAt,
    },
    /// Close the clutch and keep it closed: the gripper follows the hand.
    Engage {
        /// Where it is.
        #[command(flatten)]
        at: BridgeAt,
        /// Calibrate on the flat hand before: waits up to 30 s until it lies still for a second.
        #[arg(long)]
        calibrate_flat: bool,
        /// Activate the gripper if it is not: the fingers move.
        #[arg(long)]
        activate: bool,
        /// End by itself after this many seconds (1 to 86400).
        #[arg(long, value_name = "N", value_parser = run_time, allow_negative_numbers = true)]
        seconds: Option<Duration>,
    },
    /// Take the hand, flat and still for a second, as all joints at zero: a glove that is not calibrated does not drive.
    Calibrate {
        /// Where it is.
        #[command(flatten)]
        at: BridgeAt,
        /// Take the newest calibration back instead.
        #[arg(long)]
        undo: bool,
    },
    /// Open the clutch: end the hold that a vanished host has left; the gripper stays where it is.
    Release {
        /// Where it is.
        #[command(flatten)]
        at: BridgeAt,
    },
    /// Watch hand and gripper; the clutch is not touched.
    Monitor {
        /// Where it is.
        #[command(flatten)]
        at: BridgeAt,
        /// End by itself after this many seconds (1 to 86400).
        #[arg(long, value_name = "N", value_parser = run_time, allow_negative_numbers = true)]
        seconds: Option<Duration>,
    },
    /// Write the hand's joint angles, 20 a second, into a poses file that `train` takes.
    Log {
        /// Where it is.
        #[command(flatten)]
        at: BridgeAt,
        /// The file; not one that exists.
        #[arg(long, value_name = "FILE.csv")]
        out: PathBuf,
        /// End by itself after this many seconds (1 to 86400).
        #[arg(long, value_name = "N", value_parser = run_time, allow_negative_numbers = true)]
        seconds: Option<Duration>,
    },
    /// Make the image in a slot the active one.
    Select {
        /// The slot, 0 or 1.
        #[arg(value_parser = clap::value_parser!(u8).range(0..=1))]
        slot: u8,
        /// Where it is.
        #[command(flatten)]
        at: BridgeAt,
    },
    /// Restart the bridge.
    Reboot {
        /// Where it is.
        #[command(flatten)]
        at: BridgeAt,
    },
}

/// Which bridge, and how to print.
#[derive(Debug, Args)]
pub struct BridgeAt {
    /// The bridge: a serial port, unix:PATH or tcp:HOST:PORT.
    #[arg(long, value_name = "PORT")]
    pub bridge: Address,
    /// Print the result as JSON on standard output, and nothing else there.
    #[arg(long)]
    pub json: bool,
}

/// Options of `ports`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet ports
  gauntlet ports --json

A warning says what will go wrong with a port before you use it, and the command that helps.")]
pub struct Ports {
    /// Print the list as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Whole or broken seconds from 1 to a day.
pub(crate) fn run_time(text: &str) -> Result<Duration, String> {
    let seconds: f64 = text
        .parse()
        .map_err(|_| format!("{text} is not a number of seconds"))?;
    if (1.0..=86_400.0).contains(&seconds) {
        Ok(Duration::from_secs_f64(seconds))
    } else {
        Err(format!("{text} is not between 1 and 86400 seconds"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_tree_is_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_verb_shows_examples() {
        for verb in Cli::command().get_subcommands() {
            let help = verb.get_after_help().map(ToString::to_string);
            assert!(
                help.is_some_and(|help| help.contains("Examples:")),
                "{}",
                verb.get_name()
            );
        }
    }

    #[test]
    fn the_demo_without_a_verb_has_the_defaults_of_the_verb() {
        let Some(Verb::Demo(typed)) = Cli::parse_from(["gauntlet", "demo"]).verb else {
            panic!("demo is a verb");
        };
        assert_eq!(format!("{typed:?}"), format!("{:?}", Demo::default()));
    }

    #[test]
    fn times_out_of_range_are_refused() {
        for text in ["0", "-1", "nan", "inf", "1e9", "soon"] {
            assert!(run_time(text).is_err(), "{text}");
        }
        assert_eq!(run_time("2.5"), Ok(Duration::from_millis(2500)));
    }
}
