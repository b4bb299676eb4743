//! Results of verbs that read session logs.

use std::path::{Path, PathBuf};

use serde::Serialize;

/// A table that was written.
#[derive(Debug, Serialize)]
pub struct Table {
    /// Which: `poses`, `commands` or `openxr`.
    pub table: &'static str,
    /// Where.
    pub file: PathBuf,
    /// Rows below its header.
    pub rows: usize,
}

/// `export` of a session log.
#[derive(Debug, Serialize)]
pub struct ExportedLog<'a> {
    /// The log.
    pub log: &'a Path,
    /// What was made of it.
    pub tables: Vec<Table>,
    /// By how much the angles that follow from that differ from the log's, at most.
    pub openxr_angle_error_deg: Option<f32>,
    /// Whether the log ends with its index.
    pub finished: bool,
    /// What of the log is not in the tables, in words.
    pub notes: Vec<String>,
}
