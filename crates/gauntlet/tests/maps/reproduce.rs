//! `reproduce` with trainings of two epochs.

use crate::support;

use std::path::Path;
use std::process::Stdio;
use std::time::Duration;
use support::told::interrupted_at;
use support::{command, finish, interrupt, json, poses_file, refusal, run, text};

fn reproduce(folder: &Path, words: &[&str]) -> std::process::Output {
    let out = folder.to_str().unwrap();
    let mut all = vec!["reproduce", "--out", out, "--epochs", "2", "--seeds", "1"];
    all.extend(words);
    run(&all)
}

#[test]
fn figures_come_with_their_data_and_a_training_serves_them_all() {
    let folder = tempfile::tempdir().unwrap();
    let said = json(&reproduce(
        folder.path(),
        &["fig9", "fig1", "fig12", "fig13", "--json"],
    ));
    let results = said["results"].as_array().unwrap();
    let names: Vec<&str> = results
        .iter()
        .map(|r| r["what"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["fig1", "fig9", "fig12", "fig13"]);
    for result in results {
        for file in result["files"].as_array().unwrap() {
            let content = std::fs::read_to_string(file.as_str().unwrap()).unwrap();
            let is_whole = content.trim_end().ends_with("</svg>") || content.contains(',');
            assert!(is_whole, "{file}");
        }
    }
    let shapes = results[0]["numbers"].as_array().unwrap();
    let nodes: Vec<u64> = shapes
        .iter()
        .map(|s| s["nodes"].as_u64().unwrap())
        .collect();
    assert_eq!(nodes, [1409, 952, 1709, 2209]);
    assert_eq!(results[1]["numbers"].as_array().unwrap().len(), 8);
    let trajectory = std::fs::read_to_string(folder.path().join("fig12.csv")).unwrap();
    assert_eq!(trajectory.lines().count(), 1 + 25);
    assert!(trajectory.starts_with("pose,time_s,thumb_cmc_flex"));
    assert!(trajectory.lines().last().unwrap().starts_with("24,6,"));
    // One training; found again by the next run.
    let trained = || {
        let files = std::fs::read_dir(folder.path().join("trainings")).unwrap();
        let names = files.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.filter(|name| name.ends_with(".json")).count()
    };
    assert_eq!(trained(), 1);
    let again = reproduce(folder.path(), &["fig9"]);
    assert!(
        text(&again.stdout).contains("0 to do, 1 found"),
        "{}",
        text(&again.stdout)
    );
    assert_eq!(trained(), 1);
}

#[test]
fn the_shapes_files_train_as_any_two_domains() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(reproduce(folder.path(), &["fig1"]).status.code(), Some(0));
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (q, x, truth) = (
        file("sp2-input.csv"),
        file("sp2-target.csv"),
        file("sp2-truth.csv"),
    );
    let out = file("sp2.safetensors");
    let said = json(&run(&[
        "train",
        "--input",
        &q,
        "--target",
        &x,
        "--truth",
        &truth,
        "--volume",
        "2.88",
        "--dim",
        "2",
        "--hold-out",
        "0.5",
        "--schedule",
        "fast",
        "--epochs",
        "2",
        "--starts",
        "1",
        "--out",
        &out,
        "--json",
    ]));
    assert_eq!(said["quality"]["samples"], 476);
    assert_eq!(said["quality"]["true_pairs"], 476);
    // The matched outlines lie outside the nodes, most on SP1, and train all the same.
    for shape in ["sp1", "sp2", "sp3", "sp4"] {
        let part = |part: &str| file(&format!("{shape}-{part}.csv"));
        let words = [
            [
                "train",
                "--input",
                &part("input"),
                "--target",
                &part("target"),
            ],
            [
                "--pairs-file",
                &part("ring"),
                "--pairs",
                "boundary:4",
                "--json",
            ],
            ["--starts", "1", "--epochs", "2", "--out"],
        ];
        let said = json(&run(&[&words.concat()[..], &[&out]].concat()));
        assert_eq!(said["pairs"], 4);
        assert!(!said["warnings"].to_string().contains("outside"), "{said}");
    }
}

