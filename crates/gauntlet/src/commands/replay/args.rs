//! The options of `replay`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::options::SafeAction;
use crate::web::ViewOptions;
use host::session::Driving;

/// What the commands of a log drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Target {
    /// A virtual gripper in this process.
    Virtual,
}

/// Options of `replay`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet replay session.mcap
  gauntlet replay session.mcap --speed 1
  gauntlet replay session.mcap --view
  gauntlet replay session.mcap --model other.safetensors
  gauntlet replay session.mcap --to virtual --json

The same bytes go through the same bridge at the same instants: the commands must be those of the log, bit for bit. The \
first difference is named, and the exit code is 1 then. With another map, profile or setting it is told what would have \
been commanded, and by how much that differs; the gripper in the log goes where it went.")]
pub struct Replay {
    /// The session's log.
    #[arg(value_name = "FILE.mcap")]
    pub file: PathBuf,
    /// Replay with the view, this many times as fast as it was (0.1 to 100); else as fast as it goes, without.
    #[arg(long, value_name = "TIMES", value_parser = speed)]
    pub speed: Option<f64>,
    /// Another trained model, or a weights image: what would it have commanded?
    #[arg(long, value_name = "MODEL|IMAGE")]
    pub model: Option<PathBuf>,
    /// Another profile of the glove.
    #[arg(long, value_name = "FILE.toml")]
    pub profile: Option<PathBuf>,
    /// Another speed of the fingers, 0 to 255.
    #[arg(long, value_name = "N")]
    pub gripper_speed: Option<u8>,
    /// Another force, 0 to 255.
    #[arg(long, value_name = "N")]
    pub force: Option<u8>,
    /// Another fastest change of a commanded position, counts a second (10 to 2000).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(10..=2_000))]
    pub rate: Option<u16>,
    /// Another safe action.
    #[arg(long, value_enum, value_name = "ACTION")]
    pub safe_action: Option<SafeAction>,
    /// Drive a gripper with the log's commands.
    #[arg(long, value_enum, value_name = "GRIPPER", conflicts_with_all = ["model", "profile", "gripper_speed", "force", "rate", "safe_action"])]
    pub to: Option<Target>,
    /// The page; it shows the log at its own pace where no --speed is said.
    #[command(flatten)]
    pub view: ViewOptions,
    /// Print the result as JSON on standard output, and nothing else there.
    #[arg(long)]
    pub json: bool,
}

impl Replay {
    /// How the gripper would be driven, where that is not as in the log.
    pub fn driving(&self) -> Driving {
        let others = crate::options::DrivingOptions {
            speed: self.gripper_speed,
            force: self.force,
            rate: self.rate,
            safe_action: self.safe_action,
        };
        others.given()
    }

    /// How many times as fast as it was the log is shown; `None` where it is not.
    pub fn pace(&self) -> Option<f64> {
        self.speed.or_else(|| self.view.is_wanted().then_some(1.0))
    }

    /// Whether something is to be other than in the log.
    pub fn changes(&self) -> bool {
        self.model.is_some() || self.profile.is_some() || self.driving() != Driving::default()
    }
}

fn speed(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(speed) if (0.1..=100.0).contains(&speed) => Ok(speed),
        _ => Err("a number from 0.1 to 100".to_owned()),
    }
}
