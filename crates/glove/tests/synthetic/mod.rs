//! A person with a glove, as the wire's bytes: a guided calibration, then a minute of use. A small model of its own, apart from what it
//! tests: hands, seats, restarts and errors as a test wants them, all from a seed.

use std::f64::consts::{PI, TAU};

use glove::Instant;
use glove::calibration::{Finger, Step};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// When the use begins, and how long it is, seconds.
pub const USE_FROM: f64 = 58.0;
pub const USE_FOR: f64 = 60.0;
/// Flat poses in the use: when they begin; each lasts 2 s.
pub const FLAT_IN_USE: [f64; 2] = [86.0, 114.0];
/// How far a sensor's read is behind the one before, in parts of a scan.
const SKEW: f64 = 1.8e-3 * 35.0;

type Q = [f64; 4];
type V = [f64; 3];

/// A sensor that loses its power for a moment.
#[derive(Debug, Clone, Copy)]
pub struct Restart {
    pub sensor: usize,
    pub at: f64,
    pub away: f64,
}

/// Who wears which glove, and how well.
#[derive(Debug, Clone)]
pub struct Person {
    pub seed: u64,
    /// Scans a second.
    pub rate: f64,
    pub is_left: bool,
    /// The sensor on each segment.
    pub seats: [usize; 16],
    pub restarts: Vec<Restart>,
    /// Fingers off straight in flat poses: standard deviation, degrees.
    pub unstraight: f64,
    /// Axes off x: degrees.
    pub oblique: f64,
    /// How late the person does what is asked, seconds.
    pub late: f64,
    /// How far the turn goes, 1 as asked.
    pub turns: f64,
    /// This segment's sensor slips by the angle (degrees) about its segment's axis before the last flat pose.
    pub slip: Option<(usize, f64, V)>,
    /// The hand's attitude in use: palm down, or turned by this about the forearm, degrees.
    pub roll: f64,
}

impl Person {
    pub fn exact(seed: u64) -> Self {
        Self {
            seed,
            rate: 35.0,
            is_left: false,
            seats: std::array::from_fn(|k| k),
            restarts: Vec::new(),
            unstraight: 0.0,
            oblique: 2.5,
            late: 0.0,
            turns: 1.0,
            slip: None,
            roll: 0.0,
        }
    }
}

/// One scan.
#[derive(Debug, Clone)]
pub struct Scan {
    pub at: f64,
    pub step: Option<Step>,
    pub reads: [(Option<[u8; 8]>, Instant); 16],
    /// The true angles at its beginning, degrees.
    pub truth: [f64; 25],
}

/// What the person is asked to do.
pub fn steps() -> Vec<(Step, f64, f64)> {
    let mut steps = vec![
        (Step::FirstFlat, 1.0, 3.0),
        (Step::Turn, 4.4, 16.5),
        (Step::SecondFlat, 18.6, 20.6),
    ];
    let fingers = [
        Finger::Index,
        Finger::Middle,
        Finger::Ring,
        Finger::Little,
        Finger::Thumb,
    ];
    for (i, finger) in fingers.into_iter().enumerate() {
        let from = 21.6 + 2.0 * i as f64;
        steps.push((Step::Alone(finger), from, from + 1.99));
    }
    steps.extend([
        (Step::Fists, 31.6, 39.5),
        (Step::Thumb, 39.6, 43.5),
        (Step::Free, 43.6, 53.5),
        (Step::LastFlat, 55.4, 57.4),
    ]);
    steps
}

/// The whole session.
pub fn session(person: &Person) -> Vec<Scan> {
    let mut model = Model::new(person);
    let scans = ((USE_FROM + USE_FOR) * person.rate) as usize;
    (0..scans)
        .map(|i| model.scan(0.05 + i as f64 / person.rate))
        .collect()
}

