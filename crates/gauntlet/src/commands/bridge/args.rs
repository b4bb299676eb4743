//! The options of `bridge`.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::Result;
use clap::{Args, Subcommand};

use crate::options::{log_name, run_time};
use crate::web::ViewOptions;
use host::chip::link::{Address, Error, HostLink};
use host::next::Command;
use host::session::Devices;

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
    /// Show what the bridge does, whose profile it keeps, what its slots hold, and its counters.
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
        /// Take the sensors as ideal: sewn on straight, with one heading. Virtual gloves only.
        #[arg(long, requires = "calibrate_flat")]
        ideal: bool,
        /// Activate the gripper if it is not: the fingers move.
        #[arg(long)]
        activate: bool,
        /// End by itself after this many seconds (1 to 86400).
        #[arg(long, value_name = "N", value_parser = run_time, allow_negative_numbers = true)]
        seconds: Option<Duration>,
        /// The page.
        #[command(flatten)]
        view: ViewOptions,
    },
    /// Take the flat and still hand: it gives the headings of a glove whose profile the bridge keeps. One that is not calibrated
    /// does not drive.
    Calibrate {
        /// Where it is.
        #[command(flatten)]
        at: BridgeAt,
        /// Take the newest calibration back instead.
        #[arg(long)]
        undo: bool,
        /// Take the profile away that the bridge keeps, instead.
        #[arg(long, conflicts_with = "undo")]
        forget: bool,
        /// Give the bridge this profile of the glove before; it keeps it over restarts. Refused for a glove with other sensors.
        #[arg(long, value_name = "FILE.toml", conflicts_with_all = ["undo", "forget"])]
        profile: Option<PathBuf>,
        /// Take the sensors as ideal: sewn on straight, with one heading. Virtual gloves only; refused with a profile of the glove.
        #[arg(long, conflicts_with_all = ["undo", "forget", "profile"])]
        ideal: bool,
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
        /// The page.
        #[command(flatten)]
        view: ViewOptions,
        /// Write what the bridge tells and is told into a log, of this name or one with the date.
        #[arg(long, value_name = "FILE.mcap", num_args = 0..=1, default_missing_value = log_name())]
        log: Option<PathBuf>,
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

impl BridgeVerb {
    /// Which bridge, and how to print.
    pub fn at(&self) -> &BridgeAt {
        match self {
            Self::Status { at }
            | Self::Engage { at, .. }
            | Self::Calibrate { at, .. }
            | Self::Release { at }
            | Self::Monitor { at, .. }
            | Self::Log { at, .. }
            | Self::Select { at, .. }
            | Self::Reboot { at } => at,
        }
    }
}

impl BridgeAt {
    pub(super) fn connect(&self) -> Result<HostLink> {
        self.told(HostLink::connect(&self.bridge))
    }

    /// What the link says, as a person is told it.
    pub(super) fn told<T>(&self, said: Result<T, Error>) -> Result<T> {
        Ok(said.map_err(|error| error.at(&self.bridge))?)
    }

    pub(super) fn devices(&self) -> Devices {
        Devices::Chip(self.bridge.clone())
    }

    /// A command for this bridge.
    pub(super) fn command(&self, verb: &str) -> Command {
        Command::gauntlet(verb).option("--bridge", &self.bridge)
    }
}
