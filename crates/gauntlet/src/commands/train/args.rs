//! The options of `train`, and the words that `--pairs` takes.

use std::path::PathBuf;

use clap::{ArgGroup, Args, ValueEnum};
use host::lines::Model;
use host::training::PairChoice;

use crate::commands::teleop::Hand as WhichHand;
use crate::options::{ReadingOptions, model_parser};
use crate::web::ViewOptions;
use host::chip::link::Address;
use host::trainer::cost::Cost;
use host::trainer::measures::Coverage;
use host::trainer::network::Initialisation;

/// Options of `train`.
#[derive(Debug, Args)]
#[command(
    group(ArgGroup::new("data").required(true).multiple(true).args(["poses", "input", "live"])),
    after_help = "\
Examples:
  gauntlet train --poses my_hand.csv --out model.safetensors
  gauntlet train --poses my_hand.csv --out model.safetensors --schedule paper --seed 7
  gauntlet train --poses my_hand.csv --out model.safetensors --pairs table3:8
  gauntlet train --poses my_hand.csv --out model.safetensors --starts 1      (one start, as the paper has it)
  gauntlet train --input Q.csv --target X.csv --truth PAIRS.csv --volume 9 --dim 2 --out map.safetensors
  gauntlet train --input Q.csv --target X.csv --pairs-file PAIRS.csv --cost hae --alpha 0 --out map.safetensors
  gauntlet train --poses my_hand.csv --out model.safetensors --checkpoint half.checkpoint    (Ctrl-C stops it)
  gauntlet train --poses my_hand.csv --out model.safetensors --resume half.checkpoint
  gauntlet train --live --glove /dev/ttyUSB0 --out model.safetensors    (you show the poses: docs/teach.md)
  gauntlet train --live --glove /dev/ttyUSB0 --out model.safetensors --resume model.pairs.csv

Hands: CSV with a header, optional `time_s` first, then the 25 joint angles in radians (docs/tool.md lists \
them). A script answers for the person who would show the hand pose that belongs to a gripper pose.
Any two domains: samples of the input in the columns q0, q1, …, of the target in x0, x1, …, true pairs in \
q0… and x0…; values are taken as they are. 60 % of the rows train, the rest measure the result."
)]
pub struct Train {
    /// The hand poses to train on.
    #[arg(long, value_name = "FILE.csv", conflicts_with_all = ["input", "truth", "normalise", "force", "hidden", "epsilon", "volume", "dim"])]
    pub poses: Option<PathBuf>,
    /// The gripper that the hand will move.
    #[arg(long, value_name = "MODEL", value_parser = model_parser(), default_value = "3f", conflicts_with = "input")]
    pub gripper_model: Model,
    /// Samples of the input domain, columns q0, q1, …
    #[arg(long, value_name = "Q.csv", requires = "target")]
    pub input: Option<PathBuf>,
    /// Samples of the target domain, columns x0, x1, …; with --live instead of a gripper.
    #[arg(long, value_name = "X.csv")]
    pub target: Option<PathBuf>,
    /// Where the trained model goes. A model that is there is replaced; anything else never.
    #[arg(long, value_name = "MODEL.safetensors")]
    pub out: PathBuf,

    /// Show the hand poses yourself: with a glove on, mimic the gripper poses that are asked for.
    #[arg(long, conflicts_with_all = ["input", "pairs_file", "no_start_pairs", "checkpoint", "stop_at"])]
    pub live: bool,
    /// Where the glove of --live is.
    #[command(flatten)]
    pub worn: Worn,

    /// True pairs, columns q0… and x0…: they answer for adaptive and random pairs, and NMSE is measured with them.
    #[arg(long, value_name = "PAIRS.csv", requires = "input")]
    pub truth: Option<PathBuf>,
    /// For the volume occupancy.
    #[command(flatten)]
    pub coverage: CoverageArgs,
    /// Bring every column to mean 0 and standard deviation 1 first; the model keeps the numbers.
    #[arg(long, requires = "input")]
    pub normalise: bool,
    /// Train although a column is constant, rows repeat, or pairs lie outside the samples.
    #[arg(long, requires = "input")]
    pub force: bool,

