//! A person whose fingers play a motion, and who hears what is asked.

use super::{Attitude, MOVE_S, Person, Task, Traits};
use crate::PoseSource;
use crate::pose::{FLAT_S, FlatFirst};

/// In use: the fingers are where the motion puts them.
const IN_USE: Task = Task::Held([0.0; 25], Attitude::PalmDown);

/// A [`Person`] whose fingers play a motion, palm down: when the glove's port is opened the hand lies flat on the table for
/// [`FLAT_S`], as one of [`FlatFirst`], then it moves. Asked for something it does that, until it is asked to use the hand again
/// ([`Task::Use`]). To what the motion says the person adds what a person does: it trembles and is never quite straight.
pub struct Playing {
    person: Person,
    motion: FlatFirst,
    /// It was asked for something else than to use the hand.
    busy: bool,
    /// The port was opened, and no moment was asked for since.
    opened: bool,
    /// When it lifts the hand from the table.
    lifts: Option<f64>,
}

impl Playing {
    /// A person with these traits, whose fingers play `motion`.
    #[must_use]
    pub fn new(traits: Traits, motion: Box<dyn PoseSource>) -> Self {
        Self {
            person: Person::new(traits),
            motion: FlatFirst::new(motion),
            busy: false,
            opened: true,
            lifts: None,
        }
    }

    fn look(&mut self, time_s: f64) {
        if std::mem::take(&mut self.opened) && !self.busy {
            // Nobody saw where it was before.
            Person::ask(&mut self.person, Task::Flat, time_s - 2.0 * MOVE_S);
            self.lifts = Some(time_s + FLAT_S);
        }
        if self.busy {
            self.lifts = None;
        }
        if let Some(at) = self.lifts.filter(|at| time_s >= *at) {
            Person::ask(&mut self.person, IN_USE, at);
            self.lifts = None;
        }
    }
}

impl PoseSource for Playing {
    fn pose_at(&mut self, time_s: f64) -> [f32; 25] {
        self.look(time_s);
        let own = self.person.pose_at(time_s);
        let played = self.motion.pose_at(time_s);
        std::array::from_fn(|joint| own[joint] + played[joint])
    }

    fn attitude_at(&mut self, time_s: f64) -> Option<[f64; 4]> {
        self.person.attitude_at(time_s)
    }

    fn opened(&mut self) {
        self.opened = true;
        self.motion.opened();
    }

    fn lie_flat(&mut self, flat: bool) {
        self.ask(if flat { Task::Flat } else { IN_USE });
    }

    fn ask(&mut self, task: Task) {
        self.busy = !matches!(task, Task::Use(_) | Task::Held(..));
        self.motion.lie_flat(self.busy);
        PoseSource::ask(&mut self.person, if self.busy { task } else { IN_USE });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bent(_: f64) -> [f32; 25] {
        [0.7; 25]
    }

    fn playing() -> Playing {
        let traits = Traits {
            seed: 3,
            ..Traits::default()
        };
        Playing::new(traits, Box::new(bent))
    }

    /// The largest angle, degrees, and the height of the hand's y.
    fn look(hand: &mut Playing, t: f64) -> (f32, f64) {
        let angles = hand.pose_at(t);
        let [w, x, y, z] = hand.attitude_at(t).expect("a person knows");
        let most = angles.iter().fold(0f32, |most, a| most.max(a.abs()));
        (most.to_degrees(), 2.0 * (y * z + w * x))
    }

    #[test]
    fn the_hand_lies_on_the_table_when_its_port_is_opened_and_then_plays_its_motion() {
        let mut hand = playing();
        for begins in [10.0, 100.0] {
            for t in [0.0, 1.0, 2.9] {
                let (most, height) = look(&mut hand, begins + t);
                assert!(most < 6.0, "{most} degrees at {t}");
                assert!(height > 0.99, "{height} at {t}");
            }
            let (most, _) = look(&mut hand, begins + 6.0);
            assert!((35.0..52.0).contains(&most), "{most}");
            hand.opened();
        }
    }

    #[test]
    fn asked_for_something_it_does_that_alone_until_it_may_use_the_hand_again() {
        let mut hand = playing();
        look(&mut hand, 0.0);
        assert!(look(&mut hand, 8.0).0 > 30.0);
        PoseSource::ask(&mut hand, Task::Turn);
        // Also where a program opens the port anew.
        hand.opened();
        look(&mut hand, 8.1);
        let heights: Vec<f64> = (0..120)
            .map(|tenth| look(&mut hand, 9.5 + 0.1 * f64::from(tenth)))
            .map(|(most, height)| {
                assert!(most < 12.0, "{most}");
                height
            })
            .collect();
        assert!(heights.iter().any(|height| *height < -0.8), "{heights:?}");
        PoseSource::ask(&mut hand, Task::Use(Attitude::PalmDown));
        look(&mut hand, 30.0);
        assert!(look(&mut hand, 33.0).0 > 30.0);
    }
}
