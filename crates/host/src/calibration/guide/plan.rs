//! The steps of the guided session: what is said, how long each lasts, and which part of it is used.

use glove::calibration::{Finger, Step};

/// One step. Times in milliseconds from when it is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    /// What it is.
    pub step: Step,
    /// How long it lasts.
    pub lasts: u64,
    /// From when on scans count: before, the person is still on the way.
    pub from: u64,
    /// Until when.
    pub to: u64,
}

const fn part(step: Step, lasts: u64, from: u64, to: u64) -> Part {
    Part {
        step,
        lasts,
        from,
        to,
    }
}

const fn flat(step: Step) -> Part {
    part(step, 4_200, 2_000, 4_000)
}

const fn alone(finger: Finger) -> Part {
    part(Step::Alone(finger), 2_000, 0, 1_990)
}

/// Number of steps.
pub const PARTS: usize = 12;

/// All of them, in order: 57.6 s.
pub const PLAN: [Part; PARTS] = [
    flat(Step::FirstFlat),
    part(Step::Turn, 13_000, 400, 12_900),
    flat(Step::SecondFlat),
    alone(Finger::Index),
    alone(Finger::Middle),
    alone(Finger::Ring),
    alone(Finger::Little),
    alone(Finger::Thumb),
    part(Step::Fists, 8_000, 0, 7_900),
    part(Step::Thumb, 4_000, 0, 3_900),
    part(Step::Free, 10_000, 0, 9_900),
    flat(Step::LastFlat),
];

/// The place of a step in the plan.
pub fn place(step: Step) -> usize {
    PLAN.iter().position(|part| part.step == step).unwrap_or(0)
}

/// The steps in which one finger is bent after the other.
pub const ALONE: std::ops::Range<usize> = 3..8;

/// A step in a word or two.
pub fn name(step: Step) -> &'static str {
    match step {
        Step::FirstFlat => "flat",
        Step::Turn => "turn",
        Step::SecondFlat => "flat again",
        Step::Alone(finger) => finger.name(),
        Step::Fists => "fists",
        Step::Thumb => "thumb",
        Step::Free => "free",
        Step::LastFlat => "flat, the last",
    }
}

/// What the person is told.
pub fn words(step: Step) -> &'static str {
    match step {
        Step::FirstFlat => {
            "Lay your hand flat on the table: fingers straight and together, thumb alongside. Hold still."
        }
        Step::Turn => "Lift the hand and turn it, flat like a board all the while.",
        Step::SecondFlat => "Flat on the table again. Hold still.",
        Step::Alone(Finger::Index) => {
            "Hand up from the table. Bend and stretch the index finger, twice."
        }
        Step::Alone(Finger::Middle) => "Now the middle finger, twice.",
        Step::Alone(Finger::Ring) => "Now the ring finger, twice.",
        Step::Alone(Finger::Little) => "Now the little finger, twice.",
        Step::Alone(Finger::Thumb) => "Now the thumb: bend and stretch it twice.",
        Step::Fists => "Four fists, and open each; turn the hand a little between them.",
        Step::Thumb => "Thumb out and across the palm, twice.",
        Step::Free => "Move all fingers as you like.",
        Step::LastFlat => "Flat on the table once more. Hold still.",
    }
}

/// Where the turn is going so many milliseconds after it was asked for.
pub fn turning(at: u64) -> &'static str {
    match at {
        0..2_200 => "thumb up",
        2_200..4_000 => "on, until the palm is up",
        4_000..5_800 => "back, palm down",
        5_800..7_600 => "fingers up",
        7_600..9_600 => "fingers down",
        9_600..11_400 => "thumb up once more",
        _ => "palm down",
    }
}
