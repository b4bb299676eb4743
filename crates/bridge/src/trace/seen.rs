//! What a replay compares besides the bytes.

use crate::{State, Telemetry};
use core::fmt::Write;
use crc::{CRC_32_ISO_HDLC, Crc, Digest};

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// What the bridge made of all that came: written down with each new frame and with each change of its state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Seen {
    /// [`state_name`] has it in words.
    pub state: u8,
    /// CRC-32 of the state with its reason, the joint angles, the map's output, the filtered target and the command.
    pub digest: u32,
}

/// Whether there is something new to see.
#[derive(Debug, Clone, Copy, Default)]
pub struct Look {
    frame: u32,
    state: Option<State>,
}

impl Look {
    /// What is to be written down or compared after a step, if anything.
    pub fn look<const X: usize>(&mut self, telemetry: &Telemetry<X>) -> Option<Seen> {
        let now = (telemetry.frame_sequence, Some(telemetry.state));
        if now == (self.frame, self.state) {
            return None;
        }
        (self.frame, self.state) = now;
        Some(Seen {
            state: code(telemetry.state),
            digest: digest(telemetry),
        })
    }
}

const fn code(state: State) -> u8 {
    match state {
        State::Idle => 0,
        State::Holding(_) => 1,
        State::SafeAction(_) => 2,
        State::Blending => 3,
        State::Following => 4,
        State::Faulted(_) => 5,
    }
}

/// The state of a [`Seen`] in words.
pub const fn state_name(state: u8) -> &'static str {
    match state {
        0 => "idle",
        1 => "holding",
        2 => "safe action",
        3 => "blending",
        4 => "following",
        5 => "faulted",
        _ => "unknown",
    }
}

/// Text that goes into a checksum.
struct Summed<'c>(Digest<'c, u32>);

impl Write for Summed<'_> {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        self.0.update(text.as_bytes());
        Ok(())
    }
}

fn digest<const X: usize>(telemetry: &Telemetry<X>) -> u32 {
    let mut sum = Summed(CRC.digest());
    // Never an error.
    let _ = write!(sum, "{:?}", telemetry.state);
    let mut sum = sum.0;
    sum.update(&telemetry.frame_sequence.to_le_bytes());
    sum.update(&[u8::from(telemetry.gives_angles)]);
    for values in [Some(&telemetry.angles[..])].into_iter().chain(
        [&telemetry.map_output, &telemetry.target].map(|axes| axes.as_ref().map(|axes| &axes[..])),
    ) {
        sum.update(&[u8::from(values.is_some())]);
        for value in values.unwrap_or_default() {
            sum.update(&value.to_bits().to_le_bytes());
        }
    }
    if let Some(command) = &telemetry.command {
        for axes in [&command.position, &command.speed, &command.force] {
            sum.update(&axes[..]);
        }
    }
    sum.finalize()
}
