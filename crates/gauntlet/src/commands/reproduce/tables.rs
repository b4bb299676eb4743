//! Tables 2 and 4: ours beside the paper's.

use std::path::Path;

use anyhow::Result;
use host::trainer::whole_file;
use paper::plan::What;
use paper::shapes::ShapePair;
use paper::{Cell, Kept, Source, Table, text};

use super::Bench;
use crate::results::paper::{Data, Made, Numbers};
use host::failure::OrFail;

impl Bench<'_> {
    /// Writes a table as text and CSV and prints it.
    pub(super) fn table(&self, what: What, done: &[(Cell, Kept)]) -> Result<Made> {
        let sources: Vec<Source> = match what {
            What::Table4 => vec![self.frame.hand],
            _ => ShapePair::ALL.map(Source::Shape).to_vec(),
        };
        let tables: Vec<Table> = (sources.iter())
            .map(|&source| Table::of(source, done))
            .collect();
        let shown: String = (tables.iter())
            .map(|table| text::text(table, &self.frame))
            .collect();
        let files =
            ["txt", "csv"].map(|ending| self.folder.join(format!("{}.{ending}", what.name())));
        save(&files[0], &shown)?;
        save(&files[1], &text::csv(&tables))?;
        self.work
            .say(&self.tell, &format!("\n{}", shown.trim_end()));
        let tables: Vec<Data> = tables.iter().map(Data::from).collect();
        Ok(self.wrote(what, &files, Some(Numbers::Tables(tables))))
    }
}

/// Writes a text file, whole or not at all.
pub(super) fn save(path: &Path, text: &str) -> Result<()> {
    whole_file::write(path, text.as_bytes()).or_fail(
        || format!("the file {}", path.display()),
        "a folder where you may write, with room",
    )
}
