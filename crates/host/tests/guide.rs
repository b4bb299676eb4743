//! The guided session with a virtual person in an honest virtual glove, on the virtual clock: who does it right, and each thing that
//! can go wrong.
#![allow(missing_docs, clippy::unwrap_used)]

use std::sync::{Arc, Mutex};

use glove::Instant;
use glove::calibration::{Align, Doubt, Finger, Reads, Step, Verdict};
use glove::hand::{SEGMENT_NAMES, Side};
use glove::headings::{Config, Headings};
use glove::scan::Frame;
use host::calibration::guide::{Again, FlatPose, Guide, News, PoseEnd, Remark, Stage, slipped};
use rig::PoseSource;
use rig::glove::{Honest, VirtualGlove};
use rig::person::{Attitude, Person, Task, Traits};

const BEGINS: f64 = 3.0;
const RATE: f64 = 35.0;

/// The person in the glove, whom the test asks.
#[derive(Clone)]
struct Shared(Arc<Mutex<Person>>);

impl PoseSource for Shared {
    fn pose_at(&mut self, time_s: f64) -> [f32; 25] {
        self.0.lock().unwrap().pose_at(time_s)
    }

    fn attitude_at(&mut self, time_s: f64) -> Option<[f64; 4]> {
        self.0.lock().unwrap().attitude_at(time_s)
    }
}

fn instant(seconds: f64) -> Instant {
    Instant::from_ticks((seconds * 1e6).round() as u64)
}

fn task(step: Step) -> Task {
    match step {
        Step::FirstFlat | Step::SecondFlat | Step::LastFlat => Task::Flat,
        Step::Turn => Task::Turn,
        Step::Alone(finger) => Task::Alone(finger.number()),
        Step::Fists => Task::Fists,
        Step::Thumb => Task::Thumb,
        Step::Free => Task::Free,
    }
}

/// Something that happens to the glove.
type Happens = Box<dyn FnOnce(&VirtualGlove, Instant)>;
/// Whether a remark is the expected one.
type Expected = fn(Remark) -> bool;

struct Bench {
    glove: VirtualGlove,
    person: Shared,
    reads: Reads,
    scans: u64,
    guide: Guide,
    news: Vec<News>,
    /// Remarks that were seen, each once.
    remarks: Vec<String>,
    /// Steps that the person does not do when first asked.
    ignores: Vec<Step>,
    /// What happens when a step is asked for.
    on: Vec<(Step, Happens)>,
    /// The glove gives nothing between these.
    silent: [f64; 2],
}

impl Bench {
    fn new(traits: Traits, honest: Honest, declared: Option<Side>) -> Self {
        let side = if traits.is_left {
            Side::Left
        } else {
            Side::Right
        };
        let config = rig::glove::Config {
            side,
            honest: Some(honest),
            ..rig::glove::Config::at_baud(115_200)
        };
        let person = Shared(Arc::new(Mutex::new(Person::new(traits))));
        let glove = VirtualGlove::new(Box::new(person.clone()), config);
        glove.bring_up(usize::MAX, instant(BEGINS - 0.1));
        Self {
            glove,
            person,
            reads: Reads::new(),
            scans: 0,
            guide: Guide::new(declared),
            news: Vec::new(),
            remarks: Vec::new(),
            ignores: Vec::new(),
            on: Vec::new(),
            silent: [0.0; 2],
        }
    }

    fn of(seed: u64) -> Self {
        Self::new(traits(seed), honest(seed), None)
    }

    fn now(&self) -> f64 {
        BEGINS + self.scans as f64 / RATE
    }

    fn ask_person(&self, task: Task) {
        self.person.0.lock().unwrap().ask(task, self.now());
    }

    fn frame(&mut self) -> Option<Frame> {
        let at = self.now();
        self.scans += 1;
        if (self.silent[0]..self.silent[1]).contains(&at) {
            return None;
        }
        let row = std::array::from_fn(|k| {
            let stamp = instant(at + 1.8e-3 * k as f64);
            (self.glove.read_sample(k, stamp), stamp)
        });
        Some(self.reads.frame(&row))
    }

