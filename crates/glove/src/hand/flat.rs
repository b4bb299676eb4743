//! Calibration from a hand that lies still: palm flat, fingers straight and together.
//!
//! [`FlatHand`] looks at frames until all 16 sensors have stood still for [`timing::STILL_FOR`], and takes the mean
//! orientation of that second, not one frame of it. Until then it says what stands in the way; when its time is over,
//! that is the refusal.
//!
//! **What is still.** Every good sample of every sensor within [`STILL_WITHIN`] of the first one of the second. A sample
//! that was lost or refused now and then costs nothing, a sensor without a good one for [`timing::STILL_GAP`] starts the
//! second anew.
//!
//! **What is flat.** A sensor's heading is its own (IMU mode), so whole rotations between sensors mean nothing before
//! the calibration. Gravity needs no heading: on a flat hand, sensors sewn on straight see "up" in the same direction of
//! their own frames. A finger's segment that sees it [`FLAT_WITHIN`] away from where its parent or the `hand` sees it is
//! bent. This is judged against the mountings that are known: those of a calibration before, or straight ones
//! ([`Calibration::identity`]), as the virtual glove has them and `docs/wiring.md` asks for. It sees what tilts a
//! segment; a bend about the vertical (a fist held with the thumb up) turns nothing against gravity and cannot be seen. The
//! thumb's metacarpal is not judged: where the thumb lies is the person's.

use super::{Calibration, Quaternion, SEGMENT_COUNT, SEGMENT_NAMES, first_joint, parent};
use crate::imu;
use crate::scan::Frame;
use crate::timing::{self, after, since};
use crate::{Duration, Instant};

/// How far a sample may be from the first one of the second, radians (3°): postural tremor and the sway of a hand in the
/// air are about 1°, the sensor's own noise 0.1°; the mean is then off by 1.5° at most even if the hand turned all the while.
pub const STILL_WITHIN: f32 = 0.052_36;

/// How far gravity's direction may differ between two segments of a flat hand, radians (35°): two sensors, each sewn on by
/// eye and off by 15° at worst, and 5° for a finger that is pressed flat or bends backwards. A relaxed hand bends its PIP
/// joints by about 45°, a fist by 80° and more.
pub const FLAT_WITHIN: f32 = 0.610_87;

/// What stands in the way of a calibration, and in the end why it was refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Refusal {
    /// No frame came, or none since a while.
    NoFrames,
    /// No good sample from these segments' sensors for [`timing::STILL_GAP`] (bit k: segment k).
    Missing {
        /// The segments, never none.
        segments: u16,
    },
    /// The hand moves.
    Moving {
        /// The segment that turned furthest in its newest sample.
        segment: u8,
        /// How far from where the second began, radians.
        by: f32,
    },
    /// A finger is bent far beyond a flat hand.
    Bent {
        /// The joint that leads to the bent segment (an index of [`super::JOINT_NAMES`], its flexion).
        joint: u8,
        /// How far the segment is tilted against the one it hangs on or against the hand, radians.
        by: f32,
    },
    /// Nothing is wrong, but the hand was not still for long enough when the time was over.
    TooShort {
        /// How long it was.
        still: Duration,
    },
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match *self {
            Refusal::NoFrames => f.write_str("the glove sends no frames"),
            Refusal::Missing { segments } => {
                f.write_str("no good sample from:")?;
                for (segment, name) in SEGMENT_NAMES.iter().enumerate() {
                    if segments >> segment & 1 == 1 {
                        write!(f, " {name}")?;
                    }
                }
                Ok(())
            }
            Refusal::Moving { segment, by } => {
                let name = SEGMENT_NAMES.get(usize::from(segment)).unwrap_or(&"?");
                write!(f, "the hand moves: {name} turned by {:.0}°", degrees(by))
            }
            Refusal::Bent { joint, by } => {
                let name = super::JOINT_NAMES.get(usize::from(joint)).unwrap_or(&"?");
                write!(
                    f,
                    "the hand is not flat: bent by {:.0}° at {name}",
                    degrees(by)
                )
            }
            Refusal::TooShort { still } => {
                write!(
                    f,
                    "the hand was still for {} ms of {} ms",
                    still.as_millis(),
                    timing::STILL_FOR.as_millis()
                )
            }
        }
    }
}

