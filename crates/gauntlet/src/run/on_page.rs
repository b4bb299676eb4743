//! The page of a run: what is kept of it from picture to picture.

use std::time::{Duration, Instant};

use host::gripper::kinematics::Model;
use host::gripper::registers::two_finger;

use crate::live::View;
use crate::web::{Page, Said, Wish};
use host::lines;

/// So long it is told that a page acted on an old picture.
const BEHIND_TOLD: Duration = Duration::from_secs(4);

/// The page of a run.
#[derive(Debug)]
pub(super) struct OnPage {
    pub page: Page,
    /// Which gripper is drawn; `None`: by its number of axes.
    pub model: Option<Model>,
    /// Words and rates, and when they were made.
    pub slow: Option<(Instant, View)>,
    /// A page acted on a picture that was so old, and when.
    behind: Option<(Instant, Duration)>,
    /// Somebody asked for something there: a page that only lies open is nobody.
    pub is_used: bool,
}

impl OnPage {
    pub fn new(page: Page, model: Option<Model>) -> Self {
        Self {
            page,
            model,
            slow: None,
            behind: None,
            is_used: false,
        }
    }

    /// Looks whether who said it saw what is so.
    pub fn look(&mut self, said: &Said) {
        self.is_used |= matches!(said.wish, Wish::Close | Wish::Open | Wish::Do(_));
        if let (true, Some(behind)) = (said.wish.moves(), said.is_behind()) {
            self.behind = Some((Instant::now(), behind));
        }
    }

    /// That a page is too slow to drive by, while that is news.
    pub fn behind_words(&self, now: Instant) -> Option<String> {
        let (at, behind) = self.behind?;
        let news = now.saturating_duration_since(at) < BEHIND_TOLD;
        news.then(|| {
            let old = match behind.as_secs() {
                0..60 => format!("{} ms old", behind.as_millis()),
                _ => "old".to_owned(),
            };
            format!(
                "a page shows pictures that are {old}: nobody can drive by it; close other programs or pages"
            )
        })
    }
}

/// Which gripper is drawn for a model of ours.
pub fn drawn(model: lines::Model) -> Model {
    match model {
        lines::Model::ThreeFinger => Model::ThreeFinger,
        lines::Model::TwoFinger85 => Model::TwoFinger(two_finger::Model::TwoFinger85),
        lines::Model::TwoFinger140 => Model::TwoFinger(two_finger::Model::TwoFinger140),
        lines::Model::HandE => Model::TwoFinger(two_finger::Model::HandE),
    }
}
