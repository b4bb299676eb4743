//! Harmonic maps of a mesh by linear finite elements: the cotangent Laplacian (Pinkall and Polthier 1993) of a surface in space,
//! given values at the outline, a sparse LU of the rest.

use super::mesh::Mesh;
use rsparse::data::{Sprs, Trpl};

/// The outline's values do not fix the inside: the Laplacian is singular, which no mesh of this crate gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the Laplacian of the mesh is singular; the mesh has a part without outline")]
pub struct Singular;

/// The Laplacian of a mesh, factored.
pub struct Laplacian {
    inner: usize,
    /// Off-diagonal entries of the inner rows: column and value.
    rows: Vec<Vec<(usize, f64)>>,
    factors: Factors,
}

/// P·L·U·Q of the inner block.
struct Factors {
    lower: Sprs<f64>,
    upper: Sprs<f64>,
    row_place: Vec<isize>,
    column_order: Vec<isize>,
}

impl Laplacian {
    /// Of the surface that has the mesh's triangles and these corners in space.
    ///
    /// # Errors
    /// [`Singular`].
    pub fn new<const D: usize>(mesh: &Mesh, corners: &[[f64; D]]) -> Result<Self, Singular> {
        let mut rows: Vec<Vec<(usize, f64)>> = vec![Vec::new(); mesh.inner];
        for triangle in &mesh.triangles {
            for k in 0..3 {
                let [i, j, opposite] = [0, 1, 2].map(|turn| triangle[(k + turn) % 3]);
                let weight = -0.5 * cotangent(corners[opposite], corners[i], corners[j]);
                add(&mut rows, i, j, weight);
                add(&mut rows, j, i, weight);
            }
        }
        let factors = Factors::of(&rows)?;
        Ok(Self {
            inner: mesh.inner,
            rows,
            factors,
        })
    }

    /// The discrete harmonic function with these values at the outline: values at the inner points, column by column.
    #[must_use]
    pub fn harmonic<const D: usize>(&self, outline: &[[f64; D]]) -> Vec<[f64; D]> {
        self.solve(&vec![[0.0; D]; self.inner], outline)
    }

    /// The x with L x = `source` inside and the outline's values outside.
    fn solve<const D: usize>(&self, source: &[[f64; D]], outline: &[[f64; D]]) -> Vec<[f64; D]> {
        let mut solution = vec![[0.0; D]; self.inner];
        for column in 0..D {
            let right: Vec<f64> = (self.rows.iter().zip(source))
                .map(|(row, source)| {
                    let known = row.iter().filter(|(j, _)| *j >= self.inner);
                    let moved = known.map(|&(j, w)| w * outline[j - self.inner][column]);
                    source[column] - moved.sum::<f64>()
                })
                .collect();
            let values = self.factors.solve(&right);
            for (point, value) in solution.iter_mut().zip(values) {
                point[column] = value;
            }
        }
        solution
    }

    /// L x at the inner points, for values at all points (inner first).
    #[must_use]
    pub fn apply<const D: usize>(&self, values: &[[f64; D]]) -> Vec<[f64; D]> {
        self.rows
            .iter()
            .enumerate()
            .map(|(i, row)| {
                let mut sum = [0.0; D];
                for &(j, weight) in row {
                    // The diagonal is minus the sum of the row: differences lose no digits.
                    for (sum, (there, here)) in sum.iter_mut().zip(values[j].iter().zip(&values[i]))
                    {
                        *sum += weight * (there - here);
                    }
                }
                sum
            })
            .collect()
    }

