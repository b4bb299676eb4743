//! The command line: the verbs, and the help a newcomer reads first. The options of a verb are beside it.

mod preferred;

use std::ffi::OsString;

use anyhow::Result;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::commands::{
    bridge, calibrate, demo, doctor, eval, export, flash, glove, gripper, ports, record, replay,
    report, reproduce, settings, simulate, teleop, train,
};
use host::failure::OrFail;
use host::interrupt::Interrupt;
use host::next::Command;

/// Operate a Robotiq 3-Finger gripper with a glove of 16 orientation sensors, or try it all without hardware.
///
/// Without a verb, `gauntlet` runs the demo: it trains a map from hand poses to gripper positions, starts a virtual
/// glove and a virtual gripper that speak the real bytes, and drives one with the other for 20 seconds.
#[derive(Debug, Parser)]
#[command(
    name = "gauntlet",
    version,
    after_help = "\
Start here:
  gauntlet                                       the demo: no hardware needed
  gauntlet demo --poses my_hand.csv              the same with your own hand's recording

With hardware:
  gauntlet ports                                 which serial ports are there
  gauntlet doctor --gripper /dev/ttyUSB1 --glove /dev/ttyUSB0
  gauntlet calibrate --glove /dev/ttyUSB0
  gauntlet record --glove /dev/ttyUSB0 --out my_hand.csv
  gauntlet train --poses my_hand.csv --out model.safetensors
  gauntlet teleop --glove /dev/ttyUSB0 --gripper /dev/ttyUSB1 --model model.safetensors --calibrate-flat

`gauntlet help VERB` explains a verb and shows examples.
Exit codes: 0 done, 1 failed, 2 wrong usage."
)]
pub struct Cli {
    /// What to do; the demo if nothing is said.
    #[command(subcommand)]
    pub verb: Option<Verb>,
}

/// What the tool can do.
#[derive(Debug, Subcommand)]
pub enum Verb {
    /// Train a map, then drive a virtual gripper with a virtual glove in real time.
    Demo(demo::Demo),
    /// Learn the map from hand poses to gripper positions, or between any two domains.
    Train(Box<train::Train>),
    /// Measure how good a trained map is on given poses or samples.
    Eval(eval::Eval),
    /// Draw what a hand's map does on one page: the verdict, which finger moves what, the pairs one by one.
    Report(report::Report),
    /// Make the paper's tables and figures, with its numbers beside ours.
    Reproduce(reproduce::Reproduce),
    /// Make a virtual glove and a virtual gripper behind pseudo-terminals.
    Simulate(simulate::Simulate),
    /// Drive a gripper with a glove, through two serial ports.
    Teleop(teleop::Teleop),
    /// Replay a session's log: the same commands bit for bit, or what another map would have commanded.
    Replay(replay::Replay),
    /// Write a trained map into a file as the image that a bridge takes, or a session log into tables.
    Export(export::Export),
    /// Write a trained map into a bridge that runs on a chip.
    Flash(flash::Flash),
    /// Look after a bridge that runs on a chip.
    Bridge(bridge::Bridge),
    /// List the serial ports of this machine.
    Ports(ports::Ports),
    /// Calibrate a glove on a hand, in a minute: how its sensors sit, which hand it is, how the joints turn.
    Calibrate(calibrate::Calibrate),
    /// Record a hand from a glove, for `train`: no gripper and no model needed.
    Record(record::Record),
    /// Watch a glove by itself: the hand, the rates, each sensor.
    Glove(glove::Glove),
    /// Read, activate and move a gripper at a bench.
    Gripper(gripper::Gripper),
    /// Find out which layer fails: port, line, unit, device.
    Doctor(doctor::Doctor),
    /// Print the settings, which are defaults for every verb, and where they lie.
    Settings(settings::Settings),
}

