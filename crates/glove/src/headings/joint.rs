//! The filter of one joint: the heading of its child against its parent, how fast that drifts, and a constant offset of what measures
//! it (soft tissue, an axis a little off; at a joint of three degrees of freedom the person's mean posture).

use crate::calibration::algebra::{self, Half, rad};
use crate::calibration::solve::is_base;
use crate::timing::since;
use crate::{Duration, Instant};

/// What a joint is, to its filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// One axis, which both segments share.
    Hinge,
    /// A finger's base: x is nearly shared.
    Mcp,
    /// The thumb's base: x is shared on the whole.
    Cmc,
}

/// Standard deviation of a heading found beside a restarted sensor, radians.
const REGAINED: f32 = rad(1.5);
/// Standard deviation of the rate at the start, radians a second (0.8°/min).
const RATE: f32 = rad(0.8 / 60.0);
/// How fast the heading walks, radians² a second ((0.42°)² a minute).
const WALK: f32 = rad(0.42) * rad(0.42) / 60.0;
/// … and its rate ((0.1°/min)² a minute).
const RATE_WALK: f32 = rad(0.1 / 60.0) * rad(0.1 / 60.0) / 60.0;
/// No variance is smaller: rounding must not make one negative.
const LEAST: f32 = 1e-12;

/// How long what a flat pose corrects takes to enter, seconds.
pub(super) const ENTERS: f32 = 1.2;

impl Kind {
    /// What the joint between a segment and its parent is.
    pub(super) fn of(segment: usize) -> Self {
        match segment {
            1 => Self::Cmc,
            k if is_base(k) => Self::Mcp,
            _ => Self::Hinge,
        }
    }

    /// Standard deviation of the heading right after a calibration, radians.
    const fn first(self) -> f32 {
        match self {
            Kind::Hinge => rad(1.0),
            _ => rad(1.2),
        }
    }

    const fn offset(self) -> f32 {
        match self {
            Kind::Hinge => rad(0.8),
            _ => rad(8.0),
        }
    }

    /// How fast the offset walks, radians² a second.
    const fn offset_walk(self) -> f32 {
        let per_minute = match self {
            Kind::Hinge => rad(0.15),
            _ => rad(1.5),
        };
        per_minute * per_minute / 60.0
    }

    /// Standard deviation of a heading by one flat pose, radians: how straight a person holds it.
    const fn pose(self) -> f32 {
        match self {
            Kind::Hinge => rad(1.0),
            Kind::Mcp => rad(2.0),
            Kind::Cmc => rad(4.0),
        }
    }

    /// The least squared cosine of the axis' elevation that shows anything.
    const fn least_seen(self) -> f32 {
        match self {
            Kind::Hinge => 0.12,
            _ => 0.3,
        }
    }

    /// The variance of one look at the axis, and for how long its error lasts in seconds. `sin2`: the squared sine of the flexion.
    fn look(self, sin2: f32) -> (f32, f32) {
        const ABDUCTED: f32 = rad(10.0) * rad(10.0);
        const TWISTED: f32 = rad(8.0) * rad(8.0);
        match self {
            Kind::Hinge => (rad(2.0) * rad(2.0), 1.0),
            Kind::Mcp => (ABDUCTED * (1.0 - sin2) + TWISTED * sin2, 5.0),
            Kind::Cmc => (rad(15.0) * rad(15.0), 5.0),
        }
    }
}

/// One look at a joint's axis from both sides: the sine and cosine of the heading between them, times [`Look::seen`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Look {
    pub sin: f32,
    pub cos: f32,
    /// The squared cosine of the axis' elevation: 0 where it is vertical and shows nothing.
    pub seen: f32,
}

impl Look {
    /// The axis in the world, by the parent and by the child.
    pub fn new(parent: algebra::Vector, child: algebra::Vector) -> Self {
        let sin = parent[0] * child[1] - parent[1] * child[0];
        let cos = parent[0] * child[0] + parent[1] * child[1];
        Self {
            sin,
            cos,
            seen: libm::sqrtf(sin * sin + cos * cos),
        }
    }
}

