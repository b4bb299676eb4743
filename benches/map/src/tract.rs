//! The same network in tract.

use tract_core::internal::*;
use tract_core::ops::einsum::EinSum;
use tract_core::ops::math;

use crate::network::Network;

/// tract, optimised, with its state kept between runs.
pub struct Tract {
    state: TypedSimpleState,
}

impl Tract {
    pub fn new(n: &Network) -> TractResult<Self> {
        let constant = |shape: &[usize], values: &[f32]| {
            Tensor::from_shape(shape, values).map(|t| t.into_arc_tensor())
        };
        let mut model = TypedModel::default();
        let q = model.add_source("q", f32::fact([1, 25]))?;
        let w1 = model.add_const("w1", constant(&[300, 25], &n.w1)?)?;
        let b1 = model.add_const("b1", constant(&[1, 300], &n.b1)?)?;
        let zero = model.add_const("zero", constant(&[1, 1], &[0.0])?)?;
        let w2 = model.add_const("w2", constant(&[4, 300], &n.w2)?)?;
        let b2 = model.add_const("b2", constant(&[1, 4], &n.b2)?)?;
        let product = || TractResult::Ok(EinSum::new("mk,nk->mn".parse()?, f32::datum_type()));
        let z = model.wire_node("w1q", product()?, &[q, w1])?;
        let z = model.wire_node("z", math::add(), &[z[0], b1])?;
        let h = model.wire_node("h", math::max(), &[z[0], zero])?;
        let y = model.wire_node("w2h", product()?, &[h[0], w2])?;
        let y = model.wire_node("y", math::add(), &[y[0], b2])?;
        model.select_output_outlets(&y)?;
        let state = model.into_optimized()?.into_runnable()?.spawn()?;
        Ok(Self { state })
    }

    pub fn eval(&mut self, q: &[f32; 25]) -> TractResult<[f32; 4]> {
        let q = Tensor::from_shape(&[1, 25], q)?;
        let y = self.state.run(tvec!(q.into()))?;
        clear_upper_halves();
        let y = y[0].try_as_plain_ram()?.as_slice::<f32>()?;
        Ok([y[0], y[1], y[2], y[3]])
    }
}

/// tract's kernels leave the upper halves of the vector registers in use, which slows down SSE code after them.
fn clear_upper_halves() {
    #[cfg(target_arch = "x86_64")]
    if std::is_x86_feature_detected!("avx") {
        // SAFETY: AVX is there; the upper halves are nobody's across a call.
        unsafe { std::arch::x86_64::_mm256_zeroupper() };
    }
}
