//! What moves: the fingers of a hand, the axes of a gripper.

/// One finger's five angles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Finger {
    /// Its name.
    pub name: &'static str,
    /// Angles in radians, base first, as the joints are ordered everywhere.
    pub angles: [f32; 5],
    /// Human limits of each, radians.
    pub limits: [(f32, f32); 5],
    /// Whether every sensor that these angles need is good.
    pub good: bool,
}

/// One axis of the gripper, counts.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Its name.
    pub name: &'static str,
    /// Position last commanded.
    pub asked: Option<u8>,
    /// Position last measured.
    pub reached: Option<u8>,
    /// What the gripper says about it.
    pub word: &'static str,
}
