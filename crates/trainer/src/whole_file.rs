//! Files that appear whole or not at all: written beside their place under a passing name, then renamed. And files that are read whole,
//! from a pipe too, without waiting for ever.

use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rustix::fs::{Mode, OFlags};

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

/// A pipe that says nothing for so long says nothing.
const SILENT: Duration = Duration::from_secs(5);
const LOOK: Duration = Duration::from_millis(5);

/// A file, or a pipe, that is read from its beginning.
#[derive(Debug)]
pub struct Reading(File);

/// Opens what lies at `path`. A pipe into which nobody writes is empty.
///
/// # Errors
/// What the system says.
pub fn open(path: &Path) -> std::io::Result<Reading> {
    let flags = OFlags::RDONLY | OFlags::NONBLOCK | OFlags::CLOEXEC | OFlags::NOCTTY;
    Ok(Reading(
        rustix::fs::open(path, flags, Mode::empty())?.into(),
    ))
}

/// Reads all of it.
///
/// # Errors
/// What the system says.
pub fn read(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

impl Reading {
    /// Whether it is a file, and no pipe, device or folder.
    ///
    /// # Errors
    /// What the system says.
    pub fn is_file(&self) -> std::io::Result<bool> {
        Ok(self.0.metadata()?.is_file())
    }
}

impl Read for Reading {
    /// [`ErrorKind::TimedOut`] where nothing comes for five seconds.
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        let end = Instant::now() + SILENT;
        loop {
            match self.0.read(into) {
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                other => return other,
            }
            if Instant::now() >= end {
                let what = format!("nothing came for {} s", SILENT.as_secs());
                return Err(std::io::Error::new(ErrorKind::TimedOut, what));
            }
            std::thread::sleep(LOOK);
        }
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
    fn a_pipe_is_read_to_its_end_and_one_that_nobody_writes_to_is_not_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&path).status();
        assert!(made.unwrap().success());
        assert_eq!(read(&path).unwrap(), b"");
        let mut reading = open(&path).unwrap();
        assert!(!reading.is_file().unwrap());
        let mut writer = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
        let said = std::thread::spawn(move || {
            for piece in [&b"half"[..], b" and half"] {
                std::thread::sleep(Duration::from_millis(30));
                writer.write_all(piece).unwrap();
            }
        });
        let mut text = String::new();
        reading.read_to_string(&mut text).unwrap();
        said.join().unwrap();
        assert_eq!(text, "half and half");
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
