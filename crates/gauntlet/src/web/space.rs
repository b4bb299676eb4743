//! The gripper's space for the page's map: what of it the hand reaches.

use host::trainer::data::Matrix;
use host::trainer::hand::{Draw, Space};
use paper::principal::Principal;

use super::picture::Map;

/// Points drawn of the gripper's space.
const POINTS: usize = 500;
/// Points of it that decide where its principal axes lie.
const CLOUD: usize = 4_000;
/// Of everything random here: the same space looks the same each time.
const SEED: u64 = 1;

/// The map of a gripper's `space`: which of its points lie near one of `images` (where the hand's poses are mapped to, counts), and the
/// reference points, counts. Near is as near as for the volume occupancy (Eq. 15, 16).
pub fn space_map(space: Space, images: &Matrix, references: &Matrix) -> Map {
    let cloud = space.samples(CLOUD, SEED, Draw::Measure);
    let principal = Principal::of(&cloud, 2);
    let points = space.samples(POINTS, SEED, Draw::Train);
    let near = space.coverage().epsilon(images.rows.max(1));
    let near = near.unwrap_or_default() as f32;
    let mut map = Map {
        centre: mean(&cloud),
        axes: axes(&principal, cloud.cols),
        references: flat(&principal.project(references)),
        ..Map::default()
    };
    for (point, at) in points.iter_rows().zip(flat(&principal.project(&points))) {
        let reached = images
            .iter_rows()
            .any(|image| square_distance(point, image) <= near);
        match reached {
            true => map.covered.push(at),
            false => map.uncovered.push(at),
        }
    }
    map.words = format!(
        "{} of {POINTS} points of the gripper's space have a hand pose near them",
        map.covered.len()
    );
    map
}

fn square_distance(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

fn mean(samples: &Matrix) -> Vec<f32> {
    let mut sums = vec![0.0; samples.cols];
    for row in samples.iter_rows() {
        for (sum, value) in sums.iter_mut().zip(row) {
            *sum += f64::from(*value);
        }
    }
    let rows = samples.rows.max(1) as f64;
    sums.into_iter()
        .map(|sum: f64| (sum / rows) as f32)
        .collect()
}

/// The principal axes: how a step along each of the gripper's axes is projected.
fn axes(principal: &Principal, columns: usize) -> [Vec<f32>; 2] {
    let mut steps = Matrix::default();
    steps.push(&vec![0.0; columns]);
    for axis in 0..columns {
        let mut step = vec![0.0; columns];
        step[axis] = 1.0;
        steps.push(&step);
    }
    let along = flat(&principal.project(&steps));
    let (origin, steps) = along
        .split_first()
        .map_or(([0.0; 2], &[][..]), |(o, s)| (*o, s));
    [0, 1].map(|k| steps.iter().map(|step| step[k] - origin[k]).collect())
}

/// Two numbers a point; with one axis the second is 0.
fn flat(projected: &Matrix) -> Vec<[f32; 2]> {
    let point = |row: &[f32]| [0, 1].map(|k| row.get(k).copied().unwrap_or(0.0));
    projected.iter_rows().map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_near_an_image_is_reached_and_the_page_can_place_a_point_itself() {
        let space = Space::ThreeFinger;
        let everywhere = space.samples(2_000, 9, Draw::Stream(7));
        let references = Matrix::from_rows(&[[0.0, 0.0, 0.0, 137.0], [255.0, 255.0, 255.0, 137.0]]);
        let map = space_map(space, &everywhere, &references);
        assert!(map.covered.len() > 9 * POINTS / 10, "{}", map.words);
        let still = Matrix::from_rows(&[[20.0, 20.0, 20.0, 137.0]; 2_000]);
        let nowhere = space_map(space, &still, &references);
        assert!(nowhere.covered.len() < POINTS / 20, "{}", nowhere.words);
        for (row, at) in references.iter_rows().zip(&map.references) {
            for (k, axis) in map.axes.iter().enumerate() {
                let placed: f32 = (0..4).map(|j| axis[j] * (row[j] - map.centre[j])).sum();
                assert!((placed - at[k]).abs() < 0.1, "{placed} {at:?}");
            }
        }
    }

    #[test]
    fn a_gripper_of_one_axis_lies_on_a_line() {
        let images = Matrix::from_rows(&[[10.0], [200.0]]);
        let map = space_map(Space::OneAxis, &images, &images);
        assert_eq!(map.axes[1], [0.0]);
        assert!(map.references.iter().all(|at| at[1] == 0.0));
    }
}
