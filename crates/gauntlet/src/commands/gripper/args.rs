//! The options of `gauntlet gripper`.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args, Subcommand, ValueEnum};
use host::gripper::registers::three_finger;

use crate::options::{LineOptions, model_parser, run_time};
use host::lines::{Line, Model, Settings};
use host::next::{Command, NextStep};

/// Options of `gripper`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet gripper status   --gripper /dev/ttyUSB1
  gauntlet gripper activate --gripper /dev/ttyUSB1               the fingers move
  gauntlet gripper move     --gripper /dev/ttyUSB1 --to 120      all fingers, 0 open to 255 closed
  gauntlet gripper move     --gripper tcp:192.168.1.11 --to 100,100,100,137 --speed 50
  gauntlet gripper mode pinch --gripper /dev/ttyUSB1
  gauntlet gripper watch    --gripper /dev/ttyUSB1 --gripper-model 2f85 --seconds 10

status and watch only read. Ctrl-C during a move holds the gripper where it is.")]
pub struct Gripper {
    /// What to do.
    #[command(subcommand)]
    pub verb: Verb,
}

/// What can be done with a gripper at a bench.
#[derive(Debug, Subcommand)]
pub enum Verb {
    /// Read the gripper's state and say what it means.
    Status(Target),
    /// Activate the gripper: THE FINGERS MOVE, through their whole range.
    Activate(Target),
    /// Move to a position and wait until the gripper is there or holds something.
    Move(Move),
    /// Change the grasping mode (3-Finger only): the fingers move.
    Mode(Mode),
    /// Automatic release: all axes open slowly; the gripper needs an activation after it.
    Release(Release),
    /// Clear faults and the activation: THE GRIPPER LETS GO, and needs an activation after it.
    Reset(Target),
    /// Show every change until the time is over or Ctrl-C.
    Watch(Watch),
}

impl Verb {
    /// Where the gripper is and how to talk about it.
    pub fn target(&self) -> &Target {
        match self {
            Self::Status(target) | Self::Activate(target) | Self::Reset(target) => target,
            Self::Move(options) => &options.target,
            Self::Mode(options) => &options.target,
            Self::Release(options) => &options.target,
            Self::Watch(options) => &options.target,
        }
    }

    /// As it is typed.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Status(_) => "gripper status",
            Self::Activate(_) => "gripper activate",
            Self::Move(_) => "gripper move",
            Self::Mode(_) => "gripper mode",
            Self::Release(_) => "gripper release",
            Self::Reset(_) => "gripper reset",
            Self::Watch(_) => "gripper watch",
        }
    }
}

/// Where the gripper is and how to talk about it.
#[derive(Debug, Clone, Args)]
pub struct Target {
    /// The gripper's serial port, or `tcp:HOST[:PORT]` (3-Finger).
    #[arg(long, value_name = "PORT")]
    pub gripper: PathBuf,
    /// Which gripper it is.
    #[arg(long = "gripper-model", visible_alias = "model", value_name = "MODEL", value_parser = model_parser(), default_value = "3f")]
    pub model: Model,
    /// Take it for a --gripper-model even if it answers as one of another family: only for a gripper whose firmware answers what
    /// its manual does not name. A command for another family moves the fingers elsewhere.
    #[arg(long)]
    pub trust_model: bool,
    /// How its line differs from that of a gripper as delivered.
    #[command(flatten)]
    pub line: LineOptions,
    /// Show the status block's bytes too.
    #[arg(long)]
    pub raw: bool,
    /// Print the result as JSON on standard output, and nothing else there.
    #[arg(long)]
    pub json: bool,
}

impl Target {
    /// A gripper as delivered, at `place`.
    pub fn delivered(place: &Path, model: Model) -> Self {
        Self {
            gripper: place.to_owned(),
            model,
            trust_model: false,
            line: LineOptions::default(),
            raw: false,
            json: false,
        }
    }

    /// How to set up a driver for it on `line`.
    pub fn driver_config(&self, line: &Line) -> host::gripper::driver::Config {
        let config = line.driver_config(self.settings());
        host::gripper::driver::Config {
            check_family: config.check_family && !self.trust_model,
            ..config
        }
    }

    /// What differs from a gripper as delivered.
    pub fn settings(&self) -> Settings {
        self.line.given()
    }

    /// `gauntlet gripper VERB` for the same gripper.
    pub fn again(&self, verb: &str) -> Command {
        self.command(verb, self.settings())
    }

