//! The options of `calibrate`.

use std::path::{Path, PathBuf};

use crate::options::log_name;
use clap::Args;
use host::glove::hand::Side;

use crate::commands::glove::GloveAt;
use crate::commands::teleop::Hand as WhichHand;
use crate::options::ReadingOptions;
use crate::web::ViewOptions;
use host::chip::link::Address;

/// Options of `calibrate`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet calibrate --glove /dev/ttyUSB0                 the guided session, a minute
  gauntlet calibrate --glove /dev/ttyUSB0 --hand left     … and the glove must turn out to be a left one
  gauntlet calibrate --glove /dev/ttyUSB0 --flat          next day: does the profile still fit?
  gauntlet calibrate --bridge /dev/ttyACM0                the glove of a bridge on a chip, which keeps the profile
  gauntlet calibrate --list                               the profiles that are there

Wear the glove and sit at a table. The hand lies flat, turns, lies flat, bends one finger after the other, makes fists, \
moves the thumb, moves freely and lies flat once more: each is asked for in words and drawn, and what is not seen is asked again. \
Keys: space begins, r does a step again, q ends. Without a terminal it begins by itself. \
The profile goes into a file bound to the sensors' unique ids, where `teleop` finds it. \
It is written when every check holds or leaves doubts; what is bad is not, but with --keep-anyway. \
A virtual glove's person does what is asked by itself (`gauntlet simulate`). Exit code 1 where nothing is kept.")]
pub struct Calibrate {
    /// The glove's serial port, or `i2c:/dev/i2c-N`; needed but for --bridge and --list.
    #[arg(long, value_name = "PORT")]
    pub glove: Option<PathBuf>,
    /// The glove of the bridge on a chip there: a serial port, unix:PATH or tcp:HOST:PORT. The bridge keeps the profile, too.
    #[arg(long, value_name = "PORT", conflicts_with_all = ["glove", "list", "profile"])]
    pub bridge: Option<Address>,
    /// Which hand should wear it; a glove that turns out to be on the other one is refused.
    #[arg(long, value_enum)]
    pub hand: Option<WhichHand>,
    /// Write the profile into this file instead of among the others.
    #[arg(long, value_name = "FILE.toml", conflicts_with = "list")]
    pub out: Option<PathBuf>,
    /// Take sensors that sit elsewhere than they are wired as they sit.
    #[arg(long, conflicts_with = "list")]
    pub as_they_sit: bool,
    /// Keep the profile although a check says that it is bad.
    #[arg(long, conflicts_with = "list")]
    pub keep_anyway: bool,
    /// One flat pose of 2 s with the profile there is: whether a sensor has slipped since.
    #[arg(long, conflicts_with_all = ["list", "out", "as_they_sit", "keep_anyway"])]
    pub flat: bool,
    /// The profile for --flat, instead of the one that the glove's ids find.
    #[arg(long, value_name = "FILE.toml", requires = "flat")]
    pub profile: Option<PathBuf>,
    /// Write everything that the glove says into a log, of this name or one with the date.
    #[arg(long, value_name = "FILE.mcap", num_args = 0..=1, default_missing_value = log_name(), conflicts_with_all = ["list", "flat", "bridge"])]
    pub log: Option<PathBuf>,
    /// List the profiles that are there; no glove is needed.
    #[arg(long)]
    pub list: bool,
    /// How the glove is read.
    #[command(flatten)]
    pub reading: ReadingOptions,
    /// The page.
    #[command(flatten)]
    pub view: ViewOptions,
    /// Print the result as JSON on standard output, and nothing else there.
    #[arg(long)]
    pub json: bool,
}

impl Calibrate {
    /// The glove at a port, as other verbs know it.
    pub(super) fn at(&self, glove: &Path) -> GloveAt {
        GloveAt {
            glove: glove.to_owned(),
            profile: self.profile.clone(),
            ideal: false,
            hand: self.hand.unwrap_or(WhichHand::Right),
            reading: self.reading,
            json: self.json,
        }
    }

    pub(super) fn declared(&self) -> Option<Side> {
        self.hand.map(|hand| match hand {
            WhichHand::Right => Side::Right,
            WhichHand::Left => Side::Left,
        })
    }
}
