//! The guided calibration and the headings on persons of all kinds: left hands, swapped sensors, restarts, late ones, slips.

mod synthetic;

use glove::Instant;
use glove::calibration::{Align, Aligned, Doubt, Identity, Outcome, Reads, Session, Step, Verdict};
use glove::hand::{JOINT_COUNT, Quaternion, SEGMENT_COUNT, Side};
use glove::headings::{Config, Headings, Reading};
use synthetic::{FLAT_IN_USE, Person, Restart, Scan, USE_FROM};

/// Classes of joints that are measured together.
const CLASSES: [&str; 9] = [
    "PIP",
    "DIP",
    "thumb hinges",
    "MCP flexion",
    "MCP abduction",
    "MCP twist",
    "CMC flexion",
    "CMC abduction",
    "CMC twist",
];

fn class(joint: usize) -> usize {
    match (joint / 5, joint % 5) {
        (0, j @ 0..3) => 6 + j,
        (0, _) => 2,
        (_, 3) => 0,
        (_, 4) => 1,
        (_, j) => 3 + j,
    }
}

/// What came of a session.
struct Run {
    outcome: Outcome,
    readings: Vec<(Reading, [f64; 25])>,
    rate: f64,
}

impl Run {
    /// RMS in degrees by class while the hand is in use.
    fn rms(&self) -> [f64; 9] {
        let (mut sums, mut counts) = ([0.0; 9], [0.0; 9]);
        for (reading, truth) in &self.readings {
            for joint in 0..JOINT_COUNT {
                if reading.held >> joint & 1 == 0 {
                    let off = f64::from(reading.angles[joint].to_degrees()) - truth[joint];
                    let off = (off + 180.0).rem_euclid(360.0) - 180.0;
                    sums[class(joint)] += off * off;
                    counts[class(joint)] += 1.0;
                }
            }
        }
        std::array::from_fn(|c| f64::sqrt(sums[c] / f64::max(counts[c], 1.0)))
    }

    /// Joints that were held at some time after `from`, and the seconds of each.
    fn held(&self, from: f64) -> Vec<(usize, f64)> {
        let from = Instant::from_ticks((from * 1e6) as u64);
        (0..JOINT_COUNT)
            .filter_map(|joint| {
                let scans = self.readings.iter().filter(|(r, _)| r.at >= from);
                let held = scans.filter(|(r, _)| r.held >> joint & 1 == 1).count();
                (held > 0).then_some((joint, held as f64 / self.rate))
            })
            .collect()
    }

    fn assert_within(&self, limits: [f64; 9], who: &str) {
        let rms = self.rms();
        for (c, name) in CLASSES.iter().enumerate() {
            println!("{who}: {name} {:.2}", rms[c]);
        }
        for (c, name) in CLASSES.iter().enumerate() {
            assert!(rms[c] <= limits[c], "{who}: {name} {:.2}°", rms[c]);
        }
    }
}

/// A person who is exact, and sensors that are nearly: PIP, DIP, thumb, MCP, CMC.
const EXACT: [f64; 9] = [1.0, 1.0, 1.0, 1.5, 1.5, 1.5, 2.0, 2.0, 2.0];

struct Way {
    reads: Reads,
    starts: [u16; SEGMENT_COUNT],
    align: Align,
}

impl Way {
    fn new() -> Self {
        Self {
            reads: Reads::new(),
            starts: [0; SEGMENT_COUNT],
            align: Align::new(),
        }
    }

    /// The scan, and the sensors that started anew.
    fn take(&mut self, scan: &Scan) -> (glove::calibration::Aligned, Vec<usize>) {
        let frame = self.reads.frame(&scan.reads);
        let before = std::mem::replace(&mut self.starts, self.reads.starts);
        let restarted: Vec<usize> = (0..SEGMENT_COUNT)
            .filter(|&k| before[k] > 0 && before[k] != self.starts[k])
            .collect();
        restarted.iter().for_each(|&k| self.align.forget(k));
        (self.align.take(&frame), restarted)
    }
}

