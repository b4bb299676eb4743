//! A bridge on a chip: the host protocol, its glove's scans, and the chip as an emulator has it.

pub mod emulator;
pub mod link;
pub mod scans;

use crate::next::Command;

/// What builds the firmware, in the checkout.
fn firmware() -> Command {
    Command::program("cargo").word("xtask").word("firmware")
}
