//! The synthetic data of §3.2: four pairs of shapes, their grids, matched outlines, the harmonic map between them as ground truth,
//! and uniform samples of the targets.
//!
//! The paper draws the shapes and gives their numbers of nodes; sizes, lifts and matching here are chosen so that those numbers come
//! out exactly. Distances along an outline are measured on the surface. Everything of a pair is twice the size of the box [−1, 1]².

pub mod curve;
pub mod files;
pub mod harmonic;
pub mod mesh;
mod pair;

pub use harmonic::Singular;
pub use pair::{Domains, ShapePair};
