//! Nadam's step.

use super::dispatch;
use super::lanes::{LANES, Lanes};
use crate::optimizer::{BETA1, BETA2, EPSILON};

dispatch! {
    /// One step of Nadam with this rate (learning rate times bias correction). All slices have the same length, a multiple of 16.
    pub(crate) fn step / step_kernel(
        rate: f32,
        gradient: &[f32],
        parameters: &mut [f32],
        mean: &mut [f32],
        square: &mut [f32],
    )
}

#[inline(always)]
unsafe fn step_kernel<V: Lanes>(
    rate: f32,
    gradient: &[f32],
    parameters: &mut [f32],
    mean: &mut [f32],
    square: &mut [f32],
) {
    let length = parameters.len();
    assert!(length.is_multiple_of(LANES));
    assert!(mean.len() == length && square.len() == length);
    assert!(gradient.len() == length);
    // SAFETY: the lengths were checked; features by the caller.
    unsafe {
        let (keep1, take1) = (V::splat(BETA1 as f32), V::splat((1.0 - BETA1) as f32));
        let (keep2, take2) = (V::splat(BETA2 as f32), V::splat((1.0 - BETA2) as f32));
        let (rate, epsilon) = (V::splat(rate), V::splat(EPSILON as f32));
        for at in (0..length).step_by(LANES) {
            let g = V::load(gradient.as_ptr().add(at));
            let m = keep1.mul(V::load(mean.as_ptr().add(at))).add(take1.mul(g));
            let v = keep2
                .mul(V::load(square.as_ptr().add(at)))
                .add(take2.mul(g.mul(g)));
            m.store(mean.as_mut_ptr().add(at));
            v.store(square.as_mut_ptr().add(at));
            let direction = take1.mul(g).add(keep1.mul(m));
            let change = rate.mul(direction).div(v.sqrt().add(epsilon));
            let p = V::load(parameters.as_ptr().add(at)).sub(change);
            p.store(parameters.as_mut_ptr().add(at));
        }
    }
}
