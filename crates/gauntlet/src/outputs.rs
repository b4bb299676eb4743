//! Files the tool writes: never over an input, never over something else than a file of their own kind.

use std::io::Read;
use std::path::Path;

use anyhow::Result;

use crate::failure::Failure;

/// What is to be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A trained model, safetensors.
    Model,
    /// A session log, MCAP.
    Log,
    /// A weights image.
    Image,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Model => "a safetensors file",
            Self::Log => "an MCAP file",
            Self::Image => "a weights image",
        }
    }

    /// Whether a file that starts so, and is `length` bytes long, may be one of this kind.
    fn matches(self, start: &[u8; 9], length: u64) -> bool {
        match self {
            // Eight bytes length of the header, then a JSON object.
            Self::Model => {
                let [header @ .., first] = start;
                *first == b'{' && u64::from_le_bytes(*header) < length
            }
            Self::Log => start.starts_with(b"\x89MCAP0\r\n"),
            Self::Image => start.starts_with(&hae::image::MAGIC),
        }
    }
}

/// Refuses to write `path` where anything is there already, an empty file, too, or where its folder takes no file.
///
/// # Errors
/// A usage failure that names the path.
pub fn check_new(path: &Path) -> Result<()> {
    let next = "another name, in a folder that exists and that you may write to";
    let refuse = |why: &str| {
        let what = format!("{} is not written: {why}", path.display());
        Err(Failure::usage(what, next).into())
    };
    if std::fs::symlink_metadata(path).is_ok() {
        return refuse("it exists, and a log is never written over anything");
    }
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        return refuse("its folder does not exist");
    }
    match rustix::fs::access(folder, rustix::fs::Access::WRITE_OK) {
        Ok(()) => Ok(()),
        Err(error) => refuse(&format!("its folder takes no file: {error}")),
    }
}

/// Refuses to write `path` where it is one of `inputs`, where it exists and is not of this kind, or where its folder does
/// not exist. An empty file counts as none.
///
/// # Errors
/// A usage failure that names the path.
pub fn check(path: &Path, kind: Kind, inputs: &[&Path]) -> Result<()> {
    let refuse = |why: &str| {
        let what = format!("{} is not written: {why}", path.display());
        Err(Failure::usage(what, "another name, in a folder that exists").into())
    };
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        return refuse("its folder does not exist");
    }
    let Ok(there) = std::fs::metadata(path) else {
        return Ok(());
    };
    let real = std::fs::canonicalize(path).ok();
    let is_input = |input: &&Path| real.is_some() && std::fs::canonicalize(input).ok() == real;
    if inputs.iter().any(is_input) {
        return refuse("it is an input of this very command");
    }
    if !there.is_file() {
        return refuse("it exists and is not a file");
    }
    if there.len() == 0 {
        return Ok(());
    }
    let mut start = [0; 9];
    let read = std::fs::File::open(path).and_then(|mut file| file.read_exact(&mut start));
    if read.is_err() || !kind.matches(&start, there.len()) {
        return refuse(&format!("it exists and is not {}", kind.name()));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(path: &Path, kind: Kind, inputs: &[&Path]) -> String {
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
            assert!(refusal(path, Kind::Model, &[&input]).contains("an input"));
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
