//! The options of `gauntlet gripper`.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Subcommand, ValueEnum};
use gripper::registers::three_finger;
use host::lines::{Line, Model, Settings};

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

/// Takes a gripper's name on the command line.
pub fn model_parser() -> impl TypedValueParser<Value = Model> {
    let names = Model::ALL.map(|model| {
        let help = match model {
            Model::ThreeFinger => "3-Finger Adaptive Gripper",
            Model::TwoFinger85 | Model::TwoFinger140 | Model::HandE => model.name(),
        };
        PossibleValue::new(model.option()).help(help)
    });
    PossibleValuesParser::new(names).try_map(|name: String| name.parse::<Model>())
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
    /// Its Modbus unit (slave id), if not 9 on a serial line (1 to 247) or 2 over TCP (0 to 255).
    #[arg(long, value_name = "N")]
    pub unit: Option<u8>,
    /// Speed of the serial line, if not 115200; a network has none.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1_200..=1_000_000))]
    pub baud: Option<u32>,
    /// Wait so much longer for answers, milliseconds (1 to 1000): for a serial tunnel or a slow network. A move then
    /// leads by smaller steps.
    #[arg(long, value_name = "MS", value_parser = host::lines::patience)]
    pub patience: Option<Duration>,
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
            unit: None,
            baud: None,
            patience: None,
            raw: false,
            json: false,
        }
    }

    /// How to set up a driver for it on `line`.
    pub fn driver_config(&self, line: &Line) -> gripper::driver::Config {
        let config = line.driver_config(self.settings());
        gripper::driver::Config {
            check_family: config.check_family && !self.trust_model,
            ..config
        }
    }

    /// What differs from a gripper as delivered.
    pub fn settings(&self) -> Settings {
        Settings {
            unit: self.unit,
            baud: self.baud,
            patience: self.patience,
        }
    }

    /// `gauntlet gripper VERB` for the same gripper, to be pasted.
    pub fn again(&self, verb: &str) -> String {
        self.command(verb, self.patience)
    }

    /// The same with more patience than now.
    pub fn patient(&self, verb: &str) -> String {
        self.patient_for(verb, Duration::ZERO)
    }

    /// The same with patience for answers as late as `late`, and some to spare.
    pub fn patient_for(&self, verb: &str, late: Duration) -> String {
        let now = self.settings().patience();
        // In steps of 100 ms.
        let enough = Duration::from_millis(100 * (late.as_millis() as u64 / 100 + 1));
        let more = (now + Duration::from_millis(100)).max(enough + Duration::from_millis(100));
        self.command(verb, Some(more.min(host::lines::MOST_PATIENCE)))
    }

    /// `gauntlet doctor` for the same gripper, to be pasted.
    pub fn doctor(&self) -> String {
        self.words("doctor", self.patience)
    }

    fn command(&self, verb: &str, patience: Option<Duration>) -> String {
        self.words(&format!("gripper {verb}"), patience)
    }

    fn words(&self, verb: &str, patience: Option<Duration>) -> String {
        let mut text = format!("`gauntlet {verb} --gripper {}", quoted(&self.gripper));
        if self.model != Model::ThreeFinger {
            text.push_str(&format!(" --gripper-model {}", self.model.option()));
        }
        if let Some(unit) = self.unit {
            text.push_str(&format!(" --unit {unit}"));
        }
        if let Some(baud) = self.baud {
            text.push_str(&format!(" --baud {baud}"));
        }
        if let Some(patience) = patience {
            text.push_str(&format!(" --patience {}", patience.as_millis()));
        }
        text.push('`');
        text
    }
}

/// A path as a shell takes it.
fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    let plain = |c: char| c.is_alphanumeric() || "/._-:[]@+".contains(c);
    if text.chars().all(plain) {
        text
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
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
}

impl Move {
    /// The same move again, to be pasted.
    pub fn again(&self) -> String {
        self.target.again(&self.verb())
    }

    /// The same with more patience than now.
    pub fn patient(&self) -> String {
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
    #[arg(long, value_name = "N", default_value = "60", value_parser = crate::cli::run_time)]
    pub seconds: Duration,
}
