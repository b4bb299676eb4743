//! Where a gripper can be: what a hand's map is trained to reach, by the gripper's axes.

use crate::cost::Lambda;
use crate::data::Matrix;
use crate::measures::Coverage;
use crate::model::Normalisation;
use crate::random::Random;

/// The configuration space of a gripper, counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Space {
    /// Finger A, B, C and scissor of the 3-Finger gripper ([`gripper::space`]).
    ThreeFinger,
    /// One axis from open to closed: 2F-85, 2F-140, Hand-E.
    OneAxis,
}

/// Counts from open to closed.
const STROKE: f32 = gripper::space::MAX;
/// How much farther from the middle a finished map goes than its training did: 6 counts beyond either end.
const REACH: f32 = 1.05;
/// Scissor counts of the hand that is neither spread nor gathered.
pub(super) const NEUTRAL_SCISSOR: f32 = 130.0;

/// Streams of random target samples of one seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Draw {
    /// To train on.
    Train,
    /// To measure with.
    Measure,
    /// Another stream.
    Stream(u64),
}

impl Space {
    /// That of a gripper with so many axes; `None` where no gripper has.
    #[must_use]
    pub const fn of_axes(axes: usize) -> Option<Self> {
        match axes {
            gripper::space::AXES => Some(Self::ThreeFinger),
            1 => Some(Self::OneAxis),
            _ => None,
        }
    }

    /// Axes.
    #[must_use]
    pub const fn axes(self) -> usize {
        self.axis_names().len()
    }

    /// The axes' names, as files have them.
    #[must_use]
    pub const fn axis_names(self) -> &'static [&'static str] {
        match self {
            Self::ThreeFinger => &["finger_a", "finger_b", "finger_c", "scissor"],
            Self::OneAxis => &["fingers"],
        }
    }

    /// Whether the gripper can be there. Another number of values lies nowhere.
    #[must_use]
    pub fn contains(self, counts: &[f32]) -> bool {
        match self {
            Self::ThreeFinger => {
                <&[f32; gripper::space::AXES]>::try_from(counts).is_ok_and(gripper::space::contains)
            }
            Self::OneAxis => matches!(counts, [count] if (0.0..=STROKE).contains(count)),
        }
    }

    /// The nearest place where it can be.
    #[must_use]
    pub fn nearest(self, counts: &[f32]) -> Vec<f32> {
        match <&[f32; gripper::space::AXES]>::try_from(counts) {
            Ok(counts) if self == Self::ThreeFinger => gripper::space::nearest(counts).to_vec(),
            _ => counts
                .iter()
                .map(|count| count.clamp(0.0, STROKE))
                .collect(),
        }
    }

    /// `count` places, uniform, one a row; equal seeds and draws give equal ones.
    #[must_use]
    pub fn samples(self, count: usize, seed: u64, draw: Draw) -> Matrix {
        let stream = match draw {
            Draw::Train => 0,
            Draw::Measure => 1,
            Draw::Stream(stream) => stream,
        };
        let mut random = Random::new(seed, stream);
        let mut samples = Matrix::default();
        for _ in 0..count {
            match self {
                Self::ThreeFinger => samples.push(&gripper::space::sample(|| random.unit())),
                Self::OneAxis => samples.push(&[STROKE * random.unit()]),
            };
        }
        samples
    }

    /// The places that belong to the open hand and to the fist.
    #[must_use]
    pub const fn start(self) -> [&'static [f32]; 2] {
        match self {
            Self::ThreeFinger => [
                &[0.0, 0.0, 0.0, NEUTRAL_SCISSOR],
                &[STROKE, STROKE, STROKE, NEUTRAL_SCISSOR],
            ],
            Self::OneAxis => [&[0.0], &[STROKE]],
        }
    }

    /// Counts as network units.
    #[must_use]
    pub fn units(self) -> Normalisation {
        Normalisation::gripper(self.axes())
    }

    /// Network units of a finished map as counts: a little beyond both ends, where the gripper stays at its end. A hand is never
    /// exactly as it was shown, and a fist that is not quite one must close the gripper all the same
    /// (docs/decisions/map-reaches-beyond-the-ends.md).
    #[must_use]
    pub fn reach(self) -> Normalisation {
        self.units().stretched(REACH)
    }

    /// The factors of the cost: the paper's for hands, and five times the weight of the pairs for one axis, whose two ends would else be
    /// some counts short.
    #[must_use]
    pub const fn lambda(self) -> Lambda {
        match self {
            Self::ThreeFinger => Lambda::HAND,
            Self::OneAxis => Lambda {
                pin: 5.0 * Lambda::HAND.pin,
                ..Lambda::HAND
            },
        }
    }

    /// For the volume occupancy, in counts.
    #[must_use]
    pub fn coverage(self) -> Coverage {
        let (share, dimension) = match self {
            Self::ThreeFinger => (gripper::space::VOLUME_FRACTION, 4),
            Self::OneAxis => (1.0, 1),
        };
        Coverage::Volume {
            volume: f64::from(share) * libm::pow(f64::from(STROKE), f64::from(dimension)),
            dimension,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Space; 2] = [Space::ThreeFinger, Space::OneAxis];

    #[test]
    fn samples_and_start_places_lie_in_their_space_and_follow_from_seed_and_draw() {
        for space in ALL {
            let samples = space.samples(500, 3, Draw::Train);
            assert_eq!((samples.rows, samples.cols), (500, space.axes()));
            assert!(samples.iter_rows().all(|row| space.contains(row)));
            assert!(space.start().iter().all(|counts| space.contains(counts)));
            assert_eq!(samples, space.samples(500, 3, Draw::Stream(0)));
            assert_ne!(samples, space.samples(500, 4, Draw::Train));
            assert_ne!(samples, space.samples(500, 3, Draw::Measure));
            assert_eq!(Space::of_axes(space.axes()), Some(space));
            assert!(!space.contains(&[1.0, 2.0]) && !space.contains(&[f32::NAN; 1]));
        }
        assert_eq!(Space::of_axes(2), None);
    }

    #[test]
    fn the_nearest_place_to_one_outside_lies_inside() {
        for (space, outside) in [
            (Space::ThreeFinger, &[200.0, 200.0, 0.0, 255.0][..]),
            (Space::OneAxis, &[300.0]),
        ] {
            assert!(!space.contains(outside));
            assert!(space.contains(&space.nearest(outside)));
        }
    }

    #[test]
    fn a_finished_map_goes_6_counts_beyond_both_ends_and_keeps_the_middle() {
        for space in ALL {
            for (counts, reached) in [(0.0, -6.375), (127.5, 127.5), (255.0, 261.375)] {
                let trained = space.units().apply(&vec![counts; space.axes()]);
                let found = space.reach().invert(&trained);
                assert!(
                    found.iter().all(|found| (found - reached).abs() < 1e-3),
                    "{counts}: {found:?}"
                );
            }
        }
    }

    #[test]
    fn the_paper_s_volume_in_network_units_is_that_in_counts() {
        let scale = f64::from(Space::ThreeFinger.units().scale[0]);
        let found = Space::ThreeFinger.coverage().epsilon(254).unwrap() / (scale * scale);
        let paper = Coverage::GRIPPER.epsilon(254).unwrap();
        assert!((found / paper - 1.0).abs() < 1e-5);
    }
}
