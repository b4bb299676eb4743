//! Files that appear whole or not at all: written beside their place under a passing name, then renamed.

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::remedy::Remedy;

/// What the system refused to do with a file.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// It cannot be opened or read.
    #[error("cannot read {}: {source}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// It cannot be written.
    #[error("cannot write {}: {source}", file.display())]
    Write {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
}

impl Error {
    pub(crate) fn reading(file: &Path, source: std::io::Error) -> Self {
        let file = file.to_owned();
        Self::Read { file, source }
    }

    pub(crate) fn writing(file: &Path, source: std::io::Error) -> Self {
        let file = file.to_owned();
        Self::Write { file, source }
    }
}

impl Remedy for Error {
    fn remedy(&self) -> String {
        let next = match self {
            Self::Read { .. } => "check the path and that you may read it",
            Self::Write { .. } => "check that the folder exists and that you may write there",
        };
        next.to_owned()
    }
}

/// Writes `bytes` to `path`. A reader, or a person after a power cut, sees the old file or the new one, never a half.
///
/// # Errors
/// What the system says; the passing file is removed.
pub fn write(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let part = passing(path)?;
    let written = fill(&part, bytes).and_then(|()| std::fs::rename(&part, path));
    if written.is_err() {
        // Best effort: the first error is the one to tell.
        let _ = std::fs::remove_file(&part);
    }
    written
}

/// Tries whether a file of `length` bytes could be written to `path` now: the folder takes a name, the disk has room. Leaves nothing.
///
/// # Errors
/// What the system says.
pub fn probe(path: &Path, length: usize) -> std::io::Result<()> {
    let part = passing(path)?;
    let written = fill(&part, &vec![0; length]);
    let removed = std::fs::remove_file(&part);
    written.and(removed)
}

/// The passing name of a file that is being written.
fn passing(path: &Path) -> std::io::Result<PathBuf> {
    let mut name = path
        .file_name()
        .ok_or_else(|| std::io::Error::other("the path names no file"))?
        .to_owned();
    name.push(format!(".{}.part", std::process::id()));
    Ok(path.with_file_name(name))
}

fn fill(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let mut file = std::fs::File::create(path)?;
    file.write_all(bytes)?;
    file.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_no_passing_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("kept");
        write(&path, b"old").unwrap();
        write(&path, b"new").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        // A folder in the way: the rename fails.
        let blocked = folder.path().join("folder");
        std::fs::create_dir(&blocked).unwrap();
        assert!(write(&blocked, b"x").is_err());
        let names: Vec<_> = std::fs::read_dir(folder.path()).unwrap().collect();
        assert_eq!(names.len(), 2);
        assert!(write(&folder.path().join("no/such/folder"), b"x").is_err());
    }

    #[test]
    fn a_probe_leaves_nothing_and_says_what_a_write_would() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("kept");
        probe(&path, 1 << 16).unwrap();
        write(&path, b"old").unwrap();
        probe(&path, 1 << 16).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        assert!(probe(&folder.path().join("no/such/folder"), 1).is_err());
        assert!(probe(&folder.path().join("n".repeat(250)), 1).is_err());
    }
}
