//! The live training on the page: what is shown in the browser, and what is asked for there.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use host::gripper::kinematics::Model;
use host::report::{Progress, Reporter};
use host::teaching::{Act, Ask, Doubt, FreeAsk, Stage, State, Taught};
use host::trainer::data::Matrix;
use host::trainer::hand::Space;
use host::trainer::model::Model as Map;
use host::trainer::spread::spread;
use host::training::quality::MEASURED;
use host::words::axis_words;

use crate::live::Bindings;
use crate::live::teach::{Doing, TeachView, count};
use crate::progress::Person;
use crate::web::picture::{Action, Axis, Gripper, Guide, Headline, Teach, Tone};
use crate::web::{self, Page, Picture, Wish, space_map};

const TITLE: &str = "gauntlet train --live";
/// Any key that is none of the page's own: pedals are keyboards.
const ANY: &str = "any";

/// The page, where there is one. Clones share it.
#[derive(Debug, Clone, Default)]
pub(super) struct OnPage {
    page: Option<Arc<Mutex<Page>>>,
    /// Which gripper is drawn; none for other targets.
    drawn: Option<Model>,
    /// The motion's poses that stand for all, for the map of what is reached.
    poses: Matrix,
}

impl OnPage {
    pub fn new(page: Option<Page>, drawn: Option<Model>) -> Self {
        Self {
            page: page.map(|page| Arc::new(Mutex::new(page))),
            drawn,
            poses: Matrix::default(),
        }
    }

    /// The same for a map of this motion.
    pub fn of_motion(self, frames: &Matrix) -> Self {
        let poses = match self.page {
            Some(_) => frames.select(&spread(frames, MEASURED)),
            None => Matrix::default(),
        };
        Self { poses, ..self }
    }

