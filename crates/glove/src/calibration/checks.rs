//! What a session shows of itself: each check with its threshold, and a verdict per joint.

use super::Finger;
use super::identity::Identity;
use super::solve::{self, is_base, is_thumb};
use crate::calibration::algebra::rad;
use crate::hand::{JOINT_NAMES, SEGMENT_COUNT, SEGMENT_NAMES};

/// A segment that moved more against the hand in the turn was not held still, radians (6°; correct gloves up to 3.8°).
pub const FIT: f32 = rad(6.0);
/// A turn whose second-best heading fits nearly as well is doubtful (correct ones 0.53 to 0.62).
pub const RATIO_DOUBTFUL: f32 = 0.80;
/// … and says nothing.
pub const RATIO_USELESS: f32 = 0.95;
/// The thumb must have pointed up so far in the turn: cosine.
pub const UP: f32 = 0.5;
/// A finger's axis may be this far from the hand's x, radians (20°; correct gloves up to 11.3°).
pub const LEAN: f32 = rad(20.0);
/// Largest angle of a finger joint in the last flat pose, radians (8°; correct gloves up to 5.4°).
pub const FLAT_ANGLE: f32 = rad(8.0);

/// How far a segment may be tilted in a later flat pose, radians: 9° the hand, proximal and middle, 10° distal, 14° the thumb's.
pub const fn tilt_limit(segment: usize) -> f32 {
    match segment {
        0 => rad(9.0),
        1..=3 => rad(14.0),
        s if s % 3 == 0 => rad(10.0),
        _ => rad(9.0),
    }
}

/// How far the heading of a segment against its parent may be off in a later flat pose, radians: 4° at a hinge, 6° at an MCP joint,
/// 10° at the thumb's CMC.
pub const fn innovation_limit(segment: usize) -> f32 {
    match segment {
        0 => rad(4.0),
        1 => rad(10.0),
        s if s % 3 == 1 => rad(6.0),
        _ => rad(4.0),
    }
}

/// What the checks measured, by segment where it says so. Angles in radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Checks {
    /// Which sensor sits where.
    pub identity: Identity,
    /// How far each segment moved against the hand in the turn.
    pub fit: [f32; SEGMENT_COUNT],
    /// How ambiguous the turn leaves each heading, 0 to 1.
    pub ratio: [f32; SEGMENT_COUNT],
    /// Cosine between the hand's x and up where it was largest in the turn: a right hand's is positive, a left hand's negative.
    pub x_up: f32,
    /// The y of the thumb's axis on the flat hand, a second witness: negative on a right hand.
    pub thumb_y: f32,
    /// How much each joint to the parent moved: mean squared sine of half its angle.
    pub motion: [f32; SEGMENT_COUNT],
    /// How far each finger axis is from the hand's x.
    pub lean: [f32; SEGMENT_COUNT],
    /// How far each segment was tilted in the last flat pose, by the poses before.
    pub tilt: [f32; SEGMENT_COUNT],
    /// How far the heading of each segment against its parent was off in the last flat pose, with its sign.
    pub innovation: [f32; SEGMENT_COUNT],
    /// The largest angle of each finger joint in the last flat pose.
    pub flat_angle: [f32; SEGMENT_COUNT],
    /// Sensors that started anew after the second flat pose (bit k: as it is wired): less is known of them.
    pub restarted: u16,
    /// Sensors that started anew at a time when that spoils the session.
    pub spoiled: u16,
}

/// Something a check found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Doubt {
    /// A sensor lost its heading in the middle of the session.
    Restarted {
        /// As it is wired.
        sensor: u8,
        /// Its heading is lost; else the last flat pose gives it.
        spoils: bool,
    },
    /// The five fingers did not show three sensors each.
    Unclear {
        /// A finger that did not.
        finger: Finger,
        /// How many sensors moved most with it.
        sensors: u8,
    },
    /// Another sensor sits on this segment than is wired for it.
    Elsewhere {
        /// The segment.
        segment: u8,
        /// The sensor on it.
        sensor: u8,
    },
    /// The hand did not turn enough to show the heading of this segment's sensor.
    NotTurned {
        /// The segment.
        segment: u8,
        /// [`Checks::ratio`].
        ratio: f32,
    },
    /// The segment moved against the hand while that turned.
    NotStill {
        /// The segment.
        segment: u8,
        /// By this much.
        by: f32,
    },
    /// The turn does not show which hand it is.
    Side {
        /// [`Checks::x_up`].
        up: f32,
    },
    /// The hinge was not seen moving.
    NotBent {
        /// The segment.
        segment: u8,
    },
    /// The finger bends about another axis than the hand's x.
    Leans {
        /// The segment.
        segment: u8,
        /// By this much.
        by: f32,
    },
    /// In the last flat pose the segment did not lie as in the ones before: its sensor slipped, or the finger was not straight.
    Tilted {
        /// The segment.
        segment: u8,
        /// By this much.
        by: f32,
    },
    /// In the last flat pose the sensor was turned about the vertical: it slipped.
    Turned {
        /// The segment.
        segment: u8,
        /// By this much.
        by: f32,
    },
    /// In the last flat pose a joint of the finger was not straight.
    NotFlat {
        /// The segment.
        segment: u8,
        /// By this much.
        by: f32,
    },
}

