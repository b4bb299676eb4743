//! What a test says that cannot run here, so that nothing is left out silently.
//!
//! `cargo xtask test` names a file in [`LOG`], collects a line there for each skip, and prints them at its end.
//! [`REQUIRE`] makes skips errors: `all` of them, or the kinds it names (`GAUNTLET_REQUIRE=chip,shared`).

use std::fs::OpenOptions;
use std::io::Write;
use std::panic::Location;
use std::path::Path;

/// The environment variable with the file that takes a line for each skip: test, place and reason, between tabs.
pub const LOG: &str = "GAUNTLET_SKIPS";
/// The environment variable with the kinds of skip that are errors.
pub const REQUIRE: &str = "GAUNTLET_REQUIRE";

/// What a test lacks here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Need {
    /// QEMU and the firmware (`chip`).
    Chip,
    /// The data beside the checkout, `../shared` (`shared`).
    Shared,
    /// Programs of others, from the network (`peers`).
    Peers,
    /// A machine in another state: one that is too busy, a signal that whoever started the test has set to be ignored
    /// (`machine`).
    Machine,
}

impl Need {
    const ALL: [Self; 4] = [Self::Chip, Self::Shared, Self::Peers, Self::Machine];

    fn word(self) -> &'static str {
        match self {
            Self::Chip => "chip",
            Self::Shared => "shared",
            Self::Peers => "peers",
            Self::Machine => "machine",
        }
    }
}

/// Says that the calling test is skipped, and why; the caller returns then.
///
/// # Panics
/// [`REQUIRE`] names this kind of skip, or a kind that is none.
#[track_caller]
pub fn skipped(need: Need, why: &str) {
    println!("skipped: {why}");
    let required = std::env::var(REQUIRE).unwrap_or_default();
    match is_required(&required, need) {
        Ok(false) => {}
        Ok(true) => panic!("{REQUIRE}={required} allows no such skip: {why}"),
        Err(word) => panic!("{REQUIRE}={required}: `{word}` is none of all, {}", words()),
    }
    if let Some(path) = std::env::var_os(LOG) {
        let line = line(&test_name(), Location::caller(), why);
        // One write: tests in other processes write to the same file.
        OpenOptions::new()
            .create(true)
            .append(true)
            .open(&path)
            .and_then(|mut file| file.write_all(line.as_bytes()))
            .unwrap_or_else(|error| panic!("{LOG}={}: {error}", path.display()));
    }
}

/// The text of `name` in `../shared/data`; without it the calling test is skipped.
///
/// # Panics
/// As [`skipped`].
#[track_caller]
pub fn shared(name: &str) -> Option<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let text = std::fs::read_to_string(folder.join(name)).ok();
    if text.is_none() {
        let why = format!("no ../shared/data/{name} beside the checkout");
        skipped(Need::Shared, &why);
    }
    text
}

fn words() -> String {
    Need::ALL.map(Need::word).join(", ")
}

/// Whether `required` names `need`; the word in it that names nothing.
fn is_required(required: &str, need: Need) -> Result<bool, &str> {
    let mut named = false;
    for word in required.split(',').map(str::trim).filter(|w| !w.is_empty()) {
        match Need::ALL.iter().find(|need| need.word() == word) {
            None if word != "all" => return Err(word),
            found => named |= found.is_none_or(|found| *found == need),
        }
    }
    Ok(named)
}

/// nextest gives each test a process and its name; the test harness of plain cargo gives it a thread of that name.
fn test_name() -> String {
    std::env::var("NEXTEST_TEST_NAME").unwrap_or_else(|_| {
        let thread = std::thread::current();
        thread.name().unwrap_or("a test").to_owned()
    })
}

fn line(test: &str, at: &Location<'_>, why: &str) -> String {
    let why = why.replace(['\n', '\t'], " ");
    format!("{test}\t{}:{}\t{why}\n", at.file(), at.line())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_skip_is_an_error_where_all_or_its_kind_is_required() {
        assert_eq!(is_required("", Need::Chip), Ok(false));
        assert_eq!(is_required("all", Need::Peers), Ok(true));
        assert_eq!(is_required("chip, shared", Need::Shared), Ok(true));
        assert_eq!(is_required("chip,shared,machine", Need::Peers), Ok(false));
    }

    #[test]
    fn a_word_that_names_no_kind_is_told() {
        assert_eq!(is_required("chip,al", Need::Chip), Err("al"));
        assert_eq!(words(), "chip, shared, peers, machine");
    }

    #[test]
    fn the_line_of_a_skip_has_three_fields_whatever_its_reason_holds() {
        let line = line("a_test", Location::caller(), "no\tfile\nhere");
        let fields: Vec<&str> = line.trim_end().split('\t').collect();
        assert_eq!((fields[0], fields[2]), ("a_test", "no file here"));
        assert!(fields[1].contains("skip.rs:"), "{line}");
        assert_eq!(line.lines().count(), 1);
    }
}
