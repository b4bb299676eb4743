//! Files the tool writes: never over an input, never over something else than a file of their own kind.
//!
//! One rule for the exit code, in every verb: 2 where another command line would do (the name is taken, names a folder, or its folder
//! is not there), 1 where the system refuses (a full disk, one that is read-only, a folder of somebody else's).

use std::io::{ErrorKind, Read};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use anyhow::Result;
use host::trainer::whole_file;

use host::failure::Failure;
use host::words;

/// What is to be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A trained model, safetensors.
    Model,
    /// The state of a training, safetensors, too.
    Checkpoint,
    /// A session log, MCAP.
    Log,
    /// A weights image.
    Image,
    /// A glove's profile, TOML.
    Profile,
    /// A report, HTML.
    Page,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Model => "a safetensors file",
            Self::Checkpoint => "a checkpoint",
            Self::Log => "an MCAP file",
            Self::Image => "a weights image",
            Self::Profile => "a glove's profile",
            Self::Page => "an HTML page",
        }
    }

    /// Whether a file that starts so, and is `length` bytes long, may be one of this kind.
    fn matches(self, start: &[u8], length: u64) -> bool {
        match self {
            Self::Model => is_safetensors(start, length) && !names(start, CHECKPOINT),
            // What names neither is of an earlier version.
            Self::Checkpoint => is_safetensors(start, length) && !names(start, MODEL),
            Self::Log => start.starts_with(b"\x89MCAP0\r\n"),
            Self::Image => start.starts_with(&host::hae::image::MAGIC),
            Self::Profile => start.starts_with(PROFILE),
            Self::Page => start.starts_with(PAGE),
        }
    }
}

/// Refuses to write `path`, which is to be `what` ("a log"), where anything is there already, an empty file, too, or where its folder takes no file of a log's first
/// half second.
///
/// # Errors
/// A failure that names the path.
pub fn check_new(path: &Path, what: &str) -> Result<()> {
    if std::fs::symlink_metadata(path).is_ok() {
        return Err(refusal(
            path,
            &format!("it exists, and {what} is never written over anything"),
        ));
    }
    place_of_file(path)?;
    try_room(path, LOG_ROOM)
}

/// Refuses a path whose folder does not exist, or that names a folder.
fn place_of_file(path: &Path) -> Result<()> {
    if !folder_of(path).is_dir() {
        return Err(refusal(path, "its folder does not exist"));
    }
    if path.as_os_str().as_bytes().ends_with(b"/") {
        return Err(refusal(path, "it names a folder"));
    }
    Ok(())
}

/// What the header of a checkpoint names, and that of a model.
const CHECKPOINT: &[u8] = b"\"settings_sha256\"";
const MODEL: &[u8] = b"\"f.w1\"";
/// How a profile begins.
const PROFILE: &[u8] = b"# A glove on a hand,";
/// How a page begins.
const PAGE: &[u8] = b"<!doctype html>";
/// The headers of both are shorter.
const HEADER: u64 = 64 << 10;
/// The room that a model, a checkpoint or an image may need.
const ROOM: usize = 1 << 20;
/// The room that a log takes at its start.
const LOG_ROOM: usize = 64 << 10;

/// Eight bytes length of the header, then a JSON object.
fn is_safetensors(start: &[u8], length: u64) -> bool {
    let Some((header, rest)) = start.split_first_chunk::<8>() else {
        return false;
    };
    rest.first() == Some(&b'{') && u64::from_le_bytes(*header) < length
}

fn names(start: &[u8], word: &[u8]) -> bool {
    start.windows(word.len()).any(|window| window == word)
}

