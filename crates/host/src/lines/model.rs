//! The grippers that can stand at a line.

use gripper::kinematics;
use gripper::registers::two_finger;

/// Which gripper.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Model {
    /// 3-Finger Adaptive Gripper.
    ThreeFinger,
    /// 2F-85.
    TwoFinger85,
    /// 2F-140.
    TwoFinger140,
    /// Hand-E.
    HandE,
}

impl Model {
    /// All of them.
    pub const ALL: [Self; 4] = [
        Self::ThreeFinger,
        Self::TwoFinger85,
        Self::TwoFinger140,
        Self::HandE,
    ];

    /// The maker's name for it.
    pub fn name(self) -> &'static str {
        match self.two_finger() {
            Some(model) => model.name(),
            None => "3-Finger gripper",
        }
    }

    /// What the command line calls it.
    pub const fn option(self) -> &'static str {
        match self {
            Self::ThreeFinger => "3f",
            Self::TwoFinger85 => "2f85",
            Self::TwoFinger140 => "2f140",
            Self::HandE => "hande",
        }
    }

    /// Axes that are told where to go.
    pub fn axes(self) -> usize {
        match self.two_finger() {
            None => gripper::space::AXES,
            Some(_) => 1,
        }
    }

    /// Where its links are, for pictures.
    pub fn kinematics(self) -> kinematics::Model {
        match self.two_finger() {
            None => kinematics::Model::ThreeFinger,
            Some(model) => kinematics::Model::TwoFinger(model),
        }
    }

    /// The 2-Finger or Hand-E model it is, if it is one.
    pub fn two_finger(self) -> Option<two_finger::Model> {
        match self {
            Self::ThreeFinger => None,
            Self::TwoFinger85 => Some(two_finger::Model::TwoFinger85),
            Self::TwoFinger140 => Some(two_finger::Model::TwoFinger140),
            Self::HandE => Some(two_finger::Model::HandE),
        }
    }
}

impl std::str::FromStr for Model {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|model| model.option() == text);
        found.ok_or_else(|| format!("{text} is no gripper: 3f, 2f85, 2f140 or hande"))
    }
}