    /// One scan.
    fn step(&mut self) {
        let frame = self.frame();
        if let Some(frame) = frame {
            let starts = self.reads.starts;
            self.guide.take(&frame, &starts);
        }
        let now = instant(self.now());
        self.guide.pass(now);
        while let Some(news) = self.guide.next_news() {
            self.news.push(news);
            let News::Asked(step) = news else { continue };
            if let Some(i) = self.ignores.iter().position(|s| *s == step) {
                self.ignores.remove(i);
                continue;
            }
            if let Some(i) = self.on.iter().position(|(s, _)| *s == step) {
                (self.on.remove(i).1)(&self.glove, now);
            }
            self.ask_person(task(step));
        }
        for remark in self.guide.ask(now).remarks {
            let text = remark.to_string();
            if !self.remarks.contains(&text) {
                self.remarks.push(text);
            }
        }
    }

    /// Until all steps are done: how long it took from when it was begun, seconds.
    fn run(&mut self) -> f64 {
        if self.guide.ask(instant(self.now())).stage == Stage::Waiting {
            self.step();
            self.guide.go_on(instant(self.now()));
        }
        let mut began = None;
        while self.guide.ended().is_none() {
            self.step();
            if began.is_none() && !self.news.is_empty() {
                began = Some(self.now());
            }
            assert!(self.now() < 400.0, "it does not end: {:?}", self.news);
        }
        self.now() - began.unwrap_or_default()
    }

    fn judged(&self) -> &host::calibration::Judged {
        self.guide.ended().unwrap().as_ref().unwrap()
    }

    fn again(&self) -> Vec<(Step, Remark)> {
        let of = |news: &News| match *news {
            News::Again(step, remark) => Some((step, remark)),
            _ => None,
        };
        self.news.iter().filter_map(of).collect()
    }

    fn told(&self) -> Vec<String> {
        let findings = self.judged().findings();
        findings
            .into_iter()
            .map(|finding| format!("{}; {}", finding.what, finding.todo))
            .collect()
    }
}

fn traits(seed: u64) -> Traits {
    Traits {
        seed,
        ..Traits::default()
    }
}

fn honest(seed: u64) -> Honest {
    Honest {
        seed: seed + 500,
        ..Honest::default()
    }
}

#[test]
fn a_person_who_does_it_right_is_done_within_a_minute_and_nothing_is_asked_again() {
    for seed in 0..3 {
        let is_left = seed % 3 == 2;
        let mut bench = Bench::new(
            Traits {
                is_left,
                ..traits(seed)
            },
            honest(seed),
            None,
        );
        let took = bench.run();
        assert!(took < 58.0, "seed {seed}: {took} s");
        assert_eq!(bench.again(), [], "seed {seed}");
        assert_eq!(bench.told(), Vec::<String>::new(), "seed {seed}");
        let judged = bench.judged();
        assert_eq!(judged.verdict(), Verdict::Good);
        assert_eq!(judged.outcome.profile.side == Side::Left, is_left);
        let joints = judged.joints();
        assert_eq!(joints.len(), 15);
        let checks = joints.iter().flat_map(|joint| &joint.checks);
        assert!(checks.clone().count() > 70 && checks.clone().all(|check| check.holds));
        assert!(bench.remarks.contains(&Remark::TurnedEnough.to_string()));
        let kept = judged.kept([[7; 16]; 16], "2026-01-02T03:04:05Z".to_owned());
        assert_eq!(kept.quality.verdict, "good");
        assert_eq!(judged.again(), None);
    }
}

