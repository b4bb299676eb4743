//! The whole guided session on the virtual clock: every byte of its minute, in a second or two.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Instant as Here, SystemTime};

use anyhow::Result;
use host::glove::calibration::{Align, Bound, Verdict};
use host::glove::hand::{JOINT_COUNT, SEGMENT_COUNT};
use host::glove::headings::{Config, Headings};
use host::glove::imu::UniqueId;
use host::glove::scan::{self, Frame, Scanner};
use host::glove::{Duration, Instant};
use rig::person::{Attitude, Person, Task};
use rig::{Clock, MemoryWire, PoseSource};
use serde::Serialize;

use super::{Wearer, task};
use host::calibration::guide::News;
use host::calibration::{Guide, Judged, Kept};
use host::clock::rfc3339;
use host::failure::Failure;
use host::interrupt::Interrupt;
use host::lines::port::BAUD;

/// By then the glove has answered, with every sensor.
const UP: Duration = Duration::from_ticks(20_000_000);
/// The longest that a session may last: each step three times, and time to spare.
const LONGEST: Duration = Duration::from_ticks(600_000_000);
/// The longest that nothing is looked at: the guide's time goes on without scans, too.
const LOOK: Duration = Duration::from_ticks(20_000);
/// How long the hand is then used, to see what the calibration is worth.
const USED: Duration = Duration::from_ticks(8_000_000);
/// What comes before: from the last flat pose into use.
const BEFORE: Duration = Duration::from_ticks(2_000_000);
/// A scan's orientations are as of the end of a fusion period: half a period before the scan's beginning in the mean.
const BEHIND: f64 = 0.005;

/// What came of it.
#[derive(Debug, Clone)]
pub struct Calibrated {
    /// With its verdict.
    pub judged: Judged,
    /// The profile, as it is kept.
    pub kept: Kept,
    /// How long the session took the person, seconds.
    pub lasted_s: f64,
    /// How long it took here, seconds.
    pub took_s: f64,
    /// Steps that were asked for again.
    pub repeated: usize,
    /// How far the angles then were from the truth.
    pub fit: Fit,
}

/// Root mean squares of how far angles are from the truth while the hand is used, degrees: known of a virtual hand alone.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Fit {
    /// Of the ten hinges.
    pub hinges_deg: f64,
    /// Of the flexion of the four fingers' bases.
    pub mcp_flexion_deg: f64,
    /// Of their abduction.
    pub mcp_abduction_deg: f64,
    /// Of the thumb's base.
    pub thumb_base_deg: f64,
}

/// The person in the glove, whom the session asks and who knows the truth.
#[derive(Clone)]
struct Shared(Arc<Mutex<Person>>);

