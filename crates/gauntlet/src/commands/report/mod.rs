//! `gauntlet report`: one page that says whether a map is good and shows what it does.

mod page;
mod pictures;
mod sections;
mod shown;

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use host::trainer::data::{Columns, Pairs, Table};
use host::trainer::hand::{Draw, Space};
use host::trainer::model::Model;
use host::trainer::whole_file;

use crate::outputs::{self, Kind};
use crate::progress::Person;
use crate::results::{self, maps};
use crate::tell::Tell;
use host::failure::{Failure, OrFail, told};
use host::glove::hand::JOINT_NAMES;
use host::next::{Command, NextStep};
use host::teaching::kept::Kept;
use host::training::curve;
use host::training::judgement::Judgement;
use host::training::measuring::SEED;
use host::training::model;
use host::training::motion::Motion;
use host::training::pairs_kept::reference_pairs;
use host::training::quality::TARGETS;
use shown::Shown;

/// Options of `report`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet report --model model.safetensors                            beside it: model.poses.csv, as train --live keeps it
  gauntlet report --model model.safetensors --poses my_hand.csv
  gauntlet report --model model.safetensors --poses my_hand.csv --out report.html --json

The page is one file that needs no network: the verdict, what each finger moves, how far the gripper is reached, the \
reference pairs one by one, both domains in their principal axes, hand and gripper over six seconds. \
Exit code 0 whatever the verdict is.")]
pub struct Report {
    /// The trained model of a hand.
    #[arg(long, value_name = "MODEL.safetensors")]
    pub model: PathBuf,
    /// The hand poses to judge it on [default: those that `train --live` keeps beside the model].
    #[arg(long, value_name = "FILE.csv")]
    pub poses: Option<PathBuf>,
    /// The reference pairs, if not those that the model carries.
    #[arg(long, value_name = "PAIRS.csv")]
    pub pairs_file: Option<PathBuf>,
    /// Where the page goes [default: beside the model, ending `html`]. A page that is there is replaced; anything else never.
    #[arg(long, value_name = "PAGE.html")]
    pub out: Option<PathBuf>,
    /// Print the result as JSON on standard output, and nothing else there.
    #[arg(long)]
    pub json: bool,
}

/// Judges and draws.
///
/// # Errors
/// A failure that names the file and what is wrong with it.
pub(crate) fn run(options: &Report) -> Result<()> {
    let tell = Tell::new(options.json);
    let poses = poses(options)?;
    let out = options
        .out
        .clone()
        .unwrap_or_else(|| options.model.with_extension("html"));
    let mut inputs = vec![options.model.as_path(), &poses];
    inputs.extend(options.pairs_file.as_deref());
    outputs::check(&out, Kind::Page, &inputs)?;
    let model = model::load(&options.model, &Person)?;
    let [_, _, axes] = model.shape();
    let space = Space::of_axes(axes).unwrap_or(Space::ThreeFinger);
    let motion = Motion::open_for_measuring(&poses, &Person)?;
    let frames = motion.frames();
    let pairs = pairs(options, &model, space)?;
    let named = poses.display().to_string();
    let (judgement, held_out) =
        Judgement::on((&model, space), (&frames, &named), pairs.as_ref(), SEED);
    let targets = space.samples(TARGETS, SEED, Draw::Measure);
    let shown = Shown {
        file: &options.model,
        poses: &poses,
        model: &model,
        space,
        motion: &motion,
        frames: &frames,
        targets: &targets,
        pairs: pairs.as_ref(),
        held_out,
        judgement: &judgement,
        curve: &curve::read(&options.model),
    };
    let text = page::page(&shown).or_fail(
        || format!("the page {}", out.display()),
        "the same again, and report what it says",
    )?;
    whole_file::write(&out, text.as_bytes()).or_fail(
        || format!("{} is not written", out.display()),
        "a folder with room that you may write in",
    )?;
    if options.json {
        let reported = maps::Reported {
            page: &out,
            model: &options.model,
            poses: &poses,
            quality: maps::Measures::Hand(&judgement.quality),
            good: judgement.good(),
            verdict: judgement.to_string(),
            faults: judgement.named(),
            influence: judgement.influence.words(),
            least_reached: judgement.reach.words(),
            pairs: judgement.pairs.as_ref().map(|pairs| pairs.each.as_slice()),
        };
        return results::print("report", reported);
    }
    tell.say(format_args!("verdict    {judgement}"));
    for sentence in judgement.influence.words() {
        tell.say(format_args!("           {sentence}"));
    }
    tell.say(format_args!("           {}", judgement.reach.words()));
    tell.say(format_args!("page       {}", out.display()));
    Ok(())
}

/// The poses that are given, or lie beside the model.
fn poses(options: &Report) -> Result<PathBuf> {
    if let Some(poses) = &options.poses {
        return Ok(poses.clone());
    }
    let beside = Kept::beside(&options.model).poses;
    if beside.is_file() {
        return Ok(beside);
    }
    let what = format!(
        "a map is judged on hand poses, and {} is not there",
        beside.display()
    );
    let record = Command::gauntlet("record").word("--help");
    let next = NextStep::same(Command::more().option("--poses", "my_hand.csv"))
        .then("; ")
        .then(record.then(" says how to make such a file"));
    Err(Failure::usage(what, next).into())
}

/// The pairs of a file, or those that the model carries.
fn pairs(options: &Report, model: &Model, space: Space) -> Result<Option<Pairs>> {
    let Some(file) = &options.pairs_file else {
        return Ok(reference_pairs(model));
    };
    let columns: Vec<&str> = JOINT_NAMES
        .iter()
        .chain(space.axis_names())
        .copied()
        .collect();
    let mut table = Table::open(file, Columns::Named(&columns)).map_err(told)?;
    let pairs = table.hand_pairs(&JOINT_NAMES, space.axis_names());
    pairs.map(Some).map_err(told)
}
