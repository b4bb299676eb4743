//! What each sensor says of itself, and how still it is while the glove lies.

use glove::bus::{Batch, Bus, Transaction};
use glove::hand::{Quaternion, SEGMENT_COUNT, SEGMENT_NAMES};
use glove::imu::{self, Mode, UniqueId, register};
use glove::scan::Frame;

use super::exchange::exchange;
use crate::clock::{Clock, since};
use crate::diagnose::Findings;
use crate::interrupt::Interrupt;

/// CALIB_STAT, ST_RESULT, …, SYS_STATUS, SYS_ERR, UNIT_SEL, a reserved one, OPR_MODE.
const FIRST: u8 = 0x35;
const COUNT: usize = 9;
/// Every part passed its test at power-on.
const PASSED: u8 = 0x0F;
/// The parts of the self-test by their bits.
const PARTS: [&str; 4] = [
    "accelerometer",
    "magnetometer",
    "gyroscope",
    "microcontroller",
];
/// Times a sensor is asked.
const TRIES: usize = 3;
/// Farther from where it began a sensor did not lie still, degrees.
const MOVED: f32 = 2.0;
/// Fewer samples say nothing.
const LEAST: usize = 8;
/// A heading that drifts faster is worth a word, degrees a minute.
const DRIFTS: f32 = 10.0;

/// The sensors while the glove lies.
#[derive(Debug, Default)]
pub(super) struct Lying {
    scans: Vec<(glove::Instant, [Option<Quaternion>; SEGMENT_COUNT])>,
}

/// How one sensor lay.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Rest {
    /// From sample to sample, over √2: root of the mean square, degrees.
    noise: f32,
    /// Of the heading, degrees a minute.
    drift: f32,
}

impl Lying {
    /// Takes a frame that was complete at `at`.
    pub fn take(&mut self, frame: &Frame, at: glove::Instant) {
        let known = frame
            .samples
            .map(|sample| sample.health.is_good().then_some(sample.orientation));
        self.scans.push((at, known));
    }

    /// `None`: too few samples, or it moved.
    fn rest(&self, k: usize) -> Option<Rest> {
        let of = |(at, known): &(glove::Instant, [Option<Quaternion>; SEGMENT_COUNT])| {
            Some((*at, known[k]?))
        };
        let samples: Vec<(glove::Instant, Quaternion)> = self.scans.iter().filter_map(of).collect();
        let (begin, first) = samples.first().copied()?;
        let far = |q: &Quaternion| imu::angle_between(&first, q).to_degrees();
        if samples.len() < LEAST || samples.iter().any(|(_, q)| far(q) > MOVED) {
            return None;
        }
        let squares = samples.windows(2).map(|pair| {
            let by = imu::angle_between(&pair[0].1, &pair[1].1).to_degrees();
            by * by
        });
        let noise = (squares.sum::<f32>() / (2 * (samples.len() - 1)) as f32).sqrt();
        // The heading of each sample against the first, and the line through them by least squares.
        let turned = samples.iter().map(|(at, q)| {
            let by = (q * first.inverse()).scaled_axis();
            let minutes = since(*at, begin).as_micros() as f64 / 60e6;
            (minutes, f64::from(by.z.to_degrees()))
        });
        let turned: Vec<(f64, f64)> = turned.collect();
        let count = turned.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| turned.iter().map(of).sum::<f64>() / count;
        let (middle, level) = (mean(|t| t.0), mean(|t| t.1));
        let spread: f64 = turned.iter().map(|t| (t.0 - middle).powi(2)).sum();
        let slope: f64 = turned
            .iter()
            .map(|t| (t.0 - middle) * (t.1 - level))
            .sum::<f64>();
        (spread > 0.0).then(|| Rest {
            noise,
            drift: (slope / spread) as f32,
        })
    }
}

/// Asks each sensor what it says of itself, and tells it with how it lay. `clock`: by which the bus was driven.
pub(super) fn tell(
    bus: &mut impl Bus,
    mux: u8,
    ids: &[Option<UniqueId>; SEGMENT_COUNT],
    lying: &Lying,
    findings: &mut Findings,
    (clock, interrupt): (Clock, &Interrupt),
) {
    let rests: [Option<Rest>; SEGMENT_COUNT] = std::array::from_fn(|k| lying.rest(k));
    for (k, (id, rest)) in ids.iter().zip(rests).enumerate() {
        if interrupt.asked() {
            return findings.note("sensors", "interrupted", "again");
        }
        match registers(bus, mux, k, clock, interrupt) {
            Some(read) => one(k, id.as_ref(), &read, rest, findings),
            None => findings.note(
                "sensors",
                format!(
                    "{} gives orientations, but does not say how it is",
                    SEGMENT_NAMES[k]
                ),
                "again; its plug and cable",
            ),
        }
    }
    if rests.iter().any(Option::is_none) {
        findings.note(
            "sensors",
            "the glove did not lie still: noise and drift of those that moved are not told",
            "the same again, the glove lying on a table",
        );
    }
}

/// Nine registers of sensor `k`.
fn registers(
    bus: &mut impl Bus,
    mux: u8,
    k: usize,
    clock: Clock,
    interrupt: &Interrupt,
) -> Option<[u8; COUNT]> {
    let select = Transaction::write(mux, &[1 << imu::channel(k)]).ok()?;
    let read = Transaction::write_read(imu::address(k), &[FIRST], COUNT).ok()?;
    let batch = Batch::from_slice(&[select, read]).ok()?;
    (0..TRIES).find_map(|_| {
        let read = exchange(bus, &batch, clock, interrupt).ok()?;
        read.as_slice().try_into().ok()
    })
}

