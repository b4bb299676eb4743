//! SP1 to SP4: input shape, target shape, lifts, matched points, truth.

use super::curve::{CLOVER_RADIUS, Curve, Point, Shape};
use super::harmonic::{Laplacian, Singular};
use super::mesh::{Mesh, Node, double_area, interior};
use trainer::data::{Matrix, Pairs};
use trainer::random::Random;

/// Size of everything, relative to the box: sets the balance of the cost's terms.
const SIZE: f64 = 2.0;

/// The four input–target pairs of Figure 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ShapePair {
    /// Clover on a sphere to square.
    Sp1,
    /// U on a cylinder to triangle.
    Sp2,
    /// Circle on a cylinder to U.
    Sp3,
    /// Square to clover on a sphere.
    Sp4,
}

/// The samples of a pair.
#[derive(Clone, Debug)]
pub struct Domains {
    /// Input and target of every grid node of the input shape, from the harmonic map.
    pub truth: Pairs,
    /// The matched points of the outlines, counter-clockwise.
    pub boundary: Pairs,
    /// Column and row of every node in the 49×49 grid, for drawing.
    pub grid: Vec<[usize; 2]>,
    /// Area of the target, for ε of the volume occupancy.
    pub target_volume: f64,
    /// Intrinsic dimension of the target: 2, also for a surface in space.
    pub target_dimension: usize,
}

impl ShapePair {
    /// All four.
    pub const ALL: [Self; 4] = [Self::Sp1, Self::Sp2, Self::Sp3, Self::Sp4];

