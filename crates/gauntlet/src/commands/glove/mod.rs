//! `gauntlet glove`: a glove by itself, with no gripper and no map.

mod at;
mod flat;
pub(in crate::commands) mod speed;
mod watch;

use anyhow::Result;
use clap::{Args, Subcommand};

use host::interrupt::Interrupt;

pub use at::GloveAt;
pub(in crate::commands) use at::Opened;
pub(in crate::commands) use flat::take_flat;
pub use watch::Watch;

/// Options of `glove`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet glove watch --glove /dev/ttyUSB0                      the sensors, the rates
  gauntlet glove watch --glove /tmp/glove --seconds 10           a virtual glove's hand, too

watch only reads. Without a calibration the angles are those of sensors that would sit straight, and that is said. \
q or Ctrl-C ends it and prints how every sensor did. Exit code 1 where the glove gave nothing at the end.")]
pub struct Glove {
    /// What to do.
    #[command(subcommand)]
    pub verb: Verb,
}

/// What can be done with a glove by itself.
#[derive(Debug, Subcommand)]
pub enum Verb {
    /// Show the hand, the rates and each sensor until the time is over or Ctrl-C.
    Watch(Watch),
}

impl Glove {
    /// Whether a program reads the result.
    pub fn json(&self) -> bool {
        match &self.verb {
            Verb::Watch(options) => options.at.json,
        }
    }
}

/// Does it.
///
/// # Errors
/// A failure that names the port or the sensor.
pub(crate) fn run(options: &Glove, interrupt: &Interrupt) -> Result<()> {
    match &options.verb {
        Verb::Watch(options) => watch::run(options, interrupt),
    }
}
