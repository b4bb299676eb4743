//! What the hand in a glove does: joint angles from scans, once the glove is calibrated.
//!
//! Two ways to be calibrated, each completed by one flat pose: *ideal sensors*, which sit straight and share one heading (virtual
//! gloves), and a *profile*, which says how this glove's sensors sit on this hand ([`glove::calibration::Profile`]).

use bridge::posture::missing;
use glove::calibration::{Align, Profile};
use glove::hand::flat::{FlatHand, Progress};
use glove::hand::{self, Calibration, JOINT_COUNT, Quaternion, SEGMENT_COUNT, Side, beyond};
use glove::headings::{Config, Headings};
use glove::scan::Frame;

use super::Scanned;

/// All joints, as a bit mask.
const ALL: u32 = (1 << JOINT_COUNT) - 1;

/// The hand in one scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// When, on the clock of the scans.
    pub at: glove::Instant,
    /// Joint angles, radians, in the order of [`hand::JOINT_NAMES`].
    pub angles: [f32; JOINT_COUNT],
    /// Joints that this scan does not show (bit j): a sensor beside them is missing, has started anew, or turns as no hand does. All,
    /// where the glove is not calibrated; the angles are then those of sensors that sit straight.
    pub held: u32,
}

impl Pose {
    /// Whether every joint was measured.
    pub fn is_whole(&self) -> bool {
        self.held == 0 && self.angles.iter().all(|angle| angle.is_finite())
    }
}

/// How the newest flat pose fares.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Flat {
    /// There was none.
    #[default]
    None,
    /// The hand must lie flat and still for a second; what stands in the way, if anything does.
    Waiting(Option<String>),
    /// It was taken.
    Taken,
    /// It was not taken, and why. What was in use before still is.
    Refused(String),
}

/// A hand whose glove is read.
#[derive(Debug, Clone)]
pub struct Hand {
    way: Way,
    flat: Flat,
    pose: Option<FlatHand>,
    /// How often each sensor had started, as wired; `None` before the first scan.
    starts: Option<[u16; SEGMENT_COUNT]>,
}

#[derive(Debug, Clone)]
enum Way {
    Straight(Straight),
    Profile(Box<Seated>),
}

/// Ideal sensors.
#[derive(Debug, Clone)]
struct Straight {
    side: Side,
    calibration: Option<Calibration>,
    /// Segments whose sensor started anew since the flat pose (bit k).
    astray: u16,
}

/// Sensors that sit as a profile says.
#[derive(Debug, Clone)]
struct Seated {
    align: Align,
    headings: Headings,
    /// A flat pose was taken.
    is_posed: bool,
}

impl Hand {
    /// A glove whose sensors sit straight on their segments and share one heading.
    pub fn ideal(side: Side) -> Self {
        Self::with(Way::Straight(Straight {
            side,
            calibration: None,
            astray: 0,
        }))
    }

    /// A glove whose sensors sit as `profile` says.
    pub fn with_profile(profile: &Profile) -> Self {
        Self::with(Way::Profile(Box::new(Seated {
            align: Align::new(),
            headings: Headings::new(profile, Config::default()),
            is_posed: false,
        })))
    }

    fn with(way: Way) -> Self {
        Self {
            way,
            flat: Flat::None,
            pose: None,
            starts: None,
        }
    }

    /// From `now` on the hand lies flat: taken as soon as it was still for a second, within `wait`.
    pub fn begin_flat(&mut self, now: glove::Instant, wait: glove::Duration) {
        self.pose = Some(FlatHand::start(now, wait, &self.way.seating()));
        self.flat = Flat::Waiting(None);
    }

    /// How the newest flat pose fares.
    pub fn flat(&self) -> &Flat {
        &self.flat
    }

    /// Whether a flat pose was taken, and the sensors' headings are known since.
    pub fn is_calibrated(&self) -> bool {
        match &self.way {
            Way::Straight(way) => {
                way.calibration.is_some() && way.astray & 1 == 0 && way.astray.count_ones() < 2
            }
            Way::Profile(way) => way.is_posed && way.headings.unknown().count_ones() < OF_THE_HAND,
        }
    }

    /// Standard deviation of each joint's heading, by segment, radians; `None` where no profile says.
    pub fn sigma(&self) -> Option<[f32; SEGMENT_COUNT]> {
        match &self.way {
            Way::Straight(_) => None,
            Way::Profile(way) => Some(way.headings.sigma()),
        }
    }

    /// Takes a scan.
    pub fn take(&mut self, scanned: &Scanned) -> Pose {
        self.see_starts(scanned);
        let begun_anew = self.look_for_flat(scanned);
        match &mut self.way {
            Way::Straight(way) => way.pose(&scanned.frame, scanned.at),
            Way::Profile(way) => {
                if begun_anew {
                    way.headings.begin_flat();
                }
                let pose = way.pose(&scanned.frame);
                if self.flat == Flat::Waiting(None) && self.pose.is_none() {
                    self.flat = match way.headings.end_flat(scanned.at) {
                        Ok(_) => {
                            way.is_posed = true;
                            Flat::Taken
                        }
                        Err(why) => Flat::Refused(why.to_string()),
                    };
                }
                pose
            }
        }
    }