    fn page(&self) -> Option<MutexGuard<'_, Page>> {
        let page = self.page.as_ref()?;
        Some(page.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Whether somebody looks at it, and can say when it is enough.
    pub fn is_watched(&self) -> bool {
        self.page().is_some_and(|page| page.watching() > 0)
    }

    fn show(&self, picture: impl FnOnce() -> Picture) {
        if let Some(mut page) = self.page() {
            page.show(|| Picture {
                title: TITLE.to_owned(),
                ..picture()
            });
        }
    }

    /// What was asked for there since the last call, by name.
    fn done(&self) -> Vec<String> {
        let Some(page) = self.page() else {
            return Vec::new();
        };
        let young = |said: web::Said| match said.wish {
            Wish::Do(ref what) if said.is_young() => Some(what.clone()),
            _ => None,
        };
        page.said().filter_map(young).collect()
    }

    /// The hand is to lie flat. `worn`, here and below: the hand and how it is read.
    pub fn show_flat(&self, worn: impl FnOnce() -> Picture, words: &str, why: Option<&str>) {
        self.show(|| Picture {
            state: headline("lay the hand flat", Tone::Wait),
            guide: Some(Guide {
                part: 1,
                parts: 1,
                name: "flat hand".to_owned(),
                words: words.to_owned(),
                left: 1.0,
                remarks: why.into_iter().map(str::to_owned).collect(),
                ..Guide::default()
            }),
            ..worn()
        });
    }

    /// A movement of the free motion; whether to go on to the next.
    pub fn free(&self, worn: impl FnOnce() -> Picture, ask: &FreeAsk, seen: &str) -> bool {
        self.show(|| Picture {
            state: headline("move", Tone::Good),
            guide: Some(Guide {
                part: ask.number,
                parts: ask.of,
                name: "move freely".to_owned(),
                words: ask.ask.to_owned(),
                left_s: ask.left.as_secs_f32(),
                left: ask.left.as_secs_f32() / ask.time.as_secs_f32().max(1e-3),
                counts: true,
                remarks: vec![
                    seen.to_owned(),
                    format!("{} s of it all are left", ask.all_left.as_secs() + 1),
                ],
                ..Guide::default()
            }),
            actions: vec![action("next", " ", "the next movement (space)")],
            ..worn()
        });
        self.done().iter().any(|what| what == "next")
    }

    /// A pose that is asked for; what the person wants. `map`: what it makes of the hand now, counts.
    pub fn poses(
        &self,
        worn: impl FnOnce() -> Picture,
        view: impl FnOnce() -> TeachView,
        map: Option<&[f32]>,
    ) -> Vec<Act> {
        self.show(|| self.picture(worn(), &view(), map));
        let act = |what: &String| match what.as_str() {
            "take" => Some(Act::Capture),
            "undo" => Some(Act::Undo),
            "redo" => Some(Act::Redo),
            "skip" => Some(Act::Skip),
            "more" => Some(Act::More),
            "finish" => Some(Act::Finish),
            _ => None,
        };
        self.done().iter().filter_map(act).collect()
    }

    fn picture(&self, worn: Picture, view: &TeachView, map: Option<&[f32]>) -> Picture {
        let Doing::Poses(ask) = &view.doing else {
            return worn;
        };
        let is_trying = ask.state == State::Trying;
        let links = |counts: &[f32]| {
            let counts = whole(counts);
            self.drawn.map(|model| web::gripper(model, &counts))
        };
        let asked = ask.target.as_deref();
        let names = axis_words(view.axes.len()).iter().copied().enumerate();
        let axes = names.map(|(k, name)| Axis {
            name,
            asked: asked.and_then(|target| target.get(k)).map(|c| one(*c)),
            reached: map.and_then(|counts| counts.get(k)).map(|c| one(*c)),
            word: "by the map",
        });
        let gripper = self.drawn.map(|_| Gripper {
            reached: map.and_then(links).unwrap_or_default(),
            asked: Vec::new(),
            axes: axes.collect(),
            age_s: None,
            is_imagined: true,
        });
        let hold = match ask.state {
            State::Asking(Stage::Holding(share)) => Some(share),
            _ => None,
        };
        let (said, is_good) = view.said.clone().unwrap_or((String::new(), true));
        let teach = (!is_trying).then(|| Teach {
            round: ask.number,
            rounds: ask.of,
            target: asked.and_then(links).unwrap_or_default(),
            target_counts: asked.map(whole).unwrap_or_default(),
            words: view.prompt(),
            held: hold.unwrap_or(0.0),
            countdown: hold.map(count),
            said: is_good.then(|| said.clone()),
            refused: (!is_good).then(|| said.clone()),
        });
        let guide = is_trying.then(|| Guide {
            part: ask.of,
            parts: ask.of,
            name: "try the map".to_owned(),
            words: view.prompt(),
            left: 1.0,
            counts: true,
            remarks: vec![said],
            ..Guide::default()
        });
        Picture {
            state: state(ask.state),
            gripper,
            teach,
            guide,
            actions: actions(ask, Bindings::load().pedal),
            ..worn
        }
    }

    /// What of the gripper's space the hand reaches by `map`, and the poses that were shown.
    pub fn show_map(&self, space: Option<Space>, map: &Map, pairs: &[Taught]) {
        if let (Some(page), Some(space)) = (self.page(), space) {
            let mut references = Matrix::default();
            for pair in pairs {
                references.push(&pair.target);
            }
            page.show_map(&space_map(space, &map.map_all(&self.poses), &references));
        }
    }

    /// The last stage, or its end.
    fn show_training(&self, words: String, tone: Tone, guide: Option<Guide>) {
        self.show(|| Picture {
            state: Headline { words, tone },
            guide,
            ..Picture::default()
        });
    }

    /// What it came to. The page stays with it until the program has ended.
    pub fn show_end(&self, lines: &[(&str, String)], is_good: bool) {
        let state = match is_good {
            true => ("the map is good", Tone::Good),
            false => ("the map is not good", Tone::Bad),
        };
        let guide = Guide {
            part: 1,
            parts: 1,
            name: "the verdict".to_owned(),
            end: lines.iter().map(|(_, text)| text.clone()).collect(),
            ..Guide::default()
        };
        // Else the one before may be too new for this one to be taken.
        if self.is_watched() {
            std::thread::sleep(Duration::from_millis(20));
        }
        self.show_training(state.0.to_owned(), state.1, Some(guide));
    }
}

/// The page hears of the training, too.
impl Reporter for OnPage {
    fn note(&self, text: &str) {
        Person.note(text);
    }

