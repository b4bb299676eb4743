//! The whole loop with an honest glove.

use super::bench::Bench;
use super::hand_image;
use super::wearer::Wearer;
use bridge::Settings;
use glove::scan::Scanner;
use rig::person::{Person, Task};
use std::sync::{Arc, Mutex};

impl Wearer {
    /// The whole loop with this glove on the hand of a person who does this, from these seconds on.
    pub fn bench(&self, tasks: &[(Task, f64)]) -> (Bench, Person) {
        let mut person = Person::new(self.traits.clone());
        for (task, at) in tasks {
            person.ask(*task, *at);
        }
        let bench = Bench::wearing(
            self.glove(person.clone()),
            Scanner::with_set_baud,
            Arc::new(Mutex::new([0.0; 25])),
            Settings::default(),
            Some(hand_image(1)),
            rig::gripper::Config::default(),
            gripper::driver::Config::default(),
        );
        (bench, person)
    }
}
