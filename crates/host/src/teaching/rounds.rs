//! The session: a pose is asked, held, taken or refused; pairs are taken back and brought back; at the end the map may be tried.

use std::collections::VecDeque;

use glove::Instant;
use glove::hand::JOINT_COUNT;
use trainer::data::{Matrix, Pairs};

use super::aim::{Aim, Taught};
use super::doubt::{Doubt, doubt};
use super::hold::{Hold, Stage};
use super::learner::Wanted;
use crate::clock::since;
use crate::training::lessons::MOST_PAIRS;

/// A pose that was refused may be shown again so much later at the earliest; the words can be read meanwhile.
const AGAIN: u64 = 1_500_000;

/// What a person does besides moving the hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Act {
    /// Takes the pose now, held or not; also one that was refused for being much like another.
    Capture,
    /// Takes the last pair back: its pose is asked again.
    Undo,
    /// Brings back the pair that was taken back last.
    Redo,
    /// Another pose instead of this one.
    Skip,
    /// One more pair after all of them.
    More,
    /// No more pairs: to the last stage.
    Finish,
}

/// Where the session stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum State {
    /// The pose is chosen.
    Choosing,
    /// A pose is asked.
    Asking(Stage),
    /// A pose was refused; it is asked on.
    Refused(Doubt),
    /// All pairs are there: the map can be tried.
    Trying,
    /// The person wants the map.
    Finished,
}

/// What happened.
#[derive(Debug, Clone, PartialEq)]
pub enum News {
    /// A pose is asked.
    Asked(Vec<f32>),
    /// It was taken: pair number so, from 1. The pairs are to be kept.
    Taken(usize),
    /// It was refused.
    Refused(Doubt),
    /// A pair was taken back or brought back; so many are left. They are to be kept.
    Changed(usize),
    /// A pose was passed over. What was is to be kept.
    PassedOver,
    /// The learner is to say what comes next.
    Learn(Wanted),
    /// All pairs are there.
    Complete,
}

impl News {
    /// A newer one of the same kind says all that an older one did: what comes next is one of three.
    fn kind(&self) -> u8 {
        match self {
            Self::Asked(_) | Self::Learn(_) | Self::Complete => 0,
            Self::Taken(_) => 1,
            Self::Refused(_) => 2,
            Self::Changed(_) => 3,
            Self::PassedOver => 4,
        }
    }
}

/// What an earlier session left.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Earlier {
    /// The pairs, in their order.
    pub pairs: Vec<Taught>,
    /// Targets that were passed over.
    pub passed_over: Matrix,
}

/// How often something happened that no newer news may hide.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Poses that were refused.
    pub refused: usize,
    /// Pairs that were taken back.
    pub taken_back: usize,
}

/// What is asked now.
#[derive(Debug, Clone, PartialEq)]
pub struct Ask {
    /// Where it stands.
    pub state: State,
    /// The pose to mimic.
    pub target: Option<Vec<f32>>,
    /// Which pair this is, from 1, and of how many; the start poses count.
    pub number: usize,
    /// See [`Ask::number`].
    pub of: usize,
    /// 0 the open hand, 1 the fist, else `None`.
    pub start: Option<usize>,
}

/// The session.
#[derive(Debug)]
pub struct Teaching {
    aim: Aim,
    start: Vec<Vec<f32>>,
    rounds: usize,
    pairs: Vec<Taught>,
    taken_back: Vec<Taught>,
    passed_over: Matrix,
    target: Option<Vec<f32>>,
    hold: Hold,
    refused: Option<(Doubt, Instant)>,
    /// Of the newest question to the learner.
    asked: u64,
    is_waiting: bool,
    finished: bool,
    counts: Counts,
    /// What was not heard yet: of each kind the newest.
    news: VecDeque<News>,
}

impl Teaching {
    /// A session of `rounds` adaptive pairs after the start poses, or of as many as `earlier` has.
    pub fn new(aim: Aim, rounds: usize, earlier: Earlier, now: Instant) -> Self {
        let start = aim.start();
        let mut teaching = Self {
            rounds: rounds
                .clamp(1, MOST_PAIRS)
                .max(earlier.pairs.len().saturating_sub(start.len())),
            aim,
            start,
            pairs: earlier.pairs,
            taken_back: Vec::new(),
            passed_over: earlier.passed_over,
            target: None,
            hold: Hold::default(),
            refused: None,
            asked: 0,
            is_waiting: false,
            finished: false,
            counts: Counts::default(),
            news: VecDeque::new(),
        };
        teaching.go_on(now);
        teaching
    }

    /// The pairs so far, the start poses first.
    pub fn pairs(&self) -> &[Taught] {
        &self.pairs
    }

    /// Targets that were passed over.
    pub fn passed_over(&self) -> &Matrix {
        &self.passed_over
    }

    /// What happened so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// What is taught.
    pub fn aim(&self) -> &Aim {
        &self.aim
    }

    /// The next news, in order.
    pub fn next_news(&mut self) -> Option<News> {
        self.news.pop_front()
    }

    /// Takes a scan of the whole hand, radians.
    pub fn take(&mut self, angles: &[f32; JOINT_COUNT], at: Instant) {
        let held = self.hold.take(at, angles);
        if self.target.is_none() || self.is_pausing(at) {
            return;
        }
        if let Some(angles) = held {
            self.show(angles, false, at);
        }
    }

