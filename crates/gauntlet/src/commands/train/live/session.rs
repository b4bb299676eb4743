//! The session: scans and keys in, poses, words and the bell out.

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Result;
use host::trainer::model::Model;

use super::files::Files;
use super::hand::Worn;
use super::paged::OnPage;
use super::shower::Shower;
use crate::live::teach::{Doing, TeachView};
use crate::live::{Key, Live};
use crate::out;
use crate::tell::Tell;
use host::failure::OrFail;
use host::interrupt::Interrupt;
use host::teaching::kept::Kept;
use host::teaching::{Act, Aim, Counts, Learner, News, State, Taught, Teaching};
use host::training::lessons::Lessons;

const KEYS: &str = "hold still, or any key: take it   u: undo   r: redo   s: another pose   q: end";
const KEYS_AT_END: &str = "space: train to the end   +: one more pose   u: undo   q: end";

/// How it ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shown {
    /// All poses were shown.
    All,
    /// By the person.
    Stopped,
}

/// What is left of it.
pub(super) struct Done {
    pub pairs: Vec<Taught>,
    pub lessons: Lessons,
    pub counts: Counts,
    /// The longest time from a pose taken to the next one.
    pub slowest: Duration,
    /// How the gripper that was showing a pose was left, as its move says.
    pub left: Option<String>,
}

/// A session under way.
pub(super) struct Session<'a> {
    worn: Worn<'a>,
    learner: Learner,
    teaching: Teaching,
    kept: Kept,
    json: bool,
    map: Option<Arc<Model>>,
    said: Option<(String, bool)>,
    taken: Option<Instant>,
    slowest: Duration,
    /// The gripper that shows the poses, where one does.
    shower: Option<Shower>,
    on_page: OnPage,
}

impl<'a> Session<'a> {
    pub fn new(
        worn: Worn<'a>,
        learner: Learner,
        aim: &Aim,
        rounds: usize,
        files: &Files,
        json: bool,
    ) -> Self {
        Self {
            teaching: Teaching::new(aim.clone(), rounds, files.earlier.clone(), worn.now()),
            worn,
            learner,
            kept: files.kept.clone(),
            json,
            map: None,
            said: None,
            taken: None,
            slowest: Duration::ZERO,
            shower: None,
            on_page: OnPage::default(),
        }
    }

    /// The same with a gripper that shows the poses.
    pub fn on(self, shower: Option<Shower>) -> Self {
        Self { shower, ..self }
    }

    /// The same shown on a page, too.
    pub fn on_page(self, on_page: OnPage) -> Self {
        Self { on_page, ..self }
    }

    /// Leads the person through it.
    pub fn lead(&mut self, tell: &Tell, interrupt: &Interrupt) -> Result<Shown> {
        let terminal = || "the terminal does not work".to_owned();
        let next = "the same with | cat behind it, which prints lines instead";
        let drawn = !self.json && out::is_drawn();
        let mut live = Live::start(!drawn).or_fail(terminal, next)?;
        live.with_pedal();
        let suspend = interrupt.catch_suspend().or_fail(
            || "Ctrl-Z cannot be caught".to_owned(),
            "ending other programs: the system lacks descriptors",
        )?;
        loop {
            self.round(tell, drawn)?;
            if suspend.asked() {
                let left = self.shower.as_mut().and_then(Shower::pause);
                live.aside(|| suspend.stop()).or_fail(terminal, next)?;
                if let Some(left) = left {
                    self.say(format!("{left}; g: show poses again"), false, tell, drawn);
                }
            }
            if interrupt.asked() || (!self.json && out::reader_left()?) {
                return Ok(Shown::Stopped);
            }
            for key in live.keys().or_fail(terminal, next)? {
                let act = match key {
                    Key::End => return Ok(Shown::Stopped),
                    Key::Clutch | Key::Open => Act::Finish,
                    Key::Again => Act::Redo,
                    Key::Undo => Act::Undo,
                    Key::Calibrate => Act::Capture,
                };
                self.teaching.act(act, self.worn.now());
            }
            for key in live.others() {
                let act = match key {
                    0x7f => Act::Undo,
                    b's' => Act::Skip,
                    b'+' => Act::More,
                    // Typed right after another key.
                    b'r' => Act::Redo,
                    b'g' if self.show_again() => continue,
                    _ => Act::Capture,
                };
                self.teaching.act(act, self.worn.now());
            }
            for act in self.look_at_page() {
                self.teaching.act(act, self.worn.now());
            }
            let state = self.teaching.ask(self.worn.now()).state;
            // Without a person at the keys nobody says when it is enough.
            if state == State::Trying && !drawn && !self.on_page.is_watched() {
                self.teaching.act(Act::Finish, self.worn.now());
            }
            if state == State::Finished {
                return Ok(Shown::All);
            }
            if drawn {
                live.show(|| self.view()).or_fail(terminal, next)?;
            }
        }
    }

