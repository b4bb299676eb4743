//! A map that is taught by showing poses, with the page open in a browser: what a person sees and presses there.

use crate::support;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::Stdio;
use std::time::{Duration, Instant};

use serde_json::Value;
use support::bench::Running;
use support::browser::{Browser, decoded};
use support::{Simulation, command, page};

/// For a whole session, of a busy machine.
const SESSION: Duration = Duration::from_secs(900);
/// What the page shows at one moment: state, place, question, gripper, map, share of the ring.
const SEEN: &str = "(() => { const text = (id) => document.getElementById(id)?.textContent ?? ''; \
     const shown = (id) => !(document.getElementById(id)?.hidden ?? true); \
     return [text('state'), shown('teach') ? text('teach-name') : '', shown('guide') ? text('guide-name') : '', text('gripper-name'), \
     shown('map-panel') ? text('map-words') : '', document.querySelector('#ring .done')?.style.strokeDasharray ?? '']; })()";

/// What came of a session.
struct Came {
    result: Value,
    states: BTreeSet<String>,
    places: BTreeSet<String>,
    guides: BTreeSet<String>,
    grippers: BTreeSet<String>,
    maps: BTreeSet<String>,
    rings: BTreeSet<String>,
}

/// Teaches in front of a browser with these options; on the page the last pair is taken back once, then the map is trained to its end.
/// `None` without a browser. Where `PAGE_PICTURES` names a folder, each state is kept there as a picture.
fn taught(name: &str, more: &[&str]) -> Option<Came> {
    let mut browser = Browser::start()?;
    let simulation = Simulation::start(true, false);
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("model.safetensors");
    let poses = support::poses_file(folder.path(), 400);
    let glove = simulation.glove();
    let mut words = vec!["train", "--live", "--glove", &glove, "--ideal", "--view"];
    words.extend(["--json", "--out", out.to_str().unwrap()]);
    words.extend(more.iter().map(|word| match *word {
        "POSES" => poses.to_str().unwrap(),
        word => word,
    }));
    let mut running = Running::start(
        command(&words)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped()),
    );
    let address = page::address(running.0.stderr.take().unwrap());
    browser.screen((1280, 900), 1.0, "dark");
    browser.go(&address);
    let mut came = Came {
        result: Value::Null,
        states: BTreeSet::new(),
        places: BTreeSet::new(),
        guides: BTreeSet::new(),
        grippers: BTreeSet::new(),
        maps: BTreeSet::new(),
        rings: BTreeSet::new(),
    };
    let end = Instant::now() + SESSION;
    let (mut pressed, mut pressed_at) = (0, Instant::now());
    while running.0.try_wait().unwrap().is_none() {
        let seen = browser.ask(SEEN);
        assert!(Instant::now() < end, "it does not end: {seen}");
        let text = |k: usize| seen[k].as_str().unwrap_or_default().to_owned();
        let state = text(0);
        if came.states.insert(state.clone()) {
            picture_of(&mut browser, name, &state);
        }
        came.places.insert(text(1));
        came.guides.insert(text(2));
        came.grippers.insert(text(3));
        came.maps.insert(text(4));
        came.rings.insert(text(5));
        // The first time the last pair is taken back; then it is enough.
        if state.starts_with("try the map") && pressed_at.elapsed() > Duration::from_secs(2) {
            let (key, code, number) = match pressed {
                0 => ("u", "KeyU", 85),
                _ => (" ", "Space", 32),
            };
            browser.key(true, key, code, number);
            browser.key(false, key, code, number);
            (pressed, pressed_at) = (pressed + 1, Instant::now());
        }
        std::thread::sleep(Duration::from_millis(30));
    }
    let complaints = browser.complaints();
    assert!(complaints.is_empty(), "{complaints:?}");
    let at = address.strip_prefix("http://").unwrap();
    for asked in browser.asked_for() {
        let rest = asked.split_once("://").map(|(_, rest)| rest);
        let is_own = rest.is_some_and(|rest| rest.starts_with(at));
        assert!(is_own || asked.starts_with("data:"), "asked for {asked}");
    }
    let output = running.finish();
    came.result = serde_json::from_slice(&output.stdout).unwrap();
    Some(came)
}

