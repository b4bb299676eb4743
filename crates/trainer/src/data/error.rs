//! What can be wrong with a file of samples.

use std::path::{Path, PathBuf};

use crate::remedy::Remedy;
use crate::whole_file;

/// A row of a file.
#[derive(Clone, Debug)]
pub struct Row {
    /// The file.
    pub file: PathBuf,
    /// Line in the file, from 1.
    pub line: u64,
    /// Row, from 1.
    pub row: usize,
}

impl core::fmt::Display for Row {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { file, line, row } = self;
        write!(f, "{}, line {line} (row {row})", file.display())
    }
}

/// A field of a file; displayed without its value.
#[derive(Clone, Debug)]
pub struct Field {
    /// Its row.
    pub row: Row,
    /// Its column, as written.
    pub column: String,
    /// What stands there, as written.
    pub value: String,
}

impl core::fmt::Display for Field {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}, column `{}`", self.row, self.column)
    }
}

/// What can be wrong with a file of samples. Rows are counted from 1 without the header; the line of the file comes with them.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file cannot be read or written.
    #[error(transparent)]
    File(#[from] whole_file::Error),
    /// Not text, or the quotes do not close.
    #[error(
        "{}, line {line}: not CSV text ({what})", file.display()
    )]
    NotCsv {
        /// The file.
        file: PathBuf,
        /// Line of the fault, from 1.
        line: u64,
        /// What the reader said.
        what: String,
    },
    /// Another encoding than UTF-8, or no text.
    #[error("{} is {what}, not UTF-8 text", file.display())]
    Encoding {
        /// The file.
        file: PathBuf,
        /// What it seems to be.
        what: String,
        /// What makes it readable.
        next: String,
    },
    /// Numbers where the header should be.
    #[error(
        "{}, line {line}: {fields} fields, numbers: the header is missing", file.display()
    )]
    NoHeader {
        /// The file.
        file: PathBuf,
        /// Line in the file, from 1.
        line: u64,
        /// Fields on that line.
        fields: usize,
    },
    /// Commas between the fields and within the numbers.
    #[error(
        "{at}: {found} fields, the header has {expected}: decimal commas cannot be told from the commas between fields"
    )]
    BothCommas {
        /// Where.
        at: Row,
        /// Fields in this row.
        found: usize,
        /// Fields in the header.
        expected: usize,
    },
    /// A decimal point in a file with decimal commas.
    #[error("{0}: `{value}` has a point, others have decimal commas", value = .0.value)]
    TwoMarks(Field),
    /// No header line.
    #[error(
        "{} is empty", file.display()
    )]
    Empty {
        /// The file.
        file: PathBuf,
    },
    /// A column that is needed is not in the header.
    #[error(
        "{}: column `{column}` is missing ({})", file.display(), Named(found)
    )]
    MissingColumn {
        /// The file.
        file: PathBuf,
        /// The missing column.
        column: String,
        /// The header as it stands.
        found: Vec<String>,
    },
    /// A column is in the header twice.
    #[error(
        "{}: column `{column}` is in the header twice", file.display()
    )]
    DuplicateColumn {
        /// The file.
        file: PathBuf,
        /// The column.
        column: String,
    },
    /// A row has more or fewer fields than the header.
    #[error("{at}: {found} fields, the header has {expected}")]
    Ragged {
        /// Where.
        at: Row,
        /// Fields in this row.
        found: usize,
        /// Fields in the header.
        expected: usize,
    },
    /// A field is not a number.
    #[error("{0}: `{value}` is not a number", value = .0.value)]
    NotNumeric(Field),
    /// A field is NaN, infinite, or too large for a 32-bit number.
    #[error("{0}: {value} is not a finite value", value = .0.value)]
    NotFinite(Field),
    /// An angle beyond a full turn.
    #[error(
        "{at}: {} is beyond {}", at.value,
        if *degrees { "±360°" } else { "±2π radians" }
    )]
    BeyondTurn {
        /// Where, and the value.
        at: Field,
        /// Whether the file is in degrees.
        degrees: bool,
    },
    /// A unit that no angle has.
    #[error(
        "{}: column `{column}` is in `{unit}`, which is no unit of angles", file.display()
    )]
    Unit {
        /// The file.
        file: PathBuf,
        /// The column as written.
        column: String,
        /// The unit as written.
        unit: String,
    },
    /// Angles of two units.
    #[error(
        "{}: column `{column}` is not said to be in {others}, as others are", file.display()
    )]
    MixedUnits {
        /// The file.
        file: PathBuf,
        /// The column as written.
        column: String,
        /// The unit of the others.
        others: &'static str,
    },
    /// Times do not grow.
    #[error(
        "{at}: {} does not come after {before}", at.value
    )]
    TimeNotIncreasing {
        /// Where, and the time of this row.
        at: Field,
        /// The time of the row before.
        before: f64,
    },
    /// Fewer rows than the work at hand needs.
    #[error(
        "{}: {found} rows, at least {needed} are needed", file.display()
    )]
    TooFewRows {
        /// The file.
        file: PathBuf,
        /// Rows found.
        found: usize,
        /// Rows needed.
        needed: usize,
    },
}

