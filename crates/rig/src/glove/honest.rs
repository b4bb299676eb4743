//! What 16 sensors really say: each sewn on its own way, with a heading of its own that drifts, tilted a little, noisy, on soft tissue,
//! on a hand whose joints turn about axes of their own.

use nalgebra::{Quaternion, Unit, UnitQuaternion, Vector3};

use ::glove::hand::Side;

use crate::chance::Chance;

type Rotation = UnitQuaternion<f64>;

/// How honest the glove is: angles in degrees, spreads as standard deviations unless it says "up to".
#[derive(Debug, Clone, PartialEq)]
pub struct Honest {
    /// Everything by chance follows from it: mountings and headings among others, which may be any, and the sensors' unique ids.
    pub seed: u64,
    /// A heading drifts by up to this a minute, each sensor at its own rate …
    pub drift: f64,
    /// … and walks by this in a minute (in four minutes twice as far).
    pub walk: f64,
    /// Error of the tilt, about either level axis.
    pub tilt: f64,
    /// How long an error of the tilt lasts, seconds.
    pub tilt_lasts: f64,
    /// Noise about each axis: the quietest sensor's and the loudest's.
    pub noise: [f64; 2],
    /// A sensor turns on its segment by this for each 90° that the segment is bent, about a direction of its own: the least and the most.
    pub soft_tissue: [f64; 2],
    /// Share of reads in which bit 15 of one component is flipped.
    pub flips: f64,
    /// The thumb's hinge axes are this far from the hand's x while the hand lies flat …
    pub thumb: f64,
    /// … give or take up to this.
    pub thumb_varies: f64,
    /// A hinge's axis is off x by this, about either other axis; the thumb's MCP is where its frames count from.
    pub oblique: f64,
    /// The sensor on each segment, as it is wired.
    pub seats: [usize; 16],
}

impl Default for Honest {
    fn default() -> Self {
        Self {
            seed: 1,
            drift: 1.0,
            walk: 0.3,
            tilt: 0.5,
            tilt_lasts: 30.0,
            noise: [0.1, 0.3],
            soft_tissue: [1.0, 2.0],
            flips: 0.005,
            thumb: 50.0,
            thumb_varies: 10.0,
            oblique: 2.5,
            seats: std::array::from_fn(|segment| segment),
        }
    }
}

/// A sensor that slipped on its segment.
struct Slip {
    sensor: usize,
    turned: Rotation,
}

/// The glove on a hand.
pub(super) struct Worn {
    honest: Honest,
    chance: Chance,
    side: Side,
    /// The segment each sensor sits on.
    segment_of: [usize; 16],
    mounting: [Rotation; 16],
    slips: Vec<Slip>,
    thumb_base: Rotation,
    /// By segment: the axis of a hinge to its parent.
    axes: [Unit<Vector3<f64>>; 16],
    /// By segment: the axis and size of what soft tissue does at 90°, radians.
    soft: [(Unit<Vector3<f64>>, f64); 16],
    walks: [Walk; 16],
    /// Without noise: what is true.
    pub quiet: bool,
}

/// A random walk with a step each second, remembered at its newest place.
#[derive(Clone, Copy)]
struct Walk {
    chance: Chance,
    second: i64,
    sum: f64,
}

impl Walk {
    /// Where it is at `t`, in standard deviations of one second's step.
    fn at(&mut self, t: f64) -> f64 {
        let second = t.max(0.0).floor() as i64;
        if second < self.second {
            (self.second, self.sum) = (0, 0.0);
        }
        while self.second < second {
            self.sum += self.chance.normal(self.second);
            self.second += 1;
        }
        self.sum + (t.max(0.0) - second as f64) * self.chance.normal(second)
    }
}

fn about(axis: &Unit<Vector3<f64>>, radians: f64) -> Rotation {
    Rotation::from_axis_angle(axis, radians)
}

fn direction(chance: Chance) -> Unit<Vector3<f64>> {
    let [x, y, z] = [0, 1, 2].map(|i| chance.normal(i));
    Unit::try_new(Vector3::new(x, y, z), 1e-6).unwrap_or_else(Vector3::x_axis)
}

fn any_rotation(chance: Chance) -> Rotation {
    let [w, x, y, z] = [0, 1, 2, 3].map(|i| chance.normal(i));
    UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-6).unwrap_or_else(Rotation::identity)
}

impl Worn {
    pub fn new(honest: Honest, side: Side) -> Self {
        let chance = Chance::new(honest.seed);
        let mut segment_of = std::array::from_fn(|sensor| sensor);
        for (segment, &sensor) in honest.seats.iter().enumerate() {
            if let Some(seat) = segment_of.get_mut(sensor) {
                *seat = segment;
            }
        }
        let axes = std::array::from_fn(|segment| {
            // At the thumb's MCP its frames begin: x is its axis.
            let off = if segment == 2 {
                0.0
            } else {
                honest.oblique.to_radians()
            };
            let [y, z] = [0, 1].map(|i| off * chance.of(100 + segment).normal(i));
            Unit::new_normalize(Vector3::new(1.0, y, z))
        });
        let soft = std::array::from_fn(|segment| {
            let own = chance.of(200 + segment);
            let [least, most] = honest.soft_tissue;
            let size = least + (most - least) * own.share(9);
            (direction(own), size.to_radians())
        });
        Self {
            side,
            segment_of,
            mounting: std::array::from_fn(|sensor| any_rotation(chance.of(300 + sensor))),
            slips: Vec::new(),
            thumb_base: thumb_base(&honest, chance.of(400), side),
            axes,
            soft,
            walks: std::array::from_fn(|sensor| Walk {
                chance: chance.of(500 + sensor),
                second: 0,
                sum: 0.0,
            }),
            quiet: false,
            chance,
            honest,
        }
    }

