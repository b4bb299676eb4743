//! The CSV files: poses (`time_s`, `clip`, joint names), reference pairs (inputs then targets), samples `q0…` or `x0…` of any
//! other domain. Columns are found by name, in any order; columns that nobody asked for are passed over.

use super::{Error, Matrix};
use std::path::{Path, PathBuf};

/// Frames of joint angles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Poses {
    /// Time of each frame in seconds, strictly growing; `None` when the file has no column `time_s`.
    pub time_s: Option<Vec<f64>>,
    /// The angles, radians, one frame a row.
    pub rows: Matrix,
}

/// Reference pairs or ground truth: row i of `inputs` belongs to row i of `targets`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pairs {
    /// Input samples.
    pub inputs: Matrix,
    /// Target samples.
    pub targets: Matrix,
}

impl Pairs {
    /// `count` of these pairs at equal distances around their ring: number round(i·M/`count`) of M, for i = 1 … `count`, the last
    /// being the first of the ring. Nothing from no pairs.
    #[must_use]
    pub fn spaced(&self, count: usize) -> Self {
        let ring = self.inputs.rows.max(1);
        let places: Vec<usize> = (1..=count)
            .map(|i| (2 * i * ring + count) / (2 * count) % ring)
            .collect();
        Self {
            inputs: self.inputs.select(&places),
            targets: self.targets.select(&places),
        }
    }
}

/// Reads poses: the columns `joint_names` (radians), and `time_s` if there. Needs at least one frame.
///
/// # Errors
/// Any of [`Error`], with file, column, row and value.
pub fn read_poses(path: impl AsRef<Path>, joint_names: &[&str]) -> Result<Poses, Error> {
    let path = path.as_ref();
    let file = std::fs::File::open(path).map_err(|source| Error::Read {
        file: path.to_owned(),
        source,
    })?;
    poses_from(file, path, joint_names)
}

/// As [`read_poses`], from any reader; `name` stands for the file in errors.
///
/// # Errors
/// Any of [`Error`].
pub fn poses_from(
    reader: impl std::io::Read,
    name: &Path,
    joint_names: &[&str],
) -> Result<Poses, Error> {
    let table = Table::read(reader, name)?;
    let rows = table.angles(joint_names)?;
    table.at_least(1)?;
    Ok(Poses {
        time_s: table.times()?,
        rows,
    })
}

/// Reads a hand's pairs: the columns `inputs` (radians), then the columns `targets`. Needs at least one row.
///
/// # Errors
/// Any of [`Error`].
pub fn read_pairs(
    path: impl AsRef<Path>,
    inputs: &[&str],
    targets: &[&str],
) -> Result<Pairs, Error> {
    let table = Table::open(path.as_ref())?;
    let pairs = Pairs {
        inputs: table.angles(inputs)?,
        targets: table.columns(targets)?,
    };
    table.at_least(1)?;
    Ok(pairs)
}

/// Reads samples of any domain: the columns `<prefix>0`, `<prefix>1`, … as many as the header has. Needs at least one row.
///
/// # Errors
/// Any of [`Error`]; a gap in the numbering is a missing column.
pub fn read_samples(path: impl AsRef<Path>, prefix: &str) -> Result<Matrix, Error> {
    let table = Table::open(path.as_ref())?;
    let samples = table.numbered(prefix)?;
    table.at_least(1)?;
    Ok(samples)
}

/// Reads ground truth of any two domains: columns `q0…` and `x0…`. Needs at least one row.
///
/// # Errors
/// Any of [`Error`].
pub fn read_truth(path: impl AsRef<Path>) -> Result<Pairs, Error> {
    let table = Table::open(path.as_ref())?;
    let pairs = Pairs {
        inputs: table.numbered("q")?,
        targets: table.numbered("x")?,
    };
    table.at_least(1)?;
    Ok(pairs)
}

/// Writes poses as [`read_poses`] reads them, `time_s` first when there. The file appears whole or not at all.
///
/// # Errors
/// [`Error::Write`].
pub fn write_poses(
    path: impl AsRef<Path>,
    poses: &Poses,
    joint_names: &[&str],
) -> Result<(), Error> {
    let mut header: Vec<String> = Vec::new();
    if poses.time_s.is_some() {
        header.push("time_s".to_owned());
    }
    header.extend(joint_names.iter().map(ToString::to_string));
    let lines = poses.rows.iter_rows().enumerate().map(|(index, row)| {
        let time = poses.time_s.as_ref().and_then(|times| times.get(index));
        let time = time.map(|seconds| format!("{seconds:.4}"));
        time.into_iter().chain(row.iter().map(f32::to_string))
    });
    write_csv(path.as_ref(), &header, lines)
}

