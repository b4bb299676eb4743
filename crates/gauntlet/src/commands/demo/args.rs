//! The options of `demo`.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use crate::options::{ReadingOptions, log_name, model_parser, run_time};
use crate::web::ViewOptions;
use host::lines::Model;

/// Options of `demo`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet demo
  gauntlet demo --open --seconds 120
  gauntlet demo --poses my_hand.csv --log session.mcap
  gauntlet demo --seconds 60 --json > result.json
  gauntlet demo --gripper-model 2f85
  gauntlet demo --gripper-tcp
  gauntlet demo --on-chip
  gauntlet demo --calibrate

The poses file is CSV with a header: optional `time_s` first, then the 25 joint angles in radians \
(thumb_cmc_flex, thumb_cmc_abd, … little_dip_flex; docs/tool.md lists them). \
A virtual person wears the glove, whose sensors are as real ones: sewn on any way, each with a heading of its own that drifts, noise, \
flipped bits. The person is calibrated first, on a clock that waits for nobody; --calibrate shows that session as it is, in a minute. \
Keys while it runs on a terminal: space opens and closes the clutch, q holds the gripper and ends.")]
pub struct Demo {
    /// Train on and play this recording of a hand instead of generated motion.
    #[arg(long, value_name = "FILE.csv")]
    pub poses: Option<PathBuf>,
    /// Write everything that happens into a session log, of this name or one with the date.
    #[arg(long, value_name = "FILE.mcap", num_args = 0..=1, default_missing_value = log_name())]
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
    #[arg(long, value_name = "MODEL", value_parser = model_parser(), default_value = "3f")]
    pub gripper_model: Model,
    /// Drive the 3-Finger gripper over Modbus TCP, at a port of 127.0.0.1, instead of a serial line.
    #[arg(long, conflicts_with = "on_chip")]
    pub gripper_tcp: bool,
    /// How the glove is read; with --on-chip the chip's firmware says that.
    #[command(flatten)]
    pub reading: ReadingOptions,
    /// Sensors that sit straight and share one heading, as no real ones do: nobody needs to be calibrated.
    #[arg(long)]
    pub ideal: bool,
    /// Show the guided calibration of the virtual person in real time: a minute.
    #[arg(long, conflicts_with = "ideal")]
    pub calibrate: bool,
    /// Take this profile of the virtual person's glove (`simulate` with the same seed writes one) instead of calibrating.
    #[arg(long, value_name = "FILE.toml", conflicts_with_all = ["ideal", "calibrate"])]
    pub profile: Option<PathBuf>,
    /// Run the bridge's ARM firmware in QEMU instead of on this processor; without --log, since the bytes at a chip's ports are not
    /// seen here.
    #[arg(long, conflicts_with = "log")]
    pub on_chip: bool,
    /// The firmware for --on-chip, instead of the one that `cargo xtask firmware` built.
    #[arg(long, value_name = "ELF", requires = "on_chip")]
    pub firmware: Option<PathBuf>,
    /// The page.
    #[command(flatten)]
    pub view: ViewOptions,
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
            gripper_tcp: false,
            reading: ReadingOptions::default(),
            ideal: false,
            calibrate: false,
            profile: None,
            on_chip: false,
            firmware: None,
            view: ViewOptions::default(),
            json: false,
        }
    }
}