    /// The same with more patience than now.
    pub fn patient(&self, verb: &str) -> Command {
        self.patient_for(verb, Duration::ZERO)
    }

    /// The same with patience for answers as late as `late`, and some to spare.
    pub fn patient_for(&self, verb: &str, late: Duration) -> Command {
        let now = self.settings().patience();
        // In steps of 100 ms.
        let enough = Duration::from_millis(100 * (late.as_millis() as u64 / 100 + 1));
        let more = (now + Duration::from_millis(100)).max(enough + Duration::from_millis(100));
        let settings = Settings {
            patience: Some(more.min(host::lines::MOST_PATIENCE)),
            ..self.settings()
        };
        self.command(verb, settings)
    }

    /// `gauntlet doctor` for the same gripper.
    pub fn doctor(&self) -> Command {
        let doctor = Command::gauntlet("doctor");
        self.settings().named_in(doctor, &self.gripper, self.model)
    }

    /// What to do about a fault, with the commands for it.
    pub fn cure(&self, fault: host::gripper::Fault) -> NextStep {
        host::diagnose::cure(fault, |verb| {
            self.named_in(Command::gauntlet(verb), self.settings())
        })
    }

    fn command(&self, verb: &str, settings: Settings) -> Command {
        self.named_in(Command::gauntlet(&format!("gripper {verb}")), settings)
    }

    fn named_in(&self, command: Command, settings: Settings) -> Command {
        let command = settings.named_in(command, &self.gripper, self.model);
        match self.trust_model {
            true => command.word("--trust-model"),
            false => command,
        }
    }
}

/// Options of `gripper move`.
#[derive(Debug, Args)]
pub struct Move {
    /// Where it is.
    #[command(flatten)]
    pub target: Target,
    /// Position, 0 open to 255 closed: one number (3-Finger: for all fingers, the scissor where the mode puts it), or
    /// A,B,C,SCISSOR for each axis of a 3-Finger on its own.
    #[arg(
        long,
        value_name = "P",
        value_delimiter = ',',
        required = true,
        num_args = 1
    )]
    pub to: Vec<u8>,
    /// Speed, 0 slowest to 255 fastest.
    #[arg(long, value_name = "N", default_value_t = 64)]
    pub speed: u8,
    /// Force, 0 least to 255 most.
    #[arg(long, value_name = "N", default_value_t = 64)]
    pub force: u8,
    /// For the program with this process id, which began this one: where it ends, however it does, this holds the gripper and ends.
    #[arg(long, value_name = "PID")]
    pub ends_with: Option<u32>,
}

impl Move {
    /// The same move again.
    pub fn again(&self) -> Command {
        self.target.again(&self.verb())
    }

    /// The same with more patience than now.
    pub fn patient(&self) -> Command {
        self.target.patient(&self.verb())
    }

    fn verb(&self) -> String {
        let to: Vec<String> = self.to.iter().map(u8::to_string).collect();
        format!(
            "move --to {} --speed {} --force {}",
            to.join(","),
            self.speed,
            self.force
        )
    }
}

/// Options of `gripper mode`.
#[derive(Debug, Args)]
pub struct Mode {
    /// Which mode.
    #[arg(value_enum)]
    pub mode: Grasp,
    /// Where the gripper is.
    #[command(flatten)]
    pub target: Target,
}

/// A grasping mode.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Grasp {
    /// Parallel fingers.
    Basic,
    /// B and C together.
    Pinch,
    /// B and C apart.
    Wide,
    /// B against C, finger A unused.
    Scissor,
}

impl From<Grasp> for three_finger::Mode {
    fn from(mode: Grasp) -> Self {
        match mode {
            Grasp::Basic => Self::Basic,
            Grasp::Pinch => Self::Pinch,
            Grasp::Wide => Self::Wide,
            Grasp::Scissor => Self::Scissor,
        }
    }
}

/// Options of `gripper release`.
#[derive(Debug, Args)]
pub struct Release {
    /// Where the gripper is.
    #[command(flatten)]
    pub target: Target,
    /// Close instead of open (2-Finger ones, for an object held from inside).
    #[arg(long)]
    pub closing: bool,
}

/// Options of `gripper watch`.
#[derive(Debug, Args)]
pub struct Watch {
    /// Where the gripper is.
    #[command(flatten)]
    pub target: Target,
    /// End by itself after this many seconds (1 to 86400).
    #[arg(long, value_name = "N", default_value = "60", value_parser = run_time)]
    pub seconds: Duration,
}
