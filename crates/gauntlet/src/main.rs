//! `gauntlet`: the command-line tool. See `gauntlet --help`.

use std::process::ExitCode;

use clap::Parser;
use gauntlet::cli::Cli;
use gauntlet::{commands, failure, note, out};

fn main() -> ExitCode {
    match commands::run(Cli::parse()).and_then(|()| out::check()) {
        Ok(()) => ExitCode::from(failure::EXIT_DONE),
        Err(error) => {
            let (text, code) = failure::report(&error);
            note!("{text}");
            ExitCode::from(code)
        }
    }
}
