//! The same network in ready-made libraries, each the way its users write it, and in textbook loops.

use nalgebra::{SMatrix, SVector};

use crate::network::Network;

/// Row-major loops over slices, as in a textbook.
#[inline(never)]
pub fn textbook(w1: &[f32], b1: &[f32], w2: &[f32], b2: &[f32], q: &[f32], y: &mut [f32]) {
    let mut h = [0.0f32; 300];
    for j in 0..300 {
        let mut z = b1[j];
        for i in 0..25 {
            z += w1[j * 25 + i] * q[i];
        }
        h[j] = if z > 0.0 { z } else { 0.0 };
    }
    for x in 0..4 {
        let mut sum = b2[x];
        for j in 0..300 {
            sum += w2[x * 300 + j] * h[j];
        }
        y[x] = sum;
    }
}

/// nalgebra with sizes known to the compiler.
pub struct Nalgebra {
    w1: Box<SMatrix<f32, 300, 25>>,
    b1: SVector<f32, 300>,
    w2: Box<SMatrix<f32, 4, 300>>,
    b2: SVector<f32, 4>,
}

impl Nalgebra {
    pub fn new(n: &Network) -> Self {
        Self {
            w1: Box::new(SMatrix::from_row_slice(&n.w1)),
            b1: SVector::from_row_slice(&n.b1),
            w2: Box::new(SMatrix::from_row_slice(&n.w2)),
            b2: SVector::from_row_slice(&n.b2),
        }
    }

    #[inline(never)]
    #[expect(clippy::op_ref, reason = "the matrices would be copied")]
    pub fn eval(&self, q: &[f32; 25]) -> [f32; 4] {
        let h = (&*self.w1 * SVector::<f32, 25>::from_row_slice(q) + self.b1).map(|z| z.max(0.0));
        (&*self.w2 * h + self.b2).into()
    }
}
