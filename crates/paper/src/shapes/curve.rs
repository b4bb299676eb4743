//! The outlines of the plane shapes: closed counter-clockwise curves with landmarks, as dense polygons.
//!
//! Lengths are those of the box [−1, 1]², before the scaling of the data sets.

use core::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

/// A point of the plane.
pub type Point = [f64; 2];

/// Sides of the polygon that stands for a smooth piece; its error, below 1e-7, is far below the grid's step.
const SIDES: usize = 2000;
/// Leaves of the clover end here: r(t) = `CLOVER_SIZE`·(1 − 0.52 cos 4t) fills the box.
const CLOVER_SIZE: f64 = 0.868_94;
/// How deep the clover's notches are.
const CLOVER_DEPTH: f64 = 0.52;
/// Largest radius of the clover; the radius of the sphere that it is lifted onto.
pub const CLOVER_RADIUS: f64 = 1.3208;
/// Inner radius of the U.
const U_INNER: f64 = 10.675 / 24.0;
/// Length of the arms of the U.
const U_ARM: f64 = 13.0 / 24.0;

/// The shapes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Shape {
    /// Four leaves on the diagonals.
    Clover,
    /// Half an annulus with straight arms, open at the top.
    U,
    /// The unit circle.
    Circle,
    /// The box itself.
    Square,
    /// (−1, −1), (1, −1), (0, 1).
    Triangle,
}

/// A closed polygon, counter-clockwise, with some vertices marked.
#[derive(Clone, Debug)]
pub struct Curve {
    vertices: Vec<Point>,
    /// Indices of marked vertices, growing; the first is 0.
    landmarks: Vec<usize>,
}

impl Shape {
    /// The outline. Landmarks: the clover's leaf tips and the square's corners from the lower left one on; of the U the bottom's
    /// centre, the middle of the right arm's end, the notch's centre, the middle of the left arm's end; of the circle the bottom and
    /// the top; of the triangle the base's middle, the right corner, the apex, the left corner.
    #[must_use]
    pub fn outline(self) -> Curve {
        match self {
            Self::Clover => Curve::joined(&[0, 1, 2, 3].map(clover_leaf)),
            Self::Circle => Curve::joined(&[
                arc([0.0, 0.0], 1.0, -FRAC_PI_2, FRAC_PI_2),
                arc([0.0, 0.0], 1.0, FRAC_PI_2, 3.0 * FRAC_PI_2),
            ]),
            Self::Square => Curve::joined(&polygon(&[
                [-1.0, -1.0],
                [1.0, -1.0],
                [1.0, 1.0],
                [-1.0, 1.0],
            ])),
            Self::Triangle => Curve::joined(&polygon(&[
                [0.0, -1.0],
                [1.0, -1.0],
                [0.0, 1.0],
                [-1.0, -1.0],
            ])),
            Self::U => u_outline(),
        }
    }
}

/// From one leaf tip to the next; the first starts at the lower left.
fn clover_leaf(leaf: u8) -> Vec<Point> {
    let start = -3.0 * FRAC_PI_4 + f64::from(leaf) * FRAC_PI_2;
    (0..SIDES)
        .map(|i| {
            let t = start + FRAC_PI_2 * i as f64 / SIDES as f64;
            let r = CLOVER_SIZE * (1.0 - CLOVER_DEPTH * libm::cos(4.0 * t));
            [r * libm::cos(t), r * libm::sin(t)]
        })
        .collect()
}

fn u_outline() -> Curve {
    let middle = 0.5 * (1.0 + U_INNER);
    let quarter = |radius, from: f64, to: f64| arc([0.0, 0.0], radius, from, to);
    let mut right_outer = quarter(1.0, -FRAC_PI_2, 0.0);
    right_outer.extend([[1.0, 0.0], [1.0, U_ARM]]);
    let mut right_inner = vec![[middle, U_ARM], [U_INNER, U_ARM]];
    right_inner.extend(quarter(U_INNER, 0.0, -FRAC_PI_2));
    let mut left_inner = quarter(U_INNER, -FRAC_PI_2, -PI);
    left_inner.extend([[-U_INNER, 0.0], [-U_INNER, U_ARM]]);
    let mut left_outer = vec![[-middle, U_ARM], [-1.0, U_ARM]];
    left_outer.extend(quarter(1.0, -PI, -FRAC_PI_2));
    Curve::joined(&[right_outer, right_inner, left_inner, left_outer])
}

