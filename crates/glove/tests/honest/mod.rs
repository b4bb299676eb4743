//! A virtual person in an honest virtual glove: a guided calibration and minutes of use from the bytes of the sensors' registers, and how
//! far the angles are from the true ones.
//!
//! The bytes are those of the virtual chips' registers 20 to 27, read as a scanner reads them: the scan's beginning each 1/35 s, sensor k
//! 1.8 ms times k after it. Bus and serial line in between are left out, for speed; one test of `honest_glove` goes through them.

#![allow(dead_code, reason = "each test takes what it needs")]

mod tally;

use crate::common::Bench;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use glove::Instant;
use glove::calibration::{Align, Aligned, Finger, Outcome, Profile, Reads, Session, Step};
use glove::hand::{self, JOINT_COUNT, Quaternion, SEGMENT_COUNT, Side};
use glove::headings::{Config, Headings};
use rig::glove::{Honest, VirtualGlove};
use rig::person::{Attitude, Person, Prompt, Task, Traits, guided};
pub use tally::Tally;

/// When the session begins, seconds after the clock's start.
pub const BEGINS: f64 = 3.0;
/// When the use begins.
pub const USE_FROM: f64 = BEGINS + 58.0;
/// From when on, and until when, a flat pose in use is taken after it was asked for.
const FLAT_TAKEN: [f64; 2] = [2.0, 4.0];
/// Scans a second.
const RATE: f64 = 35.0;
/// The bytes are true for a moment a little before they are read: half of the chip's 10 ms.
const LATCH: f64 = 0.005;

/// Who does what in which glove.
#[derive(Debug, Clone)]
pub struct Course {
    pub traits: Traits,
    pub honest: Honest,
    pub attitude: Attitude,
    /// How long the use lasts, seconds; 0: the calibration alone.
    pub lasts: f64,
    /// A flat pose each so many seconds.
    pub flat_each: f64,
    /// This segment's sensor slips by the angle (degrees) about an axis of the segment, before the last flat pose.
    pub slip: Option<(usize, f64, [f64; 3])>,
    /// Through the serial line at so many baud, by a scanner from power-on.
    pub by_wire: Option<u32>,
}

impl Course {
    pub fn new(seed: u64) -> Self {
        Self {
            traits: Traits {
                seed,
                ..Traits::default()
            },
            honest: Honest {
                seed: seed + 10_000,
                ..Honest::default()
            },
            attitude: Attitude::PalmDown,
            lasts: 0.0,
            flat_each: 60.0,
            slip: None,
            by_wire: None,
        }
    }

    /// When flat poses are asked for in use.
    fn flats(&self) -> Vec<f64> {
        let times = (1..).map(|i| USE_FROM + self.flat_each * f64::from(i));
        times
            .take_while(|t| *t + 6.0 < USE_FROM + self.lasts)
            .collect()
    }

    pub fn person(&self) -> Person {
        let mut person = Person::new(self.traits.clone());
        for prompt in guided() {
            person.ask(prompt.task, BEGINS + prompt.told);
        }
        person.ask(Task::Use(self.attitude), USE_FROM - 0.5);
        for flat in self.flats() {
            person.ask(Task::Flat, flat);
            person.ask(Task::Use(self.attitude), flat + FLAT_TAKEN[1] + 0.1);
        }
        person
    }

    fn side(&self) -> Side {
        if self.traits.is_left {
            Side::Left
        } else {
            Side::Right
        }
    }
}

/// What came of it.
pub struct Came {
    pub outcome: Outcome,
    /// Of the whole use, flat poses left out; and of its last minute.
    pub corrected: Tally,
    pub last_minute: Tally,
    /// The headings of the calibration kept, nothing corrected.
    pub plain: Tally,
    pub plain_last_minute: Tally,
    /// Bits put back.
    pub repaired: u32,
    pub dropped: u32,
    /// Flat poses that were taken when asked for, and ones found besides.
    pub taken: usize,
    pub found: usize,
}

/// Where scans come from.
enum Way {
    /// The chips' registers.
    Registers {
        glove: VirtualGlove,
        reads: Box<Reads>,
        scans: u64,
    },
    /// The serial line, and a scanner on it from power-on.
    Wire(Box<Bench>),
}

struct Scans {
    way: Way,
    align: Align,
}

