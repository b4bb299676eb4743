//! What the hand in a glove does: joint angles from scans, once the glove is calibrated.
//!
//! Two ways to be calibrated, each completed by one flat pose: *ideal sensors*, which sit straight and share one heading (virtual
//! gloves), and a *profile*, which says how this glove's sensors sit on this hand. The angles are those that would drive a gripper
//! ([`bridge::posture`]).

use bridge::posture::Posture;
use glove::calibration::{Bound, Misfit};
use glove::hand::flat::{FlatHand, Progress};
use glove::hand::{JOINT_COUNT, SEGMENT_COUNT, Side};
use glove::headings::PoseReport;
use glove::scan::Frame;

use super::Scanned;
use crate::clock::since;
use crate::session::snapshot::Headings;

/// All joints, as a bit mask.
const ALL: u32 = (1 << JOINT_COUNT) - 1;

/// The hand in one scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// When the scan was complete.
    pub at: glove::Instant,
    /// Joint angles, radians, in the order of [`glove::hand::JOINT_NAMES`].
    pub angles: [f32; JOINT_COUNT],
    /// Joints that this scan does not show (bit j): a sensor beside them is missing, has started anew, or turns as no hand does; or the
    /// heading is not sure. All, where the glove is not calibrated; the angles are then those of sensors that sit straight.
    pub held: u32,
}

impl Pose {
    /// Whether every joint was measured.
    pub fn is_whole(&self) -> bool {
        self.held == 0
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
    side: Side,
    posture: Posture,
    flat: Flat,
    /// The flat pose under way, and when its time is over.
    pose: Option<(FlatHand, glove::Instant)>,
    /// How often each sensor had started and whose ids were known, as wired; `None` before the first scan.
    heard: Option<Heard>,
    /// Flat poses taken with a profile, and what the newest found.
    poses: u16,
    report: Option<PoseReport>,
}

type Heard = (
    [u16; SEGMENT_COUNT],
    [Option<glove::imu::UniqueId>; SEGMENT_COUNT],
);

impl Hand {
    /// A glove whose sensors sit straight on their segments and share one heading.
    pub fn ideal(side: Side) -> Self {
        Self {
            side,
            posture: Posture::new(side, None),
            flat: Flat::None,
            pose: None,
            heard: None,
            poses: 0,
            report: None,
        }
    }

    /// A glove whose sensors sit as its profile says.
    pub fn with_profile(profile: &Bound) -> Self {
        let mut hand = Self::ideal(profile.profile.side);
        hand.posture.set_profile(Some(profile));
        hand
    }

    /// Which hand it is.
    pub fn side(&self) -> Side {
        self.side
    }

    /// From `now` on the hand lies flat: taken as soon as it was still for a second, within `wait`.
    pub fn begin_flat(&mut self, now: glove::Instant, wait: glove::Duration) {
        self.posture.cancel_pose(now);
        let seating = self.posture.seating().unwrap_or_default();
        let until = now.checked_add_duration(wait).unwrap_or(now);
        self.pose = Some((FlatHand::start(now, wait, &seating), until));
        self.flat = Flat::Waiting(None);
    }

    /// How the newest flat pose fares.
    pub fn flat(&self) -> &Flat {
        &self.flat
    }

    /// Whether a flat pose was taken, and the sensors' headings are known since.
    pub fn is_calibrated(&self) -> bool {
        self.posture.is_calibrated()
    }

    /// Whether the profile is this glove's; `None` without one.
    pub fn fit(&self) -> Option<Result<(), Misfit>> {
        self.posture.fit()
    }

    /// What is known of the headings; `None` without a profile.
    pub fn headings(&self) -> Option<Headings> {
        let known = self.posture.headings()?;
        Some(Headings {
            sigma: known.sigma(),
            drift: known.drift(),
            degraded: known.degraded(),
            unknown: known.unknown(),
            poses: self.poses,
            pose: self.report,
        })
    }

    /// Takes a scan.
    pub fn take(&mut self, scanned: &Scanned) -> Pose {
        let at = scanned.at;
        self.hear(scanned);
        let frame = self.posture.placed(&scanned.frame);
        let frame = frame.as_ref().unwrap_or(&scanned.frame);
        let was_flat = self.look_for_flat(frame, at);
        let read = self.posture.read(frame);
        if was_flat {
            self.end_pose(at);
        }
        match read {
            Ok(reading) => Pose {
                at,
                angles: reading.angles,
                held: if self.is_calibrated() {
                    reading.held
                } else {
                    ALL
                },
            },
            Err(_) => Pose {
                at,
                angles: *self.posture.angles(),
                held: ALL,
            },
        }
    }