/// Points of an arc without its last one.
fn arc(centre: Point, radius: f64, from: f64, to: f64) -> Vec<Point> {
    let sides = libm::ceil(SIDES as f64 * libm::fabs(to - from) / TAU) as usize * 4;
    (0..sides)
        .map(|i| {
            let angle = from + (to - from) * i as f64 / sides as f64;
            [
                centre[0] + radius * libm::cos(angle),
                centre[1] + radius * libm::sin(angle),
            ]
        })
        .collect()
}

/// One piece a corner.
fn polygon(corners: &[Point]) -> Vec<Vec<Point>> {
    corners.iter().map(|corner| vec![*corner]).collect()
}

impl Curve {
    /// Pieces end to end, each without its last point; every piece's first point is a landmark.
    fn joined(pieces: &[Vec<Point>]) -> Self {
        let mut vertices = Vec::new();
        let mut landmarks = Vec::new();
        for piece in pieces {
            landmarks.push(vertices.len());
            vertices.extend_from_slice(piece);
        }
        Self {
            vertices,
            landmarks,
        }
    }

    /// A curve through these vertices, without landmarks but the first.
    #[must_use]
    pub fn through(vertices: Vec<Point>) -> Self {
        Self {
            vertices,
            landmarks: vec![0],
        }
    }

    /// The same curve with only the first of every two landmarks.
    #[must_use]
    pub fn every_second_landmark(&self) -> Self {
        Self {
            vertices: self.vertices.clone(),
            landmarks: self.landmarks.iter().copied().step_by(2).collect(),
        }
    }

    /// The vertices, counter-clockwise.
    #[must_use]
    pub fn vertices(&self) -> &[Point] {
        &self.vertices
    }

    /// Its sides, from point to point, the last back to the first.
    fn sides(&self) -> impl Iterator<Item = (Point, Point)> + '_ {
        let next = self.vertices.iter().cycle().skip(1);
        self.vertices.iter().copied().zip(next.copied())
    }

    /// True for points inside (crossing number; a point on the outline may be either).
    #[must_use]
    pub fn contains(&self, [x, y]: Point) -> bool {
        let mut inside = false;
        for (a, b) in self.sides() {
            if (a[1] > y) != (b[1] > y) {
                let crossing = a[0] + (y - a[1]) * (b[0] - a[0]) / (b[1] - a[1]);
                inside ^= x < crossing;
            }
        }
        inside
    }

    /// Distance of a point to the outline.
    #[must_use]
    pub fn distance(&self, point: Point) -> f64 {
        let squared = self.sides().map(|(a, b)| to_side(point, a, b));
        libm::sqrt(squared.fold(f64::INFINITY, f64::min))
    }

    /// Area inside (shoelace formula).
    #[must_use]
    pub fn area(&self) -> f64 {
        let cross = self.sides().map(|(a, b)| a[0] * b[1] - a[1] * b[0]);
        0.5 * cross.sum::<f64>()
    }

    /// `count` points on the outline, the same number between every two landmarks (`count` is a multiple of their number), starting
    /// at the first, at equal distances within a segment. Distances are measured after `lift`.
    #[must_use]
    pub fn spread<const D: usize>(
        &self,
        count: usize,
        lift: impl Fn(Point) -> [f64; D],
    ) -> Vec<Point> {
        let each = count / self.landmarks.len();
        let mut points = Vec::with_capacity(count);
        for (segment, &start) in self.landmarks.iter().enumerate() {
            let end = self.landmarks.get(segment + 1);
            let end = end.copied().unwrap_or(self.vertices.len());
            let chain: Vec<Point> = (start..=end)
                .map(|i| self.vertices[i % self.vertices.len()])
                .collect();
            points.extend(along(&refined(&chain), each, &lift));
        }
        points
    }
}

/// Long straight sides in short pieces, so that lengths after a lift are right.
fn refined(chain: &[Point]) -> Vec<Point> {
    const LONGEST: f64 = 0.002;
    let mut fine = Vec::new();
    for two in chain.windows(2) {
        let length = libm::hypot(two[1][0] - two[0][0], two[1][1] - two[0][1]);
        let pieces = libm::ceil(length / LONGEST).max(1.0) as usize;
        fine.extend((0..pieces).map(|i| between(two[0], two[1], i as f64 / pieces as f64)));
    }
    fine.extend(chain.last());
    fine
}