/// What is to be thought of a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// Nothing speaks against it.
    Good,
    /// It works, and could be better.
    Doubtful,
    /// It is not to be used so.
    Bad,
}

impl Doubt {
    /// How much it weighs.
    pub fn verdict(&self) -> Verdict {
        match self {
            Doubt::NotTurned { ratio, .. } if *ratio <= RATIO_USELESS => Verdict::Doubtful,
            Doubt::Restarted { spoils: false, .. }
            | Doubt::Elsewhere { .. }
            | Doubt::NotBent { .. }
            | Doubt::Leans { .. } => Verdict::Doubtful,
            _ => Verdict::Bad,
        }
    }

    /// The segment it is about; `None`: the whole hand.
    pub fn segment(&self) -> Option<usize> {
        match *self {
            Doubt::Elsewhere { segment, .. }
            | Doubt::NotTurned { segment, .. }
            | Doubt::NotStill { segment, .. }
            | Doubt::NotBent { segment }
            | Doubt::Leans { segment, .. }
            | Doubt::Tilted { segment, .. }
            | Doubt::Turned { segment, .. }
            | Doubt::NotFlat { segment, .. } => Some(usize::from(segment)),
            Doubt::Restarted { .. } | Doubt::Unclear { .. } | Doubt::Side { .. } => None,
        }
    }
}

impl Checks {
    /// Everything the checks found.
    pub fn doubts(&self) -> impl Iterator<Item = Doubt> + '_ {
        let restarted = (0..SEGMENT_COUNT)
            .filter(|&k| (self.restarted | self.spoiled) >> k & 1 == 1)
            .map(|k| Doubt::Restarted {
                sensor: k as u8,
                spoils: self.spoiled >> k & 1 == 1,
            });
        let side = (libm::fabsf(self.x_up) < UP || self.x_up.is_nan())
            .then_some(Doubt::Side { up: self.x_up });
        let unclear = Finger::ALL.into_iter().filter_map(|finger| {
            let Identity::Unclear(counts) = self.identity else {
                return None;
            };
            let sensors = counts.get(finger.number()).copied()?;
            (sensors != 3).then_some(Doubt::Unclear { finger, sensors })
        });
        restarted
            .chain(side)
            .chain(unclear)
            .chain((0..SEGMENT_COUNT).flat_map(|k| self.of_segment(k).into_iter().flatten()))
    }

    fn of_segment(&self, k: usize) -> [Option<Doubt>; 8] {
        let k = k % SEGMENT_COUNT;
        let segment = k as u8;
        let elsewhere = match self.identity {
            Identity::Moved(sensors) if usize::from(sensors[k]) != k => Some(Doubt::Elsewhere {
                segment,
                sensor: sensors[k],
            }),
            _ => None,
        };
        let over = |value: f32, limit: f32| value > limit || value.is_nan();
        let tilted = over(self.tilt[k], tilt_limit(k)).then_some(Doubt::Tilted {
            segment,
            by: self.tilt[k],
        });
        if k == 0 {
            return [elsewhere, tilted, None, None, None, None, None, None];
        }
        let (ratio, by) = (self.ratio[k], self.lean[k]);
        let turned = libm::fabsf(self.innovation[k]);
        let hinge_stood = !is_base(k) && self.motion[k] < solve::MOVED;
        [
            elsewhere,
            over(ratio, RATIO_DOUBTFUL).then_some(Doubt::NotTurned { segment, ratio }),
            over(self.fit[k], FIT).then_some(Doubt::NotStill {
                segment,
                by: self.fit[k],
            }),
            hinge_stood.then_some(Doubt::NotBent { segment }),
            (!is_thumb(k) && over(by, LEAN)).then_some(Doubt::Leans { segment, by }),
            tilted,
            over(turned, innovation_limit(k)).then_some(Doubt::Turned {
                segment,
                by: turned,
            }),
            (!is_thumb(k) && over(self.flat_angle[k], FLAT_ANGLE)).then_some(Doubt::NotFlat {
                segment,
                by: self.flat_angle[k],
            }),
        ]
    }

    /// The verdict on the joint between `segment` and its parent.
    pub fn verdict(&self, segment: usize) -> Verdict {
        let parent = crate::hand::parent(segment);
        self.doubts()
            .filter(|doubt| match doubt.segment() {
                None => true,
                // What is wrong with a sensor costs the joints on both sides of it.
                Some(at) => at == segment || Some(at) == parent,
            })
            .map(|doubt| doubt.verdict())
            .max()
            .unwrap_or(Verdict::Good)
    }

    /// The verdict on all of it.
    pub fn overall(&self) -> Verdict {
        let verdicts = self.doubts().map(|doubt| doubt.verdict());
        verdicts.max().unwrap_or(Verdict::Good)
    }

    /// The segment whose sensor slipped most, if one did: by its tilt, else by its heading, in the last flat pose.
    pub fn slipped(&self) -> Option<usize> {
        let farthest = |excess: [f32; SEGMENT_COUNT]| {
            (0..SEGMENT_COUNT)
                .max_by(|&a, &b| excess[a].total_cmp(&excess[b]))
                .filter(|&k| excess[k] > 1.0)
        };
        let tilted = core::array::from_fn(|k| self.tilt[k] / tilt_limit(k));
        farthest(tilted).or_else(|| farthest(self.turned()))
    }

    /// How far each sensor was turned about the vertical, in parts of its limit.
    fn turned(&self) -> [f32; SEGMENT_COUNT] {
        let mut against_hand = [0.0; SEGMENT_COUNT];
        for k in 1..SEGMENT_COUNT {
            let parent = crate::hand::parent(k).unwrap_or(0);
            against_hand[k] = against_hand[parent] + self.innovation[k];
        }
        // Where most of the others are off alike it is the hand's sensor.
        let mut sorted = against_hand;
        if let Some((_, others)) = sorted.split_first_mut() {
            others.sort_unstable_by(f32::total_cmp);
        }
        let common = sorted[SEGMENT_COUNT / 2];
        core::array::from_fn(|k| {
            let off = if k == 0 {
                common
            } else {
                against_hand[k] - common
            };
            libm::fabsf(off) / innovation_limit(k)
        })
    }
}