/// One joint.
#[derive(Debug, Clone)]
pub(super) struct Joint {
    pub kind: Kind,
    /// Whether there is a heading at all.
    pub known: bool,
    /// The heading, radians in (−π, π].
    pub heading: f32,
    /// Radians a second.
    pub rate: f32,
    offset: f32,
    /// Upper triangle of the covariance of heading, rate, offset.
    p: [f32; 6],
    at: Instant,
    /// What has not entered yet of a correction, radians, and how much of it enters in a second.
    lag: f32,
    enters: f32,
    /// The heading as it is shown, and half of it.
    shown: (f32, Half),
    /// How often that was turned on by a little since it was worked out.
    steps: u8,
}

impl Joint {
    /// Without a heading.
    pub fn new(kind: Kind) -> Self {
        let mut joint = Self {
            kind,
            known: false,
            heading: 0.0,
            rate: 0.0,
            offset: 0.0,
            p: [0.0; 6],
            at: Instant::from_ticks(0),
            lag: 0.0,
            enters: 0.0,
            shown: (0.0, [1.0, 0.0]),
            steps: 0,
        };
        joint.set(0.0, kind.first(), joint.at);
        joint.p[5] = kind.offset() * kind.offset();
        joint.known = false;
        joint
    }

    /// A heading from elsewhere, at once.
    fn set(&mut self, heading: f32, sigma: f32, at: Instant) {
        self.heading = algebra::wrap(heading);
        self.known = true;
        self.rate = 0.0;
        let offset = self.p[5];
        self.p = [sigma * sigma, 0.0, 0.0, RATE * RATE, 0.0, offset];
        (self.at, self.lag, self.enters) = (at, 0.0, 0.0);
        self.shown = (self.heading, algebra::half(self.heading));
    }

    /// The heading that a calibration found.
    pub fn start(&mut self, heading: f32, at: Instant) {
        self.set(heading, self.kind.first(), at);
    }

    /// The heading found beside a sensor that restarted `away` ago.
    pub fn regain(&mut self, heading: f32, away: Duration, at: Instant) {
        let drifted = RATE * algebra::seconds(away);
        let sigma = libm::sqrtf(REGAINED * REGAINED + drifted * drifted);
        self.set(heading, sigma, at);
    }

    /// How well the heading is known: its standard deviation, radians.
    pub fn sigma(&self) -> f32 {
        libm::sqrtf(self.p[0])
    }

    /// Half of the heading as it is shown: what a correction changes enters slowly.
    pub fn shown(&self) -> Half {
        self.shown.1
    }

    /// Brings what is shown up to date. A sine costs a chip more than all the rest of a joint: small steps go without.
    fn show(&mut self) {
        const SMALL: f32 = 0.03;
        let (before, half) = self.shown;
        let now = algebra::wrap(self.heading + self.lag);
        let step = algebra::wrap(now - before);
        self.steps = self.steps.wrapping_add(1);
        let half = if libm::fabsf(step) > SMALL || self.steps == 0 {
            algebra::half(now)
        } else {
            let [c, s] = algebra::half_product(half, algebra::small_half(step));
            let unit = algebra::near_unit(c * c + s * s);
            [unit * c, unit * s]
        };
        self.shown = (now, half);
    }

    /// Whether the heading is known to `sigma`.
    pub fn is_sure(&self, sigma: f32) -> bool {
        self.p[0] <= sigma * sigma
    }

    /// What a look at the axis shows beyond the heading, radians.
    pub fn offset(&self) -> f32 {
        self.offset
    }

    /// A scan passes: what is due of a correction enters.
    pub fn pass(&mut self, seconds: f32) {
        if self.lag == 0.0 {
            return;
        }
        let step = self.enters * seconds;
        self.lag = if libm::fabsf(self.lag) <= libm::fabsf(step) {
            0.0
        } else {
            self.lag - step
        };
        self.show();
    }

