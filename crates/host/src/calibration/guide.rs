//! The guided session: leads a person through the calibration, says what it sees meanwhile, and judges what came of it.
//!
//! It decides only: scans ([`Guide::take`]), the time ([`Guide::pass`]) and what the person wants ([`Guide::go_on`],
//! [`Guide::again`]) go in; what to ask for now ([`Guide::ask`]), what happened ([`Guide::next_news`]) and in the end a [`Judged`]
//! outcome come out. A step that went wrong is asked for again, twice at most; what is still wrong then the verdict says. Without
//! a repetition the session lasts 57.6 s.

mod judged;
mod judging;
mod limits;
pub mod plan;
mod pose;
mod remark;
mod watch;

use std::collections::VecDeque;

use glove::calibration::{Align, Aligned, Finger, Identity, Session, Step, Unfinished};
use glove::hand::{SEGMENT_COUNT, Side};
use glove::scan::Frame;
use glove::{Duration, Instant};

use crate::clock::since;
pub use judged::{Again, Check, Finding, Joint, Judged};
use limits::{ACROSS, is_flat};
pub use plan::{PARTS, PLAN, Part};
pub use pose::{FlatPose, PoseEnd, slipped};
pub use remark::Remark;
use watch::{Presence, Rest, Watch};

/// Time to get ready, before the first step and before one that is done again.
pub const READY: Duration = Duration::from_ticks(3_000_000);
/// How often a step that went wrong is asked for again.
pub const REPEATS: u8 = 2;
/// Without a scan for so long something is said.
const SILENT: Duration = Duration::from_ticks(1_000_000);
/// News that wait for whoever tells them.
const NEWS: usize = 32;

/// Something that happened.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum News {
    /// This step is asked for from now on.
    Asked(Step),
    /// It went wrong, and is asked for again after [`READY`].
    Again(Step, Remark),
    /// Something to know; it goes on.
    Note(Remark),
    /// All steps are done: [`Guide::ended`].
    Over,
}

/// What goes on now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Before anybody began.
    Waiting,
    /// A step comes: when.
    Ready(Instant),
    /// A step goes on: since when.
    Doing(Instant),
    /// All steps are done.
    Over,
}

/// What to ask for now, and how it goes.
#[derive(Debug, Clone, PartialEq)]
pub struct Ask {
    /// What goes on.
    pub stage: Stage,
    /// The step; the one that comes, where none goes on yet.
    pub step: Step,
    /// Its place among [`PARTS`], from 1.
    pub number: usize,
    /// Time until it begins, or ends; zero where nothing runs.
    pub left: Duration,
    /// How long all of it lasts.
    pub of: Duration,
    /// Where in the turn the hand should go.
    pub turning: Option<&'static str>,
    /// Scans count now: what the person does is measured.
    pub counts: bool,
    /// Why it is done again, and what is seen now.
    pub remarks: Vec<Remark>,
    /// Of each finger, thumb first: how far its tip is turned against the hand from where it lay flat, radians.
    pub bends: [f32; 5],
    /// How ambiguous the turn still leaves the worst heading: 1 at its beginning, below 0.80 enough.
    pub ratio: Option<f32>,
}

/// The session as it is led.
#[derive(Debug, Clone)]
pub struct Guide {
    declared: Option<Side>,
    align: Align,
    session: Session,
    starts: Option<[u16; SEGMENT_COUNT]>,
    presence: Presence,
    stage: Stage,
    /// Places in the plan that are still to do, the one under way first.
    todo: VecDeque<usize>,
    repeats: [u8; PARTS],
    why: Option<Remark>,
    watch: Watch,
    rest: Option<Rest>,
    newest: Option<Aligned>,
    news: VecDeque<News>,
    ended: Option<Result<Judged, Unfinished>>,
}

impl Guide {
    /// A session that nobody has begun. `declared`: which hand the person says it is.
    pub fn new(declared: Option<Side>) -> Self {
        Self {
            declared,
            align: Align::new(),
            session: Session::new(),
            starts: None,
            presence: Presence::new(),
            stage: Stage::Waiting,
            todo: (0..PARTS).collect(),
            repeats: [0; PARTS],
            why: None,
            watch: Watch::new(),
            rest: None,
            newest: None,
            news: VecDeque::new(),
            ended: None,
        }
    }

