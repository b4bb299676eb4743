//! What an image is made of.

use super::bound::HiddenBound;
use super::{Error, Meta, shape_is_valid};

/// The map's parameters as trained, row-major, with the normalisation folded in (radians in, counts out).
#[derive(Clone, Copy, Debug)]
pub struct Parameters<'a> {
    /// Number of inputs (Q).
    pub inputs: usize,
    /// Number of hidden units (H).
    pub hidden: usize,
    /// Number of outputs (X).
    pub outputs: usize,
    /// First layer, `[H, Q]`.
    pub w1: &'a [f32],
    /// First layer's bias, `[H]`.
    pub b1: &'a [f32],
    /// Second layer, `[X, H]`.
    pub w2: &'a [f32],
    /// Second layer's bias, `[X]`, counts.
    pub b2: &'a [f32],
}

impl Parameters<'_> {
    pub(crate) const fn shape(&self) -> [usize; 3] {
        [self.inputs, self.hidden, self.outputs]
    }

    /// Shape within the limits and every slice as long as the shape says.
    pub(crate) fn check_lengths(&self) -> Result<(), Error> {
        let &Self {
            inputs,
            hidden,
            outputs,
            ..
        } = self;
        if !shape_is_valid(inputs, hidden, outputs) {
            return Err(Error::Shape {
                found: [inputs, hidden, outputs],
            });
        }
        for (name, found, expected) in [
            ("w1", self.w1.len(), hidden * inputs),
            ("b1", self.b1.len(), hidden),
            ("w2", self.w2.len(), outputs * hidden),
            ("b2", self.b2.len(), outputs),
        ] {
            if found != expected {
                return Err(Error::ParameterLength {
                    name,
                    found,
                    expected,
                });
            }
        }
        Ok(())
    }

    /// Everything that makes parameters fit for an image: lengths, finite values, no sum that could overflow.
    pub fn check(&self) -> Result<(), Error> {
        self.check_lengths()?;
        let all = self.w1.iter().chain(self.b1).chain(self.w2).chain(self.b2);
        if let Some(at) = all.clone().position(|v| !v.is_finite()) {
            return Err(Error::NotFinite { at });
        }
        let mut bound = HiddenBound::new();
        for (j, (row, &b1)) in self.w1.chunks_exact(self.inputs).zip(self.b1).enumerate() {
            let w2 = self.w2.iter().skip(j).step_by(self.hidden);
            bound.unit(b1, row.iter(), w2);
        }
        if bound.is_safe(self.b2.iter()) {
            Ok(())
        } else {
            Err(Error::Overflow)
        }
    }

    /// [`Parameters::check`], and that the joint order goes with the number of inputs.
    pub(crate) fn check_for(&self, meta: &Meta) -> Result<(), Error> {
        self.check()?;
        let (order, inputs) = (meta.joint_order, self.inputs);
        if order.inputs().is_some_and(|n| n != inputs) {
            return Err(Error::JointOrderInputs { order, inputs });
        }
        Ok(())
    }
}