#[test]
fn each_step_comes_with_a_countdown_and_the_turn_says_where_to() {
    let mut bench = Bench::of(1);
    let at = |bench: &Bench| bench.guide.ask(instant(bench.now()));
    assert_eq!((at(&bench).stage, at(&bench).number), (Stage::Waiting, 1));
    bench.step();
    bench.guide.go_on(instant(bench.now()));
    assert!(matches!(at(&bench).stage, Stage::Ready(_)));
    assert_eq!(at(&bench).left, glove::Duration::from_ticks(3_000_000));
    bench.guide.go_on(instant(bench.now()));
    let ask = at(&bench);
    assert!(matches!(ask.stage, Stage::Doing(_)) && !ask.counts);
    let mut ways = Vec::new();
    while at(&bench).number < 3 {
        bench.step();
        let ask = at(&bench);
        assert!(ask.left <= ask.of);
        if let Some(way) = ask.turning.filter(|way| ways.last() != Some(way)) {
            ways.push(way);
        }
    }
    assert_eq!(ways.len(), 7, "{ways:?}");
    // While a finger bends it is seen to.
    let mut most = [0f32; 5];
    while at(&bench).number < 9 {
        bench.step();
        let bends = at(&bench).bends;
        most = std::array::from_fn(|f| most[f].max(bends[f]));
    }
    assert!(most.iter().all(|bend| bend.to_degrees() > 40.0), "{most:?}");
}

#[test]
fn what_the_person_missed_is_named_and_asked_again_and_then_it_is_good() {
    let missed: [(Step, Expected); 5] = [
        (
            Step::Turn,
            |r| matches!(r, Remark::TurnFurther(ratio) if ratio > 0.9),
        ),
        (Step::Alone(Finger::Middle), |r| {
            matches!(r, Remark::NotSeen(Finger::Middle, _))
        }),
        (Step::Fists, |r| matches!(r, Remark::NotClosed(..))),
        (Step::Thumb, |r| r == Remark::ThumbStays),
        (Step::LastFlat, |r| matches!(r, Remark::Strayed(..))),
    ];
    for (step, expected) in missed {
        let mut bench = Bench::of(11);
        bench.ignores = vec![step];
        bench.run();
        let again = bench.again();
        assert_eq!(again.len(), 1, "{step:?}: {again:?}");
        assert_eq!(again[0].0, step);
        assert!(expected(again[0].1), "{step:?}: {again:?}");
        assert_eq!(bench.told(), Vec::<String>::new(), "{step:?}");
        let text = again[0].1.to_string();
        let seen = bench.remarks.contains(&text);
        assert!(seen, "it stands there while it is done again: {text}");
    }
}

#[test]
fn what_goes_wrong_is_told_while_it_can_be_mended() {
    let mut bench = Bench::of(12);
    bench.ignores = vec![Step::Turn, Step::Alone(Finger::Index), Step::LastFlat];
    bench.run();
    for told in [
        "turn further",
        "index finger not seen moving",
        "hold still: ",
    ] {
        assert!(
            bench.remarks.iter().any(|remark| remark.starts_with(told)),
            "{told}: {:#?}",
            bench.remarks
        );
    }
}

#[test]
fn a_hand_that_never_turns_enough_is_refused_after_three_tries_and_the_turn_can_be_done_again() {
    let mut bench = Bench::new(
        Traits {
            turns: 0.12,
            ..traits(3)
        },
        honest(3),
        None,
    );
    bench.run();
    let turns = bench
        .again()
        .iter()
        .filter(|(step, _)| *step == Step::Turn)
        .count();
    assert_eq!(turns, 2);
    assert_eq!(bench.judged().verdict(), Verdict::Bad);
    assert_eq!(bench.judged().again(), Some(Again::Turn));
    let told = bench.told();
    assert!(
        told.iter()
            .any(|told| told.contains("did not turn enough")
                && told.contains("the turn again, farther")),
        "{told:?}"
    );
    // Another person puts it right.
    *bench.person.0.lock().unwrap() = Person::new(traits(3));
    bench.ask_person(Task::Flat);
    bench.news.clear();
    bench.guide.again(instant(bench.now()));
    bench.run();
    assert_eq!(bench.news.first(), Some(&News::Asked(Step::Turn)));
    assert_eq!(bench.told(), Vec::<String>::new());
}