    /// SP1 … SP4.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sp1 => "SP1",
            Self::Sp2 => "SP2",
            Self::Sp3 => "SP3",
            Self::Sp4 => "SP4",
        }
    }

    /// What is mapped to what.
    #[must_use]
    pub const fn description(self) -> &'static str {
        match self {
            Self::Sp1 => "3D clover to 2D square",
            Self::Sp2 => "3D U-shape to 2D triangle",
            Self::Sp3 => "3D circle to 2D U-shape",
            Self::Sp4 => "2D square to 3D clover",
        }
    }

    /// Input shape, target shape, size of the target's plane outline relative to the box, number of matched points.
    const fn parts(self) -> (Shape, Shape, f64, usize) {
        match self {
            Self::Sp1 => (Shape::Clover, Shape::Square, 0.75, 440),
            Self::Sp2 => (Shape::U, Shape::Triangle, 0.6, 456),
            Self::Sp3 => (Shape::Circle, Shape::U, 0.87, 436),
            Self::Sp4 => (Shape::Square, Shape::Clover, 1.0, 440),
        }
    }

    /// Size of the input's plane outline relative to the box.
    const fn input_scale(self) -> f64 {
        if matches!(self, Self::Sp4) { 0.75 } else { 1.0 }
    }

    /// Grid nodes with their images under the harmonic map, matched points, area of the target.
    ///
    /// # Errors
    /// [`Singular`], which none of the four pairs gives.
    pub fn build(self) -> Result<Domains, Singular> {
        let (input, target, target_scale, count) = self.parts();
        let (from, to) = (input.outline(), target.outline());
        let nodes = interior(&from);
        let matched = self.matched(&from, &to, count);
        let images = self.images(&nodes, &matched)?;
        let pair = |places: &[Point], images: &[Vec<f64>]| Pairs {
            inputs: matrix(places.iter().map(|&p| self.input(p))),
            targets: matrix(images.iter().map(|image| {
                let scaled = image.iter().map(|value| value * target_scale * SIZE);
                scaled.collect()
            })),
        };
        let places: Vec<Point> = nodes.iter().map(|node| node.point).collect();
        let outline_images: Vec<Vec<f64>> =
            matched.to.iter().map(|&p| self.target_lift(p)).collect();
        Ok(Domains {
            truth: pair(&places, &images),
            boundary: pair(&matched.from, &outline_images),
            grid: nodes.iter().map(|node| node.index).collect(),
            target_volume: self.target_volume(&to),
            target_dimension: 2,
        })
    }

    /// `count` samples, uniform in the target's plane shape, then lifted.
    #[must_use]
    pub fn sample_targets(self, count: usize, seed: u64) -> Matrix {
        let (_, target, scale, _) = self.parts();
        let outline = target.outline();
        let mut random = Random::new(seed, TARGET_STREAM);
        let samples = core::iter::repeat_with(|| [0, 1].map(|_| 2.0 * random.unit_f64() - 1.0));
        let inside = samples.filter(|&point| outline.contains(point)).take(count);
        matrix(inside.map(|point| {
            let lifted = self.target_lift(point).into_iter();
            lifted.map(|value| value * scale * SIZE).collect()
        }))
    }

    /// An input of the pair from its place in the plane.
    fn input(self, point: Point) -> Vec<f64> {
        let scale = self.input_scale() * SIZE;
        let [x, y, z] = match self {
            Self::Sp1 => onto_sphere(point),
            Self::Sp2 | Self::Sp3 => onto_cylinder(point),
            Self::Sp4 => return point.map(|value| value * scale).to_vec(),
        };
        vec![x * scale, y * scale, z * scale]
    }

    /// A target from its place in the plane, before scaling.
    fn target_lift(self, point: Point) -> Vec<f64> {
        match self {
            Self::Sp4 => onto_sphere(point).to_vec(),
            _ => point.to_vec(),
        }
    }

    /// Points of both outlines that belong together.
    fn matched(self, from: &Curve, to: &Curve, count: usize) -> Matched {
        let plane = |[x, y]: Point| [x, y, 0.0];
        match self {
            Self::Sp1 => Matched {
                from: from.spread(count, onto_sphere),
                to: to.spread(count, plane),
            },
            Self::Sp2 => Matched {
                from: from.spread(count, onto_cylinder),
                to: to.spread(count, plane),
            },
            // The circle has two landmarks, of the U only the bottom's and the notch's centre count.
            Self::Sp3 => Matched {
                from: from.spread(count, onto_cylinder),
                to: to.every_second_landmark().spread(count, plane),
            },
            Self::Sp4 => Matched {
                from: from.spread(count, plane),
                to: to.spread(count, onto_sphere),
            },
        }
    }

    /// The harmonic image of every node, before scaling.
    fn images(self, nodes: &[Node], matched: &Matched) -> Result<Vec<Vec<f64>>, Singular> {
        let places: Vec<Point> = nodes.iter().map(|node| node.point).collect();
        let (mesh, lift): (Mesh, fn(Point) -> [f64; 3]) = match self {
            Self::Sp1 => (Mesh::new(&places, &matched.from), onto_sphere),
            Self::Sp2 => (Mesh::new(&places, &matched.from), onto_cylinder),
            Self::Sp3 => return inverse_of_u(&places, matched),
            Self::Sp4 => (Mesh::new(&places, &matched.from), |[x, y]| [x, y, 0.0]),
        };
        let corners: Vec<[f64; 3]> = mesh.points.iter().map(|&p| lift(p)).collect();
        let laplacian = Laplacian::new(&mesh, &corners)?;
        Ok(if self == Self::Sp4 {
            let outline: Vec<[f64; 3]> = matched.to.iter().map(|&p| onto_sphere(p)).collect();
            let images = laplacian.harmonic_into_sphere(&outline, CLOVER_RADIUS);
            images.iter().map(|image| image.to_vec()).collect()
        } else {
            let images = laplacian.harmonic(&matched.to);
            images.iter().map(|image| image.to_vec()).collect()
        })
    }

    fn target_volume(self, outline: &Curve) -> f64 {
        let (_, _, scale, _) = self.parts();
        let scale = scale * SIZE;
        let area = match self {
            // Each triangle (0, a, b) of the plane carries R² · angle − R · ∫√(R² − r²) dangle of the sphere.
            Self::Sp4 => cap_area(outline),
            _ => outline.area(),
        };
        area * scale * scale
    }
}

