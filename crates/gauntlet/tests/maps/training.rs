//! `train` and `eval` on small data.

use crate::support;

use std::process::Stdio;
use std::time::{Duration, Instant};
use support::told::interrupted_at;
use support::{command, finish, interrupt, json, model, poses_file, refusal, run};

#[test]
fn the_same_seed_trains_the_same_model_and_another_seed_another() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 120);
    let train = |name: &str, seed: &str| {
        let out = folder.path().join(name);
        let output = run(&[
            "train",
            "--poses",
            poses.to_str().unwrap(),
            "--out",
            out.to_str().unwrap(),
            "--schedule",
            "short",
            "--epochs",
            "20",
            "--pairs",
            "1",
            "--seed",
            seed,
            "--json",
        ]);
        let said = json(&output);
        assert_eq!(said["epochs"], 120);
        assert_eq!(said["pairs"], 3);
        assert!(said["quality"]["frames"].as_u64() == Some(48), "{said}");
        std::fs::read(out).unwrap()
    };
    let first = train("a", "3");
    assert!(first == train("b", "3"), "the same seed gave other bytes");
    assert!(first != train("c", "4"));
}

#[test]
fn eval_measures_a_model_and_carries_what_is_known_about_it() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 60);
    let said = json(&run(&[
        "eval",
        "--model",
        model().to_str().unwrap(),
        "--poses",
        poses.to_str().unwrap(),
        "--json",
    ]));
    assert_eq!(said["quality"]["frames"], 60);
    for measure in ["mean_distortion", "volume_occupancy", "d_knn"] {
        assert!(
            said["quality"][measure].as_f64().is_some_and(|v| v > 0.0),
            "{measure}: {said}"
        );
    }
    assert_eq!(said["metadata"]["cost"], "hae");
    assert_eq!(said["metadata"]["pairs"], "3");
}

#[test]
fn ctrl_c_ends_a_training_soon_and_leaves_no_model() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 200);
    let out = folder.path().join("model.safetensors");
    let (poses, path) = (poses.to_str().unwrap(), out.to_str().unwrap());
    let words = ["train", "--poses", poses, "--out", path];
    let (output, took) = interrupted_at("\ntraining ", &words);
    assert!(refusal(&output, 1).contains("interrupted"));
    assert!(took < Duration::from_secs(20));
    assert!(!out.exists());
}

#[test]
fn ports_are_listed_as_json() {
    let said = json(&run(&["ports", "--json"]));
    assert!(said["ports"].is_array());
}

#[test]
fn table_3_s_poses_are_named_and_a_file_of_pairs_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 60);
    let out = folder.path().join("m.safetensors");
    let (poses, out) = (poses.to_str().unwrap(), out.to_str().unwrap());
    let train = |words: &[&str]| {
        let mut all = vec![
            "train", "--poses", poses, "--out", out, "--starts", "1", "--epochs", "5",
        ];
        all.extend(words);
        run(&all)
    };
    let output = train(&["--pairs", "table3:8"]);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}",
        support::text(&output.stderr)
    );
    let said = support::text(&output.stdout);
    for name in ["pinch close", "finger C, A open"] {
        assert!(said.contains(name), "{said}");
    }
    assert!(
        !said.contains("all fingers close"),
        "eight poses, not ten: {said}"
    );

    let header = format!(
        "{},finger_a,finger_b,finger_c,scissor",
        support::JOINTS.join(",")
    );
    let row = |counts: &str| format!("{},{counts}", ["0.1"; 25].join(","));
    let file = folder.path().join("pairs.csv");
    std::fs::write(&file, format!("{header}\n{}\n", row("0,0,255,130"))).unwrap();
    let file_word = file.to_str().unwrap();
    assert_eq!(
        json(&train(&["--pairs-file", file_word, "--json"]))["pairs"],
        1
    );
    // Scissor at a pinch and fingers A and B closed: they would meet.
    std::fs::write(
        &file,
        format!(
            "{header}\n{}\n{}\n",
            row("0,0,255,130"),
            row("255,255,0,255")
        ),
    )
    .unwrap();
    let said = refusal(&train(&["--pairs-file", file_word]), 1);
    assert!(
        said.contains("pairs.csv: pair 2") && said.contains("255.0"),
        "{said}"
    );
    assert_eq!(train(&["--pairs", "random"]).status.code(), Some(2));
    assert_eq!(train(&["--pairs", "table3:11"]).status.code(), Some(2));
}

