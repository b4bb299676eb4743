//! gFLT: the fault a gripper reports, in words.

/// How bad a fault is, as the manuals class it (and the LED shows it).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// No fault.
    None,
    /// The last command was not carried out, nothing else is wrong.
    Priority,
    /// Passes by itself when its cause does.
    Minor,
    /// Stays until the gripper is reset and activated again (rACT 1 → 0 → 1).
    Major,
}

/// The fault a gripper reports (gFLT, 4 bits). The same number means different things to different
/// families: [`Fault::three_finger`], [`Fault::two_finger`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Fault {
    /// 00.
    None,
    /// 05: commanded before activation.
    ActivationNeeded,
    /// 06 (3-Finger): commanded while a mode change is under way.
    ModeChangeNeeded,
    /// 07: rACT is not set.
    NotActivated,
    /// 08 (2F, Hand-E): too hot.
    OverTemperature,
    /// 09 (3-Finger): the communication chip is not ready.
    ChipNotReady,
    /// 09 (2F, Hand-E): nobody spoke to it for a second.
    NoCommunication,
    /// 0A (3-Finger): fingers and scissor have been in each other's way, for less than 20 s.
    Interference,
    /// 0A (2F, Hand-E): supply voltage too low.
    UnderVoltage,
    /// 0B: automatic release under way.
    Releasing,
    /// 0C (2F, Hand-E): internal fault.
    Internal,
    /// 0D: activation failed.
    Activation,
    /// 0E (3-Finger): fingers and scissor have been in each other's way for more than 20 s.
    InterferenceLasting,
    /// 0E (2F, Hand-E): motor current too high.
    OverCurrent,
    /// 0F: automatic release done.
    Released,
    /// A number the family's manual does not name (1 to 15).
    Unknown(u8),
}

impl Fault {
    /// The 3-Finger gripper's meaning of the low four bits of `code`.
    #[must_use]
    pub fn three_finger(code: u8) -> Self {
        match code & 0x0F {
            0x00 => Self::None,
            0x05 => Self::ActivationNeeded,
            0x06 => Self::ModeChangeNeeded,
            0x07 => Self::NotActivated,
            0x09 => Self::ChipNotReady,
            0x0A => Self::Interference,
            0x0B => Self::Releasing,
            0x0D => Self::Activation,
            0x0E => Self::InterferenceLasting,
            0x0F => Self::Released,
            other => Self::Unknown(other),
        }
    }

    /// The 2F-85's, 2F-140's and Hand-E's meaning of the low four bits of `code`.
    #[must_use]
    pub fn two_finger(code: u8) -> Self {
        match code & 0x0F {
            0x00 => Self::None,
            0x05 => Self::ActivationNeeded,
            0x07 => Self::NotActivated,
            0x08 => Self::OverTemperature,
            0x09 => Self::NoCommunication,
            0x0A => Self::UnderVoltage,
            0x0B => Self::Releasing,
            0x0C => Self::Internal,
            0x0D => Self::Activation,
            0x0E => Self::OverCurrent,
            0x0F => Self::Released,
            other => Self::Unknown(other),
        }
    }

    /// The number on the wire.
    #[must_use]
    pub fn code(self) -> u8 {
        match self {
            Self::None => 0x00,
            Self::ActivationNeeded => 0x05,
            Self::ModeChangeNeeded => 0x06,
            Self::NotActivated => 0x07,
            Self::OverTemperature => 0x08,
            Self::ChipNotReady | Self::NoCommunication => 0x09,
            Self::Interference | Self::UnderVoltage => 0x0A,
            Self::Releasing => 0x0B,
            Self::Internal => 0x0C,
            Self::Activation => 0x0D,
            Self::InterferenceLasting | Self::OverCurrent => 0x0E,
            Self::Released => 0x0F,
            Self::Unknown(code) => code & 0x0F,
        }
    }

    /// How bad it is. A number no manual names counts as major from 0A on, where the 2F family
    /// needs a reset, and as priority below.
    #[must_use]
    pub fn severity(self) -> Severity {
        match self {
            Self::None => Severity::None,
            Self::ActivationNeeded | Self::ModeChangeNeeded | Self::NotActivated => {
                Severity::Priority
            }
            Self::OverTemperature
            | Self::ChipNotReady
            | Self::NoCommunication
            | Self::Interference => Severity::Minor,
            Self::Releasing => Severity::Minor,
            Self::UnderVoltage | Self::Internal | Self::Activation => Severity::Major,
            Self::InterferenceLasting | Self::OverCurrent | Self::Released => Severity::Major,
            Self::Unknown(code) if code >= 0x0A => Severity::Major,
            Self::Unknown(_) => Severity::Priority,
        }
    }