impl core::error::Error for Refusal {}

fn degrees(radians: f32) -> f32 {
    radians * (180.0 / core::f32::consts::PI)
}

/// How far a calibration has come.
#[allow(
    clippy::large_enum_variant,
    reason = "made once a step and looked at once; there is no allocator"
)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Progress {
    /// Not yet.
    Waiting {
        /// How long the hand has been still.
        still: Duration,
        /// What started the second anew most recently; `None` if nothing has yet.
        obstacle: Option<Refusal>,
    },
    /// The calibration; the object has done its work.
    Done(Calibration),
    /// The time is over; the object has done its work.
    Refused(Refusal),
}

/// One attempt at a calibration.
#[derive(Debug, Clone)]
pub struct FlatHand {
    reference: Calibration,
    deadline: Instant,
    /// When the newest frame came.
    frame_at: Option<Instant>,
    /// The second under way.
    began: Option<Instant>,
    tracks: [Track; SEGMENT_COUNT],
    obstacle: Option<Refusal>,
    /// One sensor beside the hand's may be away.
    spares_one: bool,
}

/// One sensor in the second under way.
#[derive(Debug, Clone, Copy)]
struct Track {
    /// Its first good sample of the second.
    first: Option<Quaternion>,
    /// Sum of the samples, all on the first one's side: q and −q are one rotation.
    sum: nalgebra::Quaternion<f32>,
    /// When a good sample came last; of the frame, whatever the second.
    good_at: Instant,
}

impl FlatHand {
    /// Begins at `now`, to be decided within `wait`: at least [`timing::STILL_FOR`], else it can only be refused.
    ///
    /// `reference` says how the sensors sit on their segments as far as anybody knows: the calibration before this one,
    /// or [`Calibration::identity`] for sensors sewn on straight.
    pub fn start(now: Instant, wait: Duration, reference: &Calibration) -> Self {
        let track = Track {
            first: None,
            sum: nalgebra::Quaternion::new(0.0, 0.0, 0.0, 0.0),
            good_at: now,
        };
        Self {
            reference: *reference,
            deadline: after(now, wait),
            frame_at: None,
            began: None,
            tracks: [track; SEGMENT_COUNT],
            obstacle: None,
            spares_one: false,
        }
    }

    /// Does not wait for one sensor that is away, unless it is the hand's. The calibration then says nothing of its segment.
    #[must_use]
    pub fn sparing_one(mut self) -> Self {
        self.spares_one = true;
        self
    }

    /// When the second under way began; another second, another time.
    pub fn began(&self) -> Option<Instant> {
        self.began
    }

    /// Takes a frame that came at `now`.
    pub fn take(&mut self, frame: &Frame, now: Instant) -> Progress {
        if self
            .frame_at
            .replace(now)
            .is_some_and(|before| since(now, before) > timing::STILL_GAP)
        {
            // Nobody saw what the hand did meanwhile.
            self.restart(Refusal::NoFrames);
        }
        if let Some(obstacle) = self.add(frame, now) {
            self.restart(obstacle);
        }
        match self.began {
            Some(began) if since(now, began) >= timing::STILL_FOR => match self.judge() {
                Ok(calibration) => return Progress::Done(calibration),
                Err(obstacle) => self.restart(obstacle),
            },
            _ => {}
        }
        self.progress(now)
    }

    /// Says how far it is at `now` without a frame: for when none comes. Ask it with every step.
    pub fn progress(&self, now: Instant) -> Progress {
        let silent = self
            .frame_at
            .is_none_or(|at| since(now, at) > timing::STILL_GAP);
        let still = self
            .began
            .filter(|_| !silent)
            .map_or(Duration::from_ticks(0), |began| since(now, began));
        let obstacle = if silent && self.frame_at.is_some() {
            Some(Refusal::NoFrames)
        } else {
            self.obstacle
        };
        if now < self.deadline {
            return Progress::Waiting { still, obstacle };
        }
        Progress::Refused(match (self.frame_at, obstacle) {
            (None, _) => Refusal::NoFrames,
            (_, Some(obstacle)) => obstacle,
            (_, None) => Refusal::TooShort { still },
        })
    }

