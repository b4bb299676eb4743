//! The virtual person of `demo`, `simulate` and the whole-loop tests: who it is, the glove it wears, and its calibration on the virtual
//! clock.

mod calibrating;
pub mod teaching;

use std::fmt;

use host::calibration::virtual_person::VirtualPerson;
use host::glove::calibration::Step;
use host::glove::hand::{JOINT_COUNT, LIMITS, SEGMENT_COUNT, Side};
use host::glove::imu::UniqueId;
use host::trainer::hand::{Scripted, Space};
use host::trainer::operator::Operator;
use rig::PoseSource;
use rig::glove::{Config, Honest, VirtualGlove};
use rig::person::{Attitude, Playing, Task, Traits};

pub use calibrating::{Calibrated, Fit};

/// A virtual person in an honest virtual glove: everything follows from the seed. Each seed's glove has sensors of its own, so that
/// each has a profile of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct Wearer {
    /// Of the person and of the glove.
    pub seed: u64,
    /// Which hand wears it.
    pub side: Side,
    /// Two sensors that sit on each other's segment, as they are wired.
    pub swapped: Option<(usize, usize)>,
}

impl Wearer {
    /// With a right hand, every sensor on its segment.
    pub fn new(seed: u64) -> Self {
        Self {
            seed,
            side: Side::Right,
            swapped: None,
        }
    }

    /// Who it is.
    pub fn traits(&self) -> Traits {
        Traits {
            seed: self.seed,
            is_left: self.side == Side::Left,
            ..Traits::default()
        }
    }

    /// The glove on `hand`, just powered on: its serial multiplexer speaks 9,600 baud, its sensors boot for 650 ms.
    pub fn glove(&self, hand: Box<dyn PoseSource>) -> VirtualGlove {
        let mut honest = Honest {
            seed: self.seed,
            ..Honest::default()
        };
        if let Some((a, b)) = self.swapped {
            honest.seats.swap(a, b);
        }
        let config = Config {
            side: self.side,
            honest: Some(honest),
            ..Config::default()
        };
        VirtualGlove::new(hand, config)
    }

    /// The glove on this person's hand, which plays `motion` and does what it is asked.
    pub fn playing(&self, motion: Box<dyn PoseSource>) -> VirtualGlove {
        self.glove(Box::new(Playing::new(self.traits(), motion)))
    }
}

/// The unique ids of a virtual glove's sensors, as they are wired.
pub fn ids(glove: &VirtualGlove) -> [UniqueId; SEGMENT_COUNT] {
    /// Where a sensor has its id, on page 1.
    const UNIQUE_ID: u8 = 0x50;
    std::array::from_fn(|k| {
        std::array::from_fn(|byte| glove.sensor_register(k, 1, UNIQUE_ID + byte as u8))
    })
}

/// What a virtual person is asked for in a step.
pub fn task(step: Step) -> Task {
    match step {
        Step::FirstFlat | Step::SecondFlat | Step::LastFlat => Task::Flat,
        Step::Turn => Task::Turn,
        Step::Alone(finger) => Task::Alone(finger.number()),
        Step::Fists => Task::Fists,
        Step::Thumb => Task::Thumb,
        Step::Free => Task::Free,
    }
}

/// The hand pose that a virtual person shows for a gripper's counts; `None` for counts of no gripper.
pub fn mimicked(counts: &[f32]) -> Option<Task> {
    let space = Space::of_axes(counts.len())?;
    let shown = Scripted::new(space, &LIMITS).demonstrate(counts).ok()?;
    let shown = <[f32; JOINT_COUNT]>::try_from(shown).ok()?;
    Some(Task::Posture(shown.map(f64::from)))
}

/// A virtual person who hears what a person is asked for.
pub enum Listener {
    /// That of another process (`simulate`).
    There(VirtualPerson),
    /// The one in this glove.
    Here(VirtualGlove),
}

impl fmt::Debug for Listener {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Listener")
    }
}

impl Listener {
    /// Asks for a step.
    pub fn ask(&self, step: Step) {
        match self {
            Self::There(person) => person.ask(step),
            Self::Here(glove) => glove.ask(task(step)),
        }
    }

    /// Lets the hand do as it likes.
    pub fn let_go(&self) {
        match self {
            Self::There(person) => person.let_go(),
            Self::Here(glove) => glove.ask(Task::Use(Attitude::PalmDown)),
        }
    }
}