    /// Time passes.
    pub fn pass(&mut self, now: Instant) {
        self.hold.pass(now);
    }

    /// Does what the person wants.
    pub fn act(&mut self, act: Act, now: Instant) {
        match act {
            Act::Capture if self.target.is_some() => match self.hold.at_once() {
                Some(angles) => {
                    let insists = self.refused.is_some_and(|(doubt, _)| doubt.may_insist());
                    self.show(angles, insists, now);
                }
                None => self.refuse(Doubt::Unseen, now),
            },
            Act::Undo => {
                if let Some(pair) = self.pairs.pop() {
                    self.taken_back.push(pair);
                    self.counts.taken_back += 1;
                    self.changed(now);
                }
            }
            Act::Redo => {
                if let Some(pair) = self.taken_back.pop() {
                    self.pairs.push(pair);
                    self.changed(now);
                }
            }
            // The start poses are needed: without them an open hand need not be an open gripper.
            Act::Skip if self.pairs.len() >= self.start.len() => {
                if let Some(target) = self.target.take() {
                    self.passed_over.push(&target);
                    self.tell(News::PassedOver);
                    self.go_on(now);
                }
            }
            Act::More if self.is_complete() && self.rounds < MOST_PAIRS => {
                self.rounds += 1;
                self.finished = false;
                self.go_on(now);
            }
            Act::Finish if self.is_complete() => self.finished = true,
            Act::Capture | Act::Skip | Act::More | Act::Finish => {}
        }
    }

    /// The learner's answer to question `number`: the next target, none where there are pairs enough.
    pub fn learned(&mut self, number: u64, target: Option<Vec<f32>>, now: Instant) {
        if number != self.asked || !std::mem::take(&mut self.is_waiting) {
            return;
        }
        match target.filter(|_| !self.is_complete()) {
            Some(target) => self.ask_for(target, now),
            None => self.tell(News::Complete),
        }
    }

    /// Whether every pair is there.
    pub fn is_complete(&self) -> bool {
        self.pairs.len() >= self.start.len() + self.rounds
    }

    /// What is asked now.
    pub fn ask(&self, now: Instant) -> Ask {
        let state = match (&self.target, self.refused) {
            _ if self.finished => State::Finished,
            (Some(_), Some((doubt, _))) if self.is_pausing(now) => State::Refused(doubt),
            (Some(_), _) => State::Asking(self.hold.stage(now)),
            (None, _) if self.is_waiting => State::Choosing,
            (None, _) => State::Trying,
        };
        let of = self.start.len() + self.rounds;
        let place = self.pairs.len();
        Ask {
            state,
            target: self.target.clone(),
            number: (place + 1).min(of),
            of,
            start: (place < self.start.len() && self.target.is_some()).then_some(place),
        }
    }

    /// The question that the pairs so far pose to the learner.
    fn wanted(&mut self) -> Wanted {
        self.asked += 1;
        let mut sets = [Pairs::default(), Pairs::default()];
        for (k, pair) in self.pairs.iter().enumerate() {
            let set = &mut sets[usize::from(k >= self.start.len())];
            set.inputs.push(&pair.angles);
            set.targets.push(&pair.target);
        }
        let [start, taught] = sets;
        Wanted {
            number: self.asked,
            start,
            taught,
            passed_over: self.passed_over.clone(),
        }
    }

    /// To the next start pose, or to the learner.
    fn go_on(&mut self, now: Instant) {
        self.target = None;
        self.refused = None;
        if let Some(target) = self.start.get(self.pairs.len()) {
            self.is_waiting = false;
            self.ask_for(target.clone(), now);
        } else {
            self.is_waiting = true;
            let wanted = self.wanted();
            self.tell(News::Learn(wanted));
        }
    }

    fn ask_for(&mut self, target: Vec<f32>, now: Instant) {
        self.hold
            .ask(now, self.pairs.last().map(|pair| pair.angles));
        self.target = Some(target.clone());
        self.tell(News::Asked(target));
    }

    /// The hand showed this for the target.
    fn show(&mut self, angles: [f32; JOINT_COUNT], insists: bool, now: Instant) {
        let Some(target) = self.target.clone() else {
            return;
        };
        match doubt(&angles, &target, &self.pairs, &self.aim) {
            Some(doubt) if !(insists && doubt.may_insist()) => self.refuse(doubt, now),
            _ => {
                self.pairs.push(Taught { target, angles });
                // What was taken back belongs to another course of things.
                self.taken_back.clear();
                let number = self.pairs.len();
                self.tell(News::Taken(number));
                self.go_on(now);
            }
        }
    }

    fn refuse(&mut self, doubt: Doubt, now: Instant) {
        // The same is said once while the hand goes on showing it.
        if !self.is_pausing(now) {
            self.refused = Some((doubt, now));
            self.counts.refused += 1;
            self.tell(News::Refused(doubt));
        }
    }

    fn changed(&mut self, now: Instant) {
        self.finished = false;
        let left = self.pairs.len();
        self.tell(News::Changed(left));
        self.go_on(now);
    }

    fn is_pausing(&self, now: Instant) -> bool {
        self.refused
            .is_some_and(|(_, at)| since(now, at).as_ticks() < AGAIN)
    }

    fn tell(&mut self, news: News) {
        self.news.retain(|older| older.kind() != news.kind());
        self.news.push_back(news);
    }
}

#[cfg(test)]
mod tests;