impl Scans {
    fn new(course: &Course, person: Person) -> Self {
        let config = rig::glove::Config {
            side: course.side(),
            honest: Some(course.honest.clone()),
            ..rig::glove::Config::at_baud(course.by_wire.unwrap_or(115_200))
        };
        let way = if let Some(baud) = course.by_wire {
            let scan = glove::scan::Config {
                baud,
                status_checks: baud > 115_200,
                ..glove::scan::Config::default()
            };
            let bench = Bench::worn(config, Box::new(person), scan);
            Way::Wire(Box::new(bench))
        } else {
            let glove = VirtualGlove::new(Box::new(person), config);
            glove.bring_up(usize::MAX, instant(BEGINS - 0.1));
            let (reads, scans) = (Box::new(Reads::new()), 0);
            Way::Registers {
                glove,
                reads,
                scans,
            }
        };
        Self {
            way,
            align: Align::new(),
        }
    }

    fn glove(&self) -> &VirtualGlove {
        match &self.way {
            Way::Registers { glove, .. } => glove,
            Way::Wire(bench) => &bench.glove,
        }
    }

    /// The next scan.
    fn next(&mut self) -> Aligned {
        let frame = match &mut self.way {
            Way::Registers {
                glove,
                reads,
                scans,
            } => {
                let at = BEGINS + *scans as f64 / RATE;
                *scans += 1;
                let row = std::array::from_fn(|k| {
                    let stamp = instant(at + 1.8e-3 * k as f64);
                    (glove.read_sample(k, stamp), stamp)
                });
                reads.frame(&row)
            }
            Way::Wire(bench) => bench.next_frame(),
        };
        self.align.take(&frame)
    }
}

fn seconds(at: Instant) -> f64 {
    at.as_ticks() as f64 * 1e-6
}

fn instant(seconds: f64) -> Instant {
    Instant::from_ticks((seconds * 1e6).round() as u64)
}

/// The steps of the session with their windows.
pub fn steps() -> Vec<(Step, Prompt)> {
    let mut flats = [Step::FirstFlat, Step::SecondFlat, Step::LastFlat].into_iter();
    let step = |prompt: Prompt| match prompt.task {
        Task::Flat => flats.next().map(|step| (step, prompt)),
        Task::Turn => Some((Step::Turn, prompt)),
        Task::Alone(finger) => Some((Step::Alone(Finger::ALL[finger]), prompt)),
        Task::Fists => Some((Step::Fists, prompt)),
        Task::Thumb => Some((Step::Thumb, prompt)),
        Task::Free => Some((Step::Free, prompt)),
        _ => None,
    };
    guided().into_iter().filter_map(step).collect()
}

pub fn run(course: &Course) -> Came {
    let person = course.person();
    let mut scans = Scans::new(course, person.clone());
    let (outcome, ended) = calibrate(course, &mut scans);
    let mut headings = Headings::start(&outcome, ended, Config::default());
    let mut came = Came {
        outcome,
        corrected: Tally::default(),
        last_minute: Tally::default(),
        plain: Tally::default(),
        plain_last_minute: Tally::default(),
        repaired: 0,
        dropped: 0,
        taken: 0,
        found: 0,
    };
    let (flats, mut asked) = (course.flats(), false);
    loop {
        let aligned = scans.next();
        let at = seconds(aligned.at);
        if at >= USE_FROM + course.lasts {
            break;
        }
        let lying = flats
            .iter()
            .find(|f| (**f..**f + FLAT_TAKEN[1] + 0.1).contains(&at));
        let taking = lying.is_some_and(|f| (f + FLAT_TAKEN[0]..f + FLAT_TAKEN[1]).contains(&at));
        if taking && !asked {
            headings.begin_flat();
        }
        let reading = headings.take(&aligned);
        if asked && !taking {
            came.taken += usize::from(headings.end_flat(aligned.at).is_ok());
        }
        asked = taking;
        came.found += usize::from(reading.pose.is_some());
        if lying.is_some() || at < USE_FROM {
            continue;
        }
        let truth = person.angles(at - LATCH);
        let plain = angles_of(&came.outcome.profile, &came.outcome.headings, &aligned);
        let missing = reading_mask(&aligned);
        came.corrected.add(&reading.angles, reading.held, &truth);
        came.plain.add(&plain, missing, &truth);
        if at >= USE_FROM + course.lasts - 60.0 {
            came.last_minute.add(&reading.angles, reading.held, &truth);
            came.plain_last_minute.add(&plain, missing, &truth);
        }
    }
    if let Way::Registers { reads, .. } = &scans.way {
        (came.repaired, came.dropped) = (reads.repaired, reads.dropped);
    }
    came
}

