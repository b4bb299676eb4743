//! `gauntlet bridge`: a bridge on a chip, asked, watched and told over the host protocol.

mod drive;
mod poses;
mod status;

use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::Result;
use clap::{Args, Subcommand};

use super::flash::slot_lines;
use crate::options::run_time;
use crate::results::{self, devices};
use crate::tell::Tell;
use host::chip::link::{Address, Error, HostLink};
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::next::{Command, advice};
use host::session::Devices;

pub(super) use drive::start;

/// For the bridge to see that its clutch was opened.
const RELEASE_WAIT: Duration = Duration::from_secs(2);

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
    fn connect(&self) -> Result<HostLink> {
        self.told(HostLink::connect(&self.bridge))
    }

    /// What the link says, as a person is told it.
    fn told<T>(&self, said: Result<T, Error>) -> Result<T> {
        Ok(said.map_err(|error| error.at(&self.bridge))?)
    }

    fn devices(&self) -> Devices {
        Devices::Chip(self.bridge.clone())
    }

    /// A command for this bridge.
    fn command(&self, verb: &str) -> Command {
        Command::gauntlet(verb).option("--bridge", &self.bridge)
    }
}

/// Does what was asked.
///
/// # Errors
/// A failure that names the line, the file, or what the bridge refuses.
pub(crate) fn run(options: &Bridge, interrupt: &Interrupt) -> Result<()> {
    match &options.what {
        BridgeVerb::Status { at } => status::status(at),
        BridgeVerb::Engage {
            at,
            calibrate_flat,
            activate,
            seconds,
        } => drive::engage(at, *calibrate_flat, *activate, *seconds, interrupt),
        BridgeVerb::Calibrate { at, undo } => drive::calibrate(at, *undo, interrupt),
        BridgeVerb::Release { at } => release(at),
        BridgeVerb::Monitor { at, seconds } => drive::monitor(at, *seconds, interrupt),
        BridgeVerb::Log { at, out, seconds } => drive::log(at, out, *seconds, interrupt),
        BridgeVerb::Select { slot, at } => select(at, *slot),
        BridgeVerb::Reboot { at } => reboot(at),
    }
}

fn release(at: &BridgeAt) -> Result<()> {
    let mut link = at.connect()?;
    at.told(link.release())?;
    // The next step of the bridge, 10 ms later, takes it.
    let end = Instant::now() + RELEASE_WAIT;
    let mut status = at.told(link.status())?;
    while status.engaged && Instant::now() < end {
        status = at.told(link.status())?;
    }
    if status.engaged {
        return Err(Failure::new(
            format!("the bridge keeps its clutch closed: it is {}", status.state),
            advice("the same again; ")
                .then(at.command("bridge status"))
                .then(" says what keeps it"),
        )
        .into());
    }
    if at.json {
        return results::print("bridge release", devices::Released { status: &status });
    }
    Tell::new(false).say(format_args!(
        "the clutch is open; the bridge is {}",
        status.state
    ));
    Ok(())
}

fn select(at: &BridgeAt, slot: u8) -> Result<()> {
    let tell = Tell::new(at.json);
    let slots = at.told(at.connect()?.select(slot))?;
    if at.json {
        return results::print("bridge select", devices::Selected { slots: &slots });
    }
    slot_lines(&slots)
        .iter()
        .for_each(|line| tell.say(format_args!("{line}")));
    Ok(())
}

fn reboot(at: &BridgeAt) -> Result<()> {
    let mut link = at.connect()?;
    at.told(link.reboot())?;
    if at.json {
        return results::print("bridge reboot", devices::Rebooted { restarting: true });
    }
    Tell::new(false).say(format_args!("the bridge restarts"));
    Ok(())
}