#[test]
fn a_table_holds_the_orders_and_dashes_and_replaces_an_old_one_whole() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("table4.txt");
    let witness = folder.path().join("witness");
    std::fs::write(&table, "old").unwrap();
    std::fs::hard_link(&table, &witness).unwrap();
    let said = json(&reproduce(folder.path(), &["table4", "--json"]));
    let written = std::fs::read_to_string(&table).unwrap();
    assert_eq!(std::fs::read_to_string(&witness).unwrap(), "old");
    assert!(
        written.contains("± —") && written.contains("means: d-Knn: HAE"),
        "{written}"
    );
    assert!(
        !written.contains("← outside") || written.contains("this run has less"),
        "{written}"
    );
    let result = &said["results"][0]["numbers"][0];
    assert_eq!(result["rows"].as_array().unwrap().len(), 8);
    assert_eq!(result["orders"].as_array().unwrap().len(), 2);
}

#[test]
fn a_run_that_is_killed_goes_on_and_gives_what_an_unbroken_one_gives() {
    let (killed, whole) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let words = ["fig6", "--seeds", "4"];
    let out = killed.path().to_str().unwrap();
    let mut child = command(&[&["reproduce", "--out", out, "--epochs", "2"][..], &words].concat())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let trainings = killed.path().join("trainings");
    let until = std::time::Instant::now() + Duration::from_secs(120);
    while std::fs::read_dir(&trainings).map_or(0, Iterator::count) < 3 {
        assert!(std::time::Instant::now() < until);
        std::thread::sleep(Duration::from_millis(2));
    }
    // Not to be caught.
    child.kill().unwrap();
    child.wait().unwrap();
    for folder in [killed.path(), whole.path()] {
        let out = folder.to_str().unwrap();
        let output = run(&[&["reproduce", "--out", out, "--epochs", "2"][..], &words].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    }
    for file in ["fig6.csv", "fig6.svg"] {
        let of = |folder: &Path| std::fs::read(folder.join(file)).unwrap();
        assert!(of(killed.path()) == of(whole.path()), "{file}");
    }
}

#[test]
fn a_recording_takes_the_place_of_generated_motion() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 120);
    let output = reproduce(folder.path(), &["fig9", "--poses", poses.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let mut names = std::fs::read_dir(folder.path().join("trainings")).unwrap();
    assert!(names.any(|entry| {
        entry
            .unwrap()
            .file_name()
            .to_str()
            .unwrap()
            .starts_with("recorded-")
    }));
}

#[test]
fn a_run_that_is_stopped_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let words = [
        "reproduce",
        "fig6",
        "--out",
        out,
        "--epochs",
        "2",
        "--seeds",
        "500",
        "--threads",
        "1",
    ];
    let child = command(&words)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let kept = || {
        let files = std::fs::read_dir(folder.path().join("trainings"));
        files.map_or(0, |files| {
            let names = files.map(|entry| entry.unwrap().file_name().into_string().unwrap());
            names.filter(|name| name.ends_with(".json")).count()
        })
    };
    let until = std::time::Instant::now() + Duration::from_secs(120);
    while kept() < 2 && std::time::Instant::now() < until {
        std::thread::sleep(Duration::from_millis(20));
    }
    interrupt(&child);
    let output = finish(child);
    assert!(refusal(&output, 1).contains("interrupted"));
    assert!(kept() >= 2);
    assert!(!folder.path().join("fig6.svg").exists());
    // The first seed's trainings are not done again.
    let output = reproduce(folder.path(), &["fig6"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(
        text(&output.stdout).contains("1 to do, 1 found"),
        "{}",
        text(&output.stdout)
    );
    assert!(folder.path().join("fig6.svg").exists() && folder.path().join("fig6.csv").exists());
}

#[test]
fn what_cannot_be_reproduced_is_said() {
    let folder = tempfile::tempdir().unwrap();
    for words in [&["fig7"][..], &[], &["fig1", "--normal=-1"]] {
        assert_eq!(
            reproduce(folder.path(), words).status.code(),
            Some(2),
            "{words:?}"
        );
    }
    let file = folder.path().join("file");
    std::fs::write(&file, "taken").unwrap();
    let said = refusal(&reproduce(&file, &["fig1"]), 1);
    assert!(said.contains("file"), "{said}");
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "taken");
}

#[test]
fn a_hand_s_table_ends_soon_after_ctrl_c_and_goes_on_with_what_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let words = [
        "reproduce",
        "table4",
        "--out",
        out,
        "--seeds",
        "1",
        "--threads",
        "1",
        "--epochs",
        "4000",
    ];
    let (output, took) = interrupted_at("\ntrainings ", &words);
    let said = refusal(&output, 1);
    assert!(said.contains("interrupted"), "{said}");
    assert!(took < Duration::from_secs(20));
}
