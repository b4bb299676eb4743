//! The hand of a glove that is read by itself, and its sensors, for the page.

use host::glove::hand::{JOINT_COUNT, SEGMENT_COUNT, SEGMENT_NAMES, Side};
use host::glove::scan::Health;

use super::bodies;
use super::picture::{Hand, Rates, Sensor};
use host::scanning::Snapshot;

/// What is known of a sensor.
#[derive(Debug, Clone, Copy, Default)]
pub struct Known {
    /// How it is; `None` where nobody tells.
    pub health: Option<Health>,
    /// Why its samples are not used, if they are not.
    pub unused: Option<&'static str>,
    /// How sure the heading between it and its parent is, standard deviation, radians.
    pub sigma: Option<f32>,
}

/// A hand with these angles, radians, whose sensors are so.
pub fn drawn_hand(
    angles: &[f32; JOINT_COUNT],
    side: Side,
    calibrated: bool,
    sensor: impl Fn(usize) -> Known,
) -> Hand {
    let (links, places) = bodies::hand(angles, side);
    let sensors = (0..SEGMENT_COUNT).map(|segment| {
        let known = sensor(segment);
        let (health, words) = told(&known);
        Sensor {
            name: SEGMENT_NAMES[segment],
            health,
            words,
            at: places.get(segment).copied(),
            // The hand's own has no parent.
            sigma_deg: known
                .sigma
                .filter(|sigma| segment > 0 && sigma.is_finite())
                .map(f32::to_degrees),
        }
    });
    Hand {
        links,
        angles_deg: angles.iter().map(|angle| angle.to_degrees()).collect(),
        calibrated,
        age_s: None,
        sensors: sensors.collect(),
        left: side == Side::Left,
    }
}

fn told(known: &Known) -> (&'static str, String) {
    match (known.unused, known.health) {
        (Some(why), _) => ("doubtful", why.to_owned()),
        (None, Some(Health::Good)) => ("good", "good".to_owned()),
        (None, Some(Health::Starting)) => ("doubtful", Health::Starting.to_string()),
        (None, Some(health)) => ("lost", health.to_string()),
        (None, None) => ("unknown", "not told".to_owned()),
    }
}

/// The hand of a glove that is read here. `sigma`: of the headings, where they are estimated.
pub fn scanned_hand(
    angles: &[f32; JOINT_COUNT],
    side: Side,
    calibrated: bool,
    seen: Option<&Snapshot>,
    sigma: Option<[f32; SEGMENT_COUNT]>,
) -> Hand {
    let health = seen.map(Snapshot::health);
    drawn_hand(angles, side, calibrated, |segment| Known {
        health: health.map(|health| health[segment]),
        unused: None,
        sigma: sigma.map(|sigma| sigma[segment]),
    })
}

/// How it is read.
pub fn scan_rates(seen: &Snapshot) -> Rates {
    Rates {
        frames_per_s: seen.rate,
        cycles_per_s: None,
        latency_p50_us: None,
        latency_p99_us: None,
        dropped: seen.not_taken,
    }
}