    /// What it means, as a sentence.
    #[must_use]
    pub fn sentence(self) -> &'static str {
        match self {
            Self::None => "No fault.",
            Self::ActivationNeeded => "The gripper was told to move before it was activated.",
            Self::ModeChangeNeeded => {
                "The gripper was told to move while it is changing its grasping mode."
            }
            Self::NotActivated => "The gripper is not activated.",
            Self::OverTemperature => "The gripper is too hot and rests until it has cooled down.",
            Self::ChipNotReady => {
                "The gripper's communication chip is not ready (it may be starting)."
            }
            Self::NoCommunication => "The gripper heard no request for more than a second.",
            Self::Interference => "Fingers and scissor are in each other's way.",
            Self::UnderVoltage => "The gripper's supply voltage is too low.",
            Self::Releasing => "The automatic release is under way: all axes open slowly.",
            Self::Internal => "The gripper reports an internal fault.",
            Self::Activation => "The activation failed: something kept the fingers from moving.",
            Self::InterferenceLasting => {
                "Fingers and scissor were in each other's way for more than 20 s and the gripper has stopped."
            }
            Self::OverCurrent => "The motor current is too high.",
            Self::Released => "The automatic release is done.",
            Self::Unknown(_) => "The gripper reports a fault number its manual does not name.",
        }
    }

    /// What a person can do about it, as a sentence.
    #[must_use]
    pub fn action(self) -> &'static str {
        match self {
            Self::None => "Nothing to do.",
            Self::ActivationNeeded | Self::NotActivated => {
                "Activate it (the fingers will move), then command it again."
            }
            Self::ModeChangeNeeded => "Wait until the mode change is done, then command it again.",
            Self::OverTemperature => "Let it cool down; use less force or slower cycles.",
            Self::ChipNotReady => "Wait a few seconds; if it stays, switch the gripper off and on.",
            Self::NoCommunication => {
                "It clears with the next request; if it returns, check cable and adapter."
            }
            Self::Interference => "Open the fingers or spread the scissor within 20 s.",
            Self::UnderVoltage => "Check the 24 V supply and its cable, then reset and activate.",
            Self::Releasing => "Keep clear and wait until the release is done.",
            Self::Internal => {
                "Switch it off and on; reset and activate; if it stays, ask the maker."
            }
            Self::Activation => "Clear the fingers' way, then reset and activate.",
            Self::InterferenceLasting => "Free the fingers, then reset and activate.",
            Self::OverCurrent => "Remove what blocks the fingers, then reset and activate.",
            Self::Released => "Reset and activate (the fingers will move) to use it again.",
            Self::Unknown(_) => {
                "Read the status again; if it stays, reset and activate, and look in the maker's manual."
            }
        }
    }
}

impl core::fmt::Display for Fault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(
            f,
            "fault {:02X}: {} {}",
            self.code(),
            self.sentence(),
            self.action()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_of_both_families_survives_and_says_something() {
        for code in 0..16 {
            for fault in [Fault::three_finger(code), Fault::two_finger(code)] {
                assert_eq!(fault.code(), code);
                assert!(fault.sentence().ends_with('.') && fault.action().ends_with('.'));
                assert_eq!(fault.severity() == Severity::None, code == 0);
            }
        }
    }

    #[test]
    fn what_needs_a_reset_is_what_the_manuals_say() {
        let major = |family: fn(u8) -> Fault| {
            (0..16)
                .filter(|&c| family(c).severity() == Severity::Major)
                .collect::<heapless::Vec<u8, 16>>()
        };
        // 3-Finger: 0C is not in the manual.
        assert_eq!(major(Fault::three_finger), [0x0C, 0x0D, 0x0E, 0x0F]);
        // 2F: 0A to 0F, but for 0B, which is the release still under way.
        assert_eq!(major(Fault::two_finger), [0x0A, 0x0C, 0x0D, 0x0E, 0x0F]);
    }
}