    fn begin(&self, what: &'static str, total: u64) -> Box<dyn Progress> {
        Box::new(Trained {
            on_page: self.clone(),
            total,
            terminal: Person.begin(what, total),
        })
    }
}

struct Trained {
    on_page: OnPage,
    total: u64,
    terminal: Box<dyn Progress>,
}

impl Progress for Trained {
    fn at(&mut self, done: u64, left: Option<Duration>, detail: &dyn Fn() -> String) {
        self.terminal.at(done, left, detail);
        let share = done as f32 / self.total.max(1) as f32;
        let guide = || Guide {
            part: 1,
            parts: 1,
            name: "the last stage".to_owned(),
            words: "The map is trained to its end. The hand may rest.".to_owned(),
            left_s: left.map_or(0.0, |left| left.as_secs_f32()),
            left: 1.0 - share,
            counts: true,
            remarks: vec![detail()],
            ..Guide::default()
        };
        let words = format!("training: {:.0} %", 100.0 * share);
        self.on_page
            .show_training(words, Tone::Wait, self.on_page.is_watched().then(guide));
    }

    fn note(&self, text: &str) {
        self.terminal.note(text);
    }
}

fn headline(words: &str, tone: Tone) -> Headline {
    Headline {
        words: words.to_owned(),
        tone,
    }
}

fn state(state: State) -> Headline {
    match state {
        State::Choosing => headline("choosing a pose", Tone::Wait),
        State::Asking(Stage::Reading) => headline("look", Tone::Calm),
        State::Asking(Stage::Movement) => headline("show this pose", Tone::Calm),
        State::Asking(Stage::Stillness) => headline("hold still", Tone::Wait),
        State::Asking(Stage::Holding(_)) => headline("hold", Tone::Good),
        State::Asking(Stage::Unseen) => headline("no hand seen", Tone::Bad),
        State::Refused(_) => headline("not taken", Tone::Bad),
        State::Trying => headline("try the map: nothing moves", Tone::Good),
        State::Finished => headline("all poses are shown", Tone::Good),
    }
}

/// What can be done. A pedal's key does nothing but take the pose.
fn actions(ask: &Ask, pedal: Option<u8>) -> Vec<Action> {
    let mut actions = all_actions(ask);
    for action in &mut actions {
        if pedal.is_some_and(|pedal| action.key.as_bytes() == [pedal]) {
            action.key = "";
        }
    }
    actions
}

fn all_actions(ask: &Ask) -> Vec<Action> {
    let undo = action("undo", "u", "take the last one back (u)");
    match ask.state {
        State::Trying => vec![
            action("finish", " ", "train to the end (space)"),
            action("more", "+", "one more pose (+)"),
            undo,
        ],
        State::Finished => Vec::new(),
        State::Refused(doubt) if Doubt::may_insist(&doubt) => {
            vec![
                action("take", ANY, "take it all the same (any other key)"),
                undo,
            ]
        }
        _ => vec![
            action("take", ANY, "take it now (any other key)"),
            action("skip", "s", "another pose (s)"),
            undo,
            action("redo", "r", "bring it back (r)"),
        ],
    }
}

fn action(name: &'static str, key: &'static str, words: &str) -> Action {
    Action {
        name,
        key,
        words: words.to_owned(),
    }
}

fn one(count: f32) -> u8 {
    // A number that is none is 0, like one below it.
    count.round().clamp(0.0, 255.0) as u8
}

fn whole(counts: &[f32]) -> Vec<u8> {
    counts.iter().copied().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pedal_s_key_skips_nothing_on_the_page_and_the_buttons_stay() {
        let ask = Ask {
            state: State::Asking(Stage::Stillness),
            target: None,
            number: 3,
            of: 10,
            start: None,
        };
        let keys = |pedal: Option<u8>| -> Vec<_> {
            let of = |action: &Action| (action.name, action.key);
            actions(&ask, pedal).iter().map(of).collect()
        };
        assert!(keys(None).contains(&("skip", "s")));
        let with = keys(Some(b's'));
        assert_eq!(with.len(), keys(None).len());
        assert!(with.contains(&("skip", "")) && with.contains(&("take", ANY)));
        assert!(with.contains(&("undo", "u")));
    }
}
