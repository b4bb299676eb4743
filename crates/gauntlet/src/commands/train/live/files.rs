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
use host::teaching::kept::{Kept, load_pairs};
use host::teaching::{Aim, Taught};
use host::training::motion::Motion;

/// Where they are.
pub(super) struct Files {
    pub kept: Kept,
    /// The motion is there already.
    given: Option<PathBuf>,
    /// Pairs of an earlier session.
    pub earlier: Vec<Taught>,
}

impl Files {
    /// Looks whether everything can be read and written.
    pub fn of(options: &Train, aim: &Aim) -> Result<Self> {
        let inputs = [&options.poses, &options.target, &options.resume];
        let inputs: Vec<&Path> = inputs.into_iter().flatten().map(PathBuf::as_path).collect();
        outputs::check(&options.out, Kind::Model, &inputs)?;
        let mut kept = Kept::beside(&options.out);
        let mut earlier = Vec::new();
        let mut given = options.poses.clone();
        if let Some(pairs) = &options.resume {
            earlier = load_pairs(pairs, aim)?;
            kept.pairs.clone_from(pairs);
            given = given.or_else(|| Some(kept.poses.clone()));
        } else {
            refuse_earlier(&kept.pairs, Command::more().path("--resume", &kept.pairs))?;
        }
        match &given {
            Some(given) => kept.poses.clone_from(given),
            None => {
                refuse_earlier(&kept.poses, Command::more().path("--poses", &kept.poses))?;
            }
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
            let free = worn.moves_freely(options.json, tell, interrupt)?;
            self.kept.keep_motion(free.rows())?;
        }
        let motion = Motion::open_for_training(Some(&self.kept.poses), options.seed, &Person)?;
        tell.say(format_args!("poses      {}", motion.describe()));
        Ok(motion)
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
