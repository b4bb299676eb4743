//! One entry for the project's chores: `cargo xtask test | firmware | qemu | bench | docs`.
//!
//! The chores only start other programs (cargo, rustup, apt-get, qemu); what they check lives in the crates.

mod bench;
mod firmware;
mod step;
mod test;
mod thumb;

use std::process::ExitCode;

const USAGE: &str = "\
usage: cargo xtask <chore> [options]

chores:
  test [--host-only]  everything that must hold before a change lands: format, clippy, docs, the
                      device crates and the firmware built for the microcontroller, all tests
  firmware            build the device crates (no_std) and the firmware for thumbv7em-none-eabihf
  qemu                start the firmware in QEMU, its three ports as sockets in a private folder
  bench map           the map's kernels against peers and against this machine's roof
  bench train         the time of a training step and of a model
  docs                build the documentation, warnings are errors

options of test:
  --host-only         leave out what needs the microcontroller's target or QEMU";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let outcome = match words.as_slice() {
        ["test"] => test::run(test::Scope::Everything),
        ["test", "--host-only"] => test::run(test::Scope::HostOnly),
        ["firmware"] => firmware::build().map(|elf| println!("firmware: {}", elf.display())),
        ["qemu"] => firmware::emulate(),
        ["bench", "map"] => bench::map(),
        ["bench", "train"] => bench::train(),
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
