//! The map's arithmetic as a plain program: the definition that every kernel is held to, bit by bit.
//!
//! It reads row-major parameters, not the image, so that it also checks the order of the image. It is slow on purpose:
//! no step of it is rearranged.

use crate::LANES;
use crate::image::Parameters;

/// f(q) by the definition in the [crate documentation](crate#the-arithmetic); `q` holds `inputs` values in radians, `y`
/// receives `outputs` values in counts.
///
/// Inputs are not checked here. Returns `None`, with `y` untouched, if a slice's length does not fit the shape.
pub fn eval(parameters: &Parameters<'_>, q: &[f32], y: &mut [f32]) -> Option<()> {
    if parameters.check_lengths().is_err()
        || q.len() != parameters.inputs
        || y.len() != parameters.outputs
    {
        return None;
    }
    for (x, y) in y.iter_mut().enumerate() {
        *y = eval_output(parameters, q, x);
    }
    Some(())
}

/// Output x of f(q), for lengths that were checked.
pub(crate) fn eval_output(parameters: &Parameters<'_>, q: &[f32], x: usize) -> f32 {
    let &Parameters {
        inputs,
        hidden,
        w1,
        b1,
        w2,
        b2,
        ..
    } = parameters;
    let mut sums = [0.0f32; LANES];
    for j in 0..hidden.next_multiple_of(LANES) {
        // Padded units have zero weights; their products are added like any other.
        let (mut z, out) = if j < hidden {
            (b1[j], w2[x * hidden + j])
        } else {
            (0.0, 0.0)
        };
        for (i, &q) in q.iter().enumerate() {
            let w = if j < hidden { w1[j * inputs + i] } else { 0.0 };
            let product = w * q;
            z += product;
        }
        let h = if z > 0.0 { z } else { 0.0 };
        let product = out * h;
        sums[j % LANES] += product;
    }
    for distance in [8, 4, 2, 1] {
        for k in 0..distance {
            sums[k] += sums[k + distance];
        }
    }
    sums[0] + b2[x]
}
