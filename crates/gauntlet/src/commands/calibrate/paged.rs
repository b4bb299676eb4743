//! The guided session on the page.

use host::calibration::guide::{PARTS, Stage, plan};
use host::glove::hand::{JOINT_COUNT, Side};

use super::session::Session;
use crate::live::Key;
use crate::live::guided::GuideView;
use crate::live::postures::drawing;
use crate::web::picture::{Action, Guide, Hand, Headline, Tone};
use crate::web::{self, Picture, Wish};

/// What the buttons are called.
const GO: &str = "go";
const AGAIN: &str = "again";
/// How a finger that is bent so far in all bends joint by joint: base, middle, tip.
const SHARES: [f32; 3] = [0.38, 0.40, 0.22];

impl Session {
    /// Shows what is asked for, and returns what was asked for there, as keys.
    pub(super) fn look_at_page(&mut self) -> Vec<Key> {
        let Some(mut page) = self.page.take() else {
            return Vec::new();
        };
        let keys = page.said().filter_map(|said| match &said.wish {
            Wish::Do(what) if said.is_young() && what == GO => Some(Key::Clutch),
            Wish::Do(what) if said.is_young() && what == AGAIN => Some(Key::Again),
            _ => None,
        });
        let keys = keys.collect();
        page.show(|| picture(&self.view(), self.is_over()));
        self.page = Some(page);
        keys
    }
}

fn picture(view: &GuideView, over: bool) -> Picture {
    let ask = &view.ask;
    let (words, tone) = match ask.stage {
        Stage::Waiting => ("ready to begin", Tone::Calm),
        Stage::Ready(_) => ("get ready", Tone::Wait),
        Stage::Doing(_) if ask.counts => ("measuring", Tone::Good),
        Stage::Doing(_) => ("go on", Tone::Wait),
        Stage::Over if view.good => ("done", Tone::Good),
        Stage::Over => ("not good enough", Tone::Bad),
    };
    let seconds = |time: host::glove::Duration| time.as_ticks() as f32 / 1e6;
    let (left, of) = (seconds(ask.left), seconds(ask.of));
    let go = match (over, &view.keep) {
        (false, _) => Some("begin, or go on (space)".to_owned()),
        (true, keep) => keep.as_ref().map(|keep| format!("{keep} (space)")),
    };
    let again = Action {
        name: AGAIN,
        key: "r",
        words: "again (r)".to_owned(),
    };
    Picture {
        title: "gauntlet calibrate".to_owned(),
        elapsed_s: view.elapsed.as_secs_f64(),
        state: Headline {
            words: words.to_owned(),
            tone,
        },
        hand: Some(bent(ask.bends)),
        guide: Some(Guide {
            part: ask.number,
            parts: PARTS,
            name: plan::name(ask.step).to_owned(),
            words: match ask.stage {
                Stage::Waiting => {
                    "Wear the glove and sit at a table with room for the hand.".to_owned()
                }
                Stage::Over => String::new(),
                _ => plan::words(ask.step).to_owned(),
            },
            turning: ask.turning,
            drawing: match ask.stage {
                Stage::Waiting | Stage::Over => "",
                _ => drawing(ask.step, ask.turning),
            },
            left_s: left,
            left: left / of.max(1e-3),
            counts: ask.counts,
            remarks: ask.remarks.iter().map(ToString::to_string).collect(),
            bends_deg: ask.bends.iter().map(|bend| bend.to_degrees()).collect(),
            end: view.end.clone(),
        }),
        actions: go
            .map(|words| Action {
                name: GO,
                key: " ",
                words,
            })
            .into_iter()
            .chain([again])
            .collect(),
        ..Picture::default()
    }
}

/// A hand whose fingers are bent so far in all: what is known before the joints are.
fn bent(bends: [f32; 5]) -> Hand {
    let mut angles = [0.0; JOINT_COUNT];
    for (finger, bend) in bends.into_iter().enumerate() {
        for (joint, share) in [0, 3, 4].into_iter().zip(SHARES) {
            angles[5 * finger + joint] = share * bend.clamp(0.0, 4.5);
        }
    }
    Hand {
        sensors: Vec::new(),
        ..web::drawn_hand(&angles, Side::Right, false, |_| web::Known::default())
    }
}
