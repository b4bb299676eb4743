//! What is said to the person about how a step goes, and why one is done again.

use std::fmt;

use glove::calibration::{Doubt, Finger};
use glove::hand::SEGMENT_NAMES;

/// Something that is seen while a step goes on, or that speaks against it at its end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Remark {
    /// No scans have come for a second.
    NoScans,
    /// Too few scans came in the part that counts.
    FewScans(u32),
    /// A sensor gives nothing.
    Away(usize),
    /// The hand should be still, and this segment's sensor moves.
    Moves(usize),
    /// The hand lay still, but for this segment, which strayed by so much (radians).
    Strayed(usize, f32),
    /// The turn does not show all headings yet: how ambiguous the worst is.
    TurnFurther(f32),
    /// The turn shows every heading.
    TurnedEnough,
    /// A segment moves against the hand while that turns, by so much (radians).
    NotBoard(usize, f32),
    /// A finger that should bend was not seen moving: sensors that moved.
    NotSeen(Finger, u8),
    /// A finger that should close does not: how far it bends (radians).
    NotClosed(Finger, f32),
    /// The thumb was not seen going across the palm.
    ThumbStays,
    /// The fingers, bent one by one, did not show three sensors each: a finger and how many moved with it.
    Unclear(Finger, u8),
    /// Sensors sit elsewhere than they are wired: how many.
    Swapped(u8),
    /// A sensor started anew.
    Restarted(usize),
    /// What the checks found after the last flat pose.
    Found(Doubt),
}

/// Whether a remark is good news.
impl Remark {
    /// It says that all is well.
    pub fn is_good(&self) -> bool {
        matches!(self, Self::TurnedEnough)
    }
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |k: usize| SEGMENT_NAMES.get(k).copied().unwrap_or("?");
        match *self {
            Self::NoScans => f.write_str("no scans from the glove: is it plugged in?"),
            Self::FewScans(scans) => write!(
                f,
                "only {scans} scans came: the glove's line is slow or was away"
            ),
            Self::Away(k) => write!(f, "the sensor on {} gives nothing", name(k)),
            Self::Moves(k) => write!(f, "hold still: {} moves", name(k)),
            Self::Strayed(k, by) => write!(
                f,
                "{} moved by {:.0}° while the hand should be still",
                name(k),
                by.to_degrees()
            ),
            Self::TurnFurther(ratio) => {
                write!(f, "turn further, all ways ({ratio:.2}, enough is 0.80)")
            }
            Self::TurnedEnough => f.write_str("turned enough; go on to the end"),
            Self::NotBoard(k, by) => write!(
                f,
                "keep the hand like a board: {} moved by {:.0}° against it",
                name(k),
                by.to_degrees()
            ),
            Self::NotSeen(finger, 0) => {
                write!(f, "{} not seen moving: bend it farther", finger.name())
            }
            Self::NotSeen(finger, sensors) => write!(
                f,
                "{} seen moving at {sensors} of its 3 sensors: bend all of it",
                finger.name()
            ),
            Self::NotClosed(finger, by) => write!(
                f,
                "{} bends by {:.0}° only: close the fist",
                finger.name(),
                by.to_degrees()
            ),
            Self::ThumbStays => f.write_str("thumb not seen moving: out, and across the palm"),
            Self::Unclear(finger, sensors) => write!(
                f,
                "{sensors} sensors moved most with the {}, 3 sit on it: bend one finger at a time, the others still",
                finger.name()
            ),
            Self::Swapped(sensors) => write!(
                f,
                "{sensors} sensors sit elsewhere than they are wired: it goes on with them as they sit"
            ),
            Self::Restarted(k) => write!(f, "sensor {k} started anew: look at its plug"),
            Self::Found(doubt) => write!(f, "{doubt}"),
        }
    }
}