    /// How long the session lasts without a repetition.
    pub fn lasts() -> Duration {
        Duration::from_ticks(1_000 * PLAN.iter().map(|part| part.lasts).sum::<u64>())
    }

    fn part(&self) -> (usize, Part) {
        let place = self.todo.front().copied().unwrap_or(PARTS - 1);
        (place, PLAN[place.min(PARTS - 1)])
    }

    /// The person wants to begin; or, while the next step is counted down, not to wait for it.
    pub fn go_on(&mut self, now: Instant) {
        match self.stage {
            Stage::Waiting => self.stage = Stage::Ready(now + READY),
            Stage::Ready(_) => self.begin_part(now),
            Stage::Doing(_) | Stage::Over => {}
        }
    }

    /// The person wants the step that goes on, or just comes, once more. When all is over: what the verdict asks for, else the last flat
    /// pose.
    pub fn again(&mut self, now: Instant) {
        match self.stage {
            Stage::Waiting => self.go_on(now),
            Stage::Over => {
                let again = match &self.ended {
                    Some(Ok(judged)) => judged.again().unwrap_or(Again::LastFlat),
                    _ => Again::All,
                };
                self.repeat(again, now);
            }
            Stage::Ready(_) => self.stage = Stage::Ready(now + READY),
            Stage::Doing(_) => {
                self.session.end();
                self.why = None;
                self.stage = Stage::Ready(now + READY);
            }
        }
    }

    /// Does a part of the session once more.
    pub fn repeat(&mut self, again: Again, now: Instant) {
        if again == Again::All {
            let declared = self.declared;
            let (align, starts, presence) =
                (self.align.clone(), self.starts, self.presence.clone());
            *self = Self {
                align,
                starts,
                presence,
                ..Self::new(declared)
            };
        }
        self.todo = judged::places(again).collect();
        self.repeats = [0; PARTS];
        (self.ended, self.why) = (None, None);
        self.stage = Stage::Ready(now + READY);
    }

    fn begin_part(&mut self, now: Instant) {
        self.watch = Watch::new();
        self.stage = Stage::Doing(now);
        self.tell(News::Asked(self.part().1.step));
    }

    fn tell(&mut self, news: News) {
        if self.news.len() == NEWS {
            self.news.pop_front();
        }
        self.news.push_back(news);
    }

    /// What happened since, the oldest first; of many the newest 32.
    pub fn next_news(&mut self) -> Option<News> {
        self.news.pop_front()
    }

    /// Takes a scan, in the order of their times. `starts`: how often each sensor had started by then.
    pub fn take(&mut self, frame: &Frame, starts: &[u16; SEGMENT_COUNT]) {
        let before = self.starts.replace(*starts).unwrap_or(*starts);
        for k in (0..SEGMENT_COUNT).filter(|&k| before[k] != starts[k]) {
            self.align.forget(k);
            self.session.restarted(k);
            if before[k] != 0 && self.stage != Stage::Waiting {
                self.tell(News::Note(Remark::Restarted(k)));
            }
        }
        let scan = self.align.take(frame);
        self.presence.take(&scan);
        self.newest = Some(scan);
        let Stage::Doing(began) = self.stage else {
            return;
        };
        let (_, part) = self.part();
        let ms = |ms: u64| Duration::from_ticks(1_000 * ms);
        let counts = scan.at >= began + ms(part.from) && scan.at < began + ms(part.to);
        if counts && self.session.step() != Some(part.step) {
            self.session.begin(part.step);
        }
        self.watch.take(&scan, counts);
        if let Some(rest) = &self.rest {
            self.watch.bend(&scan, rest, &self.session);
        }
        if counts {
            self.session.take(&scan);
        }
    }

    /// Lets the time go on to `now`.
    pub fn pass(&mut self, now: Instant) {
        match self.stage {
            Stage::Ready(at) if now >= at => self.begin_part(now),
            Stage::Doing(began) => {
                let lasts = Duration::from_ticks(1_000 * self.part().1.lasts);
                if since(now, began) >= lasts {
                    self.end_part(now);
                }
            }
            _ => {}
        }
    }

