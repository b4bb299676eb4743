//! A place and an orientation, and how they chain: what of rotations a drawing needs.

/// A rotation, unit quaternion w, x, y, z.
type Quaternion = [f32; 4];

/// Where a link's frame is in another one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Its origin, mm.
    pub position: [f32; 3],
    /// From its frame to the other: unit quaternion w, x, y, z.
    pub orientation: Quaternion,
}

impl Pose {
    /// The other frame itself.
    pub const IDENTITY: Self = Self::new([0.0; 3], [1.0, 0.0, 0.0, 0.0]);

    /// From its parts.
    #[must_use]
    pub const fn new(position: [f32; 3], orientation: Quaternion) -> Self {
        Self {
            position,
            orientation,
        }
    }

    /// A point of its frame in the other one, mm.
    #[must_use]
    pub fn at(&self, point: [f32; 3]) -> [f32; 3] {
        sum(self.position, rotate(self.orientation, point))
    }

    /// What is at `child` in its frame, in the other frame.
    #[must_use]
    pub fn then(&self, child: &Self) -> Self {
        Self::new(
            self.at(child.position),
            product(self.orientation, child.orientation),
        )
    }

    /// Itself as seen from `parent`, both in the same frame.
    #[must_use]
    pub fn seen_from(&self, parent: &Self) -> Self {
        let [w, x, y, z] = parent.orientation;
        let back = [w, -x, -y, -z];
        let offset = sum(self.position, parent.position.map(|c| -c));
        Self::new(rotate(back, offset), product(back, self.orientation))
    }
}

pub(super) fn about_x(angle: f32) -> Quaternion {
    let (sin, cos) = libm::sincosf(0.5 * angle);
    [cos, sin, 0.0, 0.0]
}

pub(super) fn about_y(angle: f32) -> Quaternion {
    let (sin, cos) = libm::sincosf(0.5 * angle);
    [cos, 0.0, sin, 0.0]
}

pub(super) fn about_z(angle: f32) -> Quaternion {
    let (sin, cos) = libm::sincosf(0.5 * angle);
    [cos, 0.0, 0.0, sin]
}

/// First `b`, then `a`.
pub(super) fn product(a: Quaternion, b: Quaternion) -> Quaternion {
    let ([aw, ax, ay, az], [bw, bx, by, bz]) = (a, b);
    [
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    ]
}

fn sum(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// v + 2 w (u × v) + 2 u × (u × v), u the vector part.
fn rotate([w, x, y, z]: Quaternion, point: [f32; 3]) -> [f32; 3] {
    let axis = [x, y, z];
    let once = cross(axis, point).map(|c| 2.0 * c);
    sum(sum(point, once.map(|c| w * c)), cross(axis, once))
}