impl Shared {
    fn with<T>(&self, act: impl FnOnce(&mut Person) -> T) -> T {
        act(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl PoseSource for Shared {
    fn pose_at(&mut self, time_s: f64) -> [f32; JOINT_COUNT] {
        self.with(|person| person.pose_at(time_s))
    }

    fn attitude_at(&mut self, time_s: f64) -> Option<[f64; 4]> {
        self.with(|person| person.attitude_at(time_s))
    }
}

struct Bench {
    clock: Clock,
    scanner: Scanner<MemoryWire>,
    person: Shared,
}

impl Bench {
    fn new(wearer: &Wearer) -> Self {
        let clock = Clock::new();
        let person = Shared(Arc::new(Mutex::new(Person::new(wearer.traits()))));
        let glove = wearer.glove(Box::new(person.clone()));
        let wire = MemoryWire::new(&clock, glove, BAUD);
        let config = scan::Config {
            baud: BAUD,
            ..scan::Config::default()
        };
        Self {
            scanner: Scanner::new(wire, config).with_set_baud(),
            clock,
            person,
        }
    }

    /// Goes on to the next thing that happens.
    fn step(&mut self) -> Option<Frame> {
        let now = self.clock.now();
        let frame = self.scanner.poll(now);
        let soonest = Instant::from_ticks(now.as_ticks() + 1);
        let due = self.scanner.next_due().unwrap_or(now + LOOK);
        self.clock.wait_until(due.min(now + LOOK).max(soonest));
        frame
    }

    fn ask(&self, task: Task) {
        let now = seconds(self.clock.now());
        self.person.with(|person| person.ask(task, now));
    }

    fn starts(&self) -> [u16; SEGMENT_COUNT] {
        self.scanner.counters().starts
    }
}

fn seconds(at: Instant) -> f64 {
    at.as_ticks() as f64 * 1e-6
}

impl Wearer {
    /// Leads this person through the calibration, with the glove on a wire of 115,200 baud from its power-on, on a clock that waits for
    /// nobody. Ends early where somebody asks for the end.
    ///
    /// # Errors
    /// A session that came to nothing, or whose verdict is bad; the end that was asked for.
    pub fn calibrated(&self, interrupt: &Interrupt) -> Result<Calibrated> {
        let started = Here::now();
        let mut bench = Bench::new(self);
        let ids = bring_up(&mut bench)?;
        let mut session = Led::new(&mut bench);
        let end = session.bench.clock.now() + LONGEST;
        while session.guide.ended().is_none() {
            if interrupt.asked() {
                return Err(Failure::new(
                    "ended before the virtual person was calibrated",
                    "the same again",
                )
                .into());
            }
            if session.bench.clock.now() > end {
                return Err(failed("it does not end"));
            }
            session.round();
        }
        let (lasted, repeated) = (session.lasted(), session.repeated);
        let (mut align, starts) = (session.align, session.starts);
        let judged = match session.guide.ended() {
            Some(Ok(judged)) => judged.clone(),
            Some(Err(unfinished)) => return Err(failed(&unfinished.to_string())),
            None => return Err(failed("it did not end")),
        };
        if judged.verdict() == Verdict::Bad {
            let what = judged
                .findings()
                .first()
                .map_or_else(String::new, |f| f.what.clone());
            return Err(failed(&what));
        }
        let fit = used(&mut bench, &judged, &mut align, starts);
        Ok(Calibrated {
            kept: judged.kept(ids, rfc3339(SystemTime::now())),
            judged,
            lasted_s: lasted,
            took_s: started.elapsed().as_secs_f64(),
            repeated,
            fit,
        })
    }
}

fn failed(what: &str) -> anyhow::Error {
    let what = format!("the virtual person's calibration came to nothing: {what}");
    Failure::new(what, "another --seed, or --ideal").into()
}

/// Until every sensor gives orientations and has told its id.
fn bring_up(bench: &mut Bench) -> Result<[UniqueId; SEGMENT_COUNT]> {
    let end = bench.clock.now() + UP;
    let mut frames = 0;
    while bench.clock.now() < end {
        frames += u32::from(bench.step().is_some_and(|frame| frame.good() == u16::MAX));
        if let Some(ids) = whole(&bench.scanner.ids()).filter(|_| frames > 10) {
            return Ok(ids);
        }
    }
    Err(failed("its glove does not answer"))
}

fn whole(ids: &[Option<UniqueId>; SEGMENT_COUNT]) -> Option<[UniqueId; SEGMENT_COUNT]> {
    let known = ids.iter().all(Option::is_some);
    known.then(|| ids.map(Option::unwrap_or_default))
}

/// The session under way.
struct Led<'a> {
    bench: &'a mut Bench,
    guide: Guide,
    /// As the guide's own, for what comes after it.
    align: Align,
    starts: [u16; SEGMENT_COUNT],
    began: Option<Instant>,
    repeated: usize,
}

impl<'a> Led<'a> {
    fn new(bench: &'a mut Bench) -> Self {
        let mut guide = Guide::new(None);
        guide.go_on(bench.clock.now());
        Self {
            starts: bench.starts(),
            bench,
            guide,
            align: Align::new(),
            began: None,
            repeated: 0,
        }
    }

    fn round(&mut self) {
        if let Some(frame) = self.bench.step() {
            self.starts = self.bench.starts();
            self.guide.take(&frame, &self.starts);
            self.align.take(&frame);
        }
        let now = self.bench.clock.now();
        self.guide.pass(now);
        while let Some(news) = self.guide.next_news() {
            match news {
                News::Asked(step) => {
                    self.began.get_or_insert(now);
                    self.bench.ask(task(step));
                }
                News::Again(..) => self.repeated += 1,
                News::Note(_) | News::Over => {}
            }
        }
    }

    fn lasted(&self) -> f64 {
        let now = self.bench.clock.now();
        self.began
            .map_or(0.0, |began| seconds(now) - seconds(began))
    }
}

/// How far the angles are from the truth while the person goes on to use the hand.
fn used(
    bench: &mut Bench,
    judged: &Judged,
    align: &mut Align,
    starts: [u16; SEGMENT_COUNT],
) -> Fit {
    let begun = bench.clock.now();
    let mut headings = Headings::start(&judged.outcome, begun, Config::default());
    bench.ask(Task::Use(Attitude::PalmDown));
    let mut off = [0.0; JOINT_COUNT];
    let mut frames = 0.0;
    while bench.clock.now() < begun + BEFORE + USED {
        let Some(frame) = bench.step() else { continue };
        let reading = headings.take(&align.take(&frame));
        // A sensor that started anew meanwhile: not in a virtual glove without faults.
        if bench.clock.now() < begun + BEFORE || bench.starts() != starts {
            continue;
        }
        let truth = bench
            .person
            .with(|person| person.angles(seconds(reading.at) - BEHIND));
        for (sum, (angle, truth)) in off.iter_mut().zip(reading.angles.iter().zip(truth)) {
            *sum += (f64::from(*angle) - truth).to_degrees().powi(2);
        }
        frames += 1.0;
    }
    let of = |joints: &dyn Fn(usize) -> bool| {
        let joints: Vec<f64> = (0..JOINT_COUNT)
            .filter(|j| joints(*j))
            .map(|j| off[j])
            .collect();
        let mean = joints.iter().sum::<f64>() / joints.len() as f64 / f64::max(frames, 1.0);
        (mean.sqrt() * 1e3).round() / 1e3
    };
    Fit {
        hinges_deg: of(&|j| j % 5 > 2),
        mcp_flexion_deg: of(&|j| j >= 5 && j % 5 == 0),
        mcp_abduction_deg: of(&|j| j >= 5 && j % 5 == 1),
        thumb_base_deg: of(&|j| j < 3),
    }
}

impl Calibrated {
    /// The profile with its sensors' ids.
    pub fn bound(&self) -> &Bound {
        &self.kept.bound
    }

    /// How good it came out, and how long it took.
    pub fn line(&self) -> String {
        let joints = self.judged.joints();
        let good = joints.iter().filter(|joint| joint.verdict == "good");
        format!(
            "{}, {} of {} joints good, in {:.1} s of its time ({:.1} s here)",
            self.kept.quality.verdict,
            good.count(),
            joints.len(),
            self.lasted_s,
            self.took_s
        )
    }
}

impl Fit {
    /// For a person.
    pub fn line(&self) -> String {
        format!(
            "{:.1}° off the truth at the hinges, {:.1}° and {:.1}° at the fingers' bases (bent, spread), {:.1}° at the thumb's base",
            self.hinges_deg, self.mcp_flexion_deg, self.mcp_abduction_deg, self.thumb_base_deg
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_person_is_calibrated_within_a_minute_of_its_time_and_well() {
        for seed in 1..=4 {
            let wearer = Wearer::new(seed);
            let done = wearer.calibrated(&Interrupt::never().unwrap()).unwrap();
            println!(
                "seed {seed}: {:.1} s in {:.2} s, {:?}",
                done.lasted_s, done.took_s, done.fit
            );
            assert!(done.lasted_s < 60.0, "seed {seed}: {} s", done.lasted_s);
            assert_eq!(done.repeated, 0, "seed {seed}");
            assert_ne!(done.judged.verdict(), Verdict::Bad);
            assert!(done.fit.hinges_deg < 3.0, "seed {seed}: {:?}", done.fit);
            assert!(
                done.fit.mcp_flexion_deg < 4.0,
                "seed {seed}: {:?}",
                done.fit
            );
        }
    }

    #[test]
    fn another_seed_is_another_glove_and_the_same_one_the_same() {
        let of = |seed| {
            let done = Wearer::new(seed).calibrated(&Interrupt::never().unwrap());
            done.unwrap().kept.bound
        };
        let (one, again, other) = (of(1), of(1), of(2));
        assert_eq!(one, again);
        assert!(one.fits(&other.ids.map(Some)).is_err());
    }
}