#[test]
fn train_eval_and_report_say_the_same_of_the_motion_that_trained() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 700);
    let out = folder.path().join("m.safetensors");
    let (poses, out) = (poses.to_str().unwrap(), out.to_str().unwrap());
    for more in [&["--seed", "9", "--hold-out", "0.5"][..], &[]] {
        let words = [
            "train", "--poses", poses, "--out", out, "--starts", "1", "--epochs", "5", "--pairs",
            "1", "--json",
        ];
        let trained = json(&run(&[&words, more].concat()));
        assert!(trained["verdict"].is_string(), "{trained}");
        for verb in ["eval", "report"] {
            let said = run(&[verb, "--model", out, "--poses", poses, "--json"]);
            let judged = json(&said);
            for same in ["verdict", "good", "quality", "faults"] {
                assert_eq!(judged[same], trained[same], "{verb}: {same}");
            }
            let warned = support::text(&said.stderr);
            assert!(!warned.contains("not held out"), "{warned}");
        }
    }
    let output = run(&["eval", "--model", out, "--poses", poses, "--json"]);
    assert_eq!(json(&output)["held_out"], true);
}

#[test]
fn a_hand_s_own_training_file_is_not_held_out_where_all_of_it_trained() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 60);
    let out = folder.path().join("m.safetensors");
    let (poses, out) = (poses.to_str().unwrap(), out.to_str().unwrap());
    let words = [
        "train",
        "--poses",
        poses,
        "--out",
        out,
        "--starts",
        "1",
        "--epochs",
        "5",
        "--pairs",
        "1",
        "--hold-out",
        "0",
    ];
    assert_eq!(run(&words).status.code(), Some(0));
    let output = run(&["eval", "--model", out, "--poses", poses, "--json"]);
    assert!(support::text(&output.stderr).contains("not held out"));
    assert_eq!(json(&output)["held_out"], false);
}

#[test]
fn a_joint_that_rests_is_warned_of_by_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 60);
    let text = std::fs::read_to_string(&poses).unwrap();
    let resting: Vec<String> = (text.lines().enumerate())
        .map(|(row, line)| {
            let mut fields: Vec<&str> = line.split(',').collect();
            if row > 0 {
                fields[1 + 4] = "0.25";
            }
            fields.join(",")
        })
        .collect();
    std::fs::write(&poses, resting.join("\n")).unwrap();
    let out = folder.path().join("m.safetensors");
    let (poses, out) = (poses.to_str().unwrap(), out.to_str().unwrap());
    let words = ["train", "--poses", poses, "--out", out, "--starts", "1"];
    let more = ["--epochs", "5", "--pairs", "heuristic:2", "--json"];
    let said = json(&run(&[&words[..], &more].concat()));
    assert_eq!(said["pairs"], 2);
    let warned = said["warnings"].to_string();
    assert!(
        warned.contains(&format!("{} is 0.25", support::JOINTS[4])),
        "{warned}"
    );
}

#[test]
fn train_gives_the_verdict_that_eval_gives_and_few_rows_are_not_silently_fine() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 60);
    let out = folder.path().join("m.safetensors");
    let (poses, out) = (poses.to_str().unwrap(), out.to_str().unwrap());
    let said = json(&run(&[
        "train", "--poses", poses, "--out", out, "--epochs", "50", "--pairs", "1", "--json",
    ]));
    assert_eq!(said["good"], false, "{said}");
    let warned = said["warnings"].to_string();
    assert!(
        warned.contains("not good enough to drive with") && warned.contains("24 poses are few"),
        "{warned}"
    );
    let output = run(&["eval", "--model", out, "--poses", poses, "--json"]);
    assert_eq!(json(&output)["good"], false);
    let output = run(&["eval", "--model", out, "--poses", poses]);
    assert!(support::text(&output.stdout).contains("verdict            not good enough"));
    assert!(support::text(&output.stdout).contains("\n  try: train again"));
}

#[test]
fn a_long_recording_trains_as_a_short_one_and_that_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 2600);
    let out = folder.path().join("m.safetensors");
    let (poses, out) = (poses.to_str().unwrap(), out.to_str().unwrap());
    let output = run(&[
        "train", "--poses", poses, "--out", out, "--epochs", "5", "--pairs", "1", "--json",
    ]);
    let noted = support::text(&output.stderr);
    assert!(
        noted.contains("of 2600 frames the 1000 that are farthest"),
        "{noted}"
    );
    let said = json(&output);
    assert_eq!(said["quality"]["frames"], 254);
    // The digests are those of the whole file: eval knows it again, and measures what was held out.
    let known = json(&run(&["eval", "--model", out, "--poses", poses, "--json"]));
    assert_eq!(known["held_out"], true, "{known}");
    assert_eq!(known["quality"], said["quality"], "{known}");
}

