//! docs/tool.md and the help are the same facts: every option of a verb is on the page, and no other.
#![allow(missing_docs, clippy::unwrap_used)]

use std::collections::BTreeSet;
use std::path::Path;

use clap::{Command, CommandFactory};

fn page() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/tool.md");
    std::fs::read_to_string(path).unwrap()
}

/// Every `--option` in a text.
fn options(text: &str) -> BTreeSet<String> {
    let words = text.split(|c: char| !(c.is_ascii_alphanumeric() || c == '-'));
    let is_option =
        |word: &&str| word.starts_with("--") && !word.starts_with("---") && word.len() > 2;
    words.filter(is_option).map(str::to_owned).collect()
}

/// The long options of a verb and of the verbs below it, other spellings too.
fn known(verb: &Command) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for argument in verb.get_arguments().filter(|a| a.get_id() != "help") {
        let aliases = argument.get_all_aliases().unwrap_or_default();
        let spellings = argument.get_long().into_iter().chain(aliases);
        names.extend(spellings.map(|name| format!("--{name}")));
    }
    names.extend(verb.get_subcommands().flat_map(known));
    names
}

#[test]
fn every_option_of_every_verb_is_on_the_page_and_every_option_on_the_page_is_one() {
    let page = page();
    let tool = gauntlet::cli::Cli::command();
    let all = known(&tool);
    for verb in tool.get_subcommands() {
        let name = verb.get_name();
        let start = page.find(&format!("\n## {name}\n")).expect(name);
        let section = &page[start + 1..];
        let section = &section[..section.find("\n## ").unwrap_or(section.len())];
        let said = options(section);
        let missing: Vec<_> = known(verb).difference(&said).cloned().collect();
        assert_eq!(missing, Vec::<String>::new(), "not on the page of {name}");
        let firmware = ["--glove", "--gripper"].map(str::to_owned);
        let strange: Vec<_> = said
            .difference(&all)
            .filter(|option| !firmware.contains(option))
            .collect();
        assert_eq!(
            strange,
            Vec::<&String>::new(),
            "no option of the tool, at {name}"
        );
    }
}

/// The terminal breaks lines; a break by hand within a sentence would make two.
#[test]
fn no_help_breaks_a_sentence_by_hand() {
    for verb in gauntlet::cli::Cli::command().get_subcommands() {
        let help = verb.get_after_help().map(ToString::to_string);
        for line in help.unwrap_or_default().lines() {
            let whole = line.is_empty() || line.starts_with(' ') || line.ends_with(['.', ':']);
            assert!(whole, "{}: {line}", verb.get_name());
        }
    }
}
