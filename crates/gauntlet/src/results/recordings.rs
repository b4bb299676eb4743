//! Results of verbs that read session logs.

use std::path::{Path, PathBuf};

use serde::Serialize;

/// A table that was written.
#[derive(Debug, Serialize)]
pub struct Table {
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
    /// Its joint angles; `null` where they were not asked for.
    pub poses: Option<Table>,
    /// Its commands.
    pub commands: Option<Table>,
    /// The hand as OpenXR has it.
    pub openxr: Option<Table>,
    /// By how much the angles that follow from that differ from the log's, at most.
    pub openxr_angle_error_deg: Option<f32>,
    /// Whether the log ends with its index.
    pub finished: bool,
    /// What of the log is not in the tables, in words.
    pub notes: Vec<String>,
}