fn run(person: &Person) -> Run {
    run_with(person, Config::default(), false)
}

/// `next_day`: the headings of the calibration are not used; the first flat pose in use gives new ones.
fn run_with(person: &Person, config: Config, next_day: bool) -> Run {
    println!("seed {}", person.seed);
    let (mut way, mut session) = (Way::new(), Session::new());
    let mut calibrated: Option<(Outcome, Headings)> = None;
    let mut readings = Vec::new();
    let mut asked = false;
    for scan in synthetic::session(person) {
        let (aligned, restarted) = way.take(&scan);
        for k in restarted {
            match &mut calibrated {
                Some((_, headings)) => headings.restarted(k, aligned.at),
                None => session.restarted(k),
            }
        }
        if let Some((_, headings)) = &mut calibrated {
            let flat = FLAT_IN_USE
                .iter()
                .any(|f| (f + 0.1..f + 2.0).contains(&scan.at));
            if flat && !asked && next_day {
                headings.begin_flat();
                asked = true;
            }
            let reading = headings.take(&aligned);
            if asked && !flat {
                headings.end_flat(aligned.at).expect("a flat hand");
                asked = false;
            }
            if scan.at >= USE_FROM {
                readings.push((reading, scan.truth));
            }
            continue;
        }
        if scan.step != session.step() {
            if session.step() == Some(Step::LastFlat) {
                let outcome = session.finish().expect("an outcome");
                let headings = if next_day {
                    Headings::new(&outcome.profile, config)
                } else {
                    Headings::start(&outcome, aligned.at, config)
                };
                calibrated = Some((outcome, headings));
                continue;
            }
            match scan.step {
                Some(step) => session.begin(step),
                None => session.end(),
            }
        }
        session.take(&aligned);
    }
    let (outcome, _) = calibrated.expect("a calibration");
    Run {
        outcome,
        readings,
        rate: person.rate,
    }
}

fn doubts(run: &Run) -> Vec<String> {
    run.outcome.checks.doubts().map(|d| d.to_string()).collect()
}

#[test]
fn an_exact_person_is_measured_within_a_degree_or_two_on_either_hand() {
    for seed in 0..4 {
        let is_left = seed % 2 == 1;
        let person = Person {
            is_left,
            ..Person::exact(seed)
        };
        let run = run(&person);
        assert_eq!(doubts(&run), Vec::<String>::new());
        let side = if is_left { Side::Left } else { Side::Right };
        assert_eq!(run.outcome.profile.side, side);
        assert_eq!(run.outcome.checks.identity, Identity::AsWired);
        assert!((run.outcome.checks.thumb_y < 0.0) != is_left);
        assert_eq!(run.held(USE_FROM), vec![], "nothing is held");
        run.assert_within(EXACT, if is_left { "left" } else { "right" });
    }
}

#[test]
fn twice_and_more_as_many_scans_a_second_give_the_same() {
    for rate in [67.0, 88.0] {
        let person = Person {
            rate,
            restarts: vec![Restart {
                sensor: 5,
                at: 75.0,
                away: 0.68,
            }],
            ..Person::exact(50)
        };
        let run = run(&person);
        assert_eq!(doubts(&run), Vec::<String>::new());
        let held: Vec<usize> = run.held(USE_FROM).into_iter().map(|h| h.0).collect();
        assert_eq!(held, [8, 9]);
        run.assert_within(EXACT, &format!("{rate} scans/s"));
    }
}

#[test]
fn a_joint_less_sure_than_stated_is_held() {
    let config = Config {
        degraded: 1.1f32.to_radians(),
        ..Config::default()
    };
    // Right after a calibration a hinge's heading is known to 1.0°, an MCP's to 1.2°.
    let run = run_with(&Person::exact(60), config, false);
    let first = run.readings.first().expect("readings").0.held;
    let bases = (0..JOINT_COUNT)
        .filter(|j| j % 5 < 3)
        .fold(0u32, |mask, j| mask | 1 << j);
    assert_eq!(first, bases);
}