    /// The harmonic map into the sphere of `radius` about 0 with these values (on the sphere) at the outline: at every inner point
    /// L x = μ x. Each round solves L x = μ x with the μ = x·(L x)/R² and x of the round before and puts x back onto the sphere,
    /// until nothing moves by more than 1e-10, at most 1000 rounds.
    #[must_use]
    pub fn harmonic_into_sphere(&self, outline: &[[f64; 3]], radius: f64) -> Vec<[f64; 3]> {
        let onto = |point: [f64; 3]| {
            let length = libm::sqrt(dot(point, point));
            point.map(|value| value * radius / length)
        };
        let mut inner: Vec<[f64; 3]> = self.harmonic(outline).into_iter().map(onto).collect();
        for _ in 0..1000 {
            let all: Vec<[f64; 3]> = inner.iter().chain(outline).copied().collect();
            let source: Vec<[f64; 3]> = (self.apply(&all).into_iter().zip(&inner))
                .map(|(image, &x)| {
                    let mu = dot(x, image) / (radius * radius);
                    x.map(|value| mu * value)
                })
                .collect();
            let next: Vec<[f64; 3]> = self.solve(&source, outline).into_iter().map(onto).collect();
            let moved = (next.as_flattened().iter().zip(inner.as_flattened()))
                .fold(0.0, |most: f64, (a, b)| most.max(libm::fabs(a - b)));
            inner = next;
            if moved < 1e-10 {
                break;
            }
        }
        inner
    }
}

impl Factors {
    /// LU with the approximate minimum degree order of A + Aᵀ and diagonal pivots while they are good.
    fn of(rows: &[Vec<(usize, f64)>]) -> Result<Self, Singular> {
        let mut entries = Trpl::new();
        for (i, row) in rows.iter().enumerate() {
            let diagonal: f64 = row.iter().map(|(_, weight)| -weight).sum();
            entries.append(i, i, diagonal);
            for &(j, weight) in row.iter().filter(|(j, _)| *j < rows.len()) {
                entries.append(i, j, weight);
            }
        }
        (entries.m, entries.n) = (rows.len(), rows.len());
        let matrix = entries.to_sprs();
        let mut plan = rsparse::sqr(&matrix, 0, false);
        let factors = rsparse::lu(&matrix, &mut plan, 1e-3).map_err(|_| Singular)?;
        Ok(Self {
            lower: factors.l,
            upper: factors.u,
            row_place: factors.pinv.ok_or(Singular)?,
            column_order: plan.q.ok_or(Singular)?,
        })
    }

    fn solve(&self, right: &[f64]) -> Vec<f64> {
        let mut x = vec![0.0; right.len()];
        for (&place, &value) in self.row_place.iter().zip(right) {
            x[place as usize] = value;
        }
        rsparse::lsolve(&self.lower, &mut x);
        rsparse::usolve(&self.upper, &mut x);
        let mut solution = vec![0.0; right.len()];
        for (&place, &value) in self.column_order.iter().zip(&x) {
            solution[place as usize] = value;
        }
        solution
    }
}

/// Adds to the entry (i, j) when i is an inner point.
fn add(rows: &mut [Vec<(usize, f64)>], i: usize, j: usize, weight: f64) {
    let Some(row) = rows.get_mut(i) else { return };
    match row.iter_mut().find(|(column, _)| *column == j) {
        Some((_, sum)) => *sum += weight,
        None => row.push((j, weight)),
    }
}

/// Cotangent of the angle at `corner` between the ways to a and b, in any number of dimensions.
fn cotangent<const D: usize>(corner: [f64; D], a: [f64; D], b: [f64; D]) -> f64 {
    let mut to_a = a;
    let mut to_b = b;
    for k in 0..D {
        to_a[k] -= corner[k];
        to_b[k] -= corner[k];
    }
    let (aa, bb, ab) = (dot(to_a, to_a), dot(to_b, to_b), dot(to_a, to_b));
    // |a × b|² = |a|²|b|² − (a·b)², in any dimension.
    ab / libm::sqrt((aa * bb - ab * ab).max(f64::MIN_POSITIVE))
}

