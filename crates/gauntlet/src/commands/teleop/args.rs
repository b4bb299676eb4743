//! The options of `teleop`.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum};

use crate::options::{
    DrivingOptions, LineOptions, OnOff, ReadingOptions, log_name, model_parser, run_time,
};
use crate::web::ViewOptions;
use host::lines::Model;

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

The glove's profile (`gauntlet calibrate`) is found by its sensors' ids; after each power-on of the glove one flat pose \
gives the headings: `--calibrate-flat`, or the key c; u takes it back. Nothing moves at start. The gripper follows while the clutch is closed: the space bar closes and opens it, \
`--engage` closes it from the start. A gripper that is not activated is activated only by `--activate` or \
by a typed yes: activation moves the fingers. q or Ctrl-C holds the gripper where it is and ends. `gauntlet settings` binds other keys.")]
pub struct Teleop {
    /// The glove's serial port, or `i2c:/dev/i2c-N`.
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
    /// The glove's profile, if not the one that is found by its sensors' ids.
    #[arg(long, value_name = "FILE.toml", conflicts_with = "ideal")]
    pub profile: Option<PathBuf>,
    /// Take the sensors as ideal: sewn on straight, with one heading. One flat pose then calibrates them. Virtual gloves only.
    #[arg(long)]
    pub ideal: bool,
    /// Which hand wears the glove, where no profile says.
    #[arg(long, value_enum, default_value_t = Hand::Right)]
    pub hand: Hand,
    /// Take the flat hand before the clutch may close: waits up to 30 s until it lies still.
    #[arg(long)]
    pub calibrate_flat: bool,
    /// Whether flat poses are found while the hand works, and correct what has drifted.
    #[arg(long, value_enum, value_name = "ON|OFF", default_value_t = OnOff::On)]
    pub find_flat: OnOff,
    /// How the glove is read.
    #[command(flatten)]
    pub reading: ReadingOptions,
    /// How the gripper's line differs from that of a gripper as delivered.
    #[command(flatten)]
    pub line: LineOptions,
    /// How the gripper is driven.
    #[command(flatten)]
    pub driving: DrivingOptions,
    /// Which gripper it is; the map gives as many positions as it has axes.
    #[arg(long, value_name = "MODEL", value_parser = model_parser(), default_value = "3f")]
    pub gripper_model: Model,
    /// Write everything that happens into a session log, of this name or one with the date.
    #[arg(long, value_name = "FILE.mcap", num_args = 0..=1, default_missing_value = log_name())]
    pub log: Option<PathBuf>,
    /// The page.
    #[command(flatten)]
    pub view: ViewOptions,
    /// Print the summary as JSON on standard output, and nothing else there.
    #[arg(long)]
    pub json: bool,
}
