//! A whole live training by the virtual person, on the virtual clock: with the person's bare joint angles, or through every byte of an
//! honest glove.

use std::time::Duration as Time;

use anyhow::Result;
use host::glove::calibration::Bound;
use host::glove::hand::{JOINT_COUNT, SEGMENT_COUNT};
use host::glove::scan::{self, Scanner};
use host::glove::{Duration, Instant};
use host::trainer::algorithm::Schedule;
use host::trainer::hand::Space;
use rig::glove::VirtualGlove;
use rig::person::{Attitude, Playing, Task};
use rig::{Clock, MemoryWire, PoseSource};
use rustix::time::{ClockId, clock_gettime};

use super::{Wearer, mimicked};
use crate::played::source;
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::lines::port::BAUD;
use host::report::Nobody;
use host::scanning::{Flat, Hand, Scanned};
use host::teaching::kept::{Kept, load_pairs, matrices};
use host::teaching::{Act, Aim, Earlier, Free, LAST_STAGE, News, State, Taught, Teaching};
use host::training::Course;
use host::training::judgement::Judgement;
use host::training::lessons::{Finished, Lessons};
use host::training::motion::Motion;
use host::training::pairs_kept::reference_pairs;
use host::training::quality::Quality;

/// A scan of the bare hand, as often as a glove at full speed gives one.
const SCAN: Duration = Duration::from_ticks(28_000);
/// The longest that a session may last, of the person's time.
const LONGEST: Duration = Duration::from_ticks(900_000_000);
/// The longest that a glove, or a flat hand, is waited for.
const UP: Duration = Duration::from_ticks(60_000_000);
/// The longest that nothing is looked at.
const LOOK: Duration = Duration::from_ticks(20_000);

/// What shows poses: a hand on a clock that waits for nobody.
pub trait Body {
    /// Goes on to the next thing that happens; a whole pose, where one came.
    fn step(&mut self) -> Option<(Instant, [f32; JOINT_COUNT])>;
    /// The time.
    fn now(&self) -> Instant;
    /// Asks the person.
    fn ask(&mut self, task: Task);
}

/// The person's own joint angles.
pub struct Bare {
    person: Playing,
    now: Instant,
}

impl Bare {
    /// The hand of `wearer`.
    pub fn new(wearer: &Wearer) -> Self {
        let motion = Motion::Generated { seed: wearer.seed };
        Self {
            person: Playing::new(wearer.traits(), source(&motion)),
            // Past what a hand does when a port is opened.
            now: Instant::from_ticks(0),
        }
    }
}

impl Body for Bare {
    fn step(&mut self) -> Option<(Instant, [f32; JOINT_COUNT])> {
        self.now += SCAN;
        let angles = self.person.pose_at(seconds(self.now));
        Some((self.now, angles))
    }

    fn now(&self) -> Instant {
        self.now
    }

    fn ask(&mut self, task: Task) {
        PoseSource::ask(&mut self.person, task);
    }
}

/// An honest glove, calibrated, with one flat pose taken.
pub struct Gloved {
    clock: Clock,
    glove: VirtualGlove,
    scanner: Scanner<MemoryWire>,
    hand: Hand,
}