fn one(
    k: usize,
    id: Option<&UniqueId>,
    read: &[u8; COUNT],
    rest: Option<Rest>,
    findings: &mut Findings,
) {
    let [calibration, test, .., status, error, _, _, mode] = *read;
    let name = format!(
        "{} (channel {}, address {:#04X})",
        SEGMENT_NAMES[k],
        imu::channel(k),
        imu::address(k)
    );
    let id = id.map_or_else(
        || "no id".to_owned(),
        |id| {
            let digits: Vec<String> = id.iter().map(|byte| format!("{byte:02x}")).collect();
            format!("id {}", digits.concat())
        },
    );
    let part = |shift: u8| calibration >> shift & 0b11;
    let still = rest.map_or_else(String::new, |rest| {
        format!(", noise {:.2}°, drift {:.1} °/min", rest.noise, rest.drift)
    });
    let says = format!(
        "{name}: {id}, {}, calibrated gyroscope {} accelerometer {} magnetometer {} of 3, self-test {}{still}",
        mode_words(mode),
        part(4),
        part(2),
        part(0),
        if test & PASSED == PASSED {
            "passed"
        } else {
            "failed"
        },
    );
    if test & PASSED != PASSED {
        let failed: Vec<&str> = (0..PARTS.len())
            .filter(|bit| test >> bit & 1 == 0)
            .map(|bit| PARTS[bit])
            .collect();
        let what = format!("{says}: {}", failed.join(", "));
        return findings.wrong(
            "sensors",
            what,
            "switching the glove off and on; if it stays, another sensor in its place",
        );
    }
    if error != 0 {
        let what = format!("{says}; it reports error {error:02X} (SYS_STATUS {status:02X})");
        return findings.wrong("sensors", what, "switching the glove off and on");
    }
    match rest {
        Some(rest) if rest.drift.abs() > DRIFTS => findings.note(
            "sensors",
            says,
            "letting the glove lie still for ten seconds, which calibrates its gyroscope; then again",
        ),
        _ => findings.good("sensors", says),
    }
}

/// OPR_MODE in words.
fn mode_words(mode: u8) -> String {
    match mode & 0x0F {
        mode if mode == Mode::Imu.code() => "IMU mode".to_owned(),
        mode if mode == Mode::Ndof.code() => "NDOF mode".to_owned(),
        mode => format!("mode {mode:02X} (register {:#04X})", register::OPR_MODE),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::Verdict;
    use glove::scan::{Health, Sample};

    /// Four seconds of a sensor whose heading drifts, 35 scans a second.
    fn lying(degrees_a_minute: f32, shake: f32) -> Lying {
        let mut lying = Lying::default();
        for scan in 0..140u32 {
            let at = glove::Instant::from_ticks(u64::from(scan) * 28_571);
            let minutes = scan as f32 * 28_571e-6 / 60.0;
            let tremble = if scan % 2 == 0 { shake } else { -shake };
            let turn = (degrees_a_minute * minutes).to_radians();
            let orientation = Quaternion::from_euler_angles(tremble.to_radians(), 0.0, turn);
            let samples = [Sample {
                orientation,
                stamp: at,
                health: Health::Good,
            }; SEGMENT_COUNT];
            let frame = Frame {
                samples,
                sequence: scan,
            };
            lying.take(&frame, at);
        }
        lying
    }

    #[test]
    fn drift_and_noise_of_a_lying_sensor_are_told_apart_and_of_one_that_moves_neither_is() {
        for drift in [0.0, 3.0, -12.0] {
            let rest = lying(drift, 0.05).rest(4).unwrap();
            assert!((rest.drift - drift).abs() < 0.2, "{rest:?}");
            // ±0.05° from sample to sample is 0.1°, over √2.
            assert!((rest.noise - 0.0707).abs() < 0.005, "{rest:?}");
        }
        assert_eq!(lying(0.0, 1.5).rest(4), None);
        assert_eq!(Lying::default().rest(4), None);
    }

    #[test]
    fn a_failed_self_test_and_an_error_are_wrong_and_named_and_a_healthy_sensor_is_good() {
        let told = |read: [u8; COUNT], drift: f32| {
            let mut findings = Findings::default();
            let rest = Rest { noise: 0.01, drift };
            one(5, Some(&[0xAB; 16]), &read, Some(rest), &mut findings);
            findings.0.remove(0)
        };
        let healthy = [0x3C, 0x0F, 0, 0, 5, 0, 0, 0, 0x08];
        let good = told(healthy, 0.4);
        assert_eq!(good.verdict, Verdict::Good);
        for part in [
            "index_middle (channel 2, address 0x29)",
            "id abababab",
            "IMU mode",
            "gyroscope 3 accelerometer 3 magnetometer 0",
            "self-test passed",
            "noise 0.01°",
            "drift 0.4 °/min",
        ] {
            assert!(good.what.contains(part), "{part}: {}", good.what);
        }
        assert_eq!(told(healthy, -14.0).verdict, Verdict::Note);
        let mut failed = healthy;
        failed[1] = 0x0B;
        let failed = told(failed, 0.4);
        assert_eq!(failed.verdict, Verdict::Wrong);
        assert!(
            failed
                .what
                .ends_with("failed, noise 0.01°, drift 0.4 °/min: gyroscope"),
            "{}",
            failed.what
        );
        let mut error = healthy;
        error[5] = 3;
        assert!(told(error, 0.4).what.contains("error 03"));
    }
}