fn swapped(pairs: &[(usize, usize)]) -> [usize; 16] {
    let mut seats = std::array::from_fn(|k| k);
    for &(a, b) in pairs {
        seats.swap(a, b);
    }
    seats
}

#[test]
fn sensors_that_sit_elsewhere_are_named_and_taken_as_they_sit() {
    let cases: [&[(usize, usize)]; 9] = [
        &[(8, 11)],
        &[(4, 5)],
        &[(1, 2)],
        &[(3, 15)],
        &[(6, 7), (10, 14)],
        &[(4, 7), (7, 10)],
        &[(0, 9)],
        &[(0, 1)],
        &[(0, 4), (12, 13)],
    ];
    for (seed, pairs) in cases.into_iter().enumerate() {
        let person = Person {
            seats: swapped(pairs),
            late: 0.1 * seed as f64 % 0.8,
            is_left: seed % 3 == 1,
            unstraight: 2.0,
            ..Person::exact(100 + seed as u64)
        };
        let run = run(&person);
        let found = run.outcome.profile.sensors.map(usize::from);
        assert_eq!(found, person.seats, "{pairs:?}");
        assert!(matches!(run.outcome.checks.identity, Identity::Moved(_)));
        assert_eq!(run.outcome.profile.side == Side::Left, person.is_left);
        run.assert_within([4.0; 9], &format!("{pairs:?}"));
        let named = run
            .outcome
            .checks
            .doubts()
            .filter(|d| matches!(d, Doubt::Elsewhere { .. }));
        let expected = (0..16).filter(|&k| person.seats[k] != k).count();
        assert_eq!(named.count(), expected);
    }
}

#[test]
fn a_late_person_is_no_swap() {
    for seed in 0..6 {
        let person = Person {
            late: 0.14 * seed as f64,
            unstraight: 3.0,
            ..Person::exact(200 + seed)
        };
        let run = run(&person);
        assert_eq!(run.outcome.checks.identity, Identity::AsWired, "{seed}");
    }
}

#[test]
fn only_the_joints_beside_a_restarted_sensor_are_held_and_for_little_more_than_a_second() {
    let cases: [(usize, &[usize]); 7] = [
        (8, &[13, 14]),
        (4, &[5, 6, 7, 8]),
        (15, &[24]),
        (10, &[15, 16, 17, 18]),
        (1, &[0, 1, 2, 3]),
        (2, &[3, 4]),
        (3, &[4]),
    ];
    for (i, (sensor, joints)) in cases.into_iter().enumerate() {
        let person = Person {
            restarts: vec![Restart {
                sensor,
                at: 70.0 + 1.3 * i as f64,
                away: 0.68,
            }],
            is_left: i % 2 == 1,
            ..Person::exact(300 + i as u64)
        };
        let run = run(&person);
        let held = run.held(USE_FROM);
        let which: Vec<usize> = held.iter().map(|h| h.0).collect();
        assert_eq!(which, joints, "sensor {sensor}: {held:?}");
        for (joint, seconds) in held {
            assert!((1.0..1.5).contains(&seconds), "joint {joint}: {seconds} s");
        }
        run.assert_within([1.5, 1.5, 2.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0], "restart");
    }
}

#[test]
fn two_sensors_of_a_finger_that_restart_together_come_back_by_its_hinges() {
    for (i, sensors) in [[7, 8], [8, 9], [7, 9], [5, 11]].into_iter().enumerate() {
        let restarts = sensors.map(|sensor| Restart {
            sensor,
            at: 72.0,
            away: 0.7,
        });
        let person = Person {
            restarts: restarts.to_vec(),
            ..Person::exact(400 + i as u64)
        };
        let run = run(&person);
        let longest = run
            .held(USE_FROM)
            .into_iter()
            .map(|h| h.1)
            .fold(0.0, f64::max);
        assert!((1.0..2.5).contains(&longest), "{sensors:?}: {longest} s");
        run.assert_within(
            [2.0, 2.0, 2.0, 2.5, 2.5, 2.5, 3.0, 3.0, 3.0],
            "restart of two",
        );
    }
}