    fn end_part(&mut self, now: Instant) {
        let (place, part) = self.part();
        self.session.end();
        let wrong = self.judge(part.step);
        if is_flat(part.step) && wrong.is_none() {
            self.rest = self.newest.map(Rest);
        }
        if let Some(remark) = wrong
            && self.repeats[place] < REPEATS
        {
            self.repeats[place] += 1;
            self.why = Some(remark);
            self.stage = Stage::Ready(now + READY);
            if matches!(remark, Remark::Unclear(..)) {
                // One finger says nothing without the others.
                self.todo = plan::ALONE
                    .chain(self.todo.iter().skip(1).copied())
                    .collect();
            }
            let step = self.part().1.step;
            return self.tell(News::Again(step, remark));
        }
        self.why = None;
        self.todo.pop_front();
        if part.step == Step::Alone(Finger::Thumb)
            && let Identity::Moved(seats) = self.session.identity()
        {
            let moved = (0..).zip(seats).filter(|(k, seat)| k != seat).count();
            self.tell(News::Note(Remark::Swapped(moved as u8)));
        }
        if self.todo.is_empty() {
            self.stage = Stage::Over;
            let outcome = self.session.finish();
            self.ended = Some(outcome.map(|outcome| Judged {
                outcome,
                declared: self.declared,
            }));
            return self.tell(News::Over);
        }
        self.begin_part(now);
    }

    /// What to ask for at `now`, and how it goes.
    pub fn ask(&self, now: Instant) -> Ask {
        let (place, part) = self.part();
        let lasts = Duration::from_ticks(1_000 * part.lasts);
        let (left, of, at) = match self.stage {
            Stage::Waiting | Stage::Over => (Duration::from_ticks(0), lasts, None),
            Stage::Ready(at) => (since(at, now), READY, None),
            Stage::Doing(began) => {
                let at = since(now, began);
                (
                    since(began + lasts, now),
                    lasts,
                    Some(at.as_ticks() / 1_000),
                )
            }
        };
        let counts = at.is_some_and(|at| (part.from..part.to).contains(&at));
        let turns = part.step == Step::Turn && at.is_some();
        Ask {
            stage: self.stage,
            step: part.step,
            number: place + 1,
            left,
            of,
            turning: at.filter(|_| turns).map(plan::turning),
            counts,
            remarks: self.remarks(now, part, at),
            bends: self.watch.bends,
            ratio: if turns {
                self.ratio().or(Some(1.0))
            } else {
                None
            },
        }
    }

    fn remarks(&self, now: Instant, part: Part, at: Option<u64>) -> Vec<Remark> {
        let mut remarks: Vec<Remark> = self.why.into_iter().collect();
        let newest = self.presence.scan;
        if self.stage != Stage::Over && newest.is_none_or(|scan| since(now, scan) > SILENT) {
            remarks.push(Remark::NoScans);
            return remarks;
        }
        let away = self.presence.away();
        remarks.extend(
            (0..SEGMENT_COUNT)
                .filter(|k| away >> k & 1 == 1)
                .map(Remark::Away),
        );
        let Some(at) = at else { return remarks };
        // Half a second before it counts the hand should have come to rest.
        let counts = at + 500 >= part.from && at < part.to;
        let share = at as f32 / part.lasts as f32;
        match part.step {
            Step::FirstFlat | Step::SecondFlat | Step::LastFlat if counts => {
                remarks.extend(self.watch.moving().map(Remark::Moves));
            }
            Step::Turn if counts => {
                remarks.extend(self.not_board());
                // Before half of it nobody has turned enough.
                match self.not_turned() {
                    Some(further) if share > 0.5 => remarks.push(further),
                    None if self.ratio().is_some() => remarks.push(Remark::TurnedEnough),
                    _ => {}
                }
            }
            Step::Alone(finger) if share > 0.6 => remarks.extend(self.not_bent(finger)),
            Step::Fists if share > 0.4 => remarks.extend(self.not_closed()),
            Step::Thumb if share > 0.6 && self.watch.thumb_base < ACROSS => {
                remarks.push(Remark::ThumbStays);
            }
            _ => {}
        }
        remarks
    }

    /// What it came to, once all steps are done.
    pub fn ended(&self) -> Option<&Result<Judged, Unfinished>> {
        self.ended.as_ref()
    }
}
