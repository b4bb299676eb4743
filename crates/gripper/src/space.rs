//! The configuration space of the 3-Finger gripper: where its fingers may be without meeting.
//!
//! Paper §4.3, in counts: x = [A, B, C, S] ∈ [0, 255]⁴ and (S < 180 or max(A + B, A + C) < 290).
//! Near the pinch (S ≥ 180) finger A, closing between B and C, would meet them; elsewhere any
//! combination is free. The set is open along that border, so [`nearest`] stops [`MARGIN`] short.

/// Axes in order: finger A, finger B, finger C, scissor.
pub const AXES: usize = 4;
/// Scissor counts below this are free of interference, whatever the fingers do.
pub const SCISSOR_LIMIT: f32 = 180.0;
/// From the scissor limit on, A + B and A + C must stay below this.
pub const SUM_LIMIT: f32 = 290.0;
/// Largest count of an axis.
pub const MAX: f32 = 255.0;
/// How far inside the open border [`nearest`] stops, counts. Far below one count, far above f32's
/// step at 290 (3e-5).
pub const MARGIN: f32 = 1.0 / 1024.0;
/// Part of [0, 255]⁴ that lies inside: 180/255 + (75/255)·(35/255 + (1 − (35/255)³)/3).
pub const VOLUME_FRACTION: f32 = 0.844_037;

/// Whether `x` (counts) lies inside. A NaN does not.
#[must_use]
pub fn contains(x: &[f32; AXES]) -> bool {
    let [a, b, c, s] = *x;
    x.iter().all(|axis| (0.0..=MAX).contains(axis))
        && (s < SCISSOR_LIMIT || a + b.max(c) < SUM_LIMIT)
}

/// Whether a command in whole counts lies inside.
#[must_use]
pub fn contains_counts(x: &[u8; AXES]) -> bool {
    contains(&x.map(f32::from))
}

/// The point inside nearest to `x` in the Euclidean sense, [`MARGIN`] short of the open border.
///
/// A point inside comes back unchanged. A NaN cannot be placed: the input comes back as it is, and
/// [`contains`] says no to it.
#[must_use]
pub fn nearest(x: &[f32; AXES]) -> [f32; AXES] {
    if x.iter().any(|axis| axis.is_nan()) {
        return *x;
    }
    let boxed = x.map(|axis| axis.clamp(0.0, MAX));
    if contains(&boxed) {
        return boxed;
    }
    let [a, b, c, _] = boxed;
    let spread = [a, b, c, SCISSOR_LIMIT - MARGIN];
    let folded = fold(boxed);
    if distance(&boxed, &spread) <= distance(&boxed, &folded) {
        spread
    } else {
        folded
    }
}

/// The nearest point with A + B and A + C at most the limit; the scissor stays.
///
/// In the box a sum exceeds the limit only where both its fingers are at least 35, and then no step
/// below leaves the box: the two half-spaces alone decide.
fn fold([a, b, c, s]: [f32; AXES]) -> [f32; AXES] {
    let limit = SUM_LIMIT - MARGIN;
    let step = (a + b.max(c) - limit) / 2.0;
    // Only the larger sum: half of the excess from each of its two fingers.
    let one = if b >= c {
        [a - step, b - step, c, s]
    } else {
        [a - step, b, c - step, s]
    };
    if one[0] + b.min(c) <= limit {
        return one;
    }
    // Both sums at the limit: b = c = limit − a, a from d/da of the squared distance = 0.
    let a = (a + 2.0 * limit - b - c) / 3.0;
    [a, limit - a, limit - a, s]
}

fn distance(x: &[f32; AXES], y: &[f32; AXES]) -> f32 {
    x.iter().zip(y).map(|(p, q)| (p - q) * (p - q)).sum()
}

/// The command in whole counts for `x`: rounded, and inside. `None` when a component is NaN.
///
/// Rounding can push two fingers over the border together (144.5 + 144.5 → 145 + 145): then they
/// are rounded down instead.
#[must_use]
pub fn round(x: &[f32; AXES]) -> Option<[u8; AXES]> {
    if x.iter().any(|axis| axis.is_nan()) {
        return None;
    }
    let inside = nearest(x);
    let rounded = inside.map(|axis| libm::roundf(axis) as u8);
    Some(if contains_counts(&rounded) {
        rounded
    } else {
        inside.map(|axis| axis as u8)
    })
}

/// A point drawn evenly from the inside, counts. `uniform` gives numbers in [0, 1); five are used.
///
/// The part below the scissor limit is a box. Above it, the cross-section at finger A = a is the
/// square of B, C below 290 − a (all of it for a ≤ 35): A comes from the inverse of that
/// distribution, B and C are even in the square.
pub fn sample(mut uniform: impl FnMut() -> f32) -> [f32; AXES] {
    let pick = uniform();
    let (u, v, w, t) = (uniform(), uniform(), uniform(), uniform());
    let free = SCISSOR_LIMIT / MAX;
    let x = if pick * VOLUME_FRACTION < free {
        [u * MAX, v * MAX, w * MAX, t * SCISSOR_LIMIT]
    } else {
        let a = finger_a(u);
        let side = (SUM_LIMIT - a).min(MAX);
        [
            a,
            v * side,
            w * side,
            SCISSOR_LIMIT + t * (MAX - SCISSOR_LIMIT),
        ]
    };
    // Rounding of f32 may touch the border itself.
    nearest(&x)
}