fn dot<const D: usize>(a: [f64; D], b: [f64; D]) -> f64 {
    a.iter().zip(&b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::super::curve::{Point, Shape};
    use super::super::mesh::{STEP, interior};
    use super::*;

    /// A shape's mesh and the values of a function of the place at its outline.
    fn meshed(shape: Shape, count: usize) -> Mesh {
        let curve = shape.outline();
        let inner: Vec<Point> = interior(&curve).iter().map(|node| node.point).collect();
        Mesh::new(&inner, &curve.spread(count, |p| p))
    }

    fn outline_values(mesh: &Mesh, of: impl Fn(Point) -> f64) -> Vec<[f64; 1]> {
        mesh.points[mesh.inner..].iter().map(|&p| [of(p)]).collect()
    }

    #[test]
    fn linear_functions_are_kept_exactly_on_every_plane_shape() {
        for (shape, count) in [
            (Shape::Clover, 440),
            (Shape::U, 456),
            (Shape::Circle, 436),
            (Shape::Square, 440),
        ] {
            let mesh = meshed(shape, count);
            let laplacian = Laplacian::new(&mesh, &mesh.points).unwrap();
            let linear = |p: Point| 2.0 * p[0] - 0.7 * p[1] + 0.3;
            let found = laplacian.harmonic(&outline_values(&mesh, linear));
            for (value, &point) in found.iter().zip(&mesh.points) {
                assert!((value[0] - linear(point)).abs() < 1e-11, "{shape:?}");
            }
        }
    }

    /// Independent of the finite elements: x³ − 3xy² is harmonic.
    #[test]
    fn a_harmonic_polynomial_is_found_within_the_grid_s_error() {
        let cubic = |[x, y]: Point| x * x * x - 3.0 * x * y * y;
        for (shape, count) in [(Shape::Circle, 436), (Shape::Square, 440), (Shape::U, 456)] {
            let mesh = meshed(shape, count);
            let laplacian = Laplacian::new(&mesh, &mesh.points).unwrap();
            let found = laplacian.harmonic(&outline_values(&mesh, cubic));
            let errors = found
                .iter()
                .zip(&mesh.points)
                .map(|(v, &p)| (v[0] - cubic(p)).abs());
            let worst = errors.fold(0.0, f64::max);
            assert!(worst < STEP * STEP, "{shape:?}: {worst}");
        }
    }

    /// On the circle the value at the centre is the mean over the outline.
    #[test]
    fn the_centre_has_the_mean_of_the_outline() {
        let mesh = meshed(Shape::Circle, 436);
        let laplacian = Laplacian::new(&mesh, &mesh.points).unwrap();
        let values = outline_values(&mesh, |[x, y]| libm::exp(x) + x * y - libm::sin(3.0 * y));
        let mean = values.iter().map(|v| v[0]).sum::<f64>() / values.len() as f64;
        let centre = mesh.points.iter().position(|p| *p == [0.0, 0.0]).unwrap();
        let found = laplacian.harmonic(&values)[centre][0];
        assert!((found - mean).abs() < 1e-3, "{found} {mean}");
    }

    #[test]
    fn no_inner_value_lies_beyond_the_outline_s() {
        let mesh = meshed(Shape::U, 456);
        let laplacian = Laplacian::new(&mesh, &mesh.points).unwrap();
        let rough = |[x, y]: Point| libm::sin(17.0 * x) * libm::cos(23.0 * y);
        let values = outline_values(&mesh, rough);
        let (low, high) = values.iter().fold((9.0, -9.0), |(l, h): (f64, f64), v| {
            (l.min(v[0]), h.max(v[0]))
        });
        for value in laplacian.harmonic(&values) {
            assert!((low..=high).contains(&value[0]));
        }
    }

    /// A part of the sphere mapped to itself by the identity at its rim: the identity (conformal, so harmonic) is the answer.
    #[test]
    fn a_cap_of_the_sphere_with_its_own_rim_maps_to_itself() {
        let mesh = meshed(Shape::Circle, 436);
        let radius = 1.3208;
        let lift = |&[x, y]: &Point| [x, y, libm::sqrt(radius * radius - x * x - y * y)];
        let cap: Vec<[f64; 3]> = mesh.points.iter().map(lift).collect();
        let laplacian = Laplacian::new(&mesh, &cap).unwrap();
        let found = laplacian.harmonic_into_sphere(&cap[mesh.inner..], radius);
        for (a, b) in found.iter().zip(&cap) {
            let far = (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max);
            assert!(far < 2e-3, "{a:?} {b:?}");
            assert!((dot(*a, *a) - radius * radius).abs() < 1e-12);
        }
        // And where it ends, L x has no part along the sphere.
        let all: Vec<[f64; 3]> = found.iter().chain(&cap[mesh.inner..]).copied().collect();
        for (image, x) in laplacian.apply(&all).iter().zip(&found) {
            let mu = dot(*image, *x) / (radius * radius);
            let along: [f64; 3] = core::array::from_fn(|k| image[k] - mu * x[k]);
            assert!(dot(along, along) < 1e-18, "{along:?}");
        }
    }
}