    /// Time has passed since the joint was looked at last. Seconds.
    fn predict(&mut self, at: Instant) -> f32 {
        let dt = algebra::seconds(since(at, self.at));
        self.at = at;
        self.heading = algebra::wrap(self.heading + self.rate * dt);
        let [hh, hr, ho, rr, ro, oo] = &mut self.p;
        *hh += dt * (2.0 * *hr + dt * *rr) + WALK * dt;
        *hr += dt * *rr;
        *ho += dt * *ro;
        *rr += RATE_WALK * dt;
        *oo += self.kind.offset_walk() * dt;
        dt
    }

    /// The joint's turn comes at `at`, every fifth scan: with a look at its axis, if both sensors are there.
    pub fn update(&mut self, look: Option<Look>, sin2: f32, at: Instant) {
        let dt = self.predict(at);
        if let Some(look) = look
            && look.seen > self.kind.least_seen()
            && dt > 0.0
        {
            let (variance, lasts) = self.kind.look(sin2);
            // Looks closer together than their error lasts say the same thing.
            let repeated = 2.0 * lasts / dt;
            let repeated = if repeated > 1.0 { repeated } else { 1.0 };
            let seen = algebra::wrap(libm::atan2f(look.sin, look.cos) - self.heading);
            let off = algebra::wrap(seen - self.offset);
            self.correct(off, 1.0, variance * repeated / look.seen);
        }
        self.show();
    }

    /// A flat pose shows the heading `measured`. How far it was off, radians.
    pub fn pose(&mut self, measured: f32, at: Instant) -> f32 {
        let sigma = self.kind.pose();
        if !measured.is_finite() {
            return 0.0;
        }
        if !self.known {
            self.set(measured, sigma, at);
            return 0.0;
        }
        self.predict(at);
        let off = algebra::wrap(measured - self.heading);
        let before = self.heading;
        self.correct(off, 0.0, sigma * sigma);
        self.lag += algebra::wrap(before - self.heading);
        self.enters = self.lag / ENTERS;
        self.show();
        off
    }

    /// `off`: what was measured less what was expected of heading + `weight` · offset; `variance`: of that.
    fn correct(&mut self, off: f32, weight: f32, variance: f32) {
        let [hh, hr, ho, rr, ro, oo] = self.p;
        let along = [hh + weight * ho, hr + weight * ro, ho + weight * oo];
        let total = along[0] + weight * along[2] + variance;
        if !(off.is_finite() && total.is_finite() && total > 0.0) {
            return;
        }
        let gain = along.map(|c| c / total);
        self.heading = algebra::wrap(self.heading + gain[0] * off);
        self.rate += gain[1] * off;
        self.offset += gain[2] * off;
        self.p = [
            least(hh - gain[0] * along[0]),
            hr - gain[0] * along[1],
            ho - gain[0] * along[2],
            least(rr - gain[1] * along[1]),
            ro - gain[1] * along[2],
            least(oo - gain[2] * along[2]),
        ];
    }
}

