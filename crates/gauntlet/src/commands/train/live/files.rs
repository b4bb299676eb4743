//! The session's files: looked at before it begins, read where it goes on.

use std::path::{Path, PathBuf};

use anyhow::Result;

use super::hand::Worn;
use crate::commands::train::args::Train;
use crate::outputs::{self, Kind};
use crate::progress::Person;
use crate::tell::Tell;
use host::failure::{Failure, with_others};
use host::interrupt::Interrupt;
use host::next::{Command, NextStep};
use host::recording::poses::PosesFile;
use host::teaching::kept::{Kept, load_pairs};
use host::teaching::{Aim, Earlier, Taught};
use host::training::motion::Motion;

/// Where they are.
pub(super) struct Files {
    pub kept: Kept,
    /// The motion is there already.
    given: Option<PathBuf>,
    /// What an earlier session left.
    pub earlier: Earlier,
}

impl Files {
    /// Looks whether everything can be read and written.
    pub fn of(options: &Train, aim: &Aim) -> Result<Self> {
        let inputs = [&options.poses, &options.target, &options.resume];
        let inputs: Vec<&Path> = inputs.into_iter().flatten().map(PathBuf::as_path).collect();
        outputs::check(&options.out, Kind::Model, &inputs)?;
        let mut kept = Kept::beside(&options.out);
        let mut earlier = Earlier::default();
        let mut given = options.poses.clone();
        let resume = || Command::more().path("--resume", &kept.pairs);
        if let Some(pairs) = &options.resume {
            // It may have ended before the first pose, in the free motion.
            let is_before_poses = given.is_none() && !pairs.exists() && kept.poses.exists();
            if !is_before_poses {
                earlier.pairs = load_pairs(pairs, aim)?;
                given = given.or_else(|| Some(kept.poses.clone()));
            }
            earlier.passed_over = kept.load_passed_over(aim)?;
            kept.pairs.clone_from(pairs);
        } else {
            refuse_earlier(&kept.pairs, resume())?;
            if given.is_none() {
                refuse_earlier(&kept.poses, resume())?;
            }
            // What was passed over before pairs that are no more.
            kept.keep_passed_over(&earlier.passed_over)?;
        }
        if let Some(given) = &given {
            kept.poses.clone_from(given);
        }
        Ok(Self {
            kept,
            given,
            earlier,
        })
    }

    /// The motion to train on: that of a file, or what the person now does freely, which is kept.
    pub fn motion(
        &self,
        worn: &mut Worn<'_>,
        options: &Train,
        tell: &Tell,
        interrupt: &Interrupt,
    ) -> Result<Motion> {
        if self.given.is_none() {
            self.free_motion(worn, options, tell, interrupt)?;
        }
        let motion = Motion::open_for_training(Some(&self.kept.poses), options.seed, &Person)?;
        tell.say(format_args!("poses      {}", motion.describe()));
        Ok(motion)
    }

    /// What the person does freely, kept row by row.
    fn free_motion(
        &self,
        worn: &mut Worn<'_>,
        options: &Train,
        tell: &Tell,
        interrupt: &Interrupt,
    ) -> Result<()> {
        let path = self.poses();
        let (rows, file, sender) = match path.exists() {
            true => PosesFile::go_on(path, interrupt)?,
            false => {
                let (file, sender) = PosesFile::create(path, interrupt, Some)?;
                (Vec::new(), file, sender)
            }
        };
        let earlier = rows.len() as u64;
        let moved = worn.moves_freely(rows, sender, (options.json, tell), interrupt);
        let (count, written) = file.finish();
        written?;
        if moved? {
            return Ok(());
        }
        let what = format!(
            "ended in the free motion: {} poses of it are kept in {}",
            earlier + count,
            path.display()
        );
        let more = Command::more().path("--resume", self.pairs());
        let next = match earlier + count {
            0 => NextStep::same(Command::more()),
            _ => NextStep::same(more),
        };
        Err(Failure::new(what, next).into())
    }

    /// The file of the pairs.
    pub fn pairs(&self) -> &Path {
        &self.kept.pairs
    }

    /// The file of the motion.
    pub fn poses(&self) -> &Path {
        &self.kept.poses
    }

    /// How the session goes on.
    fn again(&self, pairs: &[Taught]) -> NextStep {
        let more = Command::more().path("--poses", self.poses());
        match pairs.is_empty() {
            true => NextStep::same(more),
            false => NextStep::same(more.path("--resume", self.pairs())),
        }
    }

    /// The person ended it.
    pub fn stopped(&self, pairs: &[Taught]) -> Failure {
        let what = format!(
            "ended before all poses were shown: {} of them are kept in {}",
            pairs.len(),
            self.pairs().display()
        );
        Failure::new(what, self.again(pairs))
    }

    /// The person ended the last stage.
    pub fn untrained(&self, pairs: &[Taught]) -> Failure {
        let what = format!(
            "interrupted in the training: no model was made; the {} poses are kept in {}",
            pairs.len(),
            self.pairs().display()
        );
        Failure::new(what, self.again(pairs))
    }

    /// What ended it, and how it goes on.
    pub fn goes_on(&self, error: anyhow::Error, pairs: &[Taught]) -> anyhow::Error {
        let kept = format!(
            "{} poses are kept in {}: --resume goes on with them",
            pairs.len(),
            self.pairs().display()
        );
        with_others(error, vec![kept])
    }
}

/// A file of an earlier session is never written over.
fn refuse_earlier(path: &Path, more: Command) -> Result<()> {
    if std::fs::symlink_metadata(path).is_err() {
        return Ok(());
    }
    let what = format!(
        "{} is there from an earlier session, and is never written over",
        path.display()
    );
    let next = NextStep::same(more).then(" goes on with it; or another --out");
    Err(Failure::usage(what, next).into())
}