/// Inverse distribution of finger A above the scissor limit, for u in [0, 1).
fn finger_a(u: f32) -> f32 {
    const KNEE: f32 = SUM_LIMIT - MAX;
    // Areas: KNEE·MAX² below the knee, (MAX³ − KNEE³)/3 above it.
    let (max3, knee3) = (MAX * MAX * MAX, KNEE * KNEE * KNEE);
    let below = KNEE * MAX * MAX;
    let mass = u * (below + (max3 - knee3) / 3.0);
    if mass < below {
        mass / (MAX * MAX)
    } else {
        SUM_LIMIT - libm::cbrtf((max3 - 3.0 * (mass - below)).max(knee3))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plain generator for tests: the numbers only have to be spread.
    fn spread(seed: u32) -> impl FnMut() -> f32 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 16_777_216.0
        }
    }

    #[test]
    fn the_border_is_the_papers() {
        assert!(contains(&[255.0, 255.0, 255.0, 179.9]));
        assert!(!contains(&[145.0, 145.0, 0.0, 180.0]));
        assert!(contains(&[144.9, 145.0, 145.0, 255.0]));
        assert!(!contains(&[200.0, 0.0, 90.0, 200.0]));
        assert!(!contains(&[f32::NAN, 0.0, 0.0, 0.0]));
        assert!(!contains(&[0.0, 0.0, 0.0, 255.1]));
    }

    #[test]
    fn the_volume_is_the_integral_of_its_cross_sections() {
        // Above the limit, at finger A = a, B and C fill a square: its side is found by bisection
        // of `contains`, its area summed over A.
        let mut above = 0.0;
        for step in 0..510 {
            let a = 0.25 + step as f32 * 0.5;
            let (mut low, mut high) = (0.0, 255.5);
            for _ in 0..30 {
                let middle = (low + high) / 2.0;
                if contains(&[a, middle, middle, 200.0]) {
                    low = middle
                } else {
                    high = middle
                }
            }
            above += f64::from(low / 255.0).powi(2) / 510.0;
        }
        let fraction = (180.0 + 75.0 * above) / 255.0;
        assert!(
            (fraction - f64::from(VOLUME_FRACTION)).abs() < 1e-5,
            "{fraction}"
        );
    }

    #[test]
    fn samples_are_inside_and_fill_the_two_parts_in_proportion() {
        let mut uniform = spread(1);
        let (mut low, mut mean_a) = (0, 0.0);
        const N: usize = 40_000;
        for _ in 0..N {
            let x = sample(&mut uniform);
            assert!(contains(&x), "{x:?}");
            if x[3] < SCISSOR_LIMIT {
                low += 1;
            } else {
                mean_a += x[0];
            }
        }
        let part = low as f32 / N as f32;
        assert!((part - 0.705_882 / VOLUME_FRACTION).abs() < 0.01, "{part}");
        // Mean of A above the limit, from the integral of a·side(a)²: 35²/2·255² + ∫₃₅²⁵⁵.
        let mean = mean_a / (N - low) as f32;
        assert!((mean - 75.4).abs() < 2.0, "{mean}");
    }

    #[test]
    fn nearest_is_inside_and_no_lattice_point_is_nearer() {
        let mut uniform = spread(7);
        for _ in 0..300 {
            let x = [0, 1, 2, 3].map(|_| uniform() * 300.0 - 20.0);
            let y = nearest(&x);
            assert!(contains(&y), "{x:?} -> {y:?}");
            let best = distance(&x, &y).sqrt();
            // Any point inside, on a coarse lattice, is at least as far (plus the margin).
            for a in (0..=255).step_by(15) {
                for b in (0..=255).step_by(15) {
                    for c in (0..=255).step_by(15) {
                        for s in [0.0, 60.0, 120.0, 179.99, 180.0, 200.0, 230.0, 255.0] {
                            let z = [a as f32, b as f32, c as f32, s];
                            if contains(&z) {
                                assert!(
                                    distance(&x, &z).sqrt() > best - 0.01,
                                    "{x:?}: {z:?} beats {y:?}"
                                );
                            }
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn rounded_commands_stay_inside() {
        assert_eq!(
            round(&[144.5, 144.5, 144.5, 255.0]).map(|x| contains_counts(&x)),
            Some(true)
        );
        assert_eq!(round(&[f32::NAN, 0.0, 0.0, 0.0]), None);
        let mut uniform = spread(3);
        for _ in 0..20_000 {
            let x = [0, 1, 2, 3].map(|_| uniform() * 255.0);
            assert!(
                round(&x).is_some_and(|counts| contains_counts(&counts)),
                "{x:?}"
            );
        }
    }

    #[test]
    fn infinities_are_placed_and_nan_is_not() {
        assert!(contains(&nearest(&[
            f32::INFINITY,
            f32::NEG_INFINITY,
            3.0,
            f32::INFINITY
        ])));
        assert!(!contains(&nearest(&[f32::NAN, 1.0, 2.0, 3.0])));
    }
}
