//! The trainings of a run: what is to be done, progress with an estimate, stopping.

use std::collections::HashSet;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use anyhow::Result;
use paper::plan::{Frame, What};
use paper::{Cell, Error, Kept, Laboratory, Store, Watch, run_all};

use crate::progress::Progress;
use crate::tell::Tell;
use host::failure::{Failure, told};
use host::interrupt::Interrupt;

/// The whole run's trainings.
pub struct Work<'a> {
    interrupt: &'a Interrupt,
    threads: usize,
    /// Trainings that were there at the start, and those that were not.
    found: usize,
    missing: usize,
    /// Names of those that are not there yet.
    waiting: Mutex<HashSet<String>>,
    progress: Mutex<Bar>,
}

struct Bar {
    /// Taken when the work is over.
    progress: Option<Progress>,
    /// In the units of [`Cell::work`].
    done: f64,
}

impl<'a> Work<'a> {
    /// What `wanted` needs and is not in `store` yet.
    pub fn plan(
        wanted: &[What],
        frame: &Frame,
        store: &Store,
        threads: usize,
        interrupt: &'a Interrupt,
    ) -> Self {
        let mut cells: Vec<Cell> = Vec::new();
        let mut names = HashSet::new();
        for cell in wanted.iter().flat_map(|what| frame.cells(*what)) {
            if names.insert(cell.slug()) {
                cells.push(cell);
            }
        }
        let missing: Vec<&Cell> = cells
            .iter()
            .filter(|cell| store.find(cell).is_none())
            .collect();
        let mut total: f64 = missing.iter().map(|cell| cell.work()).sum();
        if wanted.contains(&What::Fig3) {
            let stages = frame.snapshots();
            let stages = stages
                .iter()
                .filter(|cell| store.find_stages(cell).is_none());
            total += stages.map(Cell::work).sum::<f64>();
        }
        Self {
            interrupt,
            threads,
            found: cells.len() - missing.len(),
            missing: missing.len(),
            waiting: Mutex::new(missing.iter().map(|cell| cell.slug()).collect()),
            progress: Mutex::new(Bar {
                progress: Some(Progress::start("training", total as u64, false)),
                done: 0.0,
            }),
        }
    }

    /// Trainings side by side, at least one.
    pub fn threads(&self) -> usize {
        self.threads.max(1)
    }

    /// In a few words.
    pub fn describe(&self) -> String {
        format!(
            "{} to do, {} found; {} side by side",
            self.missing, self.found, self.threads
        )
    }

    /// These trainings, found or done now.
    ///
    /// # Errors
    /// A failure that names the training, or says that the run was stopped.
    pub fn train(
        &self,
        laboratory: &Laboratory,
        store: &Store,
        cells: &[Cell],
    ) -> Result<Vec<(Cell, Kept)>> {
        let arrived = |cell: &Cell, _: &Kept| {
            self.waiting().remove(&cell.slug());
        };
        let kept = run_all((laboratory, store), cells, self.threads, &arrived, self);
        let kept = kept.map_err(|error| self.failed(error))?;
        Ok(cells.iter().copied().zip(kept).collect())
    }

    /// An error of the laboratory as a person reads it.
    pub fn failed(&self, error: Error) -> anyhow::Error {
        match error {
            Error::Stopped => Failure::new(
                "interrupted; the trainings that are done are kept, the ones in work are lost",
                "the same command again: it goes on",
            )
            .into(),
            other => told(other),
        }
    }

    /// A line above the progress bar.
    pub fn say(&self, tell: &Tell, text: &str) {
        match &self.bar().progress {
            Some(progress) => progress.aside(|| tell.say(format_args!("{text}"))),
            None => tell.say(format_args!("{text}")),
        }
    }

    /// Takes the progress bar away; how long it all took.
    pub fn finish(&self) -> Duration {
        let progress = self.bar().progress.take();
        progress.map_or(Duration::ZERO, Progress::finish)
    }

    fn waiting(&self) -> MutexGuard<'_, HashSet<String>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn bar(&self) -> MutexGuard<'_, Bar> {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Watch for Work<'_> {
    fn stop(&self) -> bool {
        self.interrupt.asked()
    }

    fn advance(&self, work: f64) {
        let mut bar = self.bar();
        bar.done += work;
        let done = bar.done;
        let finished = self.missing - self.waiting().len();
        if let Some(progress) = &mut bar.progress {
            progress.at(done as u64, || {
                format!("{finished} of {} trainings", self.missing)
            });
        }
    }
}
