//! Next steps in JSON, looked at as somebody who pastes them.

use clap::Parser;
use gauntlet::cli::Cli;

/// Every command of this tool among these findings is one that can be typed.
pub fn can_be_typed(findings: &[serde_json::Value]) {
    let steps = findings
        .iter()
        .filter_map(|finding| finding.get("commands"));
    for command in steps.flat_map(|step| step.as_array().unwrap()) {
        let words = command.as_array().unwrap().iter();
        let words: Vec<&str> = words.map(|word| word.as_str().unwrap()).collect();
        if words[0] == "gauntlet" {
            let parsed = Cli::try_parse_from(&words);
            assert!(parsed.is_ok(), "{words:?}: {}", parsed.unwrap_err());
        }
    }
}
