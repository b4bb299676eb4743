//! The paper's numbers (Tables 2 and 4), the p-values of §3.2.3, and the ranges in which a right implementation lies on this crate's
//! data. What the paper's text has lost is `None`, never a guess.

use super::{Row, Source};
use crate::shapes::ShapePair;

/// d̄, VO, d-Knn, NMSE: the order of the tables' columns.
pub const MEASURES: [&str; 4] = ["d̄", "VO", "d-Knn", "NMSE"];

/// [`MEASURES`] as drawings say them.
pub const MEASURES_IN_WORDS: [&str; 4] = [
    "mean distortion d̄",
    "volume occupancy VO",
    "neighbour dissimilarity d-Knn",
    "error NMSE",
];

/// Mean and standard deviation over ten repetitions; the deviation may be lost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Printed {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub deviation: Option<f64>,
}

/// What the paper prints for a row and a measure (0 to 3) of Table 2 or 4.
#[must_use]
pub fn printed(source: Source, row: Row, measure: usize) -> Option<Printed> {
    let line = Row::TABLE.iter().position(|&r| r == row)?;
    let table = match source {
        Source::Shape(ShapePair::Sp1) => &SP1,
        Source::Shape(ShapePair::Sp2) => &SP2,
        Source::Shape(ShapePair::Sp3) => &SP3,
        Source::Shape(ShapePair::Sp4) => &SP4,
        Source::Generated | Source::Recorded => &HAND,
    };
    let (mean, deviation) = *table[line].get(measure)?;
    mean.is_finite().then_some(Printed {
        mean,
        deviation: deviation.is_finite().then_some(deviation),
    })
}

/// Not to be read in the paper's text.
const LOST: f64 = f64::NAN;
type Table = [[(f64, f64); 4]; 7];

const SP1: Table = [
    [
        (1.715, 0.359),
        (0.561, 0.118),
        (90.413, 72.694),
        (0.271, 0.168),
    ],
    [
        (0.914, 0.286),
        (0.464, 0.093),
        (11.646, 0.961),
        (0.319, 0.099),
    ],
    [
        (2.896, 0.212),
        (0.974, 0.009),
        (13.595, 4.870),
        (0.084, 0.029),
    ],
    [
        (1.937, 0.098),
        (0.971, 0.006),
        (10.506, 4.130),
        (0.096, 0.043),
    ],
    [
        (1.786, 0.140),
        (0.969, 0.003),
        (5.177, 1.068),
        (0.108, 0.052),
    ],
    [
        (1.839, 0.081),
        (0.971, 0.007),
        (4.144, 0.372),
        (0.109, 0.040),
    ],
    [
        (2.085, 0.034),
        (0.982, 0.004),
        (4.503, 0.166),
        (0.027, 0.002),
    ],
];

const SP2: Table = [
    [
        (1.154, 0.267),
        (0.548, 0.134),
        (168.100, 118.162),
        (0.572, 0.330),
    ],
    [
        (0.565, 0.136),
        (0.472, 0.090),
        (13.845, 5.984),
        (0.594, 0.338),
    ],
    [
        (1.860, 0.207),
        (0.965, 0.021),
        (71.037, 33.390),
        (0.387, 0.459),
    ],
    [
        (1.186, 0.140),
        (0.958, 0.019),
        (46.145, 27.227),
        (0.445, 0.415),
    ],
    [
        (1.132, 0.144),
        (0.950, 0.030),
        (13.121, 7.267),
        (0.516, 0.484),
    ],
    [
        (1.394, 0.225),
        (0.948, 0.039),
        (9.827, 3.012),
        (0.298, 0.206),
    ],
    [
        (1.533, 0.128),
        (0.966, 0.016),
        (8.018, 1.226),
        (0.082, 0.057),
    ],
];

const SP3: Table = [
    [
        (1.015, 0.208),
        (0.388, 0.134),
        (547.117, 286.404),
        (0.529, 0.235),
    ],
    [
        (0.583, 0.106),
        (0.390, 0.059),
        (14.526, 3.753),
        (0.525, 0.397),
    ],
    [
        (2.263, 0.199),
        (0.954, 0.022),
        (62.308, 42.230),
        (0.361, 0.403),
    ],
    [
        (1.598, 0.116),
        (0.923, 0.045),
        (110.493, 107.044),
        (0.566, 0.727),
    ],
    [
        (1.533, 0.141),
        (0.924, 0.051),
        (11.260, 6.792),
        (0.341, 0.449),
    ],
    [
        (1.820, 0.339),
        (0.920, 0.045),
        (13.567, 12.567),
        (0.295, 0.182),
    ],
    [
        (1.671, 0.032),
        (0.968, 0.005),
        (5.584, 0.229),
        (0.133, 0.010),
    ],
];

/// The text of the last three rows is damaged; deviations that stand there without a row are left out.
const SP4: Table = [
    [
        (2.439, 0.973),
        (0.108, 0.060),
        (2.981, 4.154),
        (0.764, 0.399),
    ],
    [
        (1.026, 0.438),
        (0.052, 0.025),
        (6.318, 1.764),
        (0.604, 0.308),
    ],
    [
        (5.533, 0.486),
        (0.873, 0.020),
        (5.113, 4.706),
        (0.274, 0.158),
    ],
    [
        (4.789, 0.613),
        (0.858, 0.021),
        (10.037, LOST),
        (0.325, 0.134),
    ],
    [(4.565, 0.167), (0.868, 0.015), (LOST, LOST), (0.275, 0.093)],
    [(4.813, LOST), (0.874, LOST), (LOST, LOST), (0.218, LOST)],
    [(LOST, LOST), (LOST, LOST), (LOST, LOST), (LOST, LOST)],
];