    /// Reference pairs: L or adaptive:L (chosen one after another where they help most), random:L (of the true pairs),
    /// fixed:L (the first L of --pairs-file; fixed: all), table3:L (the paper's gripper poses, hands only; also called
    /// heuristic:L), boundary:L (of the ring in --pairs-file, at equal distances).
    /// 8 adaptive ones for hands, 4 for other domains.
    #[arg(long, value_name = "L|KIND[:L]", value_parser = PairChoice::parse)]
    pub pairs: Option<PairChoice>,
    /// Reference pairs, all there from the start; with adaptive ones: those to start with.
    #[arg(long, value_name = "PAIRS.csv")]
    pub pairs_file: Option<PathBuf>,
    /// Begin with no reference pairs, as the paper's experiments do, instead of with open hand and fist.
    #[arg(long, conflicts_with_all = ["input", "pairs_file"])]
    pub no_start_pairs: bool,

    /// What the training minimises (Table 1 of the paper): pin, cae-pin, pin-ba, distortion-pin-ba or hae.
    #[arg(long, value_name = "COST", default_value = "hae", value_parser = cost)]
    pub cost: Cost,
    /// α of Eq. 4 and 6, the weight of distances in the input domain [default: 1 for hae, 0 for the others].
    #[arg(long, value_name = "A", value_parser = weight)]
    pub alpha: Option<f64>,
    /// λ1 of the distortion, λ2 of the pairs, λ3 of the coverage [default: 0.005,1,5; hands 0.005,2,5].
    #[arg(long, value_name = "L1,L2,L3", value_parser = lambda)]
    pub lambda: Option<[f64; 3]>,
    /// How long to train.
    #[arg(long, value_enum, default_value_t = Schedule::Fast)]
    pub schedule: Schedule,
    /// Epochs of the last stage, instead of the schedule's (1 to 1000000).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub epochs: Option<u32>,
    /// First learning rate, instead of the schedule's.
    #[arg(long, value_name = "R", value_parser = rate)]
    pub rate: Option<f64>,
    /// Hidden units (1 to 65535); the bridge runs 300.
    #[arg(long, value_name = "H", default_value_t = 300, value_parser = clap::value_parser!(u32).range(1..=65_535))]
    pub hidden: u32,
    /// Starts that differ in their first weights (1 to 64): those that cost most on the training samples end early; then
    /// the remaining ones that agree are averaged, and one goes on from there (hands: the cheapest goes on); 1 is the paper's way [default: 32, targets of more than 2
    /// dimensions 8, hands 6, with --live as many of them as end in 20 s; 1 with --schedule paper or another --cost].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=64))]
    pub starts: Option<u8>,
    /// Weights that start normally distributed with this deviation (0.1, say), or Glorot's uniform ones [default: glorot].
    #[arg(long, value_name = "DEVIATION|glorot", value_parser = initialisation)]
    pub normal: Option<Initialisation>,
    /// Seed of everything random: the same seed trains the same map (with --live of as many starts, which it says).
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Share of the rows that measure the result and do not train (0 to 0.9).
    #[arg(long, value_name = "SHARE", default_value_t = 0.4, value_parser = share)]
    pub hold_out: f64,
    /// Threads to compute with; the result is the same [default: as many as there are processors; of one start 2].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=64))]
    pub threads: Option<u16>,

    /// Keep the state of the training here: every minute, and when it is stopped (Ctrl-C, --stop-at).
    #[arg(long, value_name = "FILE")]
    pub checkpoint: Option<PathBuf>,
    /// Go on from this checkpoint of the same data and options; the result is that of an unbroken training, bit for bit. With --live:
    /// from the pairs file that it keeps beside its model.
    #[arg(long, value_name = "FILE")]
    pub resume: Option<PathBuf>,
    /// Stop after this epoch and keep the state.
    #[arg(long, value_name = "EPOCH", requires = "checkpoint", value_parser = clap::value_parser!(u32).range(1..))]
    pub stop_at: Option<u32>,

    /// Print the result as JSON on standard output, and nothing else there.
    #[arg(long)]
    pub json: bool,
}

/// The glove of `--live`.
#[derive(Debug, Args)]
pub struct Worn {
    /// The glove's serial port.
    #[arg(long, value_name = "PORT", requires = "live")]
    pub glove: Option<PathBuf>,
    /// The glove of the bridge on a chip there: a serial port, unix:PATH or tcp:HOST:PORT.
    #[arg(long, value_name = "PORT", requires = "live", conflicts_with_all = ["glove", "profile", "ideal"])]
    pub bridge: Option<Address>,
    /// The glove's profile, if not the one that is found by its sensors' ids.
    #[arg(
        long,
        value_name = "FILE.toml",
        requires = "live",
        conflicts_with = "ideal"
    )]
    pub profile: Option<PathBuf>,
    /// Take the sensors as ideal: sewn on straight, with one heading. Virtual gloves only.
    #[arg(long, requires = "live")]
    pub ideal: bool,
    /// Which hand wears the glove, where no profile says.
    #[arg(long, value_enum, default_value_t = WhichHand::Right)]
    pub hand: WhichHand,
    /// How the glove is read.
    #[command(flatten)]
    pub reading: ReadingOptions,
    /// Show each pose on the gripper at this port, too: the fingers move, slowly. It must be activated. Without it nothing moves.
    #[arg(
        long,
        value_name = "PORT",
        requires = "live",
        conflicts_with = "target"
    )]
    pub show_on: Option<PathBuf>,
    /// The page.
    #[command(flatten)]
    pub view: ViewOptions,
}

