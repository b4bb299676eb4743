//! How far the gripper comes as the recorded hand moves: each axis, and the corners of its space.

use trainer::data::Matrix;
use trainer::hand::Space;
use trainer::model::Model;

use crate::words::gripper_words;

/// A corner of the gripper's space, and how near the recorded hand brings the gripper to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Corner {
    /// Counts.
    pub counts: Vec<f32>,
    /// The nearest image, counts (Euclid).
    pub nearest: f32,
}

/// How far a map reaches.
#[derive(Debug, Clone, PartialEq)]
pub struct Reach {
    /// Least and greatest count of each axis.
    pub ranges: Vec<(f32, f32)>,
    /// The corners, the worst first.
    pub corners: Vec<Corner>,
    /// A corner counts as reached within this distance of an image, counts.
    within: f32,
}

/// A corner counts as reached within this distance in any case, counts: a twentieth of an axis.
const NEAR: f32 = 12.75;

impl Reach {
    /// Of a map on a hand's frames, radians.
    pub fn of(model: &Model, space: Space, frames: &Matrix) -> Self {
        let images = model.map_all(frames);
        let mut corners: Vec<Corner> = corners(space)
            .into_iter()
            .map(|counts| {
                let nearest = images.iter_rows().map(|image| distance(image, &counts));
                Corner {
                    nearest: nearest.fold(f32::INFINITY, f32::min),
                    counts,
                }
            })
            .collect();
        corners.sort_by(|a, b| b.nearest.total_cmp(&a.nearest));
        // As the volume occupancy has it (Eq. 15).
        let epsilon = space.coverage().epsilon(images.rows).unwrap_or_default();
        Self {
            ranges: images.ranges(),
            corners,
            within: NEAR.max(epsilon.sqrt() as f32),
        }
    }

    /// The worst corner in words.
    pub fn words(&self) -> String {
        match self.corners.first() {
            Some(corner) if corner.nearest > self.within => format!(
                "{} is not reachable: nearest {:.0} counts",
                gripper_words(&corner.counts),
                corner.nearest
            ),
            Some(corner) => format!(
                "every corner is reached, {} least: nearest {:.0} counts",
                gripper_words(&corner.counts),
                corner.nearest
            ),
            None => String::new(),
        }
    }
}

fn corners(space: Space) -> Vec<Vec<f32>> {
    let axes = space.axes();
    let corner = |bits: usize| -> Vec<f32> {
        (0..axes)
            .map(|axis| if bits >> axis & 1 == 1 { 255.0 } else { 0.0 })
            .collect()
    };
    (0..1 << axes)
        .map(corner)
        .filter(|counts| space.contains(counts))
        .collect()
}

fn distance(a: &[f32], b: &[f32]) -> f32 {
    let squares = a
        .iter()
        .zip(b)
        .map(|(a, b)| (a.clamp(0.0, 255.0) - b).powi(2));
    squares.sum::<f32>().sqrt()
}