    fn see_starts(&mut self, scanned: &Scanned) {
        let before = self.starts.replace(scanned.starts);
        let Some(before) = before else { return };
        for k in (0..SEGMENT_COUNT).filter(|&k| before[k] != scanned.starts[k]) {
            match &mut self.way {
                Way::Straight(way) => way.astray |= 1 << k,
                Way::Profile(way) => {
                    way.align.forget(k);
                    way.headings.restarted(k, scanned.at);
                }
            }
        }
    }

    /// Whether the second of stillness begins (anew) with this scan. The one that ends it leaves [`Flat::Waiting`] without a pose under
    /// way, where the headings are still to be taken.
    fn look_for_flat(&mut self, scanned: &Scanned) -> bool {
        let Some(pose) = &mut self.pose else {
            return false;
        };
        let frame = self.way.placed(&scanned.frame);
        match pose.take(&frame, scanned.at) {
            Progress::Waiting { still, obstacle } => {
                self.flat = Flat::Waiting(obstacle.map(|why| why.to_string()));
                still.as_ticks() == 0
            }
            Progress::Done(calibration) => {
                self.pose = None;
                self.flat = match &mut self.way {
                    Way::Straight(way) => {
                        (way.calibration, way.astray) = (Some(calibration), 0);
                        Flat::Taken
                    }
                    Way::Profile(_) => Flat::Waiting(None),
                };
                false
            }
            Progress::Refused(why) => {
                self.pose = None;
                self.flat = Flat::Refused(why.to_string());
                false
            }
        }
    }

    /// The time of a flat pose passes without a scan, too.
    pub fn pass(&mut self, now: glove::Instant) {
        if let Some(pose) = &self.pose
            && let Progress::Refused(why) = pose.progress(now)
        {
            self.pose = None;
            self.flat = Flat::Refused(why.to_string());
        }
    }
}

/// So many joints without a heading are none of single sensors: the hand's own sensor, or no flat pose.
const OF_THE_HAND: u32 = 3;

impl Way {
    /// How the sensors sit by what is known before a flat pose, by segment.
    fn seating(&self) -> Calibration {
        match self {
            Way::Straight(way) => way.calibration.unwrap_or_default(),
            Way::Profile(way) => {
                let profile = way.headings.profile();
                let mounting = std::array::from_fn(|k| {
                    // The thumb's frames count from its base.
                    let base = match (1..4).contains(&k) {
                        true => profile.thumb_base,
                        false => Quaternion::identity(),
                    };
                    base * profile.mounting[k]
                });
                Calibration::from_mounting(mounting)
            }
        }
    }

    /// The frame by segment.
    fn placed(&self, frame: &Frame) -> Frame {
        match self {
            Way::Straight(_) => *frame,
            Way::Profile(way) => {
                let seats = way.headings.profile().sensors;
                let sample = |seat: u8| frame.samples[usize::from(seat) % SEGMENT_COUNT];
                Frame {
                    samples: seats.map(sample),
                    sequence: frame.sequence,
                }
            }
        }
    }
}

impl Straight {
    fn pose(&self, frame: &Frame, at: glove::Instant) -> Pose {
        let orientations = frame.orientations();
        let calibration = self.calibration.unwrap_or_default();
        let angles = hand::joint_angles(&orientations, &calibration, self.side);
        let lost = missing(frame) | self.astray;
        let mut held = match self.calibration {
            Some(_) => beside(lost),
            None => ALL,
        };
        let excess = beyond::excess(&orientations, &calibration, self.side, &angles);
        for (segment, excess) in excess.iter().enumerate() {
            if *excess > beyond::FAR {
                held |= hand::joints_of_segment(segment);
            }
        }
        Pose { at, angles, held }
    }
}

impl Seated {
    fn pose(&mut self, frame: &Frame) -> Pose {
        let reading = self.headings.take(&self.align.take(frame));
        Pose {
            at: reading.at,
            angles: reading.angles,
            held: if self.is_posed { reading.held } else { ALL },
        }
    }
}

