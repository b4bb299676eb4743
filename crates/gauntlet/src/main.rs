//! `gauntlet`: the command-line tool. See `gauntlet --help`.

use std::process::ExitCode;

use clap::Parser;
use gauntlet::cli::Cli;
use gauntlet::{commands, note, out};
use host::failure;

fn main() -> ExitCode {
    let done = commands::run(Cli::parse());
    // What was printed before a failure is waited for, too.
    let printed = out::check();
    let code = match done.and(printed) {
        Ok(()) => failure::EXIT_DONE,
        Err(error) => {
            let (text, code) = failure::report(&error);
            note!("{text}");
            code
        }
    };
    out::finish();
    ExitCode::from(code)
}
