//! Random numbers by place: each depends on a seed and an index alone, so that a virtual hand gives the same answer however often and in
//! whatever order it is asked for a moment.

/// A source of such numbers.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Chance(u64);

/// The mixing function of SplitMix64.
fn mixed(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

impl Chance {
    pub fn new(seed: u64) -> Self {
        Self(mixed(seed.wrapping_add(0x9E37_79B9_7F4A_7C15)))
    }

    /// Another source, for the thing numbered `index`.
    pub fn of(self, index: usize) -> Self {
        Self::new(self.bits(index as i64))
    }

    pub fn bits(self, place: i64) -> u64 {
        mixed(
            self.0
                .wrapping_add((place as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15)),
        )
    }

    /// In [0, 1), all alike.
    pub fn share(self, place: i64) -> f64 {
        (self.bits(place) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// In [−1, 1), all alike.
    pub fn even(self, place: i64) -> f64 {
        2.0 * self.share(place) - 1.0
    }

    /// About normal, standard deviation 1: a sum of four, ±3.5 at most.
    pub fn normal(self, place: i64) -> f64 {
        let parts = self.bits(place).to_le_bytes();
        let sum: f64 = parts
            .chunks_exact(2)
            .map(|pair| f64::from(u16::from_le_bytes([pair[0], pair[1]])) / 32_768.0 - 1.0)
            .sum();
        sum * 0.75f64.sqrt()
    }

    /// At time `t`, standard deviation 1, changing gently over times of `lasts`.
    pub fn wander(self, t: f64, lasts: f64) -> f64 {
        let (knot, share) = knot(t, lasts);
        let mixed = (1.0 - share) * self.normal(knot) + share * self.normal(knot + 1);
        // Between two knots a mean is less than either.
        mixed / ((1.0 - share) * (1.0 - share) + share * share).sqrt()
    }

    /// At time `t`, in [−1, 1), going gently from one place to another each `lasts`.
    pub fn roam(self, t: f64, lasts: f64) -> f64 {
        let (knot, share) = knot(t, lasts);
        (1.0 - share) * self.even(knot) + share * self.even(knot + 1)
    }
}

/// The knot before `t`, and how far it is from there to the next, gently.
pub(crate) fn knot(t: f64, lasts: f64) -> (i64, f64) {
    let place = t / lasts;
    (place.floor() as i64, smooth(place - place.floor()))
}

/// From 0 to 1, beginning and ending gently.
pub(crate) fn smooth(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_mean_and_spread_they_are_said_to_have() {
        let chance = Chance::new(7).of(3);
        let moments = |value: &dyn Fn(i64) -> f64| {
            let n = 20_000;
            let (mut sum, mut squares) = (0.0, 0.0);
            for value in (0..n).map(value) {
                sum += value;
                squares += value * value;
            }
            (sum / n as f64, (squares / n as f64).sqrt())
        };
        let near = |(mean, sd): (f64, f64), wanted: f64| {
            assert!(
                mean.abs() < 0.04 && (sd / wanted - 1.0).abs() < 0.05,
                "{mean} {sd}"
            );
        };
        near(moments(&|i| chance.normal(i)), 1.0);
        near(moments(&|i| chance.even(i)), 3f64.sqrt().recip());
        near(moments(&|i| chance.wander(0.37 * i as f64, 0.6)), 1.0);
        assert_ne!(chance.of(1).bits(0), chance.of(2).bits(0));
    }
}
