//! Mean, median, spread, and the t-test of §3.2.3.

use statrs::function::beta::beta_reg;

/// What ten repetitions say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// Number of values.
    pub count: usize,
    /// Arithmetic mean.
    pub mean: f64,
    /// Median.
    pub median: f64,
    /// Standard deviation of the sample (n − 1); NaN for one value.
    pub deviation: f64,
    /// First and third quartile, by linear interpolation.
    pub quartiles: (f64, f64),
}

/// Summary of some values; `None` without any, or when one is not finite.
#[must_use]
pub fn summary(values: &[f64]) -> Option<Summary> {
    if values.is_empty() || values.iter().any(|value| !value.is_finite()) {
        return None;
    }
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let mean = mean(values);
    Some(Summary {
        count: values.len(),
        mean,
        median: quantile(&sorted, 0.5),
        deviation: deviation(values, mean),
        quartiles: (quantile(&sorted, 0.25), quantile(&sorted, 0.75)),
    })
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn deviation(values: &[f64], mean: f64) -> f64 {
    let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    libm::sqrt(squares / (values.len() as f64 - 1.0))
}

/// Of sorted, non-empty values.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len() - 1) as f64;
    let low = libm::floor(place) as usize;
    let high = (low + 1).min(sorted.len() - 1);
    sorted[low] + (sorted[high] - sorted[low]) * (place - low as f64)
}

/// A t-test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TTest {
    /// Student's t.
    pub t: f64,
    /// Degrees of freedom.
    pub freedom: usize,
    /// Two-sided p.
    pub p: f64,
}

/// The one-sample t-test of the differences of two measures of the same repetitions (same seeds, so same samples and initial
/// weights) against zero. The paper does not say whether its p is one- or two-sided; this one is two-sided. `None` for fewer than two
/// pairs or when all differences are equal.
#[must_use]
pub fn paired_t_test(a: &[f64], b: &[f64]) -> Option<TTest> {
    if a.len() != b.len() || a.len() < 2 {
        return None;
    }
    let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    let mean = mean(&differences);
    let error = deviation(&differences, mean) / libm::sqrt(a.len() as f64);
    let t = mean / error;
    if !t.is_finite() {
        return None;
    }
    let freedom = a.len() - 1;
    Some(TTest {
        t,
        freedom,
        p: two_sided(t, freedom as f64),
    })
}

/// P(|T| > |t|) = I_{ν/(ν+t²)}(ν/2, ½).
fn two_sided(t: f64, freedom: f64) -> f64 {
    beta_reg(freedom / 2.0, 0.5, freedom / (freedom + t * t))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_summary_is_what_one_computes_by_hand() {
        let found = summary(&[4.0, 1.0, 3.0, 2.0]).unwrap();
        assert_eq!((found.mean, found.median), (2.5, 2.5));
        assert_eq!(found.quartiles, (1.75, 3.25));
        assert!((found.deviation - 1.290_994_448_735_805_6).abs() < 1e-15);
        assert_eq!(summary(&[]), None);
        assert_eq!(summary(&[1.0, f64::NAN]), None);
        assert!(summary(&[1.0]).unwrap().deviation.is_nan());
    }

    /// Critical values of Student's t from printed tables (two-sided 5 %, 1 % and 0.1 %).
    #[test]
    fn p_values_are_those_of_the_printed_tables() {
        for (freedom, t, p) in [
            (1.0, 12.706, 0.05),
            (4.0, 4.604, 0.01),
            (9.0, 2.262, 0.05),
            (9.0, 4.781, 0.001),
            (30.0, 2.042, 0.05),
        ] {
            let found = two_sided(t, freedom);
            assert!((found / p - 1.0).abs() < 2e-3, "{freedom} {t}: {found}");
        }
        assert_eq!(two_sided(0.0, 9.0), 1.0);
        assert!(two_sided(1e6, 9.0) < 1e-40);
    }

    #[test]
    fn the_test_needs_pairs_that_differ() {
        // By hand: differences 1, 2, 3: mean 2, s = 1, t = 2√3.
        let test = paired_t_test(&[2.0, 4.0, 6.0], &[1.0, 2.0, 3.0]).unwrap();
        assert!((test.t - 2.0 * libm::sqrt(3.0)).abs() < 1e-12);
        // t = 3.4641 with 2 degrees: p = 1 − t/√(2 + t²) = 0.0742.
        assert!((test.p - (1.0 - test.t / libm::sqrt(2.0 + test.t * test.t))).abs() < 1e-12);
        assert_eq!(paired_t_test(&[1.0, 2.0], &[0.0, 1.0]), None);
        assert_eq!(paired_t_test(&[1.0], &[0.0]), None);
        assert_eq!(paired_t_test(&[1.0, 2.0], &[0.0]), None);
    }
}
