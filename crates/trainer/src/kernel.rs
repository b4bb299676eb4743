//! The fast f32 arithmetic: everything a training step does that grows with the number of samples.
//!
//! Two layouts, and no horizontal sums in the inner loops: *point lanes* (16 samples side by side, weights broadcast) where results
//! belong to samples, *hidden lanes* (16 hidden units side by side, samples broadcast) where they belong to weights. Both add in
//! the same order, so both see the same activations. Hidden units are padded to a multiple of 16 with zeros, which stay zero.
//!
//! Square roots are `f32::sqrt` here, not libm's: that is always the instruction of SSE, which between AVX's own made a training
//! take three times as long on an Intel processor (docs/measurements/trainer.md).

pub(crate) mod affine;
pub(crate) mod boxes;
pub(crate) mod lanes;
pub(crate) mod motion;
pub(crate) mod nadam;
#[cfg(test)]
pub(crate) mod nearest;
#[cfg(test)]
mod tests;
pub(crate) mod tracker;
pub(crate) mod tree;

use crate::data::Matrix;
use crate::network::Network;
use lanes::LANES;

/// What the machine can do, found once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Machine {
    /// No vector instruction beyond the target's own.
    Plain,
    /// AVX2.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// AVX-512 F.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Machine {
    /// The best of this machine. All give the same bits.
    pub(crate) fn best() -> Self {
        *Self::all().last().unwrap_or(&Self::Plain)
    }

    /// All that this machine can run.
    pub(crate) fn all() -> Vec<Self> {
        #[allow(unused_mut)]
        let mut all = vec![Self::Plain];
        #[cfg(target_arch = "x86_64")]
        {
            if std::arch::is_x86_feature_detected!("avx2") {
                all.push(Self::Avx2);
            }
            if std::arch::is_x86_feature_detected!("avx512f") {
                all.push(Self::Avx512);
            }
        }
        all
    }
}

