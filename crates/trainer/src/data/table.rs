//! A table of samples in memory: columns found by name, numbers as people write them, and what was taken otherwise than it stands.

use super::error::{Error, Field, Row, require_rows};
use super::matrix::Matrix;
use super::names::{Name, Unit};
use super::text::{LONGEST, Separator, Sheet};
use crate::whole_file;
use std::io::Read;
use std::path::{Path, PathBuf};

/// The columns that a table is opened for.
#[derive(Clone, Copy, Debug)]
pub enum Columns<'a> {
    /// By these names.
    Named(&'a [&'a str]),
    /// `<prefix>0`, `<prefix>1`, … for each of these prefixes.
    Numbered(&'a [&'a str]),
}

impl Columns<'_> {
    fn want(&self, name: &Name) -> bool {
        match self {
            Self::Named(names) => names.iter().any(|column| name.is(column)),
            Self::Numbered(prefixes) => {
                let number =
                    |prefix: &&str| name.plain.strip_prefix(*prefix)?.parse::<usize>().ok();
                prefixes.iter().any(|prefix| number(prefix).is_some())
            }
        }
    }
}

/// A table: every row has as many fields as the header, names are unique among the columns that are asked for.
#[derive(Debug)]
pub struct Table {
    pub(super) file: PathBuf,
    pub(super) header: Vec<Name>,
    pub(super) rows: Vec<(u64, csv::StringRecord)>,
    /// Rows before which the header stood again: files were put one after another.
    pub(super) joints: Vec<usize>,
    /// The comma is the decimal mark.
    decimal_comma: bool,
    notes: Vec<String>,
}

impl Table {
    /// Opens the file at `path` for these columns.
    ///
    /// # Errors
    /// [`Error`]: of the file, its encoding, its header or its rows.
    pub fn open(path: impl AsRef<Path>, columns: Columns<'_>) -> Result<Self, Error> {
        let path = path.as_ref();
        let file =
            std::fs::File::open(path).map_err(|why| whole_file::Error::reading(path, why))?;
        Self::read(file, path, columns)
    }

    /// As [`Table::open`], from any reader; `name` stands for the file in errors.
    ///
    /// # Errors
    /// [`Error`], as [`Table::open`].
    pub fn read(reader: impl Read, name: &Path, columns: Columns<'_>) -> Result<Self, Error> {
        let failed = |why| Error::from(whole_file::Error::reading(name, why));
        let mut bytes = Vec::new();
        let mut reader = reader.take(LONGEST + 1);
        reader.read_to_end(&mut bytes).map_err(failed)?;
        if bytes.len() as u64 > LONGEST {
            let longest = LONGEST >> 20;
            let what = format!("longer than {longest} MB, which is no table of samples");
            return Err(failed(std::io::Error::other(what)));
        }
        let sheet = Sheet::read(&bytes, name, &|field| columns.want(field))?;
        let mut table = Self {
            file: name.to_owned(),
            header: sheet.header.iter().map(|field| Name::of(field)).collect(),
            rows: sheet.rows,
            joints: Vec::new(),
            decimal_comma: false,
            notes: sheet.notes,
        };
        table.drop_headers(&sheet.header);
        table.drop_empty_end();
        table.square(sheet.separator)?;
        table.take_units(columns);
        table.find_decimal_mark();
        Ok(table)
    }