    fn restart(&mut self, obstacle: Refusal) {
        self.obstacle = Some(obstacle);
        self.began = None;
        for track in &mut self.tracks {
            track.first = None;
        }
    }

    /// Adds a frame's good samples to the second, or says why that cannot go on.
    fn add(&mut self, frame: &Frame, now: Instant) -> Option<Refusal> {
        self.began.get_or_insert(now);
        let (mut missing, mut moved) = (0u16, (0u8, 0.0));
        for (k, (track, sample)) in self.tracks.iter_mut().zip(&frame.samples).enumerate() {
            if sample.health.is_good() {
                track.good_at = now;
                let by = track.add(&sample.orientation);
                if by > moved.1 {
                    moved = (k as u8, by);
                }
            } else if since(now, track.good_at) > timing::STILL_GAP {
                missing |= 1 << k;
            }
        }
        let spared = self.spares_one && missing.is_power_of_two() && missing & 1 == 0;
        if missing != 0 && !spared {
            return Some(Refusal::Missing { segments: missing });
        }
        let (segment, by) = moved;
        (by > STILL_WITHIN).then_some(Refusal::Moving { segment, by })
    }

    /// The second is over: the calibration, unless the hand is bent.
    fn judge(&self) -> Result<Calibration, Refusal> {
        let mut mean = [Quaternion::identity(); SEGMENT_COUNT];
        for (q, track) in mean.iter_mut().zip(&self.tracks) {
            *q = track.mean();
        }
        match self.bent(&mean) {
            Some(bent) => Err(bent),
            None => Ok(Calibration::from_flat_hand(&mean)),
        }
    }

    /// The most bent joint, if one is bent beyond a flat hand.
    fn bent(&self, sensors: &[Quaternion; SEGMENT_COUNT]) -> Option<Refusal> {
        let mounting = self.reference.mounting();
        let up: [_; SEGMENT_COUNT] = core::array::from_fn(|k| {
            // What the world's up is in the segment's frame; a sensor's heading does not change it.
            mounting[k] * (sensors[k].inverse() * nalgebra::Vector3::new(0.0, 0.0, 1.0))
        });
        let mut worst = (0, 0.0);
        // From 2: the thumb's metacarpal is not judged, and the hand hangs on nothing.
        for k in 2..SEGMENT_COUNT {
            let on = parent(k).unwrap_or(0);
            let is_seen = |k: usize| self.tracks.get(k).is_some_and(|t| t.first.is_some());
            if !(is_seen(k) && is_seen(on)) {
                continue;
            }
            // The thumb's base lies otherwise than the hand.
            let against_hand = if k < 4 { 0.0 } else { angle(&up[0], &up[k]) };
            let by = angle(&up[on], &up[k]).max(against_hand);
            if by > worst.1 {
                worst = (k, by);
            }
        }
        let (segment, by) = worst;
        let joint = joint_to(segment);
        (by > FLAT_WITHIN).then_some(Refusal::Bent { joint, by })
    }
}

impl Track {
    /// Adds a good sample; how far it is from the first of the second, radians.
    fn add(&mut self, q: &Quaternion) -> f32 {
        let Some(first) = &self.first else {
            (self.first, self.sum) = (Some(*q), q.into_inner());
            return 0.0;
        };
        self.sum += imu::continuous(*q, first).into_inner();
        imu::angle_between(first, q)
    }

    fn mean(&self) -> Quaternion {
        let squared = self.sum.norm_squared();
        if self.first.is_none() || !(squared.is_finite() && squared > 0.0) {
            return Quaternion::identity();
        }
        Quaternion::new_unchecked(self.sum / libm::sqrtf(squared))
    }
}

/// The flexion angle of the joint that leads to `segment`.
fn joint_to(segment: usize) -> u8 {
    let Some(behind) = segment.checked_sub(1) else {
        return 0;
    };
    let within = match behind % 3 {
        0 => 0,
        1 => 3,
        _ => 4,
    };
    (first_joint(behind / 3) + within) as u8
}

/// The angle between two unit vectors, radians.
fn angle(a: &nalgebra::Vector3<f32>, b: &nalgebra::Vector3<f32>) -> f32 {
    let cross = a.cross(b);
    libm::atan2f(libm::sqrtf(cross.norm_squared()), a.dot(b))
}

#[cfg(test)]
mod tests;