impl Remedy for Error {
    fn remedy(&self) -> String {
        match self {
            Self::File(error) => error.remedy(),
            Self::NotCsv { .. } => "save it as comma-separated UTF-8 text with one header line".to_owned(),
            Self::Encoding { next, .. } => next.clone(),
            Self::NoHeader { .. } => "put a line with the columns' names above".to_owned(),
            Self::BothCommas { .. } => "save it with semicolons between the fields, or with decimal points".to_owned(),
            Self::TwoMarks { .. } => "save the file with one of them, without marks between thousands".to_owned(),
            Self::Empty { .. } => "it needs a header line that names the columns, then one line a sample".to_owned(),
            Self::MissingColumn { .. } => "add it to the header line and to every row".to_owned(),
            Self::DuplicateColumn { .. } => "remove or rename one of them".to_owned(),
            Self::Ragged { .. } => "complete or remove this row".to_owned(),
            Self::NotNumeric { .. } => "write it like 0.25, or remove this row".to_owned(),
            Self::NotFinite { .. } => "remove this row or fill the gap".to_owned(),
            Self::BeyondTurn { degrees: true, .. } => "repair or remove this row".to_owned(),
            Self::BeyondTurn { .. } => "take full turns away where a sensor counted on, or say in the header that angles are in degrees (index_mcp_flex [deg])".to_owned(),
            Self::Unit { .. } => "give radians ([rad]) or degrees ([deg])".to_owned(),
            Self::MixedUnits { .. } => "write one unit for all angles".to_owned(),
            Self::TimeNotIncreasing { .. } => "a new clip there needs another word in a column clip, a wrong time its right value, and without any column of times the rows count in their order".to_owned(),
            Self::TooFewRows { .. } => "record more samples".to_owned(),
        }
    }
}

/// A header as a person reads it in an error: the first names and how many more.
struct Named<'a>(&'a [String]);

impl core::fmt::Display for Named<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        const SHOWN: usize = 6;
        write!(f, "the header has {} columns: ", self.0.len())?;
        write!(f, "{}", self.0[..self.0.len().min(SHOWN)].join(", "))?;
        if self.0.len() > SHOWN {
            write!(f, ", …")?;
        }
        Ok(())
    }
}

/// Says clearly that a file has fewer samples than the work at hand needs (training needs more samples than pairs, and some to hold out).
///
/// # Errors
/// [`Error::TooFewRows`].
pub fn require_rows(file: &Path, found: usize, needed: usize) -> Result<(), Error> {
    if found < needed {
        return Err(Error::TooFewRows {
            file: file.to_owned(),
            found,
            needed,
        });
    }
    Ok(())
}