#[test]
fn a_training_that_is_done_is_kept_though_its_measures_are_not_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let spiral = |count: usize| -> Vec<[f32; 2]> {
        let point = |k: usize| [(k as f32 * 0.61).sin(), k as f32 / count as f32];
        (0..count).map(point).collect()
    };
    let samples = |name: &str, prefix: &str, count: usize| {
        let matrix = host::trainer::data::Matrix::from_rows(&spiral(count));
        host::trainer::data::write_samples(file(name), &matrix, prefix).unwrap();
    };
    // Measuring takes seconds, training does not.
    samples("q.csv", "q", 30_000);
    samples("x.csv", "x", 2_000);
    std::fs::write(file("p.csv"), "q0,q1,x0,x1\n0,0,0,0\n0.5,0.5,0.5,0.5\n").unwrap();
    let (q, x, p, out) = (
        file("q.csv"),
        file("x.csv"),
        file("p.csv"),
        file("m.safetensors"),
    );
    let words = [
        "train",
        "--input",
        &q,
        "--target",
        &x,
        "--pairs-file",
        &p,
        "--out",
        &out,
        "--epochs",
        "1",
        "--hold-out",
        "0.9",
        "--hidden",
        "8",
        "--cost",
        "pin",
    ];
    let child = command(&words)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let until = Instant::now() + Duration::from_secs(120);
    while !folder.path().join("m.safetensors").exists() {
        assert!(Instant::now() < until, "no model");
        std::thread::sleep(Duration::from_millis(1));
    }
    interrupt(&child);
    let output = finish(child);
    let said = refusal(&output, 1);
    assert!(said.contains("without its measures"), "{said}");
    assert!(support::text(&output.stderr).contains("try: `gauntlet eval --model"));
    let model = host::trainer::model::Model::load(&out).unwrap();
    assert_eq!(model.metadata["pairs"], "2");
    assert!(!model.metadata.contains_key("dbar"));
}

#[test]
fn tables_of_other_programs_train_and_what_was_done_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let plain = support::poses_text(60);
    let file = folder.path().join("hand.csv");
    let out = folder.path().join("m.safetensors");
    let train = |text: &str| {
        std::fs::write(&file, text).unwrap();
        let output = run(&[
            "train",
            "--poses",
            file.to_str().unwrap(),
            "--out",
            out.to_str().unwrap(),
            "--epochs",
            "5",
            "--pairs",
            "1",
        ]);
        let noted = support::text(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{noted}");
        noted
    };
    train(&plain);
    let model = std::fs::read(&out).unwrap();
    let semicolons = plain.replace(',', ";").replace('.', ",");
    let noted = train(&semicolons);
    assert!(
        noted.contains("hand.csv: semicolons") && noted.contains("decimal marks"),
        "{noted}"
    );
    assert!(model == std::fs::read(&out).unwrap(), "another model");
    let noted = train(&format!("Recorded today\n\n{plain}"));
    assert!(noted.contains("above the header"), "{noted}");
    assert!(model == std::fs::read(&out).unwrap(), "another model");
}

/// The most memory a process took until it ended, MB; how it ended.
fn most_memory(mut child: std::process::Child) -> (f64, std::process::ExitStatus) {
    let place = format!("/proc/{}/status", child.id());
    let end = Instant::now() + Duration::from_secs(120);
    let mut most = 0.0_f64;
    loop {
        let kilobytes = std::fs::read_to_string(&place).ok().and_then(|status| {
            let line = status
                .lines()
                .find_map(|line| line.strip_prefix("VmHWM:"))?;
            line.split_whitespace().next()?.parse::<f64>().ok()
        });
        most = most.max(kilobytes.unwrap_or(0.0) / 1024.0);
        if let Some(status) = child.try_wait().unwrap() {
            return (most, status);
        }
        if Instant::now() > end {
            child.kill().unwrap();
            panic!("still running at {most:.0} MB");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn sixteen_thousand_frames_are_measured_and_trained_in_less_than_400_megabytes() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 16_000);
    let out = folder.path().join("m.safetensors");
    let (poses, out) = (poses.to_str().unwrap(), out.to_str().unwrap());
    let short = [
        "train", "--poses", poses, "--out", out, "--pairs", "2", "--epochs", "6", "--starts", "1",
    ];
    let given = model().to_str().unwrap();
    let measured = ["eval", "--model", given, "--poses", poses];
    for words in [&measured[..], &short[..]] {
        let mut child = command(words);
        let child = child.stdout(Stdio::null()).stderr(Stdio::null()).spawn();
        let (most, status) = most_memory(child.unwrap());
        assert!(status.success(), "{}: {status}", words[0]);
        assert!((1.0..400.0).contains(&most), "{}: {most:.0} MB", words[0]);
    }
}