/// What is wrong with a command that a person is told to paste, where it is one of this tool and cannot be typed.
pub fn unusable(command: &Command) -> Option<String> {
    use clap::error::ErrorKind;
    if command
        .words()
        .first()
        .is_none_or(|word| word != "gauntlet")
    {
        return None;
    }
    match Cli::try_parse_from(command.words()) {
        Ok(_) => None,
        Err(shown) if shown.kind() == ErrorKind::DisplayHelp => None,
        Err(error) => Some(format!("{command}: {error}")),
    }
}

impl Verb {
    /// Whether a program reads the result.
    fn json(&self) -> bool {
        match self {
            Self::Demo(options) => options.json,
            Self::Train(options) => options.json,
            Self::Eval(options) => options.json,
            Self::Report(options) => options.json,
            Self::Reproduce(options) => options.json,
            Self::Simulate(_) => false,
            Self::Teleop(options) => options.json,
            Self::Replay(options) => options.json,
            Self::Export(options) => options.json,
            Self::Flash(options) => options.json,
            Self::Bridge(options) => options.what.at().json,
            Self::Ports(options) => options.json,
            Self::Record(options) => options.at.json,
            Self::Glove(options) => options.json(),
            Self::Gripper(options) => options.verb.target().json,
            Self::Doctor(options) => options.json,
            Self::Calibrate(options) => options.json,
            Self::Settings(options) => options.json,
        }
    }
}

impl Cli {
    /// Whether a program reads the result (`--json`).
    pub fn json(&self) -> bool {
        self.verb.as_ref().is_some_and(Verb::json)
    }
}

/// What was typed, with this person's settings as defaults. Ends the process where it is help, or wrong.
///
/// # Errors
/// The settings file is wrong; only for verbs that use it.
pub fn parse(typed: &[OsString]) -> Result<Cli> {
    let mut command = Cli::command();
    let typed = &preferred::whole(typed);
    if preferred::uses(typed) {
        command = preferred::with(command, &host::settings::Settings::load()?, typed);
    }
    let matches = command.get_matches_from(typed);
    Ok(Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit()))
}

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
    match cli
        .verb
        .unwrap_or_else(|| Verb::Demo(demo::Demo::default()))
    {
        Verb::Demo(options) => demo::run(&options, &interrupt()?),
        Verb::Train(options) => train::run(&options, &interrupt()?),
        Verb::Eval(options) => eval::run(&options),
        Verb::Report(options) => report::run(&options),
        Verb::Reproduce(options) => reproduce::run(&options, &interrupt()?),
        Verb::Simulate(options) => simulate::run(&options, &interrupt()?),
        Verb::Teleop(options) => teleop::run(&options, &interrupt()?),
        Verb::Replay(options) => replay::run(&options, &interrupt()?),
        Verb::Export(options) => export::run(&options, &interrupt()?),
        Verb::Flash(options) => flash::run(&options, &interrupt()?),
        Verb::Bridge(options) => bridge::run(&options, &interrupt()?),
        Verb::Ports(options) => ports::run(&options),
        Verb::Record(options) => record::run(&options, &interrupt()?),
        Verb::Glove(options) => glove::run(&options, &interrupt()?),
        Verb::Gripper(options) => gripper::run(&options, &interrupt()?),
        Verb::Doctor(options) => doctor::run(&options, &interrupt()?),
        Verb::Calibrate(options) => calibrate::run(&options, &interrupt()?),
        Verb::Settings(options) => settings::run(&options),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::demo::Demo;

    #[test]
    fn the_command_tree_is_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_verb_shows_examples() {
        for verb in Cli::command().get_subcommands() {
            let help = verb.get_after_help().map(ToString::to_string);
            assert!(
                help.is_some_and(|help| help.contains("Examples:")),
                "{}",
                verb.get_name()
            );
        }
    }

    #[test]
    fn the_demo_without_a_verb_has_the_defaults_of_the_verb() {
        let Some(Verb::Demo(typed)) = Cli::parse_from(["gauntlet", "demo"]).verb else {
            panic!("demo is a verb");
        };
        assert_eq!(format!("{typed:?}"), format!("{:?}", Demo::default()));
    }
}