fn least(variance: f32) -> f32 {
    if variance > LEAST { variance } else { LEAST }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCAN: u64 = 1_000_000 / 35;

    #[test]
    fn a_hinge_that_is_seen_follows_its_drift_and_knows_how_well() {
        let mut joint = Joint::new(Kind::Hinge);
        joint.start(3.13, Instant::from_ticks(0));
        // 3°/min, across ±π.
        for step in 1..2_100u64 {
            let at = Instant::from_ticks(5 * SCAN * step);
            let truth = 3.13 + rad(3.0 / 60.0) * at.as_ticks() as f32 * 1e-6;
            let (sin, cos) = libm::sincosf(truth);
            joint.update(Some(Look::new([1.0, 0.0, 0.0], [cos, sin, 0.0])), 0.0, at);
            let off = algebra::wrap(algebra::wrap(truth - core::f32::consts::TAU) - joint.heading);
            assert!(libm::fabsf(off) < rad(1.5), "{step}: {}°", off.to_degrees());
        }
        assert!(libm::fabsf(joint.rate.to_degrees() * 60.0 - 3.0) < 0.3);
        assert!(joint.sigma() < rad(1.0) && joint.sigma() > 0.0);
    }

    #[test]
    fn a_hinge_whose_axis_is_vertical_gets_less_sure() {
        let mut joint = Joint::new(Kind::Hinge);
        joint.start(0.5, Instant::from_ticks(0));
        for step in 1..4_200u64 {
            let at = Instant::from_ticks(5 * SCAN * step);
            joint.update(Some(Look::new([0.1, 0.0, 0.99], [0.0, 0.1, 0.99])), 0.0, at);
        }
        assert!(libm::fabsf(joint.heading - 0.5) < 1e-4);
        assert!(joint.sigma() > rad(4.0), "{}", joint.sigma().to_degrees());
    }

    #[test]
    fn what_a_flat_pose_corrects_enters_over_a_second_at_least() {
        let mut joint = Joint::new(Kind::Mcp);
        joint.start(0.0, Instant::from_ticks(0));
        let off = joint.pose(rad(5.0), Instant::from_ticks(60_000_000));
        assert!((off - rad(5.0)).abs() < 1e-6);
        let gained = joint.heading;
        assert!(gained > rad(1.0), "{}", gained.to_degrees());
        let shown = |joint: &Joint| 2.0 * libm::atan2f(joint.shown()[1], joint.shown()[0]);
        assert!(shown(&joint).abs() < 1e-6, "nothing at once");
        for scan in 1..=35 {
            joint.pass(1.0 / 35.0);
            let entered = shown(&joint) / gained;
            assert!(entered <= scan as f32 / 35.0 + 1e-3, "{scan}: {entered}");
        }
        (0..10).for_each(|_| joint.pass(1.0 / 35.0));
        assert!((shown(&joint) - gained).abs() < 1e-6);
    }

    /// Looks at a joint for so many minutes, each of which shows `seen` radians, every fifth scan.
    fn looked_at(kind: Kind, minutes: u64, seen: f32) -> Joint {
        let mut joint = Joint::new(kind);
        joint.start(0.0, Instant::from_ticks(0));
        let (sin, cos) = libm::sincosf(seen);
        for step in 1..=420 * minutes {
            let at = Instant::from_ticks(5 * SCAN * step);
            joint.update(Some(Look::new([1.0, 0.0, 0.0], [cos, sin, 0.0])), 0.0, at);
        }
        joint
    }

    #[test]
    fn a_posture_that_lasts_is_learnt_as_one_and_does_not_become_the_heading() {
        let joint = looked_at(Kind::Mcp, 10, rad(8.0));
        let (heading, offset) = (joint.heading.to_degrees(), joint.offset.to_degrees());
        assert!(offset > 3.0 && heading < 3.0, "{heading}° and {offset}°");
    }

    #[test]
    fn looks_within_a_second_say_the_same_thing_and_make_nothing_surer() {
        let joint = looked_at(Kind::Hinge, 1, 0.0);
        let [heading, _, both, _, _, offset] = joint.p;
        // As well as 30 looks of 2°, 2 s apart, show it, and not as well as 420 would.
        let sigma = libm::sqrtf(heading + 2.0 * both + offset).to_degrees();
        assert!((0.3..0.8).contains(&sigma), "{sigma}°");
    }

    #[test]
    fn a_heading_that_nobody_looks_at_walks_by_0_42_degrees_in_a_minute() {
        let mut joint = Joint::new(Kind::Hinge);
        joint.start(0.0, Instant::from_ticks(0));
        joint.p = [0.0; 6];
        joint.predict(Instant::from_ticks(60_000_000));
        assert!(
            (joint.sigma() - rad(0.42)).abs() < rad(0.01),
            "{}",
            joint.sigma()
        );
    }
}
