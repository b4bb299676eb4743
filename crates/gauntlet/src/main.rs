//! `gauntlet`: the command-line tool. See `gauntlet --help`.

use std::process::ExitCode;

use gauntlet::{cli, note, options, out, results};
use host::failure;

/// A command in the next step that cannot be typed.
fn unusable(error: &anyhow::Error) -> Option<String> {
    let next = failure::Told::of(error).next;
    next.commands().find_map(cli::unusable)
}

fn main() -> ExitCode {
    let typed: Vec<_> = std::env::args_os().collect();
    let (json, done) = match cli::parse(&typed) {
        Ok(cli) => (cli.json(), cli::run(cli)),
        Err(error) => (typed.iter().any(|word| word == "--json"), Err(error)),
    };
    let done = done.map_err(|error| failure::typed(error, &options::typed()));
    if let Err(error) = &done
        && json
        && let Err(other) = results::print_failure(error)
    {
        note!("{other}");
    }
    // What was printed before a failure is waited for, too.
    let printed = out::check();
    let code = match done.and(printed) {
        Ok(()) => failure::EXIT_DONE,
        Err(error) => {
            debug_assert_eq!(unusable(&error), None, "a next step cannot be pasted");
            let (text, code) = failure::report(&error);
            note!("{text}");
            code
        }
    };
    out::finish();
    ExitCode::from(code)
}