    /// The person's word to a gripper that shows no poses after one went wrong; whether there is such a one.
    fn show_again(&mut self) -> bool {
        let target = self.teaching.ask(self.worn.now()).target;
        let Some(shower) = self.shower.as_mut().filter(|shower| shower.is_halted()) else {
            return false;
        };
        shower.go_on();
        if let Some(target) = target {
            shower.show(&target);
        }
        true
    }

    /// Shows what is asked for on the page, and returns what was asked for there.
    fn look_at_page(&self) -> Vec<Act> {
        let map = self.map.as_ref().map(|map| map.map(&self.worn.angles));
        self.on_page
            .poses(|| self.worn.picture(), || self.view(), map.as_deref())
    }

    /// Takes what came.
    fn round(&mut self, tell: &Tell, drawn: bool) -> Result<()> {
        for pose in self.worn.poses()? {
            self.teaching.take(&pose.angles, pose.at);
        }
        self.teaching.pass(self.worn.now());
        while let Some(learned) = self.learner.answer(Duration::ZERO)? {
            self.on_page.show_map(
                self.teaching.aim().space(),
                &learned.model,
                self.teaching.pairs(),
            );
            self.map = Some(learned.model);
            self.teaching
                .learned(learned.number, learned.target, self.worn.now());
        }
        while let Some(news) = self.teaching.next_news() {
            self.hear(news, tell, drawn)?;
        }
        if let Some(wrong) = self.shower.as_mut().and_then(Shower::look) {
            self.say(wrong, false, tell, drawn);
        }
        Ok(())
    }

    fn hear(&mut self, news: News, tell: &Tell, drawn: bool) -> Result<()> {
        match news {
            News::Asked(target) => {
                if let Some(taken) = self.taken.take() {
                    self.slowest = self.slowest.max(taken.elapsed());
                }
                if let Some(person) = &self.worn.person {
                    person.show(&target);
                }
                if let Some(shower) = &mut self.shower {
                    shower.show(&target);
                }
                if drawn {
                    out::bell();
                } else {
                    let ask = self.teaching.ask(self.worn.now());
                    let words = self.teaching.aim().words(&target);
                    tell.say(format_args!("{:>2} of {}   {words}", ask.number, ask.of));
                }
            }
            News::Taken(number) => {
                self.taken = Some(Instant::now());
                self.keep()?;
                self.say(format!("pose {number} taken"), true, tell, drawn);
            }
            News::PassedOver => self.kept.keep_passed_over(self.teaching.passed_over())?,
            News::Refused(doubt) => {
                self.say(format!("not taken: {doubt}"), false, tell, drawn);
            }
            News::Changed(left) => {
                self.keep()?;
                self.say(format!("{left} poses are kept"), true, tell, drawn);
            }
            News::Learn(wanted) => self.learner.ask(wanted),
            News::Complete => {
                if let Some(person) = &self.worn.person {
                    person.let_go();
                }
                self.say("all poses are shown".to_owned(), true, tell, drawn);
            }
        }
        Ok(())
    }

    fn keep(&self) -> Result<()> {
        self.kept
            .keep_pairs(self.teaching.pairs(), self.teaching.aim())
    }

    fn say(&mut self, text: String, good: bool, tell: &Tell, drawn: bool) {
        if drawn {
            out::bell();
            if !good {
                // Who looks at the hand hears that it was not taken.
                out::bell();
            }
        } else {
            tell.say(format_args!("           {text}"));
        }
        self.said = Some((text, good));
    }

    fn view(&self) -> TeachView {
        let ask = self.teaching.ask(self.worn.now());
        let aim = self.teaching.aim();
        let is_trying = ask.state == State::Trying;
        // In the end the map's own answer to the hand, before it what is to be mimicked.
        let shown = match (&self.map, &ask.target) {
            (Some(map), None) if is_trying => Some(map.map(&self.worn.angles)),
            (_, target) => target.clone(),
        };
        let values = shown.clone().unwrap_or_else(|| vec![0.0; aim.axes()]);
        let axes = aim.axis_words().into_iter().zip(values).zip(aim.ranges());
        TeachView {
            elapsed: self.worn.started.elapsed(),
            words: ask
                .target
                .as_ref()
                .map_or_else(String::new, |target| aim.words(target)),
            gripper: shown.filter(|_| aim.space().is_some()),
            axes: axes
                .map(|((name, value), range)| (name, value, range))
                .collect(),
            hand: self.worn.angles,
            said: self.said.clone(),
            glove: self.worn.line(),
            keys: if is_trying { KEYS_AT_END } else { KEYS },
            doing: Doing::Poses(ask),
        }
    }

    /// Ends the reading and the learner's thread.
    pub fn finish(mut self) -> Result<Done> {
        // The gripper stands before anything else is waited for.
        let left = self.shower.as_mut().and_then(Shower::finish);
        Ok(Done {
            left,
            pairs: self.teaching.pairs().to_vec(),
            lessons: self.learner.end()?,
            counts: self.teaching.counts(),
            slowest: self.slowest,
        })
    }
}
