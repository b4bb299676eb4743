//! Cells that are done, kept in a folder: a model file and a JSON file each, the JSON last, so that a cell is there whole or not at
//! all. A reproduction that was stopped goes on where it was.

use super::{Cell, Error, Laboratory, Outcome, Stage, Watch};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicUsize, Ordering};
use trainer::data::{Matrix, Pairs};
use trainer::measures::Measures;
use trainer::model::Model;
use trainer::network::Network;

/// A folder of cells.
#[derive(Clone, Debug)]
pub struct Store {
    folder: PathBuf,
    digest: String,
}

/// What is kept of a cell beside its model.
#[derive(Clone, Debug, PartialEq)]
pub struct Kept {
    /// The measures on held-out samples.
    pub measures: Measures,
    /// Epoch and measures on the way.
    pub trace: Vec<(usize, Measures)>,
    /// The reference pairs, in the domains' units.
    pub pairs: Pairs,
    /// Seconds of training.
    pub seconds: f64,
}

/// The JSON file.
#[derive(Serialize, Deserialize)]
struct Record {
    format: u32,
    cell: String,
    measures: [Option<f64>; 4],
    trace: Vec<(usize, [Option<f64>; 4])>,
    pair_inputs: Vec<Vec<f32>>,
    pair_targets: Vec<Vec<f32>>,
    seconds: f64,
}

/// The JSON file of a cell's stages.
#[derive(Serialize, Deserialize)]
struct StagesRecord {
    format: u32,
    cell: String,
    stages: Vec<StageRecord>,
}

#[derive(Serialize, Deserialize)]
struct StageRecord {
    #[serde(with = "NetworkRecord")]
    f: Network<f32>,
    pair_inputs: Vec<Vec<f32>>,
    pair_targets: Vec<Vec<f32>>,
}

/// The fields of a network, to be kept.
#[derive(Serialize, Deserialize)]
#[serde(remote = "Network<f32>")]
struct NetworkRecord {
    inputs: usize,
    hidden: usize,
    outputs: usize,
    w1: Vec<f32>,
    b1: Vec<f32>,
    w2: Vec<f32>,
    b2: Vec<f32>,
}

/// Grows whenever results of the same cell change.
const FORMAT: u32 = 1;

impl Store {
    /// Cells in `folder`, which is made if it is not there. `recording` tells apart cells of different recordings.
    ///
    /// # Errors
    /// [`Error::Folder`].
    pub fn open(folder: impl AsRef<Path>, recording: Option<&Matrix>) -> Result<Self, Error> {
        let folder = folder.as_ref().to_owned();
        std::fs::create_dir_all(&folder).map_err(|source| Error::Folder {
            path: folder.clone(),
            source,
        })?;
        let digest = recording.map_or(String::new(), |frames| {
            trainer::data::sha256(&[frames])[..8].to_owned()
        });
        Ok(Self { folder, digest })
    }

    fn path(&self, cell: &Cell, ending: &str) -> PathBuf {
        let mut name = cell.slug();
        if cell.source == super::Source::Recorded {
            name = format!("{name}-{}", self.digest);
        }
        self.folder.join(format!("{name}.{ending}"))
    }

    /// A cell that is done. A file that is damaged or of another format counts as not done.
    #[must_use]
    pub fn find(&self, cell: &Cell) -> Option<Kept> {
        let text = std::fs::read_to_string(self.path(cell, "json")).ok()?;
        let record: Record = serde_json::from_str(&text).ok()?;
        if record.format != FORMAT || record.cell != cell.slug() {
            return None;
        }
        Some(Kept {
            measures: from_numbers(record.measures),
            trace: (record.trace.into_iter())
                .map(|(epoch, numbers)| (epoch, from_numbers(numbers)))
                .collect(),
            pairs: Pairs {
                inputs: from_lists(&record.pair_inputs),
                targets: from_lists(&record.pair_targets),
            },
            seconds: record.seconds,
        })
    }

    /// The model of a cell that is done.
    ///
    /// # Errors
    /// [`Error::Model`].
    pub fn model(&self, cell: &Cell) -> Result<Model, Error> {
        Ok(Model::load(self.path(cell, "safetensors"))?)
    }

    /// Keeps a cell.
    ///
    /// # Errors
    /// [`Error::Model`], [`Error::Folder`].
    pub fn keep(&self, cell: &Cell, outcome: &Outcome) -> Result<Kept, Error> {
        outcome.model.save(self.path(cell, "safetensors"))?;
        let record = Record {
            format: FORMAT,
            cell: cell.slug(),
            measures: to_numbers(&outcome.measures),
            trace: (outcome.trace.iter())
                .map(|(epoch, measures)| (*epoch, to_numbers(measures)))
                .collect(),
            pair_inputs: to_lists(&outcome.pairs.inputs),
            pair_targets: to_lists(&outcome.pairs.targets),
            seconds: outcome.seconds,
        };
        self.write(&self.path(cell, "json"), &record)?;
        Ok(Kept {
            measures: outcome.measures,
            trace: outcome.trace.clone(),
            pairs: outcome.pairs.clone(),
            seconds: outcome.seconds,
        })
    }

    /// A cell: found, or trained now and kept.
    ///
    /// # Errors
    /// [`Error`].
    pub fn get(
        &self,
        laboratory: &Laboratory,
        cell: &Cell,
        watch: &dyn Watch,
    ) -> Result<Kept, Error> {
        match self.find(cell) {
            Some(kept) => Ok(kept),
            None => self.keep(cell, &laboratory.run(cell, watch)?),
        }
    }

