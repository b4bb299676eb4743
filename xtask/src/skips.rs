//! What was left out of the tests, told at their end: the skips that tests wrote down (`rig::skip`), those of the chore
//! itself, and the tests that only run when asked for.

use crate::step::{self, Failure};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The variable that names the file for the tests' skips.
const LOG: &str = "GAUNTLET_SKIPS";
/// The variable that makes skips errors.
const REQUIRE: &str = "GAUNTLET_REQUIRE";

/// What a step of the chore lacks: the words are those of the tests' skips (`rig::skip`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The microcontroller's builds, its compiler, QEMU (`chip`).
    Chip,
}

impl Kind {
    fn word(self) -> &'static str {
        match self {
            Self::Chip => "chip",
        }
    }
}

/// Whether `required` allows no skip of this kind.
fn is_required(required: &str, kind: Kind) -> bool {
    let mut words = required.split(',').map(str::trim);
    words.any(|word| word == "all" || word == kind.word())
}

/// The skips of one run.
pub struct Skips {
    file: PathBuf,
    own: Vec<String>,
}

impl Skips {
    /// None so far.
    pub fn begin() -> Result<Self, Failure> {
        let folder = step::workspace_root().join("target");
        let file = folder.join("skips.txt");
        std::fs::create_dir_all(&folder)
            .and_then(|()| std::fs::write(&file, ""))
            .map_err(|error| format!("{}: {error}", file.display()))?;
        let own = Vec::new();
        Ok(Self { file, own })
    }

    /// Has the tests of `command` write theirs down here.
    pub fn collect(&self, command: &mut Command) {
        command.env(LOG, &self.file);
    }

    /// A step that the chore itself leaves out. An error where all is required, or this kind.
    pub fn add(&mut self, kind: Kind, what: &str, why: &str) -> Result<(), Failure> {
        println!("skipped: {what}: {why}");
        let required = std::env::var(REQUIRE).unwrap_or_default();
        if is_required(&required, kind) {
            return Err(format!(
                "{REQUIRE}={required} allows no such skip: {what}: {why}"
            ));
        }
        self.own.push(format!("{what}: {why}"));
        Ok(())
    }

    /// Names every skip, and why.
    pub fn tell(&self) {
        let written = std::fs::read_to_string(&self.file).unwrap_or_default();
        let skipped = summary(&self.own, &written);
        match skipped.as_slice() {
            [] => println!("skipped: nothing"),
            skipped => {
                println!("skipped: {}", skipped.len());
                skipped.iter().for_each(|line| println!("  {line}"));
            }
        }
        let on_demand = on_demand(&step::workspace_root());
        println!("run only when asked for: {}", on_demand.len());
        on_demand.iter().for_each(|line| println!("  {line}"));
    }
}

/// One line a skip, each once.
fn summary(own: &[String], written: &str) -> Vec<String> {
    let mut lines = own.to_vec();
    let mut tests: Vec<String> = written
        .lines()
        .map(|line| match *line.split('\t').collect::<Vec<_>>() {
            [test, at, why] => format!("{test} ({at}): {why}"),
            _ => line.to_owned(),
        })
        .collect();
    tests.sort();
    tests.dedup();
    lines.append(&mut tests);
    lines
}

/// The tests with `#[ignore = "…"]`, and what that says.
fn on_demand(root: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for folder in ["crates", "tests"] {
        walk(&root.join(folder), &mut |path, text| {
            let place = path.strip_prefix(root).unwrap_or(path).display();
            found.extend(ignored(text).map(|(test, why)| format!("{test} ({place}): {why}")));
        });
    }
    found.sort();
    found
}

/// Calls `look` with every Rust source below `folder`.
fn walk(folder: &Path, look: &mut dyn FnMut(&Path, &str)) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            walk(&path, look);
        } else if path.extension().is_some_and(|extension| extension == "rs")
            && let Ok(text) = std::fs::read_to_string(&path)
        {
            look(&path, &text);
        }
    }
}

/// Names and reasons of the ignored tests in a source.
fn ignored(text: &str) -> impl Iterator<Item = (&str, &str)> {
    text.split("\n#[ignore = \"").skip(1).filter_map(|rest| {
        let (why, rest) = rest.split_once("\"]")?;
        let (_, rest) = rest.split_once("fn ")?;
        Some((rest.split_once('(')?.0, why))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_skip_is_named_once_with_its_reason() {
        let own = ["a step: a reason".to_owned()];
        let written = "b_test\tb.rs:1\tno chip\na_test\ta.rs:2\tno file\nb_test\tb.rs:1\tno chip\n";
        assert_eq!(
            summary(&own, written),
            [
                "a step: a reason",
                "a_test (a.rs:2): no file",
                "b_test (b.rs:1): no chip"
            ]
        );
        assert!(summary(&[], "").is_empty());
    }

    #[test]
    fn a_step_that_is_left_out_is_an_error_where_its_kind_is_required() {
        for required in ["all", "chip", "chip,machine", "shared, chip"] {
            assert!(is_required(required, Kind::Chip), "{required}");
        }
        for required in ["", "machine,shared", "chips"] {
            assert!(!is_required(required, Kind::Chip), "{required}");
        }
    }

    #[test]
    fn an_ignored_test_is_found_with_its_reason() {
        let text =
            "\n#[test]\n#[ignore = \"minutes\"]\nfn a_campaign() {}\n#[test]\nfn other() {}\n";
        assert_eq!(
            ignored(text).collect::<Vec<_>>(),
            [("a_campaign", "minutes")]
        );
        let all = on_demand(&step::workspace_root());
        assert!(
            all.iter().any(|line| line.contains("campaign stalls")),
            "{all:?}"
        );
    }
}