/// The joints beside these segments, as a bit mask.
fn beside(segments: u16) -> u32 {
    let lost = (0..SEGMENT_COUNT).filter(|k| segments >> k & 1 == 1);
    lost.fold(0, |mask, k| mask | hand::joints_of_segment(k))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glove::hand::{JOINT_NAMES, segment_orientations};
    use glove::scan::{Health, Sample};

    const SCAN_US: u64 = 28_000;

    /// Scans of a hand whose joints are at `angles`.
    fn scans(
        hand: &mut Hand,
        from: u64,
        count: u64,
        turned: &[Quaternion; SEGMENT_COUNT],
        starts: [u16; SEGMENT_COUNT],
        angles: impl Fn(u64) -> [f32; JOINT_COUNT],
    ) -> Vec<Pose> {
        (from..from + count)
            .map(|scan| {
                let at = glove::Instant::from_ticks(scan * SCAN_US);
                let q = segment_orientations(&angles(scan), Side::Right);
                let samples = std::array::from_fn(|k| Sample {
                    orientation: turned[k] * q[k],
                    stamp: at,
                    health: Health::Good,
                });
                let frame = Frame {
                    samples,
                    sequence: scan as u32,
                };
                hand.take(&Scanned { frame, at, starts })
            })
            .collect()
    }

    fn begin(hand: &mut Hand, scan: u64) {
        let wait = glove::Duration::from_ticks(10_000_000);
        hand.begin_flat(glove::Instant::from_ticks(scan * SCAN_US), wait);
    }

    fn pip(of: &str) -> usize {
        JOINT_NAMES.iter().position(|name| *name == of).unwrap()
    }

    #[test]
    fn without_a_flat_pose_no_joint_is_measured_and_with_one_all_are() {
        let straight = [Quaternion::identity(); SEGMENT_COUNT];
        let profile = Profile::straight(Side::Right);
        for mut hand in [Hand::ideal(Side::Right), Hand::with_profile(&profile)] {
            let flat = |_| [0.0; JOINT_COUNT];
            let before = scans(&mut hand, 0, 10, &straight, [1; 16], flat);
            assert!(
                before
                    .iter()
                    .all(|pose| pose.held == ALL && !pose.is_whole())
            );
            assert!(!hand.is_calibrated());
            begin(&mut hand, 10);
            scans(&mut hand, 10, 45, &straight, [1; 16], flat);
            assert_eq!(hand.flat(), &Flat::Taken);
            assert!(hand.is_calibrated());
            let index = pip("index_pip_flex");
            let bent = |_| std::array::from_fn(|joint| if joint == index { 0.8 } else { 0.0 });
            let after = scans(&mut hand, 55, 5, &straight, [1; 16], bent);
            let newest = after.last().unwrap();
            assert!(newest.is_whole(), "{:b}", newest.held);
            assert!((newest.angles[index] - 0.8).abs() < 0.01, "{newest:?}");
        }
    }

    #[test]
    fn with_a_profile_headings_that_differ_cost_nothing_and_ideal_sensors_would_lie() {
        let about_up = |k: usize| Quaternion::from_euler_angles(0.0, 0.0, 0.2 * k as f32);
        // Palm down: the segment's y is the world's up.
        let down = Quaternion::from_euler_angles(std::f32::consts::FRAC_PI_2, 0.0, 0.0);
        let turned = std::array::from_fn(|k| about_up(k) * down);
        let mut hand = Hand::with_profile(&Profile::straight(Side::Right));
        begin(&mut hand, 0);
        scans(&mut hand, 0, 45, &turned, [1; 16], |_| [0.0; JOINT_COUNT]);
        assert_eq!(hand.flat(), &Flat::Taken);
        let index = pip("index_pip_flex");
        let bent = |_| std::array::from_fn(|joint| if joint == index { 0.8 } else { 0.0 });
        let pose = *scans(&mut hand, 45, 5, &turned, [1; 16], bent)
            .last()
            .unwrap();
        assert!((pose.angles[index] - 0.8).abs() < 0.02, "{pose:?}");
        assert!(pose.is_whole());
    }

    #[test]
    fn a_hand_that_moves_or_is_bent_is_not_taken_and_why_is_said() {
        let straight = [Quaternion::identity(); SEGMENT_COUNT];
        let mut hand = Hand::ideal(Side::Right);
        begin(&mut hand, 0);
        let moving = |scan| [0.1 * (scan % 20) as f32 / 2.0; JOINT_COUNT];
        scans(&mut hand, 0, 100, &straight, [1; 16], moving);
        let Flat::Waiting(Some(why)) = hand.flat() else {
            panic!("{:?}", hand.flat());
        };
        assert!(why.contains("moves"), "{why}");
        hand.pass(glove::Instant::from_ticks(11_000_000));
        assert!(matches!(hand.flat(), Flat::Refused(_)), "{:?}", hand.flat());
        assert!(!hand.is_calibrated());
    }

    #[test]
    fn a_sensor_that_starts_anew_costs_its_joints_and_the_hand_s_own_costs_the_calibration() {
        let straight = [Quaternion::identity(); SEGMENT_COUNT];
        let flat = |_| [0.0; JOINT_COUNT];
        let started = |k: usize| std::array::from_fn(|s| if s == k { 2 } else { 1 });
        let calibrated = || {
            let mut hand = Hand::ideal(Side::Right);
            begin(&mut hand, 0);
            scans(&mut hand, 0, 45, &straight, [1; 16], flat);
            assert!(hand.is_calibrated());
            hand
        };
        let mut hand = calibrated();
        let pose = scans(&mut hand, 45, 1, &straight, started(5), flat)[0];
        assert_eq!(pose.held, hand::joints_of_segment(5));
        assert!(hand.is_calibrated());
        let mut hand = calibrated();
        scans(&mut hand, 45, 1, &straight, started(0), flat);
        assert!(!hand.is_calibrated());
    }
}