/// What the volume occupancy of a domain from a file needs.
#[derive(Debug, Args)]
pub struct CoverageArgs {
    /// A target counts as reached when its squared distance to an image is below this (ε of Eq. 15).
    #[arg(long, value_name = "E", conflicts_with_all = ["volume", "dim"], value_parser = positive)]
    pub epsilon: Option<f64>,
    /// Volume (area, length) of the target domain, from which ε follows.
    #[arg(long, value_name = "V", requires = "dim", value_parser = positive)]
    pub volume: Option<f64>,
    /// Dimension of the target domain: 2 for a surface, also for one in space.
    #[arg(long, value_name = "D", requires = "volume", value_parser = clap::value_parser!(u32).range(1..=64))]
    pub dim: Option<u32>,
}

impl CoverageArgs {
    /// As the measures take it.
    pub fn coverage(&self) -> Coverage {
        match (self.epsilon, self.volume, self.dim) {
            (Some(epsilon), ..) => Coverage::Epsilon(epsilon),
            (_, Some(volume), Some(dimension)) => Coverage::Volume { volume, dimension },
            _ => Coverage::Unknown,
        }
    }
}

/// How long to train.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Schedule {
    /// Seconds: fewer epochs at a greater learning rate, as good a map (docs/measurements/trainer.md).
    #[value(alias = "short")]
    Fast,
    /// The paper's 8,000 + 100 L epochs.
    Paper,
}

impl From<Schedule> for host::trainer::algorithm::Schedule {
    fn from(word: Schedule) -> Self {
        match word {
            Schedule::Fast => Self::Fast,
            Schedule::Paper => Self::Paper,
        }
    }
}

fn cost(text: &str) -> Result<Cost, String> {
    text.parse()
        .map_err(|error: host::trainer::cost::UnknownCost| error.to_string())
}

fn number(text: &str, allowed: impl Fn(f64) -> bool, what: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if allowed(value) => Ok(value),
        _ => Err(format!("{text} is not {what}")),
    }
}

fn weight(text: &str) -> Result<f64, String> {
    number(text, |v| (0.0..=1e6).contains(&v), "a number from 0 to 1e6")
}

fn positive(text: &str) -> Result<f64, String> {
    number(text, |v| v > 0.0 && v.is_finite(), "a number above 0")
}

fn rate(text: &str) -> Result<f64, String> {
    number(text, |v| v > 0.0 && v <= 1.0, "a number above 0, at most 1")
}

/// A standard deviation of initial weights.
pub(in crate::commands) fn deviation(text: &str) -> Result<f64, String> {
    number(
        text,
        |v| v > 0.0 && v <= 10.0,
        "a number above 0, at most 10",
    )
}

/// How weights start.
fn initialisation(text: &str) -> Result<Initialisation, String> {
    match text {
        "glorot" => Ok(Initialisation::Glorot),
        number => deviation(number)
            .map(Initialisation::Normal)
            .map_err(|error| format!("{error}, nor glorot")),
    }
}

fn share(text: &str) -> Result<f64, String> {
    number(text, |v| (0.0..=0.9).contains(&v), "a share from 0 to 0.9")
}

fn lambda(text: &str) -> Result<[f64; 3], String> {
    let values: Result<Vec<f64>, String> =
        text.split(',').map(|part| weight(part.trim())).collect();
    let values = values?;
    <[f64; 3]>::try_from(values)
        .map_err(|values| format!("{} numbers, three are needed: λ1,λ2,λ3", values.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_out_of_range_are_refused() {
        assert_eq!(lambda("0.005, 1,5"), Ok([0.005, 1.0, 5.0]));
        for wrong in ["1,2", "1,2,3,4", "1,x,3", "1,2,-3", "1,2,nan"] {
            assert!(lambda(wrong).is_err(), "{wrong}");
        }
        for wrong in ["0", "-1", "nan", "inf"] {
            assert!(positive(wrong).is_err(), "{wrong}");
        }
        assert!(share("1").is_err() && share("0") == Ok(0.0));
    }
}