/// Kept where pictures are wanted, at the width of a desk and of a phone.
fn picture_of(browser: &mut Browser, name: &str, state: &str) {
    let Some(folder) = std::env::var_os("PAGE_PICTURES").map(PathBuf::from) else {
        return;
    };
    let letters = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
    let state: String = state.chars().map(letters).take(24).collect();
    for (size, screen, scale) in [("phone", (375, 812), 2.0), ("desk", (1280, 900), 1.0)] {
        browser.screen(screen, scale, "dark");
        std::thread::sleep(Duration::from_millis(150));
        let wide = browser.ask("document.documentElement.scrollWidth <= window.innerWidth");
        assert_eq!(wide, true, "{state} is wider than {size}");
        let png = decoded(&browser.picture("png"));
        std::fs::write(folder.join(format!("{name}-{state}-{size}.png")), png).unwrap();
    }
}

impl Came {
    fn is_as_a_person_needs_it(&self, of: usize) {
        for state in ["hold", "try the map: nothing moves"] {
            assert!(self.states.contains(state), "{state}: {:?}", self.states);
        }
        let training = self.states.iter().any(|s| s.starts_with("training: "));
        assert!(training, "{:?}", self.states);
        for pose in 1..=of {
            let place = format!("teaching: pose {pose} of {of}");
            assert!(self.places.contains(&place), "{place}: {:?}", self.places);
        }
        for gripper in ["show this pose", "your hand by the map"] {
            let is_there = self.grippers.contains(gripper);
            assert!(is_there, "{gripper}: {:?}", self.grippers);
        }
        // One for each map on the way: it grows.
        let maps: Vec<_> = self.maps.iter().filter(|map| !map.is_empty()).collect();
        assert!(maps.len() >= 2, "{maps:?}");
        let share = |ring: &String| ring.split([' ', ',']).next()?.parse::<f64>().ok();
        let most = self.rings.iter().filter_map(share).fold(0.0, f64::max);
        assert!(most > 30.0, "the ring stays empty: {:?}", self.rings);
        assert_eq!(self.result["result"], "train --live");
        assert_eq!(self.result["pairs"], of);
        assert_eq!(self.result["taken_back"], 1, "{}", self.result);
    }
}

#[test]
fn poses_are_shown_taken_and_taken_back_on_the_page_and_the_map_is_tried_there() {
    let short = ["--poses", "POSES", "--pairs", "1", "--epochs", "60"];
    if let Some(came) = taught("short", &[&short[..], &["--starts", "1"]].concat()) {
        came.is_as_a_person_needs_it(3);
    }
}

/// The gripper that shows the poses is held where the program that teaches is killed outright.
#[test]
fn a_killed_program_leaves_the_gripper_that_shows_poses_held_on_its_way() {
    let simulation = Simulation::start(true, false);
    let folder = tempfile::tempdir().unwrap();
    let poses = support::poses_file(folder.path(), 400);
    let out = folder.path().join("model.safetensors");
    let (gripper, _port, place) = support::devices::gripper(rig::gripper::Config::default());
    gripper.preset_active();
    let glove = simulation.glove();
    let [poses, out] = [&poses, &out].map(|path| path.to_str().unwrap());
    let words = [
        "train",
        "--live",
        "--glove",
        &glove,
        "--ideal",
        "--poses",
        poses,
        "--out",
        out,
        "--json",
        "--show-on",
        &place,
    ];
    let mut running = Running::start(command(&words).stdout(Stdio::null()).stderr(Stdio::null()));
    // The second pose is the fist: a way of seconds.
    let finger = || gripper.positions()[0];
    let end = Instant::now() + page::PATIENCE;
    while finger() < 40.0 {
        assert!(
            Instant::now() < end,
            "it shows nothing: {:?}",
            gripper.positions()
        );
        assert!(running.0.try_wait().unwrap().is_none(), "it ended");
        std::thread::sleep(Duration::from_millis(5));
    }
    running.0.kill().unwrap();
    let killed_at = finger();
    let mut stood = (killed_at, Instant::now());
    while stood.1.elapsed() < Duration::from_secs(2) {
        assert!(
            Instant::now() < end,
            "it goes on: {:?}",
            gripper.positions()
        );
        if finger() != stood.0 {
            stood = (finger(), Instant::now());
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(
        stood.0 < 250.0,
        "it went on to the end: {stood:?}, killed at {killed_at}"
    );
}

/// With the minute of free motion, eight rounds and the usual training.
#[test]
#[ignore = "minutes: cargo xtask campaign view"]
fn a_whole_live_training_in_front_of_a_browser_ends_with_a_usable_map() {
    let came = taught("live", &[]).expect("chromium");
    came.is_as_a_person_needs_it(10);
    assert!(came.guides.iter().any(|name| name.contains("move freely")));
    println!("{}", came.result["verdict"]);
    assert_eq!(came.result["good"], true, "{}", came.result);
}
