//! Which layer fails: findings, one a layer, from the port up to what the device says about itself.
//!
//! Asking never moves or changes a gripper (status reads only). A glove's sensors are brought up, as every program that
//! reads them does.

mod answer;
mod cure;
mod glove;
mod gripper;
mod late;
mod network;
mod place;
mod raw;
mod sampled;
mod search;
mod serial;

use serde::Serialize;

pub use cure::cure;
pub use glove::{
    glove, keeps_registers, missing_sensors, multiplexer_answers, no_glove, no_sensors,
};
pub use gripper::{gripper, no_gripper};
pub use place::{Asked, Place};

use crate::failure::Failure;
use crate::next::NextStep;

/// How a finding is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// As it should be.
    Good,
    /// Worth knowing; nothing is broken.
    Note,
    /// Something to mend.
    Wrong,
}

/// What was found at one layer.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// The layer: `port`, `address`, `connection`, `line`, `unit`, `search`, `gripper`, `bridge`, `bus`, `multiplexer`, `sensors`.
    pub layer: &'static str,
    /// How it is meant.
    pub verdict: Verdict,
    /// What it is.
    pub what: String,
    /// What to do about it.
    #[serde(flatten)]
    pub next: Option<NextStep>,
}

/// Findings in the order of the layers.
#[derive(Debug, Clone, Default, Serialize)]
#[serde(transparent)]
pub struct Findings(pub Vec<Finding>);

impl Findings {
    fn good(&mut self, layer: &'static str, what: impl Into<String>) {
        self.add(layer, Verdict::Good, what.into(), None);
    }

    fn note(&mut self, layer: &'static str, what: impl Into<String>, next: impl Into<NextStep>) {
        self.add(layer, Verdict::Note, what.into(), Some(next.into()));
    }

    fn wrong(&mut self, layer: &'static str, what: impl Into<String>, next: impl Into<NextStep>) {
        self.add(layer, Verdict::Wrong, what.into(), Some(next.into()));
    }

    /// Wrong where it is so in half of the cases or more, else a note.
    fn by_share(&mut self, layer: &'static str, so: usize, of: usize, what: String, next: &str) {
        if 2 * so >= of {
            self.wrong(layer, what, next);
        } else {
            self.note(layer, what, next);
        }
    }

    fn failure(&mut self, layer: &'static str, failure: &Failure) {
        self.wrong(layer, failure.to_string(), failure.next());
    }

    fn add(&mut self, layer: &'static str, verdict: Verdict, what: String, next: Option<NextStep>) {
        self.0.push(Finding {
            layer,
            verdict,
            what,
            next,
        });
    }

    /// The first thing that is wrong.
    pub fn first_wrong(&self) -> Option<&Finding> {
        self.0
            .iter()
            .find(|finding| finding.verdict == Verdict::Wrong)
    }

    /// That, as a failure that begins with `what`.
    pub fn as_failure(&self, what: &str) -> Option<Failure> {
        let wrong = self.first_wrong()?;
        let next = wrong.next.clone().unwrap_or_default();
        Some(Failure::new(format!("{what}: {}", wrong.what), next))
    }

    /// How many things are wrong.
    pub fn faults(&self) -> usize {
        let wrong = |finding: &&Finding| finding.verdict == Verdict::Wrong;
        self.0.iter().filter(wrong).count()
    }
}