/// The session, and when its last step ended.
fn calibrate(course: &Course, scans: &mut Scans) -> (Outcome, Instant) {
    let steps = steps();
    let mut session = Session::new();
    let mut slip = course.slip;
    loop {
        let aligned = scans.next();
        let at = seconds(aligned.at);
        if at > BEGINS + 53.5
            && let Some((segment, degrees, axis)) = slip.take()
        {
            scans
                .glove()
                .slip(course.honest.seats[segment], axis, degrees);
        }
        let window = |p: &Prompt| (BEGINS + p.from..BEGINS + p.to).contains(&at);
        let step = steps.iter().find(|(_, p)| window(p)).map(|(step, _)| *step);
        if step != session.step() {
            if session.step() == Some(Step::LastFlat) {
                return (session.finish().expect("an outcome"), aligned.at);
            }
            match step {
                Some(step) => session.begin(step),
                None => session.end(),
            }
        }
        session.take(&aligned);
    }
}

/// Angles beside a sensor that is not there.
fn reading_mask(aligned: &Aligned) -> u32 {
    (0..SEGMENT_COUNT)
        .filter(|&k| !aligned.is_good(k))
        .fold(0, |mask, k| mask | hand::joints_of_segment(k))
}

/// The angles by fixed headings: what there would be without the filters.
fn angles_of(profile: &Profile, headings: &[f32; 16], aligned: &Aligned) -> [f32; JOINT_COUNT] {
    let about_up = |by: f32| {
        let (sin, cos) = (0.5 * by).sin_cos();
        Quaternion::new_unchecked(nalgebra::Quaternion::new(cos, 0.0, 0.0, sin))
    };
    let segments: [Quaternion; SEGMENT_COUNT] = std::array::from_fn(|k| {
        let q = aligned.orientations[usize::from(profile.sensors[k])];
        about_up(-headings[k]) * q * profile.mounting[k].inverse()
    });
    let sign = if profile.side == Side::Left {
        -1.0
    } else {
        1.0
    };
    let mut angles = [0.0; JOINT_COUNT];
    for k in 1..SEGMENT_COUNT {
        let (finger, behind) = ((k - 1) / 3, (k - 1) % 3);
        let mut parent = segments[hand::parent(k).expect("a parent")];
        if behind > 0 {
            let q = parent.inverse() * segments[k];
            let axis = profile.axes[k];
            let along = q.i * axis[0] + q.j * axis[1] + q.k * axis[2];
            let q_sign = if q.w < 0.0 { -1.0 } else { 1.0 };
            angles[5 * finger + 2 + behind] = 2.0 * (q_sign * along).atan2(q_sign * q.w);
            continue;
        }
        if k == 1 {
            parent *= profile.thumb_base;
        }
        let m = (parent.inverse() * segments[k]).to_rotation_matrix();
        let flexion = (-m[(1, 2)]).atan2(m[(2, 2)]);
        let level = (m[(1, 2)].powi(2) + m[(2, 2)].powi(2)).sqrt();
        let twist = (-m[(0, 1)]).atan2(m[(0, 0)]);
        let abduction = m[(0, 2)].atan2(level);
        for (i, angle) in [flexion, sign * abduction, sign * twist]
            .into_iter()
            .enumerate()
        {
            angles[5 * finger + i] = angle;
        }
    }
    angles
}

/// Runs `work` on all items, on as many threads as the machine has; results in the items' order.
pub fn each<T: Sync, R: Send>(items: &[T], work: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let (next, results) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some((i, item)) = {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    items.get(i).map(|item| (i, item))
                } {
                    let result = work(item);
                    results.lock().expect("no thread failed").push((i, result));
                }
            });
        }
    });
    let mut results = results.into_inner().expect("no thread failed");
    results.sort_by_key(|(i, _)| *i);
    results.into_iter().map(|(_, result)| result).collect()
}