#[test]
fn after_a_restart_of_the_hands_sensor_its_joints_are_held_until_a_flat_pose() {
    let person = Person {
        restarts: vec![Restart {
            sensor: 0,
            at: 70.0,
            away: 0.68,
        }],
        ..Person::exact(500)
    };
    let run = run(&person);
    let hinge = |j: usize| j % 5 >= 3;
    for (joint, seconds) in run.held(USE_FROM) {
        assert!(!hinge(joint), "joint {joint} does not hang on the hand");
        // From 70 s to the pose at 86 s.
        assert!(
            (16.0..19.0).contains(&seconds),
            "joint {joint}: {seconds} s"
        );
    }
    assert_eq!(run.held(FLAT_IN_USE[0] + 2.2), vec![]);
    run.assert_within([1.5, 1.5, 2.0, 2.5, 2.5, 2.5, 5.0, 5.0, 5.0], "hand");
}

#[test]
fn next_day_one_flat_pose_gives_all_headings() {
    let run = run_with(&Person::exact(600), Config::default(), true);
    let held = run.held(USE_FROM);
    let bases = held.iter().filter(|(joint, _)| joint % 5 < 3);
    let until = FLAT_IN_USE[0] - USE_FROM;
    // No joint on the hand before the pose; a hinge soon shows itself.
    assert_eq!(bases.clone().count(), 15);
    assert!(bases.clone().all(|&(_, seconds)| seconds > until));
    assert!(
        held.iter()
            .all(|&(joint, seconds)| joint % 5 < 3 || seconds < 10.0)
    );
    assert_eq!(run.held(FLAT_IN_USE[0] + 2.1), vec![]);
    run.assert_within([1.5, 1.5, 2.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0], "next day");
}

#[test]
fn flat_poses_are_found_in_use_unless_that_is_switched_off() {
    let person = Person {
        unstraight: 2.0,
        ..Person::exact(700)
    };
    for finds_flat in [true, false] {
        let config = Config {
            finds_flat,
            ..Config::default()
        };
        let run = run_with(&person, config, false);
        let found: Vec<u64> = run
            .readings
            .iter()
            .filter(|(reading, _)| reading.pose.is_some())
            .map(|(reading, _)| reading.at.as_ticks() / 1_000_000)
            .collect();
        assert_eq!(found.len(), if finds_flat { 2 } else { 0 }, "{found:?}");
    }
}

#[test]
fn a_hand_that_hardly_turned_is_refused() {
    let person = Person {
        turns: 0.05,
        ..Person::exact(800)
    };
    let run = run(&person);
    let refused =
        run.outcome.checks.doubts().any(
            |doubt| matches!(doubt, Doubt::NotTurned { .. } if doubt.verdict() == Verdict::Bad),
        );
    assert!(refused, "{:?}", doubts(&run));
}

#[test]
fn a_sensor_that_slipped_by_20_degrees_is_named() {
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for (i, axis) in axes.into_iter().enumerate() {
        for segment in 0..SEGMENT_COUNT {
            let person = Person {
                slip: Some((segment, 20.0, axis)),
                unstraight: 1.5,
                ..Person::exact(900 + 16 * i as u64 + segment as u64)
            };
            let checks = run(&person).outcome.checks;
            assert_eq!(checks.slipped(), Some(segment), "about {axis:?}");
            assert_eq!(checks.overall(), Verdict::Bad);
            // The heading of the hand's sensor shows at the joints on it.
            let at = if segment == 0 && i == 1 { 4 } else { segment };
            assert_eq!(checks.verdict(at), Verdict::Bad, "{segment} about {axis:?}");
        }
    }
}

