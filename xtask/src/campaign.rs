//! Campaigns that take minutes: the ignored tests, whose shorter parts run with all the others.

use crate::step::{self, Failure, cargo};

/// The gripper's: 100,000 cycles beside the glove at full speed, at 100 Hz and with replies dropped; a cut at every byte
/// of a full stroke.
pub fn gripper() -> Result<(), Failure> {
    step::run(
        "gripper campaigns",
        &mut cargo(&[
            "test",
            "--locked",
            "--package",
            "loop-tests",
            "--test",
            "gripper_rate",
            "--",
            "--ignored",
            "--nocapture",
        ]),
    )
}