const HAND: Table = [
    [
        (3.606, 0.174),
        (0.468, 0.024),
        (11.994, 1.323),
        (LOST, LOST),
    ],
    [
        (0.971, 0.030),
        (0.417, 0.008),
        (18.395, 0.437),
        (LOST, LOST),
    ],
    [
        (13.412, 0.744),
        (0.936, 0.011),
        (19.517, 3.382),
        (LOST, LOST),
    ],
    [
        (6.116, 0.340),
        (0.936, 0.008),
        (15.638, 1.667),
        (LOST, LOST),
    ],
    [
        (5.672, 0.187),
        (0.934, 0.005),
        (10.814, 1.012),
        (LOST, LOST),
    ],
    [(5.980, 0.139), (0.931, 0.010), (9.948, 0.817), (LOST, LOST)],
    [
        (5.950, 0.402),
        (0.936, 0.006),
        (11.031, 0.936),
        (LOST, LOST),
    ],
];

/// The paper's p-values for SP1 to SP4: d̄ of HAE (α=0) against ‖J‖² + Pin + BA, and against Pin + BA.
pub const P_VALUES: [[f64; 2]; 4] = [
    [8.2e-4, 4.6e-7],
    [0.21, 3.2e-5],
    [0.19, 1.3e-5],
    [0.24, 1.5e-4],
];

/// The range for the median of five seeds or more on this crate's data, full schedule; `None` where none is known.
#[must_use]
pub fn range(source: Source, row: Row, measure: usize) -> Option<(f64, f64)> {
    const ANY: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
    let up_to = |high: f64| (f64::NEG_INFINITY, high);
    let from = |low: f64| (low, f64::INFINITY);
    let ranges = match (source, row) {
        (Source::Shape(ShapePair::Sp1), Row::Pin) => [(0.8, 1.7), (0.25, 0.75), ANY, ANY],
        (Source::Shape(ShapePair::Sp1), Row::CaePin) => [(0.6, 1.0), (0.2, 0.55), (6.0, 14.0), ANY],
        (Source::Shape(ShapePair::Sp1), Row::PinBa) => {
            [(2.2, 2.6), from(0.965), (3.0, 6.0), up_to(0.06)]
        }
        (Source::Shape(ShapePair::Sp1), Row::DistortionPinBa) => {
            [(1.8, 2.15), from(0.945), (4.0, 18.0), up_to(0.2)]
        }
        (Source::Shape(ShapePair::Sp1), Row::HaeZero) => [ANY, from(0.92), ANY, ANY],
        (Source::Shape(ShapePair::Sp1), Row::HaeOne) => {
            [(1.9, 2.2), from(0.955), (2.2, 2.9), up_to(0.06)]
        }
        (Source::Shape(ShapePair::Sp1), Row::HaeAdaptive) => {
            [(1.95, 2.35), from(0.955), (2.2, 2.9), up_to(0.08)]
        }
        (Source::Shape(ShapePair::Sp2), Row::HaeAdaptive) => {
            [(1.5, 2.6), from(0.90), (8.0, 12.0), up_to(0.6)]
        }
        (Source::Shape(ShapePair::Sp3), Row::HaeAdaptive) => {
            [(1.75, 2.1), from(0.91), (5.5, 6.7), up_to(0.3)]
        }
        (Source::Shape(ShapePair::Sp4), Row::HaeAdaptive) => {
            [(4.4, 5.1), from(0.95), (0.9, 1.15), up_to(0.10)]
        }
        (Source::Generated, Row::HaeAdaptive) => [ANY, from(0.92), (8.0, 14.0), ANY],
        (Source::Generated, Row::Pin | Row::CaePin) => [ANY, up_to(0.70), ANY, ANY],
        (Source::Generated, row) if !matches!(row, Row::HaeFixed | Row::HaeStarts) => {
            [ANY, from(0.90), ANY, ANY]
        }
        _ => return None,
    };
    ranges.get(measure).copied().filter(|&range| range != ANY)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lost_numbers_are_not_there_and_the_others_are() {
        let sp4 = Source::Shape(ShapePair::Sp4);
        assert_eq!(printed(sp4, Row::HaeAdaptive, 0), None);
        assert_eq!(printed(sp4, Row::HaeOne, 1).unwrap().deviation, None);
        let first = printed(Source::Shape(ShapePair::Sp1), Row::HaeAdaptive, 3).unwrap();
        assert_eq!((first.mean, first.deviation), (0.027, Some(0.002)));
        assert_eq!(printed(Source::Generated, Row::Pin, 3), None);
        assert_eq!(printed(Source::Generated, Row::HaeFixed, 0), None);
        assert_eq!(printed(Source::Generated, Row::Pin, 9), None);
    }

    #[test]
    fn ranges_hold_a_low_and_a_high_end_in_order() {
        for source in [
            Source::Shape(ShapePair::Sp1),
            Source::Shape(ShapePair::Sp4),
            Source::Generated,
        ] {
            for row in Row::TABLE {
                for measure in 0..4 {
                    if let Some((low, high)) = range(source, row, measure) {
                        assert!(low < high);
                    }
                }
            }
        }
        assert_eq!(range(Source::Recorded, Row::Pin, 0), None);
    }
}