struct Model<'a> {
    person: &'a Person,
    rng: ChaCha8Rng,
    mounting: [Q; 16],
    axes: [V; 16],
    thumb_base: Q,
    heading: [f64; 16],
    rate: [f64; 16],
    /// Off straight, per flat pose.
    unstraight: [[f64; 25]; 6],
    /// Where each joint goes next in free motion: a grid of targets.
    targets: Vec<[f64; 25]>,
    restarted: Vec<bool>,
    phases: [f64; 3],
}

const FLEX: [f64; 5] = [1.0, 0.0, 0.0, 1.0, 1.0];

impl<'a> Model<'a> {
    fn new(person: &'a Person) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(person.seed);
        let side = if person.is_left { -1.0 } else { 1.0 };
        let mounting = std::array::from_fn(|_| random_rotation(&mut rng));
        let mut axes = [[1.0, 0.0, 0.0]; 16];
        for (k, axis) in axes.iter_mut().enumerate() {
            if k > 1 && (k - 1) % 3 != 0 && k != 2 {
                let off = person.oblique.to_radians();
                *axis = unit([1.0, off * normal(&mut rng), off * normal(&mut rng)]);
            }
        }
        let unstraight =
            std::array::from_fn(|_| std::array::from_fn(|_| person.unstraight * normal(&mut rng)));
        let targets = (0..400).map(|_| target(&mut rng)).collect();
        Self {
            person,
            mounting,
            axes,
            thumb_base: about([0.05, 0.0, -side], (50.0f64).to_radians()),
            heading: std::array::from_fn(|_| rng.random_range(-PI..PI)),
            rate: std::array::from_fn(|_| rng.random_range(-1.0f64..1.0).to_radians() / 60.0),
            unstraight,
            targets,
            restarted: vec![false; person.restarts.len()],
            phases: std::array::from_fn(|_| rng.random_range(0.0..TAU)),
            rng,
        }
    }

    fn scan(&mut self, at: f64) -> Scan {
        let mut reads = [(None, Instant::from_ticks(0)); 16];
        for (segment, &sensor) in self.person.seats.clone().iter().enumerate() {
            let t = at + SKEW / self.person.rate * sensor as f64;
            let stamp = Instant::from_ticks((t * 1e6).round() as u64);
            reads[sensor] = (Some(self.read(segment, sensor, t)), stamp);
        }
        let step = steps()
            .into_iter()
            .find(|&(_, from, to)| (from..=to).contains(&at))
            .map(|(step, _, _)| step);
        Scan {
            at,
            step,
            reads,
            truth: self.angles(at),
        }
    }

    fn read(&mut self, segment: usize, sensor: usize, t: f64) -> [u8; 8] {
        let person = self.person;
        for (restart, done) in person.restarts.iter().zip(&mut self.restarted) {
            if restart.sensor == sensor && t >= restart.at {
                if t < restart.at + restart.away {
                    return [0; 8];
                }
                if !std::mem::replace(done, true) {
                    self.heading[sensor] = self.rng.random_range(-PI..PI);
                }
            }
        }
        let mut mounting = self.mounting[segment];
        if let Some((slipped, by, axis)) = person.slip
            && slipped == segment
            && t > 54.0
        {
            mounting = product(about(axis, by.to_radians()), mounting);
        }
        let up = about(
            [0.0, 0.0, 1.0],
            self.heading[sensor] + self.rate[sensor] * t,
        );
        let q = product(product(up, self.segments(t)[segment]), mounting);
        let shake: V = std::array::from_fn(|_| 0.2f64.to_radians() * normal(&mut self.rng));
        let shaken = product(q, about(shake, norm(shake)));
        let sign = if self.rng.random_bool(0.5) { 1.0 } else { -1.0 };
        let mut bytes = [0; 8];
        for (pair, c) in bytes.chunks_mut(2).zip(shaken) {
            pair.copy_from_slice(&((sign * c * 16_384.0).round() as i16).to_le_bytes());
        }
        if self.rng.random_bool(0.005) {
            let component = self.rng.random_range(0..4usize);
            // Exactly ±1 cannot be told.
            if i16::from_le_bytes([bytes[2 * component], bytes[2 * component + 1]]).unsigned_abs()
                < 16_384
            {
                bytes[2 * component + 1] ^= 0x80;
            }
        }
        bytes
    }

