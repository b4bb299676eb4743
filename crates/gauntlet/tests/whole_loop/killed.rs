//! A live training that is killed outright, at random moments, and goes on: what was shown stays shown.

use crate::support;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::Stdio;
use std::time::{Duration, Instant};

use host::trainer::random::Random;
use support::bench::Running;
use support::told::Told;
use support::{Simulation, command};

/// For one word of a program, on a busy machine.
const WORD: Duration = Duration::from_secs(120);
/// The longest that a session lives after the flat hand, s: longer than the free motion's first movements, and than three poses.
const LIFE_S: f64 = 10.0;

/// A session's files, and the glove and the person that outlive every program.
struct Session {
    simulation: Simulation,
    folder: tempfile::TempDir,
    poses: Option<PathBuf>,
}

/// What a killed program had said.
#[derive(Debug, Default)]
struct Said {
    /// The number of the newest pose that was taken.
    taken: usize,
    /// What was asked, by its number.
    asked: BTreeMap<usize, String>,
    /// The first number that was asked.
    first: Option<usize>,
    all: String,
}

impl Session {
    fn new(is_moved: bool) -> Self {
        let folder = tempfile::tempdir().unwrap();
        Self {
            simulation: Simulation::start(true, false),
            poses: is_moved.then(|| support::poses_file(folder.path(), 400)),
            folder,
        }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The whole rows of a file, without its header.
    fn rows(&self, name: &str) -> Vec<String> {
        let Ok(text) = std::fs::read_to_string(self.file(name)) else {
            return Vec::new();
        };
        assert!(text.ends_with('\n'), "half a row: {text}");
        let columns = |line: &str| line.split(',').count();
        let header = text.lines().next().map(columns);
        assert!(text.lines().all(|line| Some(columns(line)) == header));
        text.lines().skip(1).map(str::to_owned).collect()
    }

    fn start(&self, resumes: bool) -> (Running, Told) {
        let glove = self.simulation.glove();
        let text = |path: PathBuf| path.to_str().unwrap().to_owned();
        let (out, pairs) = (
            text(self.file("map.safetensors")),
            text(self.file("map.pairs.csv")),
        );
        let poses = self.poses.clone().map(text);
        let mut words = vec![
            "train", "--live", "--glove", &glove, "--ideal", "--json", "--out", &out, "--starts",
            "1", "--epochs", "60",
        ];
        if let Some(poses) = &poses {
            words.extend(["--poses", poses]);
        }
        if resumes {
            words.extend(["--resume", &pairs]);
        }
        let piped = || Stdio::piped();
        let mut running = Running::start(command(&words).stdout(Stdio::null()).stderr(piped()));
        let told = Told::by(running.0.stderr.take().unwrap());
        (running, told)
    }

    /// Runs until so long after the flat hand, or until `enough` of what it says, and kills it; whether it had ended by itself.
    fn killed(&self, resumes: bool, life: Duration, enough: impl Fn(&str) -> bool) -> (Said, bool) {
        let (mut running, told) = self.start(resumes);
        let end = Instant::now() + WORD;
        let mut flat_at = None;
        let ended = loop {
            if let Some(status) = running.0.try_wait().unwrap() {
                assert!(status.success(), "{}", told.all());
                break true;
            }
            let said = told.so_far();
            if flat_at.is_none() && said.contains("flat     taken") {
                flat_at = Some(Instant::now());
            }
            let is_over = flat_at.is_some_and(|at| at.elapsed() >= life);
            if enough(&said) || is_over {
                running.0.kill().unwrap();
                running.0.wait().unwrap();
                break false;
            }
            assert!(Instant::now() < end, "it does not go on: {said}");
            std::thread::sleep(Duration::from_millis(2));
        };
        (Said::of(told.all()), ended)
    }
}

impl Said {
    fn of(all: String) -> Self {
        let mut said = Self::default();
        for line in all.lines() {
            let words: Vec<&str> = line.split_whitespace().collect();
            match words[..] {
                ["pose", number, "taken"] => said.taken = number.parse().unwrap(),
                [number, "of", of, ..] if of.parse::<usize>().is_ok() => {
                    let number = number.parse().unwrap();
                    said.first.get_or_insert(number);
                    said.asked.insert(number, words[3..].join(" "));
                }
                _ => {}
            }
        }
        Self { all, ..said }
    }
}

/// Kills sessions so often and has them go on; how many poses were shown in all.
fn killed(times: u64, seed: u64) -> usize {
    println!("seed {seed}");
    let mut random = Random::new(seed, 9);
    let (mut session, mut shown) = (Session::new(true), 0);
    let mut before = Said::default();
    let mut rows = Vec::new();
    for moment in 0..times {
        let life = Duration::from_secs_f64(LIFE_S * random.unit_f64());
        let (said, ended) = session.killed(!rows.is_empty(), life, |_| false);
        let left = session.rows("map.pairs.csv");
        let context = format!("moment {moment}, {life:?}: {}", said.all);
        assert!(left.starts_with(&rows), "rounds are lost: {context}");
        // What was said to be taken is kept; the newest may be there before the word.
        let told = said.taken.max(rows.len());
        assert!((told..=told + 1).contains(&left.len()), "{context}");
        if let Some(first) = said.first {
            assert_eq!(first, rows.len() + 1, "{context}");
            if let Some(asked) = before.asked.get(&first) {
                assert_eq!(asked, &said.asked[&first], "another pose: {context}");
            }
        }
        shown += left.len() - rows.len();
        (before, rows) = (said, left);
        if ended {
            assert_eq!(rows.len(), 10, "{}", before.all);
            (session, before, rows) = (Session::new(true), Said::default(), Vec::new());
        }
    }
    // It goes on once more, until another pose is taken, or all are there.
    let goes_on = |said: &str| {
        let mut lines = said.lines().map(str::trim);
        lines.any(|line| line.starts_with("pose ") || line == "all poses are shown")
    };
    let (said, _) = session.killed(!rows.is_empty(), WORD, goes_on);
    let left = session.rows("map.pairs.csv");
    assert!(
        goes_on(&said.all) && left.starts_with(&rows),
        "{}",
        said.all
    );
    shown
}

#[test]
fn a_killed_program_keeps_every_round_and_goes_on_with_the_pose_it_asked_for() {
    killed(3, 4);
}

#[test]
#[ignore = "minutes: cargo xtask campaign teaching"]
fn fifty_programs_killed_at_random_moments_keep_every_round() {
    let shown = killed(50, 11);
    println!("{shown} poses were shown between 50 kills");
    assert!(
        shown >= 30,
        "they were killed before anything was shown: {shown}"
    );
}

#[test]
fn a_program_killed_in_the_free_motion_keeps_what_was_moved_and_goes_on_there() {
    let session = Session::new(false);
    let asked = |number: usize| move |said: &str| said.contains(&format!("\n {number} of "));
    let (said, _) = session.killed(false, WORD, asked(2));
    let moved = session.rows("map.poses.csv");
    assert!(moved.len() > 20, "{}: {}", moved.len(), said.all);
    let (again, _) = session.killed(true, WORD, asked(3));
    let more = session.rows("map.poses.csv");
    assert!(more.starts_with(&moved) && more.len() > moved.len() + 20);
    assert!(matches!(again.first, Some(1 | 2)), "{}", again.all);
}