#[test]
fn swapped_sensors_are_named_and_can_be_taken_as_they_sit() {
    for (a, b) in [(8, 11), (0, 5)] {
        let mut honest = honest(4);
        honest.seats.swap(a, b);
        let mut bench = Bench::new(traits(4), honest.clone(), None);
        bench.run();
        assert_eq!(bench.again(), [], "{a} and {b}");
        assert!(bench.news.contains(&News::Note(Remark::Swapped(2))));
        let judged = bench.judged();
        assert!(judged.is_swapped());
        assert_eq!(judged.verdict(), Verdict::Doubtful);
        assert_eq!(
            judged.outcome.profile.sensors.map(usize::from),
            honest.seats
        );
        let name = format!("sensor {b} sits on {}", SEGMENT_NAMES[a]);
        assert!(
            bench.told().iter().any(|told| told.starts_with(&name)),
            "{:?}",
            bench.told()
        );
    }
}

#[test]
fn a_left_glove_that_is_said_to_be_right_is_named_and_refused_and_the_other_way_round() {
    for is_left in [true, false] {
        let declared = if is_left { Side::Right } else { Side::Left };
        let mut bench = Bench::new(
            Traits {
                is_left,
                ..traits(5)
            },
            honest(5),
            Some(declared),
        );
        bench.run();
        let told = bench.told();
        assert_eq!(told.len(), 1, "{told:?}");
        let (is, said) = if is_left {
            ("left", "right")
        } else {
            ("right", "left")
        };
        assert!(told[0].starts_with(&format!("the glove is on a {is} hand, and {said} was said")));
        assert!(told[0].contains(&format!("--hand {is}")));
        assert_eq!(bench.judged().verdict(), Verdict::Bad);
        let shown = bench.judged().of_the_hand_shown().unwrap();
        assert_eq!(shown.verdict(), Verdict::Good);
        assert_eq!(shown.of_the_hand_shown(), None, "that is the hand it shows");
    }
}

#[test]
fn a_sensor_that_slips_before_the_last_flat_pose_is_named_after_the_pose_was_tried_again() {
    for (segment, axis) in [(12, [0.0, 0.0, 1.0]), (7, [0.0, 1.0, 0.0])] {
        let mut bench = Bench::of(6);
        let slip = move |glove: &VirtualGlove, _| glove.slip(segment, axis, 20.0);
        bench.on.push((Step::LastFlat, Box::new(slip)));
        bench.run();
        let again = bench.again();
        assert_eq!(again.len(), 2, "{again:?}");
        assert!(again.iter().all(|(step, remark)| *step == Step::LastFlat
            && matches!(remark, Remark::Found(doubt) if doubt.segment() == Some(segment))));
        let findings = bench.judged().findings();
        assert!(!findings.is_empty());
        let name = Some(SEGMENT_NAMES[segment]);
        assert!(
            findings
                .iter()
                .all(|f| f.segment == name && f.verdict == "bad"),
            "{findings:?}"
        );
        assert!(findings[0].todo.contains("sewn or pressed on"));
    }
}

#[test]
fn a_sensor_that_starts_anew_is_told_at_once_and_costs_what_it_must() {
    for (step, verdict, again) in [
        (Step::Free, Verdict::Doubtful, None),
        (Step::Turn, Verdict::Bad, Some(Again::All)),
    ] {
        let mut bench = Bench::of(7);
        let restart = |glove: &VirtualGlove, now: Instant| {
            glove.reset_sensor(9, now);
            glove.bring_up(9, now + glove::Duration::from_ticks(700_000));
        };
        bench.on.push((step, Box::new(restart)));
        bench.run();
        let noted = |news: &News| *news == News::Note(Remark::Restarted(9));
        assert!(bench.news.iter().any(noted), "{step:?}: {:?}", bench.news);
        let found = bench.judged().outcome.checks.doubts().collect::<Vec<_>>();
        let spoils = verdict == Verdict::Bad;
        assert!(
            found.contains(&Doubt::Restarted { sensor: 9, spoils }),
            "{found:?}"
        );
        assert_eq!(bench.judged().verdict(), verdict, "{found:?}");
        assert_eq!(bench.judged().again(), again);
    }
}