    /// From now on sensor `sensor` sits turned by `degrees` about `axis` of its segment.
    pub fn slip(&mut self, sensor: usize, axis: [f64; 3], degrees: f64) {
        let turned = Rotation::new(
            Vector3::from(axis).try_normalize(1e-9).unwrap_or_default() * degrees.to_radians(),
        );
        self.slips.push(Slip { sensor, turned });
    }

    /// Seed and share of flipped bits of sensor `sensor`.
    pub fn flips(&self, sensor: usize) -> (Chance, f64) {
        (self.chance.of(600 + sensor), self.honest.flips)
    }

    /// What the sensors' unique ids follow from: each glove has its own.
    pub fn ids(&self) -> Chance {
        self.chance.of(1_100)
    }

    /// How far into its 10 ms sensor `sensor` is, as a share.
    pub fn phase(&self, sensor: usize) -> f64 {
        self.chance.of(700 + sensor).share(0)
    }

    /// What `sensor` measures `t` seconds after the clock's start, in the fusion's `start`th run, on a hand with `angles` (radians)
    /// held as `attitude` in a world whose z is up: w, x, y, z.
    pub fn measures(
        &mut self,
        sensor: usize,
        start: u32,
        t: f64,
        angles: &[f32; 25],
        attitude: &Rotation,
    ) -> [f32; 4] {
        let segment = self.segment_of[sensor];
        let up = Vector3::z_axis();
        let heading = about(&up, self.heading(sensor, start, t));
        let mut q = heading * self.tilt(sensor, t) * self.segment(segment, angles, attitude);
        let (axis, size) = &self.soft[segment];
        q *= about(
            axis,
            size * bent(segment, angles) / std::f64::consts::FRAC_PI_2,
        );
        for slip in self.slips.iter().filter(|slip| slip.sensor == sensor) {
            q *= slip.turned;
        }
        q *= self.mounting[sensor];
        if !self.quiet {
            q *= self.noise(sensor, t);
        }
        // The chip gives the scalar part as it comes; a q and its opposite are one.
        let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
        [q.w, q.i, q.j, q.k].map(|c| (sign * c) as f32)
    }

    /// Turn of the sensor's world about the vertical, radians.
    fn heading(&mut self, sensor: usize, start: u32, t: f64) -> f64 {
        let own = self.chance.of(800 + sensor);
        let first = std::f64::consts::PI * own.even(i64::from(start) + 1);
        let drifted = self.honest.drift * own.even(0) * t / 60.0;
        let walked = self.honest.walk / 60f64.sqrt() * self.walks[sensor].at(t);
        first + (drifted + walked).to_radians()
    }

    fn tilt(&self, sensor: usize, t: f64) -> Rotation {
        let own = self.chance.of(900 + sensor);
        let [x, y] = [0, 1]
            .map(|i| (self.honest.tilt * own.of(i).wander(t, self.honest.tilt_lasts)).to_radians());
        Rotation::new(Vector3::new(x, y, 0.0))
    }

    fn noise(&self, sensor: usize, t: f64) -> Rotation {
        let own = self.chance.of(1_000 + sensor);
        let [least, most] = self.honest.noise;
        let size = (least + (most - least) * own.share(-1)).to_radians();
        let moment = 4 * (t * 1e6).round() as i64;
        let [x, y, z] = [0, 1, 2].map(|i| size * own.normal(moment + i));
        Rotation::new(Vector3::new(x, y, z))
    }

    /// The segment in the world.
    fn segment(&self, segment: usize, angles: &[f32; 25], hand: &Rotation) -> Rotation {
        if segment == 0 {
            return *hand;
        }
        let (finger, behind) = ((segment - 1) / 3, (segment - 1) % 3);
        let of = |i: usize| f64::from(angles[5 * finger + i]);
        let sign = match self.side {
            Side::Right => 1.0,
            Side::Left => -1.0,
        };
        let base = if finger == 0 {
            hand * self.thumb_base
        } else {
            *hand
        };
        let mut q = base
            * about(&Vector3::x_axis(), of(0))
            * about(&Vector3::y_axis(), sign * of(1))
            * about(&Vector3::z_axis(), sign * of(2));
        for hinge in 1..=behind {
            q *= about(&self.axes[1 + 3 * finger + hinge], of(2 + hinge));
        }
        q
    }
}

/// How far the joint between a segment and its parent is bent; the back of the hand stretches with the mean of its fingers.
fn bent(segment: usize, angles: &[f32; 25]) -> f64 {
    let of = |joint: usize| f64::from(angles[joint]);
    match segment.checked_sub(1) {
        None => [5, 10, 15, 20].map(of).iter().sum::<f64>() / 4.0,
        Some(behind) => of(5 * (behind / 3) + [0, 3, 4][behind % 3]),
    }
}

/// The thumb's frames while the hand lies flat: x along its MCP axis, z as near to the hand's as that leaves it.
fn thumb_base(honest: &Honest, chance: Chance, side: Side) -> Rotation {
    let by = honest.thumb + honest.thumb_varies * chance.even(0);
    let back = match side {
        Side::Right => -1.0,
        Side::Left => 1.0,
    };
    let about_axis = Vector3::new(0.08 * chance.even(1), 0.08 * chance.even(2), back);
    let turned = about(&Unit::new_normalize(about_axis), by.to_radians());
    let x = turned * Vector3::x();
    let z = (Vector3::z() - x * x.z).normalize();
    let columns = nalgebra::Matrix3::from_columns(&[x, z.cross(&x), z]);
    Rotation::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(columns))
}