impl core::fmt::Display for Doubt {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let name = |segment: u8| SEGMENT_NAMES.get(usize::from(segment)).unwrap_or(&"?");
        let deg = |by: f32| by.to_degrees();
        match *self {
            Doubt::Restarted { sensor, spoils } => {
                write!(f, "sensor {sensor} started anew in the session: ")?;
                f.write_str(if spoils {
                    "its heading is lost; begin again"
                } else {
                    "its new heading is known by the last flat pose alone"
                })
            }
            Doubt::Unclear { finger, sensors } => write!(
                f,
                "{sensors} sensors moved with the {}, 3 sit on it: bend the fingers again, one by one",
                finger.name()
            ),
            Doubt::Elsewhere { segment, sensor } => write!(
                f,
                "sensor {sensor} sits on {}, where sensor {segment} belongs",
                name(segment)
            ),
            Doubt::NotTurned { segment, ratio } => write!(
                f,
                "the hand did not turn enough to know the heading of {} (ratio {ratio:.2}): turn it further, all ways",
                name(segment)
            ),
            Doubt::NotStill { segment, by } => write!(
                f,
                "{} moved by {:.1}° while the hand turned: keep it like a board",
                name(segment),
                deg(by)
            ),
            Doubt::Side { up } => write!(
                f,
                "the thumb did not point up in the turn ({up:.2}): which hand it is does not show"
            ),
            Doubt::NotBent { segment } => {
                let joint = joint_name(segment);
                write!(f, "{joint} was not seen moving: bend it")
            }
            Doubt::Leans { segment, by } => write!(
                f,
                "{} bends {:.0}° askew: is its sensor on the right finger?",
                name(segment),
                deg(by)
            ),
            Doubt::Tilted { segment, by } => write!(
                f,
                "{} lay {:.0}° tilted in the last flat pose: its sensor slipped, or the finger was not straight",
                name(segment),
                deg(by)
            ),
            Doubt::Turned { segment, by } => write!(
                f,
                "the sensor on {} lay turned by {:.0}° in the last flat pose: it slipped",
                name(segment),
                deg(by)
            ),
            Doubt::NotFlat { segment, by } => write!(
                f,
                "{} was bent by {:.0}° in the last flat pose",
                joint_name(segment),
                deg(by)
            ),
        }
    }
}

/// The flexion of the joint between a segment and its parent.
fn joint_name(segment: u8) -> &'static str {
    let Some(behind) = usize::from(segment).checked_sub(1) else {
        return "?";
    };
    let within = [0, 3, 4][behind % 3];
    JOINT_NAMES.get(5 * (behind / 3) + within).unwrap_or(&"?")
}