impl Gloved {
    /// Powers the glove of `wearer` on and has the hand laid flat.
    ///
    /// # Errors
    /// The glove does not answer, or the flat hand is not taken.
    pub fn new(wearer: &Wearer, bound: &Bound) -> Result<Self> {
        let clock = Clock::new();
        let motion = Motion::Generated { seed: wearer.seed };
        let glove = wearer.playing(source(&motion));
        let wire = MemoryWire::new(&clock, glove.clone(), BAUD);
        let config = scan::Config {
            baud: BAUD,
            ..scan::Config::default()
        };
        let mut gloved = Self {
            scanner: Scanner::new(wire, config).with_set_baud(),
            hand: Hand::with_profile(bound),
            clock,
            glove,
        };
        let end = gloved.now() + UP;
        gloved.glove.ask(Task::Flat);
        let mut scans = 0;
        while scans < 50 {
            scans += u32::from(gloved.scan().is_some_and(|s| s.frame.good() == u16::MAX));
            if gloved.now() > end {
                return Err(
                    Failure::new("the virtual glove does not answer", "another --seed").into(),
                );
            }
        }
        let wait = Duration::from_ticks(30_000_000);
        gloved.hand.begin_flat(gloved.now(), wait);
        while *gloved.hand.flat() != Flat::Taken {
            let _ = gloved.step();
            if let Flat::Refused(why) = gloved.hand.flat() {
                let what = format!("the virtual person's flat hand was not taken: {why}");
                return Err(Failure::new(what, "another --seed").into());
            }
            gloved.hand.pass(gloved.clock.now());
        }
        gloved.glove.ask(Task::Use(Attitude::PalmDown));
        Ok(gloved)
    }

    fn scan(&mut self) -> Option<Scanned> {
        let now = self.clock.now();
        let frame = self.scanner.poll(now);
        let soonest = Instant::from_ticks(now.as_ticks() + 1);
        let due = self.scanner.next_due().unwrap_or(now + LOOK);
        self.clock.wait_until(due.min(now + LOOK).max(soonest));
        let starts: [u16; SEGMENT_COUNT] = self.scanner.counters().starts;
        let ids = self.scanner.ids();
        frame.map(|frame| Scanned {
            frame,
            at: now,
            starts,
            ids,
        })
    }
}

impl Body for Gloved {
    fn step(&mut self) -> Option<(Instant, [f32; JOINT_COUNT])> {
        let scanned = self.scan()?;
        let pose = self.hand.take(&scanned);
        pose.is_whole().then_some((pose.at, pose.angles))
    }

    fn now(&self) -> Instant {
        self.clock.now()
    }

    fn ask(&mut self, task: Task) {
        self.glove.ask(task);
    }
}

/// What is taught, and how.
#[derive(Debug, Clone)]
pub struct Lived {
    /// The gripper.
    pub space: Space,
    /// Adaptive pairs.
    pub rounds: usize,
    /// Of the training.
    pub seed: u64,
    /// In this pair (from 1) the person shows nonsense.
    pub nonsense: Option<usize>,
    /// Starts of the last stage; none said: as many as end in time.
    pub starts: Option<usize>,
}

/// What came of it.
pub struct Came {
    /// The pairs.
    pub pairs: Vec<Taught>,
    /// Poses that were refused.
    pub refused: usize,
    /// How long the person took, s of its time.
    pub person_s: f64,
    /// The longest time from a pose taken to the next, processor seconds here.
    pub next_pose_s: f64,
}

impl Lived {
    /// The free motion, kept in the session's files.
    ///
    /// # Errors
    /// The file cannot be written; it does not end.
    pub fn free_motion(&self, body: &mut dyn Body, kept: &Kept) -> Result<()> {
        let mut free = Free::new(body.now());
        let end = body.now() + LONGEST;
        while !free.is_over() && body.now() < end {
            if let Some((at, angles)) = body.step() {
                let _ = free.take(&angles, at);
            }
            free.pass(body.now());
        }
        kept.keep_motion(free.rows())
    }

    /// The trainer's half, with the motion that was kept.
    ///
    /// # Errors
    /// A failure that says what is wrong with the motion.
    pub fn lessons(&self, kept: &Kept) -> Result<(Lessons, Motion)> {
        let motion = Motion::open_for_training(Some(&kept.poses), self.seed, &Nobody)?;
        // One thread: the same map, and a computer with other work does not stop it.
        let course = Course {
            threads: Some(1),
            starts: self.starts,
            // Two processors share them otherwise.
            within: self.starts.is_none().then_some(2 * LAST_STAGE),
            ..Course::hae(Schedule::Fast, None, self.seed)
        };
        let lessons = Lessons::of_gripper(&motion, self.space, course, &Nobody)?;
        Ok((lessons, motion))
    }

