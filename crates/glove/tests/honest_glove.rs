//! Calibration and headings on a virtual person in an honest virtual glove: how far angles are from the true ones, and what the checks
//! find. The short form runs with all tests; the whole is `cargo xtask campaign glove`, and its figures are in
//! `docs/measurements/glove.md`.

mod common;
mod honest;

use glove::calibration::{Doubt, Identity, Verdict};
use glove::hand::Side;
use honest::{Came, Course, Tally, each, run};
use rig::glove::Honest;
use rig::person::{Attitude, Traits};

/// Seeds of the campaign.
const SEEDS: u64 = 24;

/// A flat hand that is exact, on sensors that do not shift on its skin.
fn exact(seed: u64) -> Course {
    let base = Course::new(seed);
    Course {
        traits: Traits::exact(seed),
        honest: Honest {
            soft_tissue: [0.0; 2],
            ..base.honest.clone()
        },
        ..base
    }
}

/// … and sensors that know which way is up.
fn untilted(seed: u64) -> Course {
    let mut course = exact(seed);
    course.honest.tilt = 0.0;
    course
}

fn doubts(came: &Came) -> Vec<String> {
    came.outcome
        .checks
        .doubts()
        .map(|d| d.to_string())
        .collect()
}

#[test]
fn three_persons_in_honest_gloves_are_measured_within_the_limits_of_any_one() {
    let courses: Vec<Course> = (0..3)
        .map(|seed| {
            let mut course = Course::new(seed);
            course.traits.is_left = seed == 1;
            course.lasts = 80.0;
            course
        })
        .collect();
    for (course, came) in courses.iter().zip(each(&courses, run)) {
        let row = came.corrected.row();
        println!("seed {}: {row:.2?}", course.traits.seed);
        assert_eq!(came.outcome.checks.identity, Identity::AsWired);
        assert_eq!(
            came.outcome.profile.side == Side::Left,
            course.traits.is_left
        );
        assert_eq!(doubts(&came), Vec::<String>::new());
        assert!(came.repaired > 100, "{} bits put back", came.repaired);
        assert_eq!((came.dropped, came.taken), (0, 1));
        assert!(came.corrected.hinges() <= 2.8);
        assert!(came.corrected.mcp(0) <= 4.0);
    }
}

#[test]
fn an_exact_person_without_soft_tissue_is_measured_within_a_degree() {
    let mut course = exact(3);
    course.lasts = 80.0;
    let came = run(&course);
    println!("{:.2?}", came.corrected.row());
    assert!(came.corrected.hinges() <= 1.0);
    assert!(came.corrected.mcp(0) <= 1.5);
}

#[test]
fn from_power_on_through_the_line_and_the_scanner_it_is_the_same_at_both_ends_of_its_speeds() {
    for baud in [115_200, 460_800] {
        let mut course = Course::new(2);
        (course.by_wire, course.lasts) = (Some(baud), 20.0);
        let came = run(&course);
        println!("{baud} baud: {:.2?}", came.corrected.row());
        assert_eq!(came.outcome.checks.identity, Identity::AsWired);
        assert_eq!(doubts(&came), Vec::<String>::new());
        assert!(came.corrected.hinges() <= 2.8);
        assert!(came.corrected.mcp(0) <= 4.0);
    }
}

