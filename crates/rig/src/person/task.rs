//! What a person can be asked to do.

use crate::chance::Chance;

/// How the hand is held in use.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Attitude {
    /// Palm down, rolling and pitching by up to 30°.
    PalmDown,
    /// Thumb up, within 12°.
    ThumbUp,
    /// Any way.
    Free,
    /// Rolled about the forearm (90: the thumb of a right hand up) and pitched (−80: the fingers down, 80: up) by so many degrees from
    /// palm down, within 6°.
    Steady {
        /// About the forearm.
        roll: f64,
        /// Of the fingers above the wrist.
        pitch: f64,
    },
}

/// What a person can be asked to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Task {
    /// Flat on the table, still.
    Flat,
    /// Lifted and turned all ways, like a board: 12 s.
    Turn,
    /// One finger (0 thumb to 4 little) bent and stretched twice in 2 s, the others still.
    Alone(usize),
    /// Four fists in 8 s, turning the hand between them.
    Fists,
    /// The thumb out and across the palm, twice in 4 s.
    Thumb,
    /// All fingers as the person likes.
    Free,
    /// All fingers as the person likes, the hand held so.
    Use(Attitude),
    /// This posture (25 angles, radians, in the order of `glove::hand::JOINT_NAMES`), palm down; as exact as the person is.
    Posture([f64; 25]),
    /// The same with the hand held so.
    Held([f64; 25], Attitude),
}

/// Something that was asked, and when the person begins it.
#[derive(Debug, Clone)]
pub(super) struct Asked {
    pub(super) task: Task,
    pub(super) begins: f64,
    pub(super) chance: Chance,
    /// Off straight, degrees.
    pub(super) off: [f64; 25],
    /// Of its attitude, against what was asked before.
    pub(super) sign: f64,
}
