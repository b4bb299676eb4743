//! Where a session's devices are, for the commands that a person is told to type.

use std::path::PathBuf;

use crate::chip::link::Address;
use crate::lines::{Model, Settings};
use crate::next::{Command, NextStep, advice};

/// Where they are.
#[derive(Debug, Clone, Default)]
pub enum Devices {
    /// Nobody says, or they are gone with the session: virtual ones.
    #[default]
    Unknown,
    /// At lines of this computer.
    Here {
        /// The glove's port.
        glove: PathBuf,
        /// The gripper's port or address.
        gripper: PathBuf,
        /// Which gripper it is.
        model: Model,
        /// How it is asked.
        settings: Settings,
    },
    /// At a bridge on a chip.
    Chip(Address),
}

impl Devices {
    /// A command for the gripper with this verb; on a chip the one that asks the bridge.
    pub fn gripper(&self, verb: &str) -> Option<Command> {
        match self {
            Self::Unknown => None,
            Self::Here {
                gripper,
                model,
                settings,
                ..
            } => Some(settings.named_in(Command::gauntlet(verb), gripper, *model)),
            Self::Chip(address) => Some(status(address)),
        }
    }

    /// The command that looks at the glove; on a chip the one that asks the bridge.
    pub fn glove(&self) -> Option<Command> {
        match self {
            Self::Unknown => None,
            Self::Here { glove, .. } => Some(Command::gauntlet("doctor").path("--glove", glove)),
            Self::Chip(address) => Some(status(address)),
        }
    }

    /// A command for the bridge on a chip with this verb.
    pub fn bridge(&self, verb: &str) -> Option<Command> {
        match self {
            Self::Chip(address) => Some(Command::gauntlet(verb).option("--bridge", address)),
            Self::Unknown | Self::Here { .. } => None,
        }
    }
}

fn status(address: &Address) -> Command {
    Command::gauntlet("bridge status").option("--bridge", address)
}

/// `words`, and where there is a command, that too and what it is good for.
pub(super) fn and(words: &str, command: Option<Command>, why: &str) -> NextStep {
    match command {
        Some(command) if words.is_empty() => command.then(why),
        Some(command) => advice(words).then("; ").then(command).then(why),
        None if words.is_empty() => "the same again".into(),
        None => words.into(),
    }
}