fn heading() {
    println!(
        "| | ten hinges | PIP | DIP | thumb | MCP flex | abd | twist | CMC flex | abd | twist |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
}

fn line(name: &str, tally: &Tally) {
    let cells: Vec<String> = tally.row().iter().map(|v| format!("{v:.2}")).collect();
    println!("| {name} | {} |", cells.join(" | "));
}

fn pooled(cames: &[Came], of: impl Fn(&Came) -> &Tally) -> Tally {
    let mut sum = Tally::default();
    cames.iter().for_each(|came| sum.join(of(came)));
    sum
}

fn worst(cames: &[Came], of: impl Fn(&Came) -> f64) -> f64 {
    cames.iter().map(of).fold(0.0, f64::max)
}

/// Ten minutes of `SEEDS` persons.
fn ten_minutes(name: &str, course: impl Fn(u64) -> Course) -> Vec<Came> {
    let courses: Vec<Course> = (0..SEEDS)
        .map(|seed| Course {
            lasts: 600.0,
            ..course(seed)
        })
        .collect();
    let cames = each(&courses, run);
    line(name, &pooled(&cames, |c| &c.corrected));
    line("… last minute", &pooled(&cames, |c| &c.last_minute));
    line("… not corrected", &pooled(&cames, |c| &c.plain));
    line(
        "… not corrected, last minute",
        &pooled(&cames, |c| &c.plain_last_minute),
    );
    println!(
        "worst seed: hinges {:.2} (last minute {:.2}), MCP flexion {:.2} ({:.2}), abduction {:.2} ({:.2}); held {:.4} of the angles; flat poses taken {}, found besides {}; bits put back {}, reads dropped {}",
        worst(&cames, |c| c.corrected.hinges()),
        worst(&cames, |c| c.last_minute.hinges()),
        worst(&cames, |c| c.corrected.mcp(0)),
        worst(&cames, |c| c.last_minute.mcp(0)),
        worst(&cames, |c| c.corrected.mcp(1)),
        worst(&cames, |c| c.last_minute.mcp(1)),
        pooled(&cames, |c| &c.corrected).held(),
        cames.iter().map(|c| c.taken).sum::<usize>(),
        cames.iter().map(|c| c.found).sum::<usize>(),
        cames.iter().map(|c| u64::from(c.repaired)).sum::<u64>(),
        cames.iter().map(|c| u64::from(c.dropped)).sum::<u64>(),
    );
    cames
}

#[test]
#[ignore = "minutes: cargo xtask campaign glove"]
fn campaign_ten_minutes_of_many_persons() {
    heading();
    let palm_down = ten_minutes("palm down ±30°", Course::new);
    let exact = ten_minutes("palm down, flat pose exact, no soft tissue", exact);
    let untilted = ten_minutes("… and no error of tilt", untilted);
    for (name, attitude) in [
        ("thumb up ±12°", Attitude::ThumbUp),
        ("any attitude", Attitude::Free),
    ] {
        ten_minutes(name, |seed| Course {
            attitude,
            ..Course::new(seed)
        });
    }
    for of in [|c: &Came| c.corrected, |c: &Came| c.last_minute] {
        let pool = |cames: &[Came]| {
            let mut all = Tally::default();
            cames.iter().for_each(|came| all.join(&of(came)));
            all
        };
        let all = pool(&palm_down);
        assert!(all.hinges() <= 2.0 && all.mcp(0) <= 2.5 && all.mcp(1) <= 2.5);
        assert!(worst(&palm_down, |c| of(c).hinges()) <= 2.8);
        assert!(worst(&palm_down, |c| of(c).mcp(0)) <= 4.0);
        assert!(pool(&exact).hinges() <= 1.0 && pool(&exact).mcp(0) <= 1.5);
        assert!(worst(&untilted, |c| of(c).hinges()) <= 1.0);
        assert!(worst(&untilted, |c| of(c).mcp(0)) <= 1.5);
    }
}

#[test]
#[ignore = "minutes: cargo xtask campaign glove"]
fn campaign_checks_of_correct_sessions() {
    let courses: Vec<Course> = (0..600)
        .map(|i| {
            let mut course = Course::new(10_000 + i);
            course.traits.is_left = i % 4 == 3;
            course
        })
        .collect();
    let (mut alarms, mut wrong) = (0, 0);
    for (course, came) in courses.iter().zip(each(&courses, run)) {
        let found = doubts(&came);
        if !found.is_empty() {
            alarms += 1;
            println!("seed {}: {found:?}", course.traits.seed);
        }
        let left = came.outcome.profile.side == Side::Left;
        wrong += usize::from(came.outcome.checks.identity != Identity::AsWired);
        wrong += usize::from(left != course.traits.is_left);
    }
    println!(
        "{} correct sessions: {alarms} with a false alarm, {wrong} with a wrong seat or side",
        courses.len()
    );
    assert!(alarms * 50 <= courses.len() && wrong == 0);
}

#[test]
#[ignore = "minutes: cargo xtask campaign glove"]
fn campaign_checks_of_swapped_pairs() {
    let pairs = (0..16).flat_map(|a| (a + 1..16).map(move |b| (a, b)));
    let courses: Vec<Course> = pairs
        .enumerate()
        .map(|(i, (a, b))| {
            let mut course = Course::new(2_000 + i as u64);
            course.honest.seats.swap(a, b);
            course
        })
        .collect();
    let mut named = 0;
    for (course, came) in courses.iter().zip(each(&courses, run)) {
        let found = came.outcome.profile.sensors.map(usize::from);
        named += usize::from(found == course.honest.seats);
        if found != course.honest.seats {
            println!(
                "seed {}: {:?}, {:?}",
                course.traits.seed,
                course.honest.seats,
                doubts(&came)
            );
        }
    }
    println!("{} swapped pairs: {named} named exactly", courses.len());
    assert_eq!(named, courses.len());
}

#[test]
#[ignore = "minutes: cargo xtask campaign glove"]
fn campaign_checks_of_slips_of_20_degrees() {
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let courses: Vec<Course> = (0..144)
        .map(|i| {
            let mut course = Course::new(3_000 + i as u64);
            course.slip = Some((i % 16, 20.0, axes[i / 16 % 3]));
            course
        })
        .collect();
    let (mut found, mut named) = (0, 0);
    for (course, came) in courses.iter().zip(each(&courses, run)) {
        let checks = &came.outcome.checks;
        let segment = course.slip.map(|slip| slip.0);
        let told = checks.doubts().any(|doubt| {
            matches!(doubt, Doubt::Tilted { .. } | Doubt::Turned { .. })
                && doubt.verdict() == Verdict::Bad
        });
        found += usize::from(told);
        named += usize::from(checks.slipped() == segment);
        if !told || checks.slipped() != segment {
            println!(
                "seed {}: {:?}, {:?}",
                course.traits.seed,
                course.slip,
                doubts(&came)
            );
        }
    }
    println!(
        "{} slips of 20°: {found} found, {named} named",
        courses.len()
    );
    assert_eq!(found, courses.len());
}
