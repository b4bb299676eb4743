//! One entry for the project's chores: `cargo xtask test | firmware | docs`.
//!
//! The chores only start other programs (cargo, rustup, apt-get); what they check lives in the crates.

mod step;
mod test;
mod thumb;

use std::process::ExitCode;

const USAGE: &str = "\
usage: cargo xtask <chore> [options]

chores:
  test [--host-only]  everything that must hold before a change lands: format, clippy, tests, docs,
                      and the device crates built for the microcontroller
  firmware            build the device crates (no_std) for thumbv7em-none-eabihf
  docs                build the documentation, warnings are errors

options of test:
  --host-only         leave out what needs the microcontroller's target";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let outcome = match words.as_slice() {
        ["test"] => test::run(test::Scope::Everything),
        ["test", "--host-only"] => test::run(test::Scope::HostOnly),
        ["firmware"] => thumb::build_device_crates(),
        ["docs"] => test::docs(),
        ["help" | "--help" | "-h"] => {
            println!("{USAGE}");
            return ExitCode::SUCCESS;
        }
        _ => {
            eprintln!("error: unknown chore: {:?}\n\n{USAGE}", words.join(" "));
            return ExitCode::from(2);
        }
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
