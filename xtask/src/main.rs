//! One entry for the project's chores: `cargo xtask setup | test | firmware | qemu | powercut | same-bits | bench | figures | campaign | fuzz |
//! pictures | docs`.
//!
//! The chores only start other programs (cargo, rustup, apt-get, qemu); what they check lives in the crates.

mod bench;
mod campaign;
mod elf;
mod figures;
mod firmware;
mod fuzz;
mod pictures;
mod setup;
mod skips;
mod step;
mod surprises;
mod test;
mod thumb;

use std::process::ExitCode;

const USAGE: &str = "\
usage: cargo xtask <chore> [options]

chores:
  setup               install what the tests use and is not here, saying each line before it runs: the
                      microcontroller's core library, QEMU, Modbus programs of others (into target/)
  test [options]      everything that must hold before a change lands: format, clippy, docs, the
                      device crates and the firmware built for the microcontroller, all tests; as root or
                      with CI set it does `setup` first, otherwise it says what to type
  firmware            build the device crates (no_std) and the firmware for thumbv7em-none-eabihf; check that
                      the loop cannot panic, that there is no allocator, and that the program has not grown
  figures --record    write sizes and instruction counts down as those of the compiler in use
  qemu                start the firmware in QEMU, its ports as sockets in a private folder, or on the serial
                      devices of [--glove PORT] [--gripper PORT]
  qemu --measure      the whole loop in QEMU for 60 s: rates and losses
  same-bits           the map and the whole bridge on the emulated chip and here, bit by bit
  powercut            power cuts in the weights store, any slot contents, QEMU killed while flashing
  bench map           the map's kernels against peers and against this machine's roof
  bench train         the time of a training step and of a model
  campaign gripper    the gripper's long campaigns: rates beside the glove, cut wires; minutes
  campaign glove      virtual persons in honest gloves: errors of ten minutes, what the checks find; minutes
  campaign teaching   live trainings by the virtual person in honest gloves, killed and gone on; minutes
  campaign sessions   seeded sessions with faults replayed from their logs, runs killed, disks full; half an hour
  campaign log-cost   the loop with and without a log, five pairs of runs in turns; on a quiet machine
  campaign stalls     processes that stand still in motion, on the PC and in QEMU; minutes
  campaign view       what a page costs the loop (five pairs of runs), an hour's soak; on a quiet machine
  fuzz [--short]      the fuzz targets under cargo-fuzz, 10 minutes each (30 s with --short); where
                      there is no nightly compiler, on stable
  pictures            make the README's picture of the page from a demo in a browser without a screen, and
                      pictures of the page's every state into target/pictures, to look at; needs chromium
  docs                build the documentation, warnings are errors

options of test:
  --host-only         leave out what needs the microcontroller's target or QEMU
  --no-setup          install nothing

GAUNTLET_REQUIRE=all makes every skipped test an error; so does a list of kinds for theirs: chip (QEMU and the
firmware), shared (data beside the checkout), peers (programs of others), machine (too busy, or ignoring a signal).";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let outcome = match words.as_slice() {
        ["setup"] => setup::run(),
        ["test", options @ ..] => match test::Options::parse(options) {
            Some(options) => test::run(options),
            None => return unknown(&words),
        },
        ["firmware"] => firmware::build().and_then(|elf| {
            println!("firmware: {}", elf.display());
            firmware::inspect(&elf, figures::Mode::Check)
        }),
        ["figures", "--record"] => firmware::record(),
        ["qemu", "--measure"] => firmware::run_campaign("measure"),
        ["qemu", options @ ..] => firmware::emulate(options),
        ["same-bits"] => firmware::run_campaign("same-bits"),
        ["powercut"] => firmware::run_campaign("powercut"),
        ["bench", "map"] => bench::map(),
        ["bench", "train"] => bench::train(),
        ["campaign", "gripper"] => campaign::gripper(),
        ["campaign", "glove"] => campaign::glove(),
        ["campaign", "teaching"] => campaign::teaching(),
        ["campaign", "stalls"] => campaign::stalls(),
        ["campaign", "view"] => campaign::view(),
        ["campaign", "sessions"] => campaign::sessions(),
        ["campaign", "log-cost"] => campaign::log_cost(),
        ["fuzz"] => fuzz::run(fuzz::Length::Long),
        ["fuzz", "--short"] => fuzz::run(fuzz::Length::Short),
        ["pictures"] => pictures::run(),
        ["docs"] => test::docs(),
        ["help" | "--help" | "-h"] => {
            println!("{USAGE}");
            return ExitCode::SUCCESS;
        }
        _ => return unknown(&words),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn unknown(words: &[&str]) -> ExitCode {
    eprintln!("error: unknown chore: {:?}\n\n{USAGE}", words.join(" "));
    ExitCode::from(2)
}