/// Writes pairs as [`read_pairs`] reads them. The file appears whole or not at all.
///
/// # Errors
/// [`Error::Write`].
pub fn write_pairs(
    path: impl AsRef<Path>,
    pairs: &Pairs,
    inputs: &[&str],
    targets: &[&str],
) -> Result<(), Error> {
    let names = inputs.iter().chain(targets);
    let header: Vec<String> = names.map(ToString::to_string).collect();
    let rows = pairs.inputs.iter_rows().zip(pairs.targets.iter_rows());
    let lines = rows.map(|(q, x)| q.iter().chain(x).map(f32::to_string));
    write_csv(path.as_ref(), &header, lines)
}

/// Writes samples as [`read_samples`] reads them. The file appears whole or not at all.
///
/// # Errors
/// [`Error::Write`].
pub fn write_samples(path: impl AsRef<Path>, samples: &Matrix, prefix: &str) -> Result<(), Error> {
    let header: Vec<String> = (0..samples.cols).map(|i| format!("{prefix}{i}")).collect();
    let lines = samples
        .iter_rows()
        .map(|row| row.iter().map(f32::to_string));
    write_csv(path.as_ref(), &header, lines)
}

fn write_csv<L, F>(path: &Path, header: &[String], lines: L) -> Result<(), Error>
where
    L: Iterator<Item = F>,
    F: Iterator<Item = String>,
{
    let mut text = header.join(",");
    text.push('\n');
    for line in lines {
        text.push_str(&line.collect::<Vec<_>>().join(","));
        text.push('\n');
    }
    crate::whole_file::write(path, text.as_bytes()).map_err(|source| Error::Write {
        file: path.to_owned(),
        source,
    })
}

/// A CSV file in memory: every row has as many fields as the header, names are unique.
struct Table {
    file: PathBuf,
    header: Vec<String>,
    rows: Vec<(u64, csv::StringRecord)>,
}

impl Table {
    fn open(path: &Path) -> Result<Self, Error> {
        let file = std::fs::File::open(path).map_err(|source| Error::Read {
            file: path.to_owned(),
            source,
        })?;
        Self::read(file, path)
    }

    fn read(mut reader: impl std::io::Read, name: &Path) -> Result<Self, Error> {
        let mut bytes = Vec::new();
        reader
            .read_to_end(&mut bytes)
            .map_err(|source| Error::Read {
                file: name.to_owned(),
                source,
            })?;
        let mut reader = csv::ReaderBuilder::new()
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(&bytes[..]);
        let header = reader.headers().map_err(|error| csv_error(name, error))?;
        let header: Vec<String> = header
            .iter()
            // Spreadsheets put a byte order mark before the first name.
            .map(|field| field.trim_start_matches('\u{feff}').to_owned())
            .collect();
        if header.iter().all(String::is_empty) {
            return Err(Error::Empty {
                file: name.to_owned(),
            });
        }
        let mut rows = Vec::new();
        for record in reader.into_records() {
            let record = record.map_err(|error| csv_error(name, error))?;
            let line = record.position().map_or(0, |place| line_of(place, &bytes));
            if record.len() != header.len() {
                return Err(Error::Ragged {
                    file: name.to_owned(),
                    line,
                    row: rows.len() + 1,
                    found: record.len(),
                    expected: header.len(),
                });
            }
            rows.push((line, record));
        }
        Ok(Self {
            file: name.to_owned(),
            header,
            rows,
        })
    }

    /// Where `column` stands, `None` if nowhere.
    fn position(&self, column: &str) -> Result<Option<usize>, Error> {
        let mut places = (0..self.header.len()).filter(|&i| self.header[i] == column);
        let first = places.next();
        if places.next().is_some() {
            return Err(Error::DuplicateColumn {
                file: self.file.clone(),
                column: column.to_owned(),
            });
        }
        Ok(first)
    }

    fn needed_position(&self, column: &str) -> Result<usize, Error> {
        self.position(column)?.ok_or_else(|| Error::MissingColumn {
            file: self.file.clone(),
            column: column.to_owned(),
            found: self.header.clone(),
        })
    }

