//! Sizes and instruction counts of the firmware against the checked-in ones of the same compiler.

use crate::step::{self, Failure};
use crate::thumb;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Growth beyond which a figure fails, in percent.
const GROWTH: u64 = 5;

/// Names and values, in the order they were measured.
pub type Figures = Vec<(String, u64)>;

/// What to do with figures that were measured.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Hold them against the checked-in ones.
    Check,
    /// Write them down as the compiler's.
    Record,
}

fn file() -> PathBuf {
    step::workspace_root().join("firmware-sim/figures.txt")
}

type Entries = BTreeMap<String, BTreeMap<String, u64>>;

/// The checked-in figures of every compiler.
fn read(text: &str) -> Result<Entries, Failure> {
    let mut entries = Entries::new();
    let mut compiler = None;
    for line in text.lines().map(str::trim) {
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        if let Some(name) = line.strip_prefix('[').and_then(|l| l.strip_suffix(']')) {
            compiler = Some(name.to_owned());
            continue;
        }
        let figure = line
            .split_once(' ')
            .and_then(|(name, value)| Some((name.to_owned(), value.trim().parse().ok()?)));
        let (Some(compiler), Some((name, value))) = (&compiler, figure) else {
            return Err(format!("{}: not a figure: {line:?}", file().display()));
        };
        entries
            .entry(compiler.clone())
            .or_default()
            .insert(name, value);
    }
    Ok(entries)
}

/// Holds `found` against the file, or writes it there. A compiler without an entry prints and does not fail.
pub fn hold(found: &Figures, mode: Mode) -> Result<(), Failure> {
    let path = file();
    let text =
        std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    let mut entries = read(&text)?;
    let compiler = thumb::compiler()?;
    if mode == Mode::Record {
        entries
            .entry(compiler)
            .or_default()
            .extend(found.iter().cloned());
        return write(&entries);
    }
    let Some(known) = entries.get(&compiler) else {
        println!("figures: no entry for {compiler}; these are not held against anything:");
        found
            .iter()
            .for_each(|(name, value)| println!("  {name:<32} {value:>8}"));
        return Ok(());
    };
    let grown = compare(found, known);
    if grown.is_empty() {
        return Ok(());
    }
    Err(format!(
        "more than {GROWTH} % above {} for {compiler}: {}. If it must be so: cargo xtask figures --record",
        path.display(),
        grown.join(", ")
    ))
}

/// Prints every figure; those that grew too much.
fn compare(found: &Figures, known: &BTreeMap<String, u64>) -> Vec<String> {
    let mut grown = Vec::new();
    for (name, value) in found {
        match known.get(name) {
            None => println!("  {name:<32} {value:>8}  new"),
            Some(before) => {
                println!("  {name:<32} {value:>8}  was {before}");
                if too_much(*before, *value) {
                    grown.push(format!("{name} {value}, was {before}"));
                }
            }
        }
    }
    grown
}

fn too_much(before: u64, now: u64) -> bool {
    now * 100 > before * (100 + GROWTH)
}

fn write(entries: &Entries) -> Result<(), Failure> {
    let mut text = "# The firmware's sizes (bytes) and instruction counts, for each compiler: docs/measurements/chip.md says what they are.\n\
         # `cargo xtask test` fails when one grows by more than 5 %; `cargo xtask figures --record` writes those of the compiler in use.\n"
        .to_owned();
    for (compiler, figures) in entries {
        text += &format!("\n[{compiler}]\n");
        for (name, value) in figures {
            text += &format!("{name} {value}\n");
        }
    }
    let path = file();
    std::fs::write(&path, text).map_err(|error| format!("{}: {error}", path.display()))?;
    println!("written: {}", path.display());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_beyond_five_percent_is_too_much() {
        assert!(!too_much(1000, 1050) && too_much(1000, 1051));
        assert!(!too_much(1000, 10) && !too_much(0, 0) && too_much(0, 1));
    }

    #[test]
    fn the_checked_in_file_is_read_and_what_is_no_figure_refused() {
        let text = std::fs::read_to_string(file()).expect("the file");
        let entries = read(&text).expect("figures");
        assert!(
            entries
                .values()
                .all(|figures| figures.contains_key("size.text"))
        );
        assert!(read("size.text 5").is_err() && read("[a]\nsize.text five").is_err());
    }

    #[test]
    fn a_figure_that_grew_is_named() {
        let known = BTreeMap::from([("a".to_owned(), 100), ("b".to_owned(), 100)]);
        let found = vec![
            ("a".to_owned(), 105),
            ("b".to_owned(), 106),
            ("c".to_owned(), 9),
        ];
        assert_eq!(compare(&found, &known), ["b 106, was 100"]);
    }
}