    /// What was taken otherwise than it stands, for a person to read: one line each, without the file's name.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    pub(super) fn note(&mut self, note: String) {
        self.notes.push(note);
    }

    /// Samples of any domain: the columns `<prefix>0`, `<prefix>1`, … as many as the header has.
    ///
    /// # Errors
    /// Any of [`Error`]; a gap in the numbering is a missing column.
    pub fn samples(&mut self, prefix: &str) -> Result<Matrix, Error> {
        let samples = self.numbered(prefix)?;
        self.at_least(1)?;
        Ok(samples)
    }

    /// Rows that are the header again.
    fn drop_headers(&mut self, header: &[String]) {
        let mut kept = Vec::with_capacity(self.rows.len());
        for (line, record) in core::mem::take(&mut self.rows) {
            if record.iter().eq(header.iter().map(String::as_str)) {
                self.joints.push(kept.len());
            } else {
                kept.push((line, record));
            }
        }
        self.rows = kept;
        if !self.joints.is_empty() {
            let count = self.joints.len();
            self.note(format!(
                "the header stands again {count} times: new clips begin there"
            ));
        }
    }

    /// Rows without a value at the end, as spreadsheets leave them.
    fn drop_empty_end(&mut self) {
        let is_empty = |(_, row): &(u64, csv::StringRecord)| row.iter().all(str::is_empty);
        let kept = self
            .rows
            .iter()
            .rposition(|row| !is_empty(row))
            .map_or(0, |last| last + 1);
        let count = self.rows.len() - kept;
        if count > 0 {
            self.rows.truncate(kept);
            self.note(format!("empty rows at the end are passed over: {count}"));
        }
    }

    /// Every row has as many fields as the header; a separator at a line's end makes no field.
    fn square(&mut self, separator: Separator) -> Result<(), Error> {
        let ends_open = self
            .header
            .last()
            .is_some_and(|name| name.written.is_empty());
        for (row, (line, record)) in self.rows.iter_mut().enumerate() {
            let (found, expected) = (record.len(), self.header.len());
            if found == expected + 1 && record.get(expected) == Some("") {
                record.truncate(expected);
            } else if found + 1 == expected && ends_open {
                record.push_field("");
            } else if found != expected {
                let whole = |field: &str| field.parse::<i64>().is_ok();
                let both = separator == Separator::Byte(b',')
                    && (expected + 1..=2 * expected).contains(&found)
                    && record.iter().filter(|field| whole(field)).count() * 4 > found * 3;
                let at = Row {
                    file: self.file.clone(),
                    line: *line,
                    row: row + 1,
                };
                return Err(if both {
                    Error::BothCommas {
                        at,
                        found,
                        expected,
                    }
                } else {
                    Error::Ragged {
                        at,
                        found,
                        expected,
                    }
                });
            }
        }
        Ok(())
    }

    /// A second line of the header, with units: no number stands in the columns that are wanted.
    fn take_units(&mut self, columns: Columns<'_>) {
        let wanted: Vec<usize> = (0..self.header.len())
            .filter(|&place| columns.want(&self.header[place]))
            .collect();
        let [(line, first), (_, second), ..] = &self.rows[..] else {
            return;
        };
        let words = |row: &csv::StringRecord| {
            let word = |text: &str| text.replace(',', ".").parse::<f64>().is_err();
            wanted.iter().all(|&place| row.get(place).is_some_and(word))
        };
        if wanted.is_empty() || !words(first) || words(second) {
            return;
        }
        for (name, text) in self.header.iter_mut().zip(first) {
            if name.unit.is_none() {
                name.unit = Unit::of(text);
            }
        }
        let note = format!("line {line} holds no numbers: taken as units");
        self.rows.remove(0);
        for joint in &mut self.joints {
            *joint = joint.saturating_sub(1);
        }
        self.note(note);
    }

    fn find_decimal_mark(&mut self) {
        let mut fields = self.rows.iter().flat_map(|(_, row)| row.iter());
        let comma = |field: &str| {
            let parts = field.split_once(',');
            parts.is_some_and(|(a, b)| format!("{a}.{b}").parse::<f64>().is_ok())
        };
        self.decimal_comma = fields.any(comma);
        if self.decimal_comma {
            self.note("commas are taken as decimal marks".to_owned());
        }
    }

    /// Where `column` stands, `None` if nowhere: to the letter, else in another spelling.
    pub(super) fn position(&self, column: &str) -> Result<Option<usize>, Error> {
        let places = |matches: &dyn Fn(&Name) -> bool| -> Vec<usize> {
            let all = self.header.iter().enumerate();
            all.filter(|(_, name)| matches(name))
                .map(|(i, _)| i)
                .collect()
        };
        let mut found = places(&|name| name.written == column);
        if found.is_empty() {
            found = places(&|name| name.plain == column);
        }
        if found.len() > 1 {
            return Err(Error::DuplicateColumn {
                file: self.file.clone(),
                column: column.to_owned(),
            });
        }
        Ok(found.first().copied())
    }

    /// Where the columns stand; says which are spelled otherwise.
    pub(super) fn positions<S: AsRef<str>>(&mut self, names: &[S]) -> Result<Vec<usize>, Error> {
        let mut places = Vec::with_capacity(names.len());
        for name in names {
            let name = name.as_ref();
            places.push(self.position(name)?.ok_or_else(|| Error::MissingColumn {
                file: self.file.clone(),
                column: name.to_owned(),
                found: self.header.iter().map(|n| n.written.clone()).collect(),
            })?);
        }
        let mut others = places.iter().zip(names).filter_map(|(&place, name)| {
            let written = &self.header[place].written;
            (written != name.as_ref()).then(|| format!("`{written}` is `{}`", name.as_ref()))
        });
        if let Some(first) = others.next() {
            let note = match others.count() {
                0 => format!("a column is spelled otherwise: {first}"),
                more => format!("{} columns are spelled otherwise: {first}, …", more + 1),
            };
            self.note(note);
        }
        Ok(places)
    }

    pub(super) fn columns<S: AsRef<str>>(&mut self, names: &[S]) -> Result<Matrix, Error> {
        let places = self.positions(names)?;
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

    /// The columns `<prefix>0…`: as many as the highest number in the header asks for, at least one.
    fn numbered(&mut self, prefix: &str) -> Result<Matrix, Error> {
        let numbers = self.header.iter();
        let numbers = numbers.filter_map(|n| n.plain.strip_prefix(prefix)?.parse::<usize>().ok());
        // A gap shows within the first `header.len()` numbers, so a wild number makes no long list.
        let count = numbers.max().unwrap_or(0).min(self.header.len()) + 1;
        let names: Vec<String> = (0..count).map(|i| format!("{prefix}{i}")).collect();
        self.columns(&names)
    }

    /// A finite number that stays finite as f32.
    pub(super) fn number(&self, row: usize, place: usize) -> Result<f64, Error> {
        let text = self.rows[row].1.get(place).unwrap_or_default();
        match self.parse(text) {
            Some(value) if (value as f32).is_finite() => Ok(value),
            Some(_) => Err(Error::NotFinite(self.field(row, place))),
            None if self.decimal_comma && text.contains('.') && text.parse::<f64>().is_ok() => {
                Err(Error::TwoMarks(self.field(row, place)))
            }
            None => Err(Error::NotNumeric(self.field(row, place))),
        }
    }

    /// The field of a row (from 0) in a column of the header.
    pub(super) fn field(&self, row: usize, place: usize) -> Field {
        let (line, record) = &self.rows[row];
        Field {
            row: Row {
                file: self.file.clone(),
                line: *line,
                row: row + 1,
            },
            column: self.header[place].written.clone(),
            value: record.get(place).unwrap_or_default().to_owned(),
        }
    }

    /// The number of a field. Where the comma is the decimal mark, a point is none.
    fn parse(&self, text: &str) -> Option<f64> {
        if !self.decimal_comma {
            return text.parse().ok();
        }
        if text.contains('.') {
            return None;
        }
        text.replacen(',', ".", 1).parse().ok()
    }

    pub(super) fn at_least(&self, needed: usize) -> Result<(), Error> {
        require_rows(&self.file, self.rows.len(), needed)
    }
}