/// `count` points at equal distances, the first at the start, none at the end.
fn along<const D: usize>(
    chain: &[Point],
    count: usize,
    lift: &impl Fn(Point) -> [f64; D],
) -> Vec<Point> {
    let mut lengths = vec![0.0];
    let mut total = 0.0;
    for two in chain.windows(2) {
        let (a, b) = (lift(two[0]), lift(two[1]));
        let squares = a.iter().zip(&b).map(|(a, b)| (a - b) * (a - b));
        total += libm::sqrt(squares.sum::<f64>());
        lengths.push(total);
    }
    (0..count)
        .map(|i| {
            let wanted = total * i as f64 / count as f64;
            let side = lengths.partition_point(|&length| length <= wanted);
            let side = side.clamp(1, chain.len() - 1);
            let part = (wanted - lengths[side - 1]) / (lengths[side] - lengths[side - 1]);
            between(chain[side - 1], chain[side], part)
        })
        .collect()
}

fn between(a: Point, b: Point, part: f64) -> Point {
    [a[0] + (b[0] - a[0]) * part, a[1] + (b[1] - a[1]) * part]
}

/// Squared distance of a point to a side.
fn to_side(point: Point, a: Point, b: Point) -> f64 {
    let side = [b[0] - a[0], b[1] - a[1]];
    let length = side[0] * side[0] + side[1] * side[1];
    let dot = (point[0] - a[0]) * side[0] + (point[1] - a[1]) * side[1];
    let part = if length > 0.0 { dot / length } else { 0.0 };
    let near = between(a, b, part.clamp(0.0, 1.0));
    (point[0] - near[0]) * (point[0] - near[0]) + (point[1] - near[1]) * (point[1] - near[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_are_those_of_the_formulas() {
        // Clover: ½∫r² dt = π c² (1 + 0.52²/2).
        let clover = PI * CLOVER_SIZE * CLOVER_SIZE * (1.0 + 0.52 * 0.52 / 2.0);
        let u = FRAC_PI_2 * (1.0 - U_INNER * U_INNER) + 2.0 * U_ARM * (1.0 - U_INNER);
        for (shape, area) in [
            (Shape::Clover, clover),
            (Shape::U, u),
            (Shape::Circle, PI),
            (Shape::Square, 4.0),
            (Shape::Triangle, 2.0),
        ] {
            let found = shape.outline().area();
            assert!((found - area).abs() < 2e-5, "{shape:?} {found} {area}");
        }
    }

    #[test]
    fn the_clover_fills_the_box_and_its_leaves_end_on_the_diagonals() {
        let clover = Shape::Clover.outline();
        let widest = clover.vertices().iter().fold(0.0, |w: f64, p| w.max(p[0]));
        assert!((widest - 1.0).abs() < 1e-4, "{widest}");
        let farthest = clover.vertices().iter().map(|p| libm::hypot(p[0], p[1]));
        let farthest = farthest.fold(0.0, f64::max);
        assert!((farthest - CLOVER_RADIUS).abs() < 1e-4, "{farthest}");
        let tip = clover.vertices()[0];
        assert!(tip[0] < 0.0 && (tip[0] - tip[1]).abs() < 1e-12);
    }

    #[test]
    fn inside_and_distance_of_a_square_are_plain() {
        let square = Shape::Square.outline();
        assert!(square.contains([0.9, -0.9]) && !square.contains([1.1, 0.0]));
        assert!((square.distance([0.75, 0.1]) - 0.25).abs() < 1e-12);
        assert!((square.distance([2.0, 2.0]) - libm::sqrt(2.0)).abs() < 1e-12);
    }

    #[test]
    fn spread_points_start_at_landmarks_and_keep_equal_distances() {
        let points = Shape::U.outline().spread(456, |p| p);
        assert_eq!(points.len(), 456);
        let near =
            |i: usize, p: Point| libm::hypot(points[i][0] - p[0], points[i][1] - p[1]) < 1e-9;
        assert!(near(0, [0.0, -1.0]) && near(228, [0.0, -U_INNER]));
        assert!(near(114, [0.5 * (1.0 + U_INNER), U_ARM]));
        let gap = |i: usize| {
            libm::hypot(
                points[i + 1][0] - points[i][0],
                points[i + 1][1] - points[i][1],
            )
        };
        assert!((gap(10) - gap(60)).abs() < 1e-5);
    }
}
