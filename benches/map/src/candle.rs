//! The same network in candle, on the CPU.

use candle_core::{Device, Tensor};

use crate::network::Network;

/// candle on the CPU.
pub struct Candle {
    w1: Tensor,
    b1: Tensor,
    w2: Tensor,
    b2: Tensor,
}

impl Candle {
    pub fn new(n: &Network) -> candle_core::Result<Self> {
        let cpu = &Device::Cpu;
        Ok(Self {
            w1: Tensor::from_slice(&n.w1, (300, 25), cpu)?.t()?,
            b1: Tensor::from_slice(&n.b1, (1, 300), cpu)?,
            w2: Tensor::from_slice(&n.w2, (4, 300), cpu)?.t()?,
            b2: Tensor::from_slice(&n.b2, (1, 4), cpu)?,
        })
    }

    pub fn eval(&self, q: &[f32; 25]) -> candle_core::Result<[f32; 4]> {
        let q = Tensor::from_slice(q, (1, 25), &Device::Cpu)?;
        let h = q.matmul(&self.w1)?.add(&self.b1)?.relu()?;
        let y = h
            .matmul(&self.w2)?
            .add(&self.b2)?
            .flatten_all()?
            .to_vec1::<f32>()?;
        Ok([y[0], y[1], y[2], y[3]])
    }
}
