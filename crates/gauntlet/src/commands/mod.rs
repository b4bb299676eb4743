//! The verbs, one module each.

mod bridge;
mod bridge_log;
mod demo;
pub mod doctor;
pub mod eval;
pub mod export;
mod flash;
pub mod gripper;
mod on_chip;
mod ports;
pub mod reproduce;
mod simulate;
mod teleop;
pub mod train;

use anyhow::Result;

use crate::cli::{Cli, Demo, Verb};
use host::failure::OrFail;
use host::interrupt::Interrupt;

/// Runs what the command line says.
///
/// # Errors
/// Whatever went wrong, mostly a [`host::failure::Failure`] with the next step.
pub fn run(cli: Cli) -> Result<()> {
    // Only where something must be brought to an end in order: elsewhere Ctrl-C ends the program as it ends any other.
    let interrupt = || {
        Interrupt::install().or_fail(
            || "Ctrl-C cannot be caught".to_owned(),
            "ending other programs: the system lacks descriptors",
        )
    };
    match cli.verb.unwrap_or_else(|| Verb::Demo(Demo::default())) {
        Verb::Demo(options) => demo::run(&options, &interrupt()?),
        Verb::Train(options) => train::run(&options, &interrupt()?),
        Verb::Eval(options) => eval::run(&options),
        Verb::Reproduce(options) => reproduce::run(&options, &interrupt()?),
        Verb::Simulate(options) => simulate::run(&options, &interrupt()?),
        Verb::Teleop(options) => teleop::run(&options, &interrupt()?),
        Verb::Export(options) => export::run(&options),
        Verb::Flash(options) => flash::run(&options, &interrupt()?),
        Verb::Bridge(options) => bridge::run(&options, &interrupt()?),
        Verb::Ports(options) => ports::run(&options),
        Verb::Gripper(options) => gripper::run(&options, &interrupt()?),
        Verb::Doctor(options) => doctor::run(&options, &interrupt()?),
    }
}