    fn columns<S: AsRef<str>>(&self, names: &[S]) -> Result<Matrix, Error> {
        let places = names
            .iter()
            .map(|name| self.needed_position(name.as_ref()))
            .collect::<Result<Vec<_>, _>>()?;
        let mut values = Vec::with_capacity(places.len() * self.rows.len());
        for row in 0..self.rows.len() {
            for &place in &places {
                values.push(self.number(row, place)? as f32);
            }
        }
        Ok(Matrix {
            rows: self.rows.len(),
            cols: places.len(),
            data: values,
        })
    }

    /// Columns of joint angles, none beyond ±2π.
    fn angles(&self, names: &[&str]) -> Result<Matrix, Error> {
        let angles = self.columns(names)?;
        let beyond = |angle: &f32| angle.abs() > core::f32::consts::TAU;
        if let Some(place) = angles.data.iter().position(beyond) {
            let row = place / angles.cols;
            return Err(Error::NotRadians {
                file: self.file.clone(),
                line: self.rows[row].0,
                row: row + 1,
                column: names[place % angles.cols].to_owned(),
                value: angles.data[place],
            });
        }
        Ok(angles)
    }

    /// The columns `<prefix>0…`: as many as the highest number in the header asks for, at least one.
    fn numbered(&self, prefix: &str) -> Result<Matrix, Error> {
        let numbers = self
            .header
            .iter()
            .filter_map(|name| name.strip_prefix(prefix)?.parse::<usize>().ok());
        // A gap shows within the first `header.len()` numbers, so a wild number makes no long list.
        let count = numbers.max().unwrap_or(0).min(self.header.len()) + 1;
        let names: Vec<String> = (0..count).map(|i| format!("{prefix}{i}")).collect();
        self.columns(&names)
    }

    /// A finite number that stays finite as f32.
    fn number(&self, row: usize, place: usize) -> Result<f64, Error> {
        let (line, record) = &self.rows[row];
        let text = record.get(place).unwrap_or_default();
        match text.parse::<f64>() {
            Ok(value) if (value as f32).is_finite() => Ok(value),
            Ok(_) => Err(Error::NotFinite {
                file: self.file.clone(),
                line: *line,
                row: row + 1,
                column: self.header[place].clone(),
                value: text.to_owned(),
            }),
            Err(_) => Err(Error::NotNumeric {
                file: self.file.clone(),
                line: *line,
                row: row + 1,
                column: self.header[place].clone(),
                value: text.to_owned(),
            }),
        }
    }

    fn times(&self) -> Result<Option<Vec<f64>>, Error> {
        let Some(place) = self.position("time_s")? else {
            return Ok(None);
        };
        let mut times: Vec<f64> = Vec::with_capacity(self.rows.len());
        for row in 0..self.rows.len() {
            let time_s = self.number(row, place)?;
            if let Some(&before) = times.last()
                && time_s <= before
            {
                return Err(Error::TimeNotIncreasing {
                    file: self.file.clone(),
                    line: self.rows[row].0,
                    row: row + 1,
                    time_s,
                    before,
                });
            }
            times.push(time_s);
        }
        Ok(Some(times))
    }

    fn at_least(&self, needed: usize) -> Result<(), Error> {
        super::require_rows(&self.file, self.rows.len(), needed)
    }
}

/// The line on which a record starts: its position is before the empty lines that were passed over.
fn line_of(place: &csv::Position, bytes: &[u8]) -> u64 {
    let start = usize::try_from(place.byte()).unwrap_or(usize::MAX);
    let rest = bytes.get(start..).unwrap_or_default();
    let empty = rest.iter().take_while(|byte| matches!(byte, b'\r' | b'\n'));
    place.line() + empty.filter(|byte| **byte == b'\n').count() as u64
}

fn csv_error(file: &Path, error: csv::Error) -> Error {
    let line = error.position().map_or(1, csv::Position::line);
    let what = error.to_string();
    match error.into_kind() {
        csv::ErrorKind::Io(source) => Error::Read {
            file: file.to_owned(),
            source,
        },
        csv::ErrorKind::Utf8 { err, .. } => Error::NotCsv {
            file: file.to_owned(),
            line,
            what: format!("field {} is not UTF-8", err.field() + 1),
        },
        _ => Error::NotCsv {
            file: file.to_owned(),
            line,
            what,
        },
    }
}
