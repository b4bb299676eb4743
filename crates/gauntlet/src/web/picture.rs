//! What the page shows at one moment. Every panel is optional: a verb fills in what it has.
//!
//! Geometry is computed here and not in the browser: a body is a list of [`Link`]s in millimetres, in a frame whose z points up
//! on the page. The page turns, sorts, shades and draws them.

use serde::Serialize;
use serde::ser::{SerializeSeq, Serializer};

/// Version of what the page is told: the page and the program come from one binary, a recorded conversation does not.
pub const VERSION: u32 = 1;

/// Everything that is shown at one moment.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Picture {
    /// What runs.
    pub title: String,
    /// Seconds since it started.
    pub elapsed_s: f64,
    /// Seconds after which it ends by itself.
    pub total_s: Option<f64>,
    /// What is so, in large words.
    pub state: Headline,
    /// The clutch; `None` where there is none.
    pub clutch: Option<Clutch>,
    /// The hand.
    pub hand: Option<Hand>,
    /// The gripper.
    pub gripper: Option<Gripper>,
    /// Rates and latency.
    pub rates: Option<Rates>,
    /// What is wrong now, in words; empty when all is well.
    pub faults: Vec<String>,
    /// Teaching: the pose that is asked for.
    pub teach: Option<Teach>,
    /// A guided session: what to do now.
    pub guide: Option<Guide>,
    /// What a button or a key on the page does beside the clutch.
    pub actions: Vec<Action>,
}

/// The state in large words.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Headline {
    /// In a word or two.
    pub words: String,
    /// How that is to be taken.
    pub tone: Tone,
}

/// How something is to be taken.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Tone {
    /// Neither good nor bad.
    #[default]
    Calm,
    /// It works: the gripper follows, a pose was taken.
    Good,
    /// It waits for something.
    Wait,
    /// Something is wrong.
    Bad,
}

/// The clutch as the bridge has it, and who holds it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Clutch {
    /// `open`, `closed`, `lost` (no heartbeat for 250 ms: held) or `expired` (it opened by itself after 1 s).
    pub position: &'static str,
    /// Which page holds it closed; `None` where none does.
    pub page: Option<u64>,
    /// Whether the terminal, or the program by itself, holds it closed.
    pub terminal: bool,
    /// Whether a page may close it at all.
    pub may_close: bool,
}

/// The hand.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Hand {
    /// Its bones.
    pub links: Vec<Link>,
    /// Its 25 joint angles in their usual order, degrees.
    #[serde(serialize_with = "tenths")]
    pub angles_deg: Vec<f32>,
    /// Whether the angles are to be believed: calibrated.
    pub calibrated: bool,
    /// Age of the angles in seconds, where they are old.
    pub age_s: Option<f32>,
    /// Its sensors, by segment.
    pub sensors: Vec<Sensor>,
    /// Whether it is a left hand.
    pub left: bool,
}

/// A sensor on the hand.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sensor {
    /// The segment it sits on.
    pub name: &'static str,
    /// How it is: `good`, `doubtful` (its joint is held, or it is not used until a flat pose), `lost` or `unknown`.
    pub health: &'static str,
    /// The same in words, with the reason.
    pub words: String,
    /// Where it sits on the drawn hand, mm.
    pub at: Option<[f32; 3]>,
    /// How sure the heading between it and its parent is, standard deviation, degrees; `None` where nobody says.
    pub sigma_deg: Option<f32>,
}

/// The gripper.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Gripper {
    /// Where it is.
    pub reached: Vec<Link>,
    /// Where it is asked to be: drawn as a ghost.
    pub asked: Vec<Link>,
    /// Its axes.
    pub axes: Vec<Axis>,
    /// Age of the positions in seconds, where they are old.
    pub age_s: Option<f32>,
    /// Whether this is what a map makes of the hand, and no gripper that is there.
    pub is_imagined: bool,
}

/// One axis of the gripper, counts.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Axis {
    /// Its name.
    pub name: &'static str,
    /// Where it is asked to be.
    pub asked: Option<u8>,
    /// Where it is.
    pub reached: Option<u8>,
    /// What the gripper says about it.
    pub word: &'static str,
}

/// Rates and latency.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Rates {
    /// Glove frames in the last second.
    pub frames_per_s: f64,
    /// Gripper cycles in the last second; `None` where there is no gripper.
    pub cycles_per_s: Option<f64>,
    /// From the oldest sample used to the command's departure, µs: half of all commands were faster.
    pub latency_p50_us: Option<u64>,
    /// The same for 99 of 100.
    pub latency_p99_us: Option<u64>,
    /// Frames not answered by a command, or not used.
    pub dropped: u64,
}

