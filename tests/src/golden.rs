//! The recorded calibration sessions beside the checkout, as the chip takes them, and what the host makes of them.

use std::path::Path;

use glove::calibration::{Bound, Finger, Step};
use glove::headings::Config;
use host::calibration::recorded::Prompt;
use host::calibration::{Recorded, replay};

/// Their names: plain, with anatomical axes, with two sensors exchanged, with one that starts anew.
pub const SESSIONS: [&str; 4] = ["a_docs_axes", "b_anatomical", "c_swapped", "d_restart"];

/// The number of a step for the chip; 0 is none.
fn number(prompt: Option<Prompt>) -> u8 {
    match prompt {
        Some(Prompt::Calibration(step)) => match step {
            Step::FirstFlat => 1,
            Step::Turn => 2,
            Step::SecondFlat => 3,
            Step::Alone(Finger::Index) => 4,
            Step::Alone(Finger::Middle) => 5,
            Step::Alone(Finger::Ring) => 6,
            Step::Alone(Finger::Little) => 7,
            Step::Alone(Finger::Thumb) => 8,
            Step::Fists => 9,
            Step::Thumb => 10,
            Step::Free => 11,
            Step::LastFlat => 12,
        },
        Some(Prompt::FlatInUse) => 13,
        Some(Prompt::Use | Prompt::Other) | None => 0,
    }
}

/// A session; `None`, with a word, where the data is not there.
///
/// # Panics
/// It cannot be read.
pub fn session(name: &str) -> Option<Recorded> {
    rig::skip::shared(&format!("glove/{name}/prompts.csv"))?;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/glove");
    Some(Recorded::read(&folder.join(name)).expect("the session's files"))
}

/// Its rows for the chip.
pub fn rows(recorded: &Recorded) -> Vec<u8> {
    let mut bytes = Vec::new();
    for row in &recorded.rows {
        let windows = recorded.windows.iter().filter(|w| w.holds(row.at));
        // A flat pose lies within the use.
        let prompt = windows
            .map(|window| number(Some(window.prompt)))
            .max()
            .unwrap_or(0);
        bytes.push(prompt);
        bytes.extend(row.at.as_ticks().to_le_bytes());
        let there = (0..16).filter(|&k| row.reads[k].is_some());
        let there = there.fold(0u16, |mask, k| mask | 1 << k);
        bytes.extend(there.to_le_bytes());
        bytes.extend(row.reads.iter().flat_map(|read| read.unwrap_or_default()));
    }
    bytes
}

/// What the chip should put out: the profile, then the angles and held joints of each scan after the calibration.
///
/// # Panics
/// It comes to no calibration.
pub fn here(recorded: &Recorded) -> Vec<u8> {
    let replay = replay(recorded, Config::default()).expect("a calibration");
    let bound = Bound {
        profile: replay.outcome.profile,
        ids: [[0; 16]; 16],
    };
    let mut bytes = bound.to_bytes().to_vec();
    for reading in replay.readings.iter().flatten() {
        let angles = reading.angles.iter();
        bytes.extend(angles.flat_map(|angle| angle.to_bits().to_le_bytes()));
        bytes.extend(reading.held.to_le_bytes());
    }
    bytes
}
