//! The trainer: learns the map from hand poses to gripper poses (the harmonic autoencoder, HAE) from samples of two
//! domains and a few reference pairs.
//!
//! Eq. n and § n cite "A learning-based harmonic mapping: Framework, assessment, and case study of human-to-robot hand
//! pose mapping"; where the paper leaves a choice open, the module that makes it says so. The mathematical half:
//! [`network`], [`cost`], [`optimizer`], [`algorithm`], [`measures`], [`neighbours`], with the fast arithmetic in
//! `kernel`. The other half brings data in and models out: [`data`], [`operator`], [`model`], and [`hand`] for the hand.
//!
//! Results depend on the seed alone: not on the number of threads, nor on which vector instructions the machine has.

pub mod algorithm;
pub mod cost;
pub mod data;
pub mod hand;
mod hexadecimal;
pub(crate) mod kernel;
pub mod measures;
pub mod model;
pub mod neighbours;
pub mod network;
pub mod operator;
pub mod optimizer;
pub(crate) mod pool;
pub mod random;
pub mod remedy;
pub mod spread;
pub mod whole_file;
