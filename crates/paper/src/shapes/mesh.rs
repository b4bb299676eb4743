//! The grid nodes inside a shape, and a triangle mesh of nodes and outline (Delaunay, by Bowyer and Watson's insertion).

use super::curve::{Curve, Point};
use trainer::random::Random;

/// Nodes along a side of the box.
pub const NODES: usize = 49;
/// Step of the grid.
pub const STEP: f64 = 2.0 / 48.0;
/// A node counts as interior at this distance from the outline.
pub const CLEARANCE: f64 = STEP * 2.0 / 3.0;

/// A node of the grid: column and row from the lower left, and its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// Column and row, from 0.
    pub index: [usize; 2],
    /// Place in the box.
    pub point: Point,
}

/// The grid's nodes inside the curve and at least [`CLEARANCE`] away from it, row by row.
#[must_use]
pub fn interior(curve: &Curve) -> Vec<Node> {
    let mut nodes = Vec::new();
    for row in 0..NODES {
        for column in 0..NODES {
            // Symmetric about 0 to the last bit, so that a symmetric shape has symmetric nodes.
            let place = |i: usize| (i as f64 - 24.0) / 24.0;
            let point = [place(column), place(row)];
            // A hair less, so that rounding decides nothing.
            if curve.contains(point) && curve.distance(point) >= CLEARANCE - 1e-9 {
                nodes.push(Node {
                    index: [column, row],
                    point,
                });
            }
        }
    }
    nodes
}

/// Triangles over some points, counter-clockwise.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// First the inner points, then those of the outline.
    pub points: Vec<Point>,
    /// Number of inner points.
    pub inner: usize,
    /// Indices of the corners.
    pub triangles: Vec<[usize; 3]>,
}

impl Mesh {
    /// A mesh of the polygon through `outline` with the given inner points. The outline's points must lie closer together than the
    /// inner points are to it: then every side of the outline is an edge of the mesh.
    #[must_use]
    pub fn new(inner: &[Point], outline: &[Point]) -> Self {
        let points: Vec<Point> = inner.iter().chain(outline).copied().collect();
        let polygon = Curve::through(outline.to_vec());
        let triangles = delaunay(&shaken(&points, inner.len()))
            .into_iter()
            .filter(|&[a, b, c]| {
                let (a, b, c) = (points[a], points[b], points[c]);
                // Three points of a straight side make a triangle without area.
                let centre = [(a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0];
                double_area(a, b, c) > 1e-5 * STEP * STEP && polygon.contains(centre)
            })
            .collect();
        Self {
            points,
            inner: inner.len(),
            triangles,
        }
    }
}

/// Twice the signed area; positive when a, b, c go counter-clockwise.
#[must_use]
pub fn double_area(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Inner points moved by a hair, for the choice of triangles only: four grid nodes on one circle have no Delaunay triangulation of
/// their own, and rounding must not choose.
fn shaken(points: &[Point], inner: usize) -> Vec<Point> {
    let mut random = Random::new(0, 0);
    let mut moved = points.to_vec();
    for value in moved[..inner].iter_mut().flatten() {
        *value += 1e-6 * STEP * (random.unit_f64() - 0.5);
    }
    moved
}

/// Corners far outside everything; the three of a triangle that holds the box.
const FAR: [Point; 3] = [[-3e3, -2e3], [3e3, -2e3], [0.0, 4e3]];

/// The Delaunay triangles of points in general position, counter-clockwise.
fn delaunay(points: &[Point]) -> Vec<[usize; 3]> {
    let count = points.len();
    let place = |i: usize| points.get(i).copied().unwrap_or_else(|| FAR[i - count]);
    let mut triangles = vec![[count, count + 1, count + 2]];
    for (new, &point) in points.iter().enumerate() {
        let mut edges: Vec<[usize; 2]> = Vec::new();
        triangles.retain(|&[a, b, c]| {
            let hit = in_circle(place(a), place(b), place(c), point);
            if hit {
                edges.extend([[a, b], [b, c], [c, a]]);
            }
            !hit
        });
        // The edges of the hole are those that no other removed triangle had.
        let rim = edges
            .iter()
            .filter(|[a, b]| !edges.contains(&[*b, *a]))
            .map(|&[a, b]| [a, b, new]);
        triangles.extend(rim);
    }
    triangles.retain(|corners| corners.iter().all(|&i| i < count));
    triangles
}

/// True when `d` lies inside the circle through a, b, c (counter-clockwise).
fn in_circle(a: Point, b: Point, c: Point, d: Point) -> bool {
    let row = |p: Point| {
        let (x, y) = (p[0] - d[0], p[1] - d[1]);
        (x, y, x * x + y * y)
    };
    let ((ax, ay, aw), (bx, by, bw), (cx, cy, cw)) = (row(a), row(b), row(c));
    ax * (by * cw - bw * cy) - ay * (bx * cw - bw * cx) + aw * (bx * cy - by * cx) > 0.0
}

#[cfg(test)]
mod tests {
    use super::super::curve::Shape;
    use super::*;

    #[test]
    fn the_grids_have_the_papers_numbers_of_nodes() {
        for (shape, count) in [
            (Shape::Clover, 1409),
            (Shape::U, 952),
            (Shape::Circle, 1709),
            (Shape::Square, 2209),
        ] {
            assert_eq!(interior(&shape.outline()).len(), count, "{shape:?}");
        }
    }

    /// Euler: a disc of V points, B of them on its rim, has 2V − B − 2 triangles; and they fill it.
    #[test]
    fn a_mesh_is_a_disc_that_fills_its_outline() {
        for (shape, count) in [
            (Shape::Clover, 440),
            (Shape::U, 456),
            (Shape::Circle, 436),
            (Shape::Square, 440),
        ] {
            let curve = shape.outline();
            let outline = curve.spread(count, |p| p);
            let inner: Vec<Point> = interior(&curve).iter().map(|node| node.point).collect();
            let mesh = Mesh::new(&inner, &outline);
            let expected = 2 * mesh.points.len() - count - 2;
            assert_eq!(mesh.triangles.len(), expected, "{shape:?}");
            let areas = mesh.triangles.iter().map(|&[a, b, c]| {
                0.5 * double_area(mesh.points[a], mesh.points[b], mesh.points[c])
            });
            let filled: f64 = areas.sum();
            let area = Curve::through(outline).area();
            assert!((filled - area).abs() < 1e-9, "{shape:?} {filled} {area}");
        }
    }

    #[test]
    fn no_point_lies_within_the_circle_of_a_triangle() {
        let mut random = Random::new(4, 0);
        let points: Vec<Point> = (0..120)
            .map(|_| [random.unit_f64(), random.unit_f64()])
            .collect();
        let triangles = delaunay(&points);
        assert!(triangles.len() > 150);
        for &[a, b, c] in &triangles {
            let others = (0..points.len()).filter(|i| ![a, b, c].contains(i));
            let (a, b, c) = (points[a], points[b], points[c]);
            assert!(double_area(a, b, c) > 0.0);
            assert!(others.into_iter().all(|i| !in_circle(a, b, c, points[i])));
        }
    }
}
