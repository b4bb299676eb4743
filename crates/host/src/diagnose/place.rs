//! Where a gripper is and how it is asked, and the commands that say the same to another verb.

use std::path::Path;
use std::time::Duration;

use gripper::registers::Kind;
use gripper::timing;

use crate::lines::port::BAUD;
use crate::lines::tcp;
use crate::lines::{MOST_PATIENCE, Model, Settings, UNIT};
use crate::next::Command;
use crate::report::Reporter;

/// What differs from a gripper as delivered, as far as a person knows.
#[derive(Debug, Clone, Copy, Default)]
pub struct Asked<'a> {
    /// Unit, speed and patience.
    pub settings: Settings,
    /// Which gripper it should be.
    pub model: Option<Model>,
    /// Who hears how a long search goes.
    pub reporter: Option<&'a dyn Reporter>,
}

/// A gripper's port or address, and how it is asked there.
#[derive(Debug, Clone, Copy)]
pub struct Place<'a> {
    /// A serial port, or `tcp:HOST[:PORT]`.
    pub path: &'a Path,
    /// How it is asked.
    pub asked: Asked<'a>,
}

impl Place<'_> {
    fn is_network(&self) -> bool {
        matches!(tcp::Address::parse(self.path), Ok(Some(_)))
    }

    /// The Modbus unit asked.
    pub fn unit(&self) -> u8 {
        let usual = if self.is_network() { tcp::UNIT } else { UNIT };
        self.asked.settings.unit.unwrap_or(usual)
    }

    /// The speed of a serial line, baud.
    pub fn baud(&self) -> u32 {
        self.asked.settings.baud.unwrap_or(BAUD)
    }

    /// How long after a question its answer may begin.
    pub fn patience(&self) -> Duration {
        let usual = if self.is_network() {
            tcp::EXCHANGE
        } else {
            Duration::from_micros(timing::RESPONSE_PC.as_micros())
        };
        usual + self.asked.settings.patience()
    }

    /// The same place, asked with this patience.
    pub fn with_patience(mut self, patience: Duration) -> Self {
        self.asked.settings.patience = Some(patience.min(MOST_PATIENCE));
        self
    }

    /// The same place, asked as this unit.
    pub fn with_unit(mut self, unit: u8) -> Self {
        self.asked.settings.unit = Some(unit);
        self
    }

    /// The same place, asked at this speed.
    pub fn with_baud(mut self, baud: u32) -> Self {
        self.asked.settings.baud = Some(baud);
        self
    }

    /// The same place for a gripper of this kind.
    pub fn with_kind(mut self, kind: Kind) -> Self {
        let named = self.asked.model.filter(|model| kind_of(*model) == kind);
        self.asked.model = named.or(match kind {
            Kind::ThreeFinger => None,
            Kind::TwoFinger => Some(Model::TwoFinger85),
        });
        self
    }

    /// A command for this place.
    pub fn command(&self, verb: &str) -> Command {
        let model = self.asked.model.unwrap_or(Model::ThreeFinger);
        self.asked
            .settings
            .named_in(Command::gauntlet(verb), self.path, model)
    }
}

/// The family of a model.
pub fn kind_of(model: Model) -> Kind {
    match model.two_finger() {
        None => Kind::ThreeFinger,
        Some(_) => Kind::TwoFinger,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_names_the_port_and_what_differs_and_can_be_pasted() {
        let place = Place {
            path: Path::new("/dev/ttyUSB1"),
            asked: Asked::default(),
        };
        let command = |place: Place<'_>| place.command("gripper status").to_string();
        assert_eq!(
            command(place),
            "gauntlet gripper status --gripper /dev/ttyUSB1"
        );
        assert_eq!(
            command(
                place
                    .with_baud(57_600)
                    .with_unit(5)
                    .with_kind(Kind::TwoFinger)
            ),
            "gauntlet gripper status --gripper /dev/ttyUSB1 --baud 57600 --unit 5 --gripper-model 2f85"
        );
        assert_eq!(
            command(place.with_unit(9).with_patience(Duration::from_millis(60))),
            "gauntlet gripper status --gripper /dev/ttyUSB1 --patience 60"
        );
    }
}