    fn segments(&self, t: f64) -> [Q; 16] {
        let a = self.angles(t).map(f64::to_radians);
        let side = if self.person.is_left { -1.0 } else { 1.0 };
        let hand = self.attitude(t);
        let mut segments = [hand; 16];
        for finger in 0..5 {
            let (j, s) = (5 * finger, 1 + 3 * finger);
            let base = if finger == 0 {
                product(hand, self.thumb_base)
            } else {
                hand
            };
            let bend = product(
                about([1.0, 0.0, 0.0], a[j]),
                product(
                    about([0.0, 1.0, 0.0], side * a[j + 1]),
                    about([0.0, 0.0, 1.0], side * a[j + 2]),
                ),
            );
            segments[s] = product(base, bend);
            segments[s + 1] = product(segments[s], about(self.axes[s + 1], a[j + 3]));
            segments[s + 2] = product(segments[s + 1], about(self.axes[s + 2], a[j + 4]));
        }
        segments
    }

    /// The hand in the world: a board on the table where it is asked to be.
    fn attitude(&self, t: f64) -> Q {
        let thumb_up = if self.person.is_left { -90.0 } else { 90.0 };
        let level = about([1.0, 0.0, 0.0], PI / 2.0);
        let turn = self.person.turns;
        // When, roll about the forearm, pitch.
        let way = [
            (4.2, 0.0, 0.0),
            (6.0, thumb_up, 0.0),
            (7.8, 2.0 * thumb_up, 0.0),
            (9.6, 0.0, 0.0),
            (11.4, 0.0, -80.0),
            (13.4, 0.0, 80.0),
            (15.2, thumb_up, 0.0),
            (17.0, 0.0, 0.0),
        ];
        let (mut roll, mut pitch) = (0.0, 0.0);
        for pair in way.windows(2) {
            let ((from, r0, p0), (to, r1, p1)) = (pair[0], pair[1]);
            if (from..to).contains(&t) {
                let s = smooth((t - from) / (to - from));
                roll = turn * (r0 + s * (r1 - r0));
                pitch = turn * (p0 + s * (p1 - p0));
            }
        }
        let moves = self.moving(t);
        let sway = |i: usize, period: f64| (t * TAU / period + self.phases[i]).sin();
        roll += moves * (self.person.roll + 25.0 * sway(0, 6.1));
        pitch += moves * 25.0 * sway(1, 7.3);
        let about_z = about([0.0, 0.0, 1.0], moves * 0.8 * sway(2, 9.7));
        let roll = about([0.0, 0.0, 1.0], roll.to_radians());
        let pitch = about([1.0, 0.0, 0.0], pitch.to_radians());
        product(about_z, product(level, product(pitch, roll)))
    }

    /// How far the hand is from lying flat: 0 in flat poses and while it turns like a board, 1 in free use.
    fn moving(&self, t: f64) -> f64 {
        let t = t - self.person.late;
        let rest = |from: f64, to: f64| smooth((from - t) / 0.8) + smooth((t - to) / 0.8);
        let mut moving = smooth((t - USE_FROM) / 1.0);
        for flat in FLAT_IN_USE {
            moving *= rest(flat - 0.2, flat + 2.2).min(1.0);
        }
        if (31.6..=54.5).contains(&t) {
            let within = smooth((t - 31.8) / 0.5) * smooth((54.2 - t) / 0.5);
            moving = moving.max(0.6 * within);
        }
        moving
    }

