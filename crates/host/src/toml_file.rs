//! TOML files that people read and write: bounded in size, errors with the file, the line and the value.

use std::io::Read;
use std::path::Path;

use crate::failure::Failure;
use crate::next::NextStep;

/// No file of ours is longer.
const MOST: u64 = 64 << 10;

/// Reads a file; `None` where there is none.
///
/// # Errors
/// A file that cannot be read, is too long or no text.
pub(crate) fn read(path: &Path) -> Result<Option<String>, Failure> {
    let shown = path.display();
    let wrong = |what: String, next: &str| Failure::new(format!("{shown}: {what}"), next);
    let file = match trainer::whole_file::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(wrong(error.to_string(), "a file that you may read")),
    };
    let mut bytes = Vec::new();
    file.take(MOST + 1)
        .read_to_end(&mut bytes)
        .map_err(|error| wrong(error.to_string(), "a file that you may read"))?;
    if bytes.len() as u64 > MOST {
        let what = format!("longer than {} kB", MOST >> 10);
        return Err(wrong(what, "another file: this is none of the tool's"));
    }
    String::from_utf8(bytes).map(Some).map_err(|error| {
        let line = 1 + bytecount(&error.as_bytes()[..error.utf8_error().valid_up_to()]);
        wrong(
            format!("line {line} is not UTF-8 text"),
            "another file: this one is damaged",
        )
    })
}

/// Reads TOML into `T`.
///
/// # Errors
/// The file, the line, and what is wrong there.
pub(crate) fn parse<T: serde::de::DeserializeOwned>(
    path: &Path,
    text: &str,
    next: impl Into<NextStep>,
) -> Result<T, Failure> {
    toml::from_str(text).map_err(|error| {
        let at = error.span().map_or_else(String::new, |span| {
            format!("line {}: ", line(text, span.start))
        });
        let what = error.message().replace('\n', ", ");
        Failure::new(format!("{}: {at}{what}", path.display()), next)
    })
}

/// The line of a place in a text, from 1.
pub(crate) fn line(text: &str, at: usize) -> usize {
    1 + bytecount(text.as_bytes().get(..at).unwrap_or_default())
}

fn bytecount(bytes: &[u8]) -> usize {
    bytes.iter().filter(|byte| **byte == b'\n').count()
}

/// A text as TOML has it.
pub(crate) fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}
