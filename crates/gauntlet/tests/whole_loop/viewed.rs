//! Every verb that works in front of one computer's devices and has a page: where it says the address, and that the page is its own.
//! `demo` trains first, and bridges on a chip are in `chip_judged`.

use crate::support;

use std::process::Stdio;

use support::bench::Running;
use support::page::{OpenPage, address};
use support::{Simulation, command, interrupt, model, run_owned, teleop, text, wait};

/// What the page is called, the words of the verb, and whether the page says what to do.
const VERBS: [(&str, &str, bool); 5] = [
    (
        "gauntlet teleop",
        "teleop --glove GLOVE --gripper GRIPPER --model MODEL --ideal",
        false,
    ),
    // Two seconds, of which the page sees enough.
    ("gauntlet replay", "replay LOG --speed 0.1", false),
    (
        "gauntlet record",
        "record --glove GLOVE --ideal --out HAND",
        true,
    ),
    (
        "gauntlet train --live",
        "train --live --glove GLOVE --ideal --out MAP",
        false,
    ),
    ("gauntlet calibrate", "calibrate --glove GLOVE", true),
];

#[test]
fn every_verb_with_a_view_serves_its_page() {
    let simulation = Simulation::start(true, true);
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (glove, gripper, log) = (simulation.glove(), simulation.gripper(), at("run.mcap"));
    let more = [
        "--ideal",
        "--calibrate-flat",
        "--seconds",
        "2",
        "--log",
        &log,
    ];
    let logged = run_owned(&teleop(&glove, &gripper, &more));
    let is_there = std::path::Path::new(&log).exists();
    assert!(is_there, "{}", text(&logged.stderr));
    for (title, verb, is_guided) in VERBS {
        for json in [false, true] {
            // No file is written over.
            let hand = at(&format!("hand_{json}.csv"));
            let map = at(&format!("map_{json}.safetensors"));
            let mut words: Vec<&str> = verb
                .split(' ')
                .map(|word| match word {
                    "GLOVE" => glove.as_str(),
                    "GRIPPER" => gripper.as_str(),
                    "MODEL" => model().to_str().unwrap(),
                    "LOG" => log.as_str(),
                    "HAND" => hand.as_str(),
                    "MAP" => map.as_str(),
                    word => word,
                })
                .collect();
            words.push("--view");
            words.extend(json.then_some("--json"));
            // The result has standard output to itself.
            let (stdout, stderr) = match json {
                true => (Stdio::null(), Stdio::piped()),
                false => (Stdio::piped(), Stdio::inherit()),
            };
            let mut running = Running::start(command(&words).stdout(stdout).stderr(stderr));
            let address = match json {
                true => address(running.0.stderr.take().unwrap()),
                false => address(running.0.stdout.take().unwrap()),
            };
            let mut page = OpenPage::open(&address);
            page.until(&format!("the page of {title}"), |page| {
                let picture = &page.picture;
                picture["title"] == title && (!is_guided || !picture["guide"].is_null())
            });
            interrupt(&running.0);
            let why = page.until_closed();
            assert_eq!(why.as_deref(), Some("the program has ended"), "{words:?}");
            let end = wait(&mut running.0);
            assert!(end.code().is_some(), "{words:?} was killed: {end}");
        }
    }
}