/// How far the joints are off the person's while the hand is used for 8 s after the session, root mean square, degrees: the worst of
/// all joints.
fn worst_joint_in_use(bench: &mut Bench) -> f32 {
    let outcome = bench.judged().outcome;
    let config = Config {
        finds_flat: false,
        ..Config::default()
    };
    let mut headings = Headings::start(&outcome, instant(bench.now()), config);
    let mut align = Align::new();
    bench.ask_person(Task::Use(Attitude::Free));
    let (mut sums, mut n) = ([0.0f64; 25], 0.0);
    for scan in 0..(11.0 * RATE) as u32 {
        let at = bench.now();
        let frame = bench.frame().unwrap();
        let reading = headings.take(&align.take(&frame));
        if scan < (3.0 * RATE) as u32 {
            continue;
        }
        assert_eq!(reading.held, 0);
        // The chips are some 5 ms behind.
        let truth = bench.person.0.lock().unwrap().angles(at - 0.005);
        for (sum, (angle, truth)) in sums.iter_mut().zip(reading.angles.iter().zip(truth)) {
            *sum += (f64::from(*angle) - truth).to_degrees().powi(2);
        }
        n += 1.0;
    }
    sums.iter()
        .fold(0.0, |worst: f64, sum| worst.max((sum / n).sqrt())) as f32
}

#[test]
fn after_a_sensor_started_anew_a_turn_done_again_gives_the_true_mountings() {
    let exact = |turns: f64| Traits {
        turns,
        unstraight: 0.0,
        thumb_off: 0.0,
        table: 0.0,
        ..traits(21)
    };
    let mut worst = Vec::new();
    for sensor in [None, Some(9), Some(7), Some(2), Some(0)] {
        let mut bench = Bench::new(exact(0.12), honest(21), None);
        if let Some(sensor) = sensor {
            let restart = move |glove: &VirtualGlove, now: Instant| {
                glove.reset_sensor(sensor, now);
                glove.bring_up(sensor, now + glove::Duration::from_ticks(700_000));
            };
            bench.on.push((Step::Free, Box::new(restart)));
        }
        bench.run();
        assert_eq!(bench.judged().again(), Some(Again::Turn), "{sensor:?}");
        *bench.person.0.lock().unwrap() = Person::new(exact(1.0));
        bench.ask_person(Task::Flat);
        bench.guide.again(instant(bench.now()));
        bench.run();
        assert_eq!(bench.told(), Vec::<String>::new(), "{sensor:?}");
        worst.push((sensor, worst_joint_in_use(&mut bench)));
    }
    println!("{worst:.1?}");
    let (_, without) = worst[0];
    for (sensor, off) in &worst {
        assert!(*off < 6.0, "{worst:.1?}");
        assert!(*off < without + 2.0, "{sensor:?}: {worst:.1?}");
    }
}

#[test]
fn what_is_left_of_the_bending_after_a_sensor_started_anew_begins_with_the_turn() {
    let mut bench = Bench::of(22);
    let restart = |glove: &VirtualGlove, now: Instant| {
        glove.reset_sensor(6, now);
        glove.bring_up(6, now + glove::Duration::from_ticks(700_000));
    };
    bench
        .on
        .push((Step::Alone(Finger::Index), Box::new(restart)));
    bench.run();
    let judged = bench.judged();
    assert!(judged.outcome.checks.restarted != 0);
    assert_eq!(judged.again(), Some(Again::Turn), "{:?}", bench.told());
    bench.guide.again(instant(bench.now()));
    bench.run();
    assert_eq!(bench.told(), Vec::<String>::new());
}