    /// The poses, going on with those that were kept; `stops` ends it as a killed program ends.
    ///
    /// # Errors
    /// The files, or the training; it does not end.
    pub fn poses(
        &self,
        body: &mut dyn Body,
        lessons: &mut Lessons,
        kept: &Kept,
        stops: &mut dyn FnMut(&Teaching) -> bool,
    ) -> Result<Came> {
        let aim = Aim::Gripper(self.space);
        let earlier = Earlier {
            pairs: match kept.pairs.exists() {
                true => load_pairs(&kept.pairs, &aim)?,
                false => Vec::new(),
            },
            passed_over: kept.load_passed_over(&aim)?,
        };
        let begun = body.now();
        let mut teaching = Teaching::new(aim, self.rounds, earlier, begun);
        let mut slowest = Time::ZERO;
        loop {
            while let Some(news) = teaching.next_news() {
                match news {
                    News::Asked(target) => self.show(body, &target, teaching.pairs().len() + 1),
                    News::Taken(_) | News::Changed(_) => {
                        kept.keep_pairs(teaching.pairs(), teaching.aim())?;
                    }
                    News::PassedOver => kept.keep_passed_over(teaching.passed_over())?,
                    News::Refused(doubt) => {
                        if doubt.may_insist() && teaching.counts().refused > 3 {
                            teaching.act(Act::Skip, body.now());
                        }
                    }
                    News::Learn(wanted) => {
                        let began = worked();
                        let lesson =
                            lessons.next(&wanted.start, &wanted.taught, &wanted.passed_over)?;
                        slowest = slowest.max(worked().saturating_sub(began));
                        teaching.learned(wanted.number, lesson.target, body.now());
                    }
                    News::Complete => teaching.act(Act::Finish, body.now()),
                }
            }
            if teaching.ask(body.now()).state == State::Finished || stops(&teaching) {
                break;
            }
            if host::clock::since(body.now(), begun) > LONGEST {
                let what = format!("the session does not end: {:?}", teaching.ask(body.now()));
                return Err(Failure::new(what, "the same again").into());
            }
            if let Some((at, angles)) = body.step() {
                teaching.take(&angles, at);
            }
            teaching.pass(body.now());
        }
        Ok(Came {
            pairs: teaching.pairs().to_vec(),
            refused: teaching.counts().refused,
            person_s: seconds(body.now()) - seconds(begun),
            next_pose_s: slowest.as_secs_f64(),
        })
    }

    /// What the person shows for a target: nonsense in one pair.
    fn show(&self, body: &mut dyn Body, target: &[f32], number: usize) {
        let shown: Vec<f32> = match self.nonsense == Some(number) {
            // The opposite of what is asked.
            true => target.iter().map(|count| 255.0 - count).collect(),
            false => target.to_vec(),
        };
        if let Some(task) = mimicked(&self.space.nearest(&shown)) {
            body.ask(task);
        }
    }

    /// The last stage, and the verdict.
    ///
    /// # Errors
    /// The training.
    pub fn finish(
        &self,
        lessons: &mut Lessons,
        motion: &Motion,
        pairs: &[Taught],
        interrupt: &Interrupt,
    ) -> Result<(Finished, Judgement)> {
        let finished = lessons.finish_quietly(matrices(pairs), interrupt)?;
        let quality = Quality::from_measured(&finished.measured, self.space);
        let map = (&finished.model, self.space);
        let pairs = reference_pairs(&finished.model);
        let judgement = Judgement::of(map, &motion.frames(), pairs.as_ref(), quality);
        Ok((finished, judgement))
    }
}

/// What this program has worked so far, of all its threads: with one at work it is the time that a quiet computer takes, however much else
/// this one has to do.
fn worked() -> Time {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    Time::new(
        u64::try_from(time.tv_sec).unwrap_or(0),
        u32::try_from(time.tv_nsec).unwrap_or(0),
    )
}

fn seconds(at: Instant) -> f64 {
    at.as_ticks() as f64 * 1e-6
}

#[cfg(test)]
mod tests;