#[test]
fn a_sensor_that_restarts_while_fingers_bend_gets_its_heading_from_the_last_flat_pose() {
    for (i, sensor) in [6, 0, 1, 7, 11].into_iter().enumerate() {
        let person = Person {
            restarts: vec![Restart {
                sensor,
                at: 33.0 + 4.0 * i as f64,
                away: 0.68,
            }],
            ..Person::exact(1000 + i as u64)
        };
        let run = run(&person);
        let named = Doubt::Restarted {
            sensor: sensor as u8,
            spoils: false,
        };
        let doubts: Vec<Doubt> = run.outcome.checks.doubts().collect();
        assert_eq!(doubts, [named], "sensor {sensor}");
        run.assert_within(
            [1.5, 1.5, 2.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0],
            "in the session",
        );
    }
}

#[test]
fn a_sensor_that_restarts_before_its_heading_is_known_spoils_the_session() {
    for (i, at) in [2.0, 3.5, 10.0, 17.0, 19.5, 56.0].into_iter().enumerate() {
        let person = Person {
            restarts: vec![Restart {
                sensor: 6,
                at,
                away: 0.68,
            }],
            ..Person::exact(1100 + i as u64)
        };
        let run = run(&person);
        let named = Doubt::Restarted {
            sensor: 6,
            spoils: true,
        };
        assert!(run.outcome.checks.doubts().any(|d| d == named), "at {at} s");
        assert_eq!(run.outcome.checks.verdict(6), Verdict::Bad);
    }
}

/// The scans of a session, each with its step.
fn steps_of(person: &Person) -> Vec<(Option<Step>, Aligned)> {
    let mut way = Way::new();
    let mut steps = Vec::new();
    for scan in synthetic::session(person) {
        if scan.step.is_none() && matches!(steps.last(), Some((Some(Step::LastFlat), _))) {
            break;
        }
        let (aligned, _) = way.take(&scan);
        steps.push((scan.step, aligned));
    }
    steps
}

fn feed<'a>(session: &mut Session, scans: impl Iterator<Item = &'a (Option<Step>, Aligned)>) {
    for (step, aligned) in scans {
        if *step != session.step() {
            match step {
                Some(step) => session.begin(*step),
                None => session.end(),
            }
        }
        session.take(aligned);
    }
}

#[test]
fn a_turn_done_again_after_a_sensor_restarted_gives_the_mountings_of_a_session_without_that() {
    let person = Person::exact(1300);
    let scans = steps_of(&person);
    let mut undisturbed = Session::new();
    feed(&mut undisturbed, scans.iter());
    let truth = undisturbed.finish().expect("an outcome").profile;
    for sensor in [6, 7, 2, 0] {
        let mut session = Session::new();
        let before_last = |scan: &&(Option<Step>, Aligned)| scan.0 != Some(Step::LastFlat);
        feed(&mut session, scans.iter().filter(before_last));
        session.end();
        session.restarted(sensor);
        // From the turn on once more, with that sensor's new heading.
        let again = scans.iter().skip_while(|scan| scan.0 != Some(Step::Turn));
        let about_up = Quaternion::from_axis_angle(&nalgebra::Vector3::z_axis(), 1.5);
        let jumped: Vec<_> = again
            .map(|(step, aligned)| {
                let mut aligned = *aligned;
                let q = &mut aligned.orientations[sensor];
                *q = about_up * *q;
                (*step, aligned)
            })
            .collect();
        feed(&mut session, jumped.iter());
        let outcome = session.finish().expect("an outcome");
        for (k, (is, was)) in outcome
            .profile
            .mounting
            .iter()
            .zip(truth.mounting)
            .enumerate()
        {
            let off = is.angle_to(&was).to_degrees();
            assert!(off < 2.0, "sensor {sensor}, segment {k}: {off}°");
        }
        let doubts: Vec<_> = outcome.checks.doubts().collect();
        assert_eq!(doubts, [], "sensor {sensor}");
    }
}

#[test]
fn a_sensor_that_restarts_in_a_flat_pose_that_was_asked_for_does_not_spoil_it() {
    let person = Person {
        restarts: vec![Restart {
            sensor: 9,
            at: FLAT_IN_USE[0] + 0.6,
            away: 0.68,
        }],
        ..Person::exact(1200)
    };
    run_with(&person, Config::default(), true).assert_within(
        [1.5, 1.5, 2.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0],
        "restart in a pose",
    );
}