/// Teaching the map: what is asked for.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Teach {
    /// Which pose it is, from 1; the start poses count.
    pub round: usize,
    /// Of how many.
    pub rounds: usize,
    /// The pose to mimic, as the gripper would have it.
    pub target: Vec<Link>,
    /// The same in counts.
    pub target_counts: Vec<u8>,
    /// What to do, in words.
    pub words: String,
    /// How much of the hold is done, 0 to 1.
    pub held: f32,
    /// What is counted down: 3, 2, 1.
    pub countdown: Option<u8>,
    /// What was said last, where it is no refusal.
    pub said: Option<String>,
    /// Why the newest pose was refused, in words.
    pub refused: Option<String>,
}

/// A guided session: what to do now.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Guide {
    /// Which part it is, from 1.
    pub part: usize,
    /// Of how many.
    pub parts: usize,
    /// Its name.
    pub name: String,
    /// What to do, in words.
    pub words: String,
    /// Which way to turn now.
    pub turning: Option<&'static str>,
    /// Seconds that are left of it.
    pub left_s: f32,
    /// Share of its time that is left, 0 to 1.
    pub left: f32,
    /// Whether what is done now counts.
    pub counts: bool,
    /// What is seen of it.
    pub remarks: Vec<String>,
    /// How far each finger is bent in all, thumb first, degrees.
    #[serde(serialize_with = "tenths")]
    pub bends_deg: Vec<f32>,
    /// What it came to, once it is over.
    pub end: Vec<String>,
}

/// What a button on the page does.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Action {
    /// How the page names it to the program.
    pub name: &'static str,
    /// The key that does it, a letter as [`KeyboardEvent.key`](https://developer.mozilla.org/docs/Web/API/KeyboardEvent/key) has it;
    /// `any`: every key that nothing else is done by.
    pub key: &'static str,
    /// What the button says.
    pub words: String,
}

/// The gripper's space in its principal axes: sent when it changes, not with each picture.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Map {
    /// Centre of the space, counts.
    #[serde(serialize_with = "tenths")]
    pub centre: Vec<f32>,
    /// The first two principal axes, unit vectors over the gripper's axes; the second is zero where there is one axis.
    pub axes: [Vec<f32>; 2],
    /// Points of the space that the hand reaches, in these axes, counts.
    #[serde(serialize_with = "points")]
    pub covered: Vec<[f32; 2]>,
    /// Points of the space that it does not reach.
    #[serde(serialize_with = "points")]
    pub uncovered: Vec<[f32; 2]>,
    /// Reference points, in the order in which they were shown.
    #[serde(serialize_with = "points")]
    pub references: Vec<[f32; 2]>,
    /// What is shown, in a line: how much is covered.
    pub words: String,
}

/// A part of a body: a round bar between two points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Link {
    /// One end, mm.
    pub from: [f32; 3],
    /// The other, mm.
    pub to: [f32; 3],
    /// Radius at either end, mm.
    pub radius: [f32; 2],
    /// What it is.
    pub part: Part,
}

/// What a link is a part of: this decides its colour, and where a sensor is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Segment of the hand, 0 to 15, on which a sensor sits.
    Segment(u8),
    /// Palm and wrist.
    Palm,
    /// The gripper's body.
    Base,
    /// Finger of the gripper: 0 is A, 1 is B, 2 is C.
    Finger(u8),
}

impl Part {
    /// As one number: segments as they are, then palm 100, base 101, fingers from 200.
    fn code(self) -> u8 {
        match self {
            Self::Segment(segment) => segment.min(99),
            Self::Palm => 100,
            Self::Base => 101,
            Self::Finger(finger) => finger.saturating_add(200),
        }
    }
}

impl Serialize for Link {
    /// Nine numbers, to a tenth of a millimetre: from, to, radii, part.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut list = serializer.serialize_seq(Some(9))?;
        for value in self.from.iter().chain(&self.to).chain(&self.radius) {
            list.serialize_element(&tenth(*value))?;
        }
        list.serialize_element(&self.part.code())?;
        list.end()
    }
}

fn tenth(value: f32) -> f64 {
    (f64::from(value) * 10.0).round() / 10.0
}

fn tenths<S: Serializer>(values: &[f32], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(values.iter().map(|value| tenth(*value)))
}

fn points<S: Serializer>(values: &[[f32; 2]], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(values.iter().map(|point| point.map(tenth)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_is_nine_numbers_and_what_is_not_finite_is_null() {
        let link = Link {
            from: [0.04, -1.06, 2.0],
            to: [f32::NAN, 0.0, 0.0],
            radius: [8.0, 7.25],
            part: Part::Finger(2),
        };
        let text = serde_json::to_string(&link).unwrap();
        assert_eq!(text, "[0.0,-1.1,2.0,null,0.0,0.0,8.0,7.3,202]");
    }
}