    /// The stages of a cell (see [`Laboratory::stages`]) that were kept.
    #[must_use]
    pub fn find_stages(&self, cell: &Cell) -> Option<Vec<Stage>> {
        let text = std::fs::read_to_string(self.path(cell, "stages.json")).ok()?;
        let record: StagesRecord = serde_json::from_str(&text).ok()?;
        let is_this = record.format == FORMAT && record.cell == cell.slug();
        let stages = record.stages.into_iter().map(|stage| {
            let pairs = Pairs {
                inputs: from_lists(&stage.pair_inputs),
                targets: from_lists(&stage.pair_targets),
            };
            (stage.f, pairs)
        });
        is_this.then(|| stages.collect())
    }

    /// The stages of a cell: found, or trained now and kept.
    ///
    /// # Errors
    /// [`Error`].
    pub fn stages(
        &self,
        laboratory: &Laboratory,
        cell: &Cell,
        watch: &dyn Watch,
    ) -> Result<Vec<Stage>, Error> {
        if let Some(stages) = self.find_stages(cell) {
            return Ok(stages);
        }
        let stages = laboratory.stages(cell, watch)?;
        let record = StagesRecord {
            format: FORMAT,
            cell: cell.slug(),
            stages: (stages.iter())
                .map(|(f, pairs)| StageRecord {
                    f: f.clone(),
                    pair_inputs: to_lists(&pairs.inputs),
                    pair_targets: to_lists(&pairs.targets),
                })
                .collect(),
        };
        self.write(&self.path(cell, "stages.json"), &record)?;
        Ok(stages)
    }

    fn write(&self, path: &Path, record: &impl Serialize) -> Result<(), Error> {
        let text = serde_json::to_vec(record).map_err(std::io::Error::other);
        text.and_then(|text| trainer::whole_file::write(path, &text))
            .map_err(|source| Error::Folder {
                path: path.to_owned(),
                source,
            })
    }
}

/// All cells, found or trained, on `threads` threads (a cell each); the results stand in the order of the cells and do not depend on
/// the number of threads. `done` hears of every cell as it is there. The first error stops the rest; what is done is kept.
///
/// # Errors
/// [`Error`], [`Error::Stopped`] when `watch` said so.
pub fn run_all(
    (laboratory, store): (&Laboratory, &Store),
    cells: &[Cell],
    threads: usize,
    done: &(dyn Fn(&Cell, &Kept) + Sync),
    watch: &dyn Watch,
) -> Result<Vec<Kept>, Error> {
    let next = AtomicUsize::new(0);
    let failed = Mutex::new(None);
    let results: Vec<Mutex<Option<Kept>>> = cells.iter().map(|_| Mutex::new(None)).collect();
    let has_failed = || {
        let failed = failed.lock().unwrap_or_else(PoisonError::into_inner);
        failed.is_some()
    };
    let work = || {
        while let Some(index) =
            Some(next.fetch_add(1, Ordering::Relaxed)).filter(|&i| i < cells.len())
        {
            let cell = &cells[index];
            let watch = OrFailed {
                watch,
                has_failed: &has_failed,
            };
            match store.get(laboratory, cell, &watch) {
                Ok(kept) => {
                    done(cell, &kept);
                    *results[index]
                        .lock()
                        .unwrap_or_else(PoisonError::into_inner) = Some(kept);
                }
                Err(error) => {
                    let mut first = failed.lock().unwrap_or_else(PoisonError::into_inner);
                    first.get_or_insert(error);
                    return;
                }
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads.max(1) {
            scope.spawn(work);
        }
        work();
    });
    if let Some(error) = failed.into_inner().unwrap_or_else(PoisonError::into_inner) {
        return Err(error);
    }
    let kept = results.into_iter().map(|result| {
        let result = result.into_inner().unwrap_or_else(PoisonError::into_inner);
        result.ok_or(Error::Stopped)
    });
    kept.collect()
}

/// Stops also when another thread has failed.
struct OrFailed<'a> {
    watch: &'a dyn Watch,
    has_failed: &'a (dyn Fn() -> bool + Sync),
}

impl Watch for OrFailed<'_> {
    fn stop(&self) -> bool {
        self.watch.stop() || (self.has_failed)()
    }

    fn advance(&self, work: f64) {
        self.watch.advance(work);
    }
}

/// JSON has no NaN: what is not finite is null.
fn to_numbers(measures: &Measures) -> [Option<f64>; 4] {
    [
        Some(measures.distortion),
        measures.occupancy,
        Some(measures.dissimilarity),
        measures.nmse,
    ]
    .map(|number| number.filter(|n| n.is_finite()))
}

fn from_numbers([distortion, occupancy, dissimilarity, nmse]: [Option<f64>; 4]) -> Measures {
    Measures {
        distortion: distortion.unwrap_or(f64::NAN),
        occupancy,
        dissimilarity: dissimilarity.unwrap_or(f64::NAN),
        nmse,
    }
}

fn to_lists(samples: &Matrix) -> Vec<Vec<f32>> {
    samples.iter_rows().map(<[f32]>::to_vec).collect()
}

fn from_lists(rows: &[Vec<f32>]) -> Matrix {
    let mut samples = Matrix::default();
    for row in rows {
        samples.push(row);
    }
    samples
}