    /// Sensors that started since the scan before: whose they are, and that their headings are others.
    fn hear(&mut self, scanned: &Scanned) {
        let before = self.heard.replace((scanned.starts, scanned.ids));
        if before != self.heard {
            self.posture.meet(&scanned.ids);
        }
        if self.posture.calibration().is_some()
            && let Some((before, _)) = before
        {
            for k in (0..SEGMENT_COUNT).filter(|&k| before[k] != scanned.starts[k]) {
                self.posture.distrust(k, scanned.at);
            }
        }
        self.posture.hear(&scanned.starts, true, scanned.at);
    }

    /// Whether the hand was flat and still for long enough by this frame, where a profile's headings are to be taken of it.
    fn look_for_flat(&mut self, frame: &Frame, at: glove::Instant) -> bool {
        let Some((pose, _)) = &mut self.pose else {
            return false;
        };
        let began = pose.began();
        let progress = pose.take(frame, at);
        let is_new = pose.began() != began;
        let has_profile = self.posture.fit().is_some();
        if has_profile && is_new {
            self.posture.begin_pose();
        }
        match progress {
            Progress::Done(_) if has_profile => return true,
            Progress::Done(calibration) => {
                self.posture.calibrate(Some(calibration));
                self.pose = None;
                self.flat = Flat::Taken;
            }
            progress => self.follow(progress, at),
        }
        false
    }

    fn follow(&mut self, progress: Progress, at: glove::Instant) {
        match progress {
            Progress::Waiting { obstacle, .. } => {
                // What stood in the way last is said until something else does.
                let before = match std::mem::take(&mut self.flat) {
                    Flat::Waiting(before) => before,
                    _ => None,
                };
                self.flat = Flat::Waiting(obstacle.map(|why| why.to_string()).or(before));
            }
            Progress::Refused(why) => self.refuse(why.to_string(), at),
            Progress::Done(_) => {}
        }
    }

    /// The headings of the pose, or the same again as long as there is time.
    fn end_pose(&mut self, at: glove::Instant) {
        let Some((_, until)) = self.pose.take() else {
            return;
        };
        if let Some(Err(misfit)) = self.posture.fit() {
            return self.refuse(misfit.to_string(), at);
        }
        match self.posture.end_pose(at) {
            Ok(report) => {
                self.flat = Flat::Taken;
                self.poses = self.poses.wrapping_add(1);
                self.report = Some(report);
            }
            Err(why) if at < until => {
                self.begin_flat(at, since(until, at));
                self.flat = Flat::Waiting(Some(why.to_string()));
            }
            Err(why) => self.refuse(why.to_string(), at),
        }
    }

    fn refuse(&mut self, why: String, at: glove::Instant) {
        self.pose = None;
        self.posture.cancel_pose(at);
        self.flat = Flat::Refused(why);
    }

    /// The time of a flat pose passes without a scan, too.
    pub fn pass(&mut self, now: glove::Instant) {
        if let Some((pose, _)) = &self.pose {
            let progress = pose.progress(now);
            if matches!(progress, Progress::Refused(_)) {
                self.follow(progress, now);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glove::calibration::Profile;
    use glove::hand::{self, JOINT_NAMES, Quaternion, segment_orientations};
    use glove::imu::UniqueId;
    use glove::scan::{Health, Sample};

    const SCAN_US: u64 = 28_000;

    const IDS: [UniqueId; SEGMENT_COUNT] = {
        let mut ids = [[7; 16]; SEGMENT_COUNT];
        let mut k = 0;
        while k < SEGMENT_COUNT {
            ids[k][0] = k as u8;
            k += 1;
        }
        ids
    };

    /// A profile of a glove whose sensors sit straight.
    fn bound() -> Bound {
        Bound {
            profile: Profile::straight(Side::Right),
            ids: IDS,
        }
    }

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
                hand.take(&Scanned {
                    frame,
                    at,
                    starts,
                    ids: IDS.map(Some),
                })
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
        // Palm down: the segment's y is the world's up.
        let down = Quaternion::from_euler_angles(std::f32::consts::FRAC_PI_2, 0.0, 0.0);
        let straight = [down; SEGMENT_COUNT];
        for mut hand in [Hand::ideal(Side::Right), Hand::with_profile(&bound())] {
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
        let mut hand = Hand::with_profile(&bound());
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
    #[test]
    fn a_profile_of_another_glove_calibrates_nothing_and_says_so() {
        let still = [Quaternion::identity(); SEGMENT_COUNT];
        let mut other = bound();
        other.ids[3][1] = 99;
        let mut hand = Hand::with_profile(&other);
        begin(&mut hand, 0);
        let poses = scans(&mut hand, 0, 45, &still, [1; 16], |_| [0.0; JOINT_COUNT]);
        assert!(matches!(hand.flat(), Flat::Refused(_)), "{:?}", hand.flat());
        assert!(!hand.is_calibrated() && poses.iter().all(|pose| !pose.is_whole()));
        assert!(
            matches!(hand.fit(), Some(Err(Misfit::Differ(_)))),
            "{:?}",
            hand.fit()
        );
    }
}