#[test]
fn a_glove_that_falls_silent_is_named_and_the_step_is_done_again() {
    let mut bench = Bench::of(8);
    bench.silent = [BEGINS + 4.0, BEGINS + 6.9];
    bench.run();
    let again = bench.again();
    assert!(
        matches!(again[..], [(Step::FirstFlat, Remark::FewScans(_))]),
        "{again:?}"
    );
    assert!(bench.remarks.contains(&Remark::NoScans.to_string()));
    assert_eq!(bench.told(), Vec::<String>::new());
}

#[test]
fn a_glove_that_never_comes_back_ends_the_session_with_what_is_missing() {
    let mut bench = Bench::of(9);
    bench.silent = [BEGINS + 12.0, 1e9];
    bench.run();
    let unfinished = bench.guide.ended().unwrap().as_ref().unwrap_err();
    assert!(!unfinished.to_string().is_empty());
}

#[test]
fn the_person_may_do_a_step_again_and_skip_the_wait_for_it() {
    let mut bench = Bench::of(10);
    bench.step();
    bench.guide.go_on(instant(bench.now()));
    while bench.guide.ask(instant(bench.now())).number < 2 {
        bench.step();
    }
    for _ in 0..100 {
        bench.step();
    }
    bench.guide.again(instant(bench.now()));
    bench.ask_person(Task::Flat);
    for _ in 0..40 {
        bench.step();
    }
    bench.guide.go_on(instant(bench.now()));
    bench.run();
    let turns = bench
        .news
        .iter()
        .filter(|news| **news == News::Asked(Step::Turn))
        .count();
    assert_eq!(turns, 2);
    assert_eq!(bench.told(), Vec::<String>::new());
}

#[test]
fn next_day_one_flat_pose_is_taken_and_a_sensor_that_slipped_overnight_is_named() {
    for slips in [false, true] {
        let mut bench = Bench::of(13);
        bench.run();
        let profile = bench.judged().outcome.profile;
        // Power off and on: every heading is another.
        for k in 0..16 {
            bench.glove.reset_sensor(k, instant(bench.now()));
        }
        bench.scans += 35;
        bench.glove.bring_up(usize::MAX, instant(bench.now()));
        if slips {
            bench.glove.slip(8, [1.0, 0.0, 0.0], 25.0);
        }
        bench.ask_person(Task::Use(Attitude::PalmDown));
        for _ in 0..70 {
            bench.frame();
        }
        let mut pose = FlatPose::new(&profile, instant(bench.now()));
        bench.ask_person(Task::Flat);
        let end = loop {
            let frame = bench.frame().unwrap();
            let starts = bench.reads.starts;
            pose.take(&frame, &starts);
            if let Some(end) = pose.pass(instant(bench.now())) {
                break end;
            }
        };
        let names = |end: &PoseEnd| match end {
            PoseEnd::Taken(report) => slipped(report)
                .into_iter()
                .filter_map(|f| f.segment)
                .collect(),
            PoseEnd::NotFlat(not_flat) => vec![match not_flat {
                glove::headings::NotFlat::Tilted { segment, .. } => {
                    SEGMENT_NAMES[usize::from(*segment)]
                }
                glove::headings::NotFlat::Missing(_) => "missing",
            }],
            PoseEnd::Moved(remark) => panic!("{remark}"),
        };
        let expected: Vec<&str> = if slips { vec!["middle_middle"] } else { vec![] };
        assert_eq!(names(&end), expected, "{end:?}");
    }
}

#[test]
fn a_flat_pose_of_a_hand_that_moves_is_none() {
    let mut bench = Bench::of(14);
    bench.run();
    let profile = bench.judged().outcome.profile;
    bench.ask_person(Task::Use(Attitude::PalmDown));
    let mut pose = FlatPose::new(&profile, instant(bench.now()));
    let end = loop {
        let frame = bench.frame().unwrap();
        pose.take(&frame, &bench.reads.starts);
        if let Some(end) = pose.pass(instant(bench.now())) {
            break end;
        }
    };
    assert!(
        matches!(end, PoseEnd::Moved(Remark::Strayed(..))),
        "{end:?}"
    );
    assert!(pose.remark().is_some());
}