/// Where a file is or would be, by whatever name.
fn place(path: &Path) -> Option<PathBuf> {
    let there = std::fs::canonicalize(path).ok();
    there.or_else(|| {
        Some(
            std::fs::canonicalize(folder_of(path))
                .ok()?
                .join(path.file_name()?),
        )
    })
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Whether two names are of one file: a link of either kind, or another way to the same place.
fn is_same(a: &Path, b: &Path) -> bool {
    let node = |path| {
        std::fs::metadata(path)
            .ok()
            .map(|file| (file.dev(), file.ino()))
    };
    let places = place(a).is_some_and(|first| place(b) == Some(first));
    places || node(a).is_some_and(|first| node(b) == Some(first))
}

/// Refuses to write `path` where it is one of `inputs`, where it exists and is not of this kind, or where its folder does
/// not exist. An empty file counts as none. What is written whole and then renamed is tried: a folder that may not be written in, a
/// full disk or a name too long are told now, not after the work.
///
/// # Errors
/// A failure that names the path.
pub fn check(path: &Path, kind: Kind, inputs: &[&Path]) -> Result<()> {
    let refuse = |why: &str| Err(refusal(path, why));
    place_of_file(path)?;
    if inputs.iter().any(|input| is_same(path, input)) {
        return refuse("it is an input of this very command");
    }
    if let Ok(there) = std::fs::metadata(path)
        && let Some(why) = unlike(path, kind, &there)
    {
        return refuse(&why);
    }
    match kind {
        Kind::Log => Ok(()),
        _ => room(path),
    }
}

/// Tries whether a file could be written to `path` now.
///
/// # Errors
/// A failure that names the path.
pub fn room(path: &Path) -> Result<()> {
    try_room(path, ROOM)
}

fn try_room(path: &Path, length: usize) -> Result<()> {
    let Err(error) = whole_file::probe(path, length) else {
        return Ok(());
    };
    let why = words::disk(&error);
    Err(match error.kind() {
        ErrorKind::InvalidFilename | ErrorKind::NotFound | ErrorKind::NotADirectory => {
            refusal(path, &why)
        }
        _ => Failure::new(not_written(path, &why), NEXT).into(),
    })
}

const NEXT: &str = "another name, in a folder that exists, has room and lets you write";

/// A name that will not do.
fn refusal(path: &Path, why: &str) -> anyhow::Error {
    Failure::usage(not_written(path, why), NEXT).into()
}

fn not_written(path: &Path, why: &str) -> String {
    format!("{} is not written: {why}", path.display())
}

/// Why what is there is not replaced by something of this kind.
fn unlike(path: &Path, kind: Kind, there: &std::fs::Metadata) -> Option<String> {
    if !there.is_file() {
        return Some("it exists and is not a file".to_owned());
    }
    if there.len() == 0 {
        return None;
    }
    let mut start = Vec::new();
    let read = std::fs::File::open(path).and_then(|file| file.take(HEADER).read_to_end(&mut start));
    let fits = read.is_ok() && kind.matches(&start, there.len());
    (!fits).then(|| format!("it exists and is not {}", kind.name()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(path: &Path, kind: Kind, inputs: &[&Path]) -> String {
        check(path, kind, inputs).unwrap_err().to_string()
    }

    #[test]
    fn an_input_is_never_written_over_by_whatever_name() {
        let folder = tempfile::tempdir().unwrap();
        let input = folder.path().join("hand.csv");
        let link = folder.path().join("link");
        std::fs::write(&input, "time_s").unwrap();
        std::os::unix::fs::symlink(&input, &link).unwrap();
        for path in [&input, &link] {
            assert!(said(path, Kind::Model, &[&input]).contains("an input"));
        }
    }

    #[test]
    fn only_files_of_the_same_kind_are_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out");
        let model = b"\x10\0\0\0\0\0\0\0{\"a\":1}         ";
        let log = b"\x89MCAP0\r\n and more";
        for (content, model_is_fine, log_is_fine) in [
            (&b""[..], true, true),
            (model, true, false),
            (log, false, true),
            (b"time_s,thumb_cmc_flex", false, false),
            (b"short", false, false),
        ] {
            std::fs::write(&path, content).unwrap();
            assert_eq!(
                check(&path, Kind::Model, &[]).is_ok(),
                model_is_fine,
                "{content:?}"
            );
            assert_eq!(
                check(&path, Kind::Log, &[]).is_ok(),
                log_is_fine,
                "{content:?}"
            );
        }
    }

    #[test]
    fn one_file_under_two_names_is_one_though_it_is_not_there_yet() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("m");
        let sub = folder.path().join("sub");
        std::fs::create_dir(&sub).unwrap();
        for (other, is_same) in [
            ("../m", true),
            (".././m", true),
            ("m", false),
            ("../n", false),
        ] {
            let refused = check(&sub.join(other), Kind::Checkpoint, &[&out]).is_err();
            assert_eq!(refused, is_same, "{other}");
        }
        std::fs::write(&out, "").unwrap();
        let hard = folder.path().join("hard");
        std::fs::hard_link(&out, &hard).unwrap();
        assert!(said(&hard, Kind::Checkpoint, &[&out]).contains("an input"));
    }

    #[test]
    fn a_model_and_a_checkpoint_do_not_take_each_other_s_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out");
        let file = |name: &str| format!("\u{10}\0\0\0\0\0\0\0{{\"{name}\":1}}         ");
        for (name, taken) in [
            ("f.w1", [true, false]),
            ("settings_sha256", [false, true]),
            ("other", [true, true]),
        ] {
            std::fs::write(&path, file(name)).unwrap();
            let found = [Kind::Model, Kind::Checkpoint].map(|kind| check(&path, kind, &[]).is_ok());
            assert_eq!(found, taken, "{name}");
        }
    }

    #[test]
    fn what_cannot_be_written_is_told_before_the_work_and_nothing_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let long = folder.path().join("n".repeat(250));
        let open = folder.path().join("new/");
        assert!(said(&open, Kind::Model, &[]).contains("names a folder"));
        for kind in [Kind::Model, Kind::Checkpoint, Kind::Image] {
            assert!(said(&long, kind, &[]).contains("is not written"));
            // A folder in which nobody may write, root neither.
            assert!(said(Path::new("/proc/m"), kind, &[]).contains("is not written"));
            check(&folder.path().join("fine"), kind, &[]).unwrap();
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn devices_folders_and_missing_folders_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        for path in [
            Path::new("/dev/null"),
            folder.path(),
            Path::new("/nowhere/m"),
        ] {
            assert!(check(path, Kind::Model, &[]).is_err(), "{}", path.display());
        }
        assert!(check(&folder.path().join("new"), Kind::Log, &[]).is_ok());
    }
}