/// Random numbers of the target samples; other uses of one seed take other streams.
const TARGET_STREAM: u64 = 0x5441_5247;

/// Points of two outlines; those with equal index belong together.
struct Matched {
    from: Vec<Point>,
    to: Vec<Point>,
}

/// U is not convex: a harmonic map into it leaves it and folds. The map from the U to the circle's cylinder, rolled out flat, is into
/// a convex shape, so it is one to one (Radó, Kneser, Choquet); its inverse is the truth.
fn inverse_of_u(places: &[Point], matched: &Matched) -> Result<Vec<Vec<f64>>, Singular> {
    let u_nodes: Vec<Point> = (interior(&Shape::U.outline()).iter())
        .map(|node| node.point)
        .collect();
    let mesh = Mesh::new(&u_nodes, &matched.to);
    let rim: Vec<Point> = matched.from.iter().map(|&p| rolled_out(p)).collect();
    let mut images = Laplacian::new(&mesh, &mesh.points)?.harmonic(&rim);
    images.extend(rim);
    Ok(places
        .iter()
        .map(|&place| pull_back(&mesh, &images, rolled_out(place)).to_vec())
        .collect())
}

/// The point of the mesh whose image is `point`. Outside all triangles by a hair, the nearest one answers.
fn pull_back(mesh: &Mesh, images: &[Point], point: Point) -> Point {
    let mut best = (f64::NEG_INFINITY, [0.0; 2]);
    for &[a, b, c] in &mesh.triangles {
        let (ia, ib, ic) = (images[a], images[b], images[c]);
        let area = double_area(ia, ib, ic);
        let weights = [
            double_area(point, ib, ic) / area,
            double_area(ia, point, ic) / area,
            double_area(ia, ib, point) / area,
        ];
        let least = weights.iter().copied().fold(f64::INFINITY, f64::min);
        if least > best.0 {
            let corners = [a, b, c].map(|i| mesh.points[i]);
            let place = [0, 1].map(|axis| (0..3).map(|k| weights[k] * corners[k][axis]).sum());
            best = (least, place);
        }
        if least >= 0.0 {
            break;
        }
    }
    best.1
}

fn onto_sphere([x, y]: Point) -> [f64; 3] {
    let squared = CLOVER_RADIUS * CLOVER_RADIUS - x * x - y * y;
    [x, y, libm::sqrt(squared.max(0.0))]
}

fn onto_cylinder([x, y]: Point) -> [f64; 3] {
    [x, y, libm::sqrt((1.0 - x * x).max(0.0))]
}

/// The cylinder's surface, rolled out: length along it from x = 0, and y.
fn rolled_out([x, y]: Point) -> Point {
    [libm::asin(x.clamp(-1.0, 1.0)), y]
}

/// Area of the sphere above a star-shaped outline: ∫ (R² − R √(R² − r²)) dangle.
fn cap_area(outline: &Curve) -> f64 {
    let vertices = outline.vertices();
    let next = vertices.iter().cycle().skip(1);
    let slices = vertices.iter().zip(next).map(|(a, b)| {
        let angle = libm::atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]);
        let squared = 0.5 * (a[0] * a[0] + a[1] * a[1] + b[0] * b[0] + b[1] * b[1]);
        let height = libm::sqrt((CLOVER_RADIUS * CLOVER_RADIUS - squared).max(0.0));
        angle * CLOVER_RADIUS * (CLOVER_RADIUS - height)
    });
    slices.sum()
}

fn matrix(rows: impl Iterator<Item = Vec<f64>>) -> Matrix {
    let mut samples = Matrix::default();
    for row in rows {
        let row: Vec<f32> = row.into_iter().map(|value| value as f32).collect();
        samples.push(&row);
    }
    samples
}

#[cfg(test)]
mod tests;