    /// The true joint angles at `t`, degrees.
    fn angles(&self, t: f64) -> [f64; 25] {
        let mut angles = self.off_straight(t);
        let late = t - self.person.late;
        let wave = |t: f64, period: f64| 0.5 - 0.5 * (t * TAU / period).cos();
        for (step, from, to) in steps() {
            let t = late - from;
            if !(0.0..to - from).contains(&t) {
                continue;
            }
            match step {
                Step::Alone(finger) => {
                    let bend = wave(t, (to - from) / 2.0);
                    let amount = if finger == Finger::Thumb { 40.0 } else { 70.0 };
                    for (i, flex) in FLEX.into_iter().enumerate() {
                        let base = finger == Finger::Thumb && i == 0;
                        let amount = if base { 18.0 } else { amount };
                        angles[5 * finger.number() + i] += flex * amount * bend;
                    }
                }
                Step::Fists => {
                    let bend = wave(t, (to - from) / 4.0);
                    for j in 0..25 {
                        let amount = if j < 5 { 25.0 } else { 75.0 };
                        angles[j] += FLEX[j % 5] * amount * bend;
                    }
                }
                Step::Thumb => {
                    let s = (t * TAU / 2.0).sin();
                    for (j, amount) in [(0, 20.0), (1, 20.0), (3, 15.0), (4, 15.0)] {
                        angles[j] += amount * s;
                    }
                }
                _ => {}
            }
        }
        let free = self.moving(t) * if late > 43.6 { 1.0 } else { 0.0 };
        let at = late.max(0.0) / 0.4;
        let (i, s) = (at as usize, smooth(at.fract()));
        if let (Some(a), Some(b)) = (self.targets.get(i), self.targets.get(i + 1)) {
            for j in 0..25 {
                angles[j] += free * (a[j] + s * (b[j] - a[j]));
            }
        }
        angles
    }

    /// How the fingers are off straight: another way in each flat pose, gently from one to the next.
    fn off_straight(&self, t: f64) -> [f64; 25] {
        let knots = [2.0, 10.0, 19.6, 56.4, 87.0, 115.0];
        let i = knots.partition_point(|&knot| knot <= t).clamp(1, 5);
        let s = smooth((t - knots[i - 1]) / (knots[i] - knots[i - 1]) * 3.0 - 1.0);
        let (a, b) = (&self.unstraight[i - 1], &self.unstraight[i]);
        std::array::from_fn(|j| a[j] + s * (b[j] - a[j]))
    }
}

/// A posture within what a hand does, degrees.
fn target(rng: &mut ChaCha8Rng) -> [f64; 25] {
    std::array::from_fn(|j| {
        let (low, high) = match (j / 5, j % 5) {
            (0, 0) => (-10.0, 25.0),
            (0, 1) => (-15.0, 20.0),
            (0, 2) => (-8.0, 8.0),
            (0, _) => (0.0, 50.0),
            (_, 1) => (-8.0, 8.0),
            (_, 2) => (-5.0, 5.0),
            _ => (0.0, 80.0),
        };
        rng.random_range(low..high)
    })
}

fn smooth(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| rng.random_range(0.0..1.0f64)).sum::<f64>() - 6.0
}

fn random_rotation(rng: &mut ChaCha8Rng) -> Q {
    let q: Q = std::array::from_fn(|_| normal(rng));
    let n = q.iter().map(|c| c * c).sum::<f64>().sqrt();
    q.map(|c| c / n)
}

fn norm(v: V) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}

fn unit(v: V) -> V {
    let n = norm(v);
    if n > 0.0 {
        v.map(|c| c / n)
    } else {
        [1.0, 0.0, 0.0]
    }
}

fn about(axis: V, angle: f64) -> Q {
    let (s, c) = (0.5 * angle).sin_cos();
    let [x, y, z] = unit(axis);
    [c, s * x, s * y, s * z]
}

fn product(a: Q, b: Q) -> Q {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}