/// Makes the safe entry of a generic kernel: one function for each kind of machine, chosen at run time. The kernel's body must check
/// its slices before it uses pointers.
macro_rules! dispatch {
    ($(#[$doc:meta])* $visibility:vis fn $name:ident / $kernel:ident ($($argument:ident: $type:ty),* $(,)?) $(-> $result:ty)?) => {
        $(#[$doc])*
        #[allow(clippy::too_many_arguments)]
        $visibility fn $name(machine: $crate::kernel::Machine, $($argument: $type),*) $(-> $result)? {
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2")]
            #[allow(clippy::too_many_arguments)]
            fn avx2($($argument: $type),*) $(-> $result)? {
                // SAFETY: this function has the feature.
                unsafe { $kernel::<$crate::kernel::lanes::Avx2>($($argument),*) }
            }
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx512f")]
            #[allow(clippy::too_many_arguments)]
            fn avx512($($argument: $type),*) $(-> $result)? {
                // SAFETY: this function has the feature.
                unsafe { $kernel::<$crate::kernel::lanes::Avx512>($($argument),*) }
            }
            match machine {
                // SAFETY: plain code needs no feature.
                $crate::kernel::Machine::Plain => unsafe {
                    $kernel::<$crate::kernel::lanes::Plain>($($argument),*)
                },
                // SAFETY: `Machine` has this value only where the feature was found.
                #[cfg(target_arch = "x86_64")]
                $crate::kernel::Machine::Avx2 => unsafe { avx2($($argument),*) },
                // SAFETY: as above.
                #[cfg(target_arch = "x86_64")]
                $crate::kernel::Machine::Avx512 => unsafe { avx512($($argument),*) },
            }
        }
    };
}
pub(crate) use dispatch;

/// The shape of a network, and where its arrays lie in a flat array of parameters (or gradients):
/// w1 transposed \[inputs\]\[padded\], b1 \[padded\], w2 \[outputs\]\[padded\], b2 \[outputs\], padded to whole vectors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shape {
    pub(crate) inputs: usize,
    pub(crate) hidden: usize,
    pub(crate) outputs: usize,
}

impl Shape {
    pub(crate) fn padded(self) -> usize {
        self.hidden.next_multiple_of(LANES)
    }
    pub(crate) fn b1(self) -> usize {
        self.inputs * self.padded()
    }
    pub(crate) fn w2(self) -> usize {
        (self.inputs + 1) * self.padded()
    }
    pub(crate) fn b2(self) -> usize {
        (self.inputs + 1 + self.outputs) * self.padded()
    }
    /// Length of the flat array.
    pub(crate) fn len(self) -> usize {
        self.b2() + self.outputs.next_multiple_of(LANES)
    }
    /// Floats a unit in the unit-major copy: its w1 row, its bias, its w2 column.
    pub(crate) fn unit(self) -> usize {
        self.inputs + 1 + self.outputs
    }

    /// Writes a network into its flat form.
    pub(crate) fn flatten(self, net: &Network, flat: &mut [f32]) {
        let padded = self.padded();
        for j in 0..self.hidden {
            for i in 0..self.inputs {
                flat[i * padded + j] = net.w1[j * self.inputs + i];
            }
            flat[self.b1() + j] = net.b1[j];
            for k in 0..self.outputs {
                flat[self.w2() + k * padded + j] = net.w2[k * self.hidden + j];
            }
        }
        flat[self.b2()..self.b2() + self.outputs].copy_from_slice(&net.b2);
    }

    /// The network of a flat form.
    pub(crate) fn network(self, flat: &[f32]) -> Network {
        let mut net = Network::zeros(self.inputs, self.hidden, self.outputs);
        let padded = self.padded();
        for j in 0..self.hidden {
            for i in 0..self.inputs {
                net.w1[j * self.inputs + i] = flat[i * padded + j];
            }
            net.b1[j] = flat[self.b1() + j];
            for k in 0..self.outputs {
                net.w2[k * self.hidden + j] = flat[self.w2() + k * padded + j];
            }
        }
        net.b2
            .copy_from_slice(&flat[self.b2()..self.b2() + self.outputs]);
        net
    }

    /// The unit-major copy for point lanes: \[hidden\]\[unit()\], then b2.
    pub(crate) fn unit_major(self, flat: &[f32], out: &mut Vec<f32>) {
        let padded = self.padded();
        out.clear();
        for j in 0..self.hidden {
            let column = flat[..self.b2()].chunks_exact(padded);
            out.extend(column.map(|row| row[j]));
        }
        out.extend_from_slice(&flat[self.b2()..self.b2() + self.outputs]);
    }
}

/// Samples in point lanes: \[block\]\[dimension\]\[16\]; the last block is filled up with zeros.
#[derive(Clone, Debug, Default)]
pub(crate) struct Blocks {
    /// Samples.
    pub(crate) count: usize,
    /// Dimensions.
    pub(crate) dims: usize,
    pub(crate) data: Vec<f32>,
}

impl Blocks {
    pub(crate) fn zeros(count: usize, dims: usize) -> Self {
        Self {
            count,
            dims,
            data: vec![0.0; count.div_ceil(LANES) * dims * LANES],
        }
    }

    pub(crate) fn from_matrix(matrix: &Matrix) -> Self {
        let mut blocks = Self::zeros(matrix.rows, matrix.cols);
        for (n, row) in matrix.iter_rows().enumerate() {
            for (i, &value) in row.iter().enumerate() {
                blocks.set(n, i, value);
            }
        }
        blocks
    }

    /// The data from a block on; empty beyond the last.
    pub(crate) fn from(&self, block: usize) -> &[f32] {
        &self.data[(block * self.dims * LANES).min(self.data.len())..]
    }

    /// Number of blocks.
    pub(crate) fn blocks(&self) -> usize {
        self.count.div_ceil(LANES)
    }

    fn index(&self, sample: usize, dim: usize) -> usize {
        (sample / LANES * self.dims + dim) * LANES + sample % LANES
    }
    pub(crate) fn get(&self, sample: usize, dim: usize) -> f32 {
        self.data[self.index(sample, dim)]
    }
    pub(crate) fn set(&mut self, sample: usize, dim: usize, value: f32) {
        let index = self.index(sample, dim);
        self.data[index] = value;
    }
}
