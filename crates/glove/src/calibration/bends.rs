//! Hinge axes from bending: the second moments of each joint's relative rotation. The mountings come in when the axes are read, so
//! they may change until then.

use super::algebra::{self, Vector};
use crate::hand::Quaternion;
use nalgebra::Quaternion as Raw;

/// Steps of the power iteration.
const STEPS: usize = 30;

/// Σ d dᵀ of one joint's relative rotation between its two sensors.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moments {
    /// Upper triangle, row by row, of w, x, y, z.
    sums: [f32; 10],
    n: u32,
}

/// What bending shows of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bending {
    /// The axis in the segments' frames, unit; positive is the way it bent.
    pub axis: Vector,
    /// Mean of the squared sine of half the rotation: how much it moved.
    pub motion: f32,
}

/// Row and column of each of the ten sums.
const PLACES: [(usize, usize); 10] = [
    (0, 0),
    (0, 1),
    (0, 2),
    (0, 3),
    (1, 1),
    (1, 2),
    (1, 3),
    (2, 2),
    (2, 3),
    (3, 3),
];

impl Moments {
    pub const fn new() -> Self {
        Self {
            sums: [0.0; 10],
            n: 0,
        }
    }

    /// A scan: `child` as `parent` sees it, headings taken out.
    pub fn add(&mut self, parent: &Quaternion, child: &Quaternion) {
        let d = components(&(parent.quaternion().conjugate() * child.quaternion()));
        for (sum, (row, column)) in self.sums.iter_mut().zip(PLACES) {
            *sum += d[row] * d[column];
        }
        self.n += 1;
    }

    /// A scan in which the joint is not looked at: it counts as still.
    pub fn pass(&mut self) {
        self.n += 1;
    }

    pub fn join(&mut self, other: &Self) {
        for (sum, other) in self.sums.iter_mut().zip(&other.sums) {
            *sum += other;
        }
        self.n += other.n;
    }

    /// The joint's axis, with its sensors mounted so; `None` where nothing moved.
    pub fn bending(&self, parent: &Quaternion, child: &Quaternion) -> Option<Bending> {
        if self.n == 0 {
            return None;
        }
        let moved = self.mounted(parent, child);
        let n = self.n as f32;
        let motion = (moved[1][1] + moved[2][2] + moved[3][3]) / n;
        let mut axis = algebra::unit(algebra::X)?;
        // Starts from the column that is longest: never at right angles to what is looked for.
        let mut longest = 0.0;
        for row in moved.iter().skip(1) {
            // Symmetric: a row is a column.
            let v = [row[1], row[2], row[3]];
            let length = algebra::norm(v);
            if length > longest {
                (longest, axis) = (length, algebra::unit(v)?);
            }
        }
        for _ in 0..STEPS {
            let row = |i: usize| algebra::dot([moved[i][1], moved[i][2], moved[i][3]], axis);
            axis = algebra::unit([row(1), row(2), row(3)])?;
        }
        let way = algebra::dot([moved[0][1], moved[0][2], moved[0][3]], axis);
        if way < 0.0 {
            axis = axis.map(|c| -c);
        }
        Some(Bending { axis, motion })
    }

    /// T N Tᵀ with T = left(M_parent) right(M_child*): the moments of the rotation between the segments.
    fn mounted(&self, parent: &Quaternion, child: &Quaternion) -> [[f32; 4]; 4] {
        let mut sums = [[0.0; 4]; 4];
        for (sum, (row, column)) in self.sums.iter().zip(PLACES) {
            sums[row][column] = *sum;
            sums[column][row] = *sum;
        }
        // The rotation of each unit quaternion: the columns of T.
        let mut t = [[0.0; 4]; 4];
        for (column, unit) in t.iter_mut().enumerate() {
            let mut e = [0.0; 4];
            e[column] = 1.0;
            let e = Raw::new(e[0], e[1], e[2], e[3]);
            *unit = components(&(parent.quaternion() * e * child.quaternion().conjugate()));
        }
        let mut half = [[0.0; 4]; 4];
        for (i, row) in half.iter_mut().enumerate() {
            for (j, cell) in row.iter_mut().enumerate() {
                *cell = (0..4).map(|k| t[k][i] * sums[k][j]).sum();
            }
        }
        let mut moved = [[0.0; 4]; 4];
        for (i, row) in moved.iter_mut().enumerate() {
            for (j, cell) in row.iter_mut().enumerate() {
                *cell = (0..4).map(|k| half[i][k] * t[k][j]).sum();
            }
        }
        moved
    }
}

fn components(q: &Raw<f32>) -> [f32; 4] {
    [q.w, q.i, q.j, q.k]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axis_and_its_way_come_back_through_any_mountings() {
        let axis = algebra::unit([0.9, 0.3, -0.2]).unwrap();
        let parent = algebra::normalised(Raw::new(0.2, 0.4, -0.7, 0.5)).unwrap();
        let child = algebra::normalised(Raw::new(-0.6, 0.1, 0.3, 0.7)).unwrap();
        let mut moments = Moments::new();
        for step in 0..100 {
            let [c, s] = algebra::half(1.6 * (step % 20) as f32 / 20.0);
            let bend = algebra::quaternion(c, s * axis[0], s * axis[1], s * axis[2]);
            let hand = algebra::normalised(Raw::new(1.0, 0.01 * step as f32, -0.3, 0.2)).unwrap();
            moments.add(&(hand * parent), &(hand * bend * child));
        }
        let bending = moments.bending(&parent, &child).unwrap();
        assert!(
            algebra::between(bending.axis, axis) < 1e-3,
            "{:?}",
            bending.axis
        );
        assert!(bending.motion > 0.1);
    }

    #[test]
    fn a_joint_that_did_not_move_has_no_axis() {
        assert_eq!(
            Moments::new().bending(&Quaternion::identity(), &Quaternion::identity()),
            None
        );
    }
}
