//! `train` and `eval` on samples of any two domains, and what is wrong with them.
#![allow(missing_docs, clippy::unwrap_used)]

mod support;

use std::path::PathBuf;
use support::{command, finish, interrupt, json, refusal, run, text};
use trainer::data::{Matrix, Pairs, write_pairs, write_samples};

/// A square of the plane and its image, stretched and moved: a map that is easy to learn.
struct Files {
    folder: tempfile::TempDir,
}

impl Files {
    fn new() -> Self {
        let files = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        let pairs = pairs();
        write_samples(files.path("q.csv"), &pairs.inputs, "q").unwrap();
        write_samples(files.path("x.csv"), &targets(), "x").unwrap();
        files.write_truth("truth.csv", &pairs);
        files
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text_of(&self, name: &str) -> String {
        self.path(name).to_str().unwrap().to_owned()
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    fn write_truth(&self, name: &str, pairs: &Pairs) {
        write_pairs(self.path(name), pairs, &["q0", "q1"], &["x0", "x1"]).unwrap();
    }

    /// `train` in a few epochs, with more words.
    fn train(&self, words: &[&str]) -> std::process::Output {
        let mut all = vec!["--epochs", "40"];
        all.extend(words);
        self.train_long(&all)
    }

    fn train_long(&self, words: &[&str]) -> std::process::Output {
        let (q, x) = (self.text_of("q.csv"), self.text_of("x.csv"));
        let out = self.text_of("map.safetensors");
        let mut all = vec![
            "train",
            "--input",
            &q,
            "--target",
            &x,
            "--out",
            &out,
            "--schedule",
            "fast",
        ];
        all.extend(words);
        run(&all)
    }

    /// `train` with true pairs.
    fn train_with_truth(&self, words: &[&str]) -> std::process::Output {
        let truth = self.text_of("truth.csv");
        let mut all = vec!["--truth", truth.as_str()];
        all.extend(words);
        self.train(&all)
    }

    /// The refusal of a training, after seeing that nothing was written.
    fn refused(&self, words: &[&str], code: i32) -> String {
        let said = refusal(&self.train_with_truth(words), code);
        assert!(
            !self.path("map.safetensors").exists(),
            "a model was written"
        );
        let left = std::fs::read_dir(self.folder.path()).unwrap();
        for entry in left {
            let name = entry.unwrap().file_name();
            assert!(
                !name.to_str().unwrap().ends_with(".part"),
                "{name:?} is left"
            );
        }
        said
    }
}

fn pairs() -> Pairs {
    let mut pairs = Pairs::default();
    for i in 0..12 {
        for j in 0..12 {
            let q = [
                i as f32 / 6.0 - 1.0,
                j as f32 / 6.0 - 1.0 + 0.001 * i as f32,
            ];
            pairs.inputs.push(&q);
            pairs.targets.push(&[1.5 * q[0] + 0.5, q[1] - 0.2]);
        }
    }
    pairs
}

fn targets() -> Matrix {
    let mut targets = Matrix::default();
    for i in 0..20 {
        for j in 0..20 {
            targets.push(&[
                3.0 * i as f32 / 19.0 - 1.0,
                2.0 * j as f32 / 19.0 - 1.2 + 0.0001 * i as f32,
            ]);
        }
    }
    targets
}

#[test]
fn any_two_domains_train_and_the_four_measures_come_out() {
    let files = Files::new();
    let said =
        json(&files.train_with_truth(&["--pairs", "3", "--volume", "6", "--dim", "2", "--json"]));
    assert_eq!(said["epochs"], 340);
    assert_eq!(said["pairs"], 3);
    assert_eq!(said["quality"]["samples"], 58);
    assert_eq!(said["quality"]["true_pairs"], 58);
    for measure in ["mean_distortion", "volume_occupancy", "d_knn", "nmse"] {
        assert!(
            said["quality"][measure].as_f64().is_some(),
            "{measure}: {said}"
        );
    }
    // No normalisation: the model's numbers are those of the files.
    let model = trainer::model::Model::load(files.path("map.safetensors")).unwrap();
    assert_eq!(
        (model.q.offset, model.q.scale),
        (vec![0.0; 2], vec![1.0; 2])
    );
    let (q, x) = (files.text_of("q.csv"), files.text_of("x.csv"));
    let (model, truth) = (files.text_of("map.safetensors"), files.text_of("truth.csv"));
    let output = run(&[
        "eval",
        "--model",
        &model,
        "--input",
        &q,
        "--target",
        &x,
        "--truth",
        &truth,
        "--epsilon",
        "0.2",
        "--json",
    ]);
    assert!(
        text(&output.stderr).contains("not held out"),
        "{}",
        text(&output.stderr)
    );
    let said = json(&output);
    assert_eq!(said["held_out"], false);
    assert_eq!(said["quality"]["true_pairs"], 144);
    assert!(
        said["quality"]["nmse"]
            .as_f64()
            .is_some_and(|nmse| nmse < 2.0),
        "{said}"
    );
    assert_eq!(said["metadata"]["pairs"], "3");
}

#[test]
fn what_cannot_be_measured_is_null_with_a_word_why() {
    let files = Files::new();
    files.write_truth("pairs.csv", &pairs().spaced(4));
    let pairs = files.text_of("pairs.csv");
    let said = json(&files.train(&["--pairs-file", &pairs, "--json"]));
    assert!(said["quality"]["volume_occupancy"].is_null() && said["quality"]["nmse"].is_null());
    let unknown = said["quality"]["unknown"].to_string();
    assert!(
        unknown.contains("--volume") && unknown.contains("--truth"),
        "{unknown}"
    );
    let metadata = trainer::model::Model::load(files.path("map.safetensors"))
        .unwrap()
        .metadata;
    assert!(!metadata.contains_key("vo") && !metadata.contains_key("nmse"));
    assert!(metadata.contains_key("dbar") && metadata.contains_key("dknn"));
}

#[test]
fn samples_that_did_not_train_are_held_out() {
    let files = Files::new();
    assert!(files.train_with_truth(&[]).status.success());
    let mut others = pairs();
    for value in &mut others.inputs.data {
        *value *= 0.9;
    }
    write_samples(files.path("others.csv"), &others.inputs, "q").unwrap();
    let (model, q, x) = (
        files.text_of("map.safetensors"),
        files.text_of("others.csv"),
        files.text_of("x.csv"),
    );
    let output = run(&[
        "eval", "--model", &model, "--input", &q, "--target", &x, "--json",
    ]);
    assert!(
        !text(&output.stderr).contains("warning"),
        "{}",
        text(&output.stderr)
    );
    assert_eq!(json(&output)["held_out"], true);
}

#[test]
fn normalised_columns_are_written_into_the_model() {
    let files = Files::new();
    let said =
        json(&files.train_with_truth(&["--normalise", "--volume", "6", "--dim", "2", "--json"]));
    assert!(said["quality"]["volume_occupancy"].as_f64().is_some());
    let model = trainer::model::Model::load(files.path("map.safetensors")).unwrap();
    assert!(model.x.scale[0] > 1.1 * model.x.scale[1], "{:?}", model.x);
}

#[test]
fn every_kind_of_pairs_trains() {
    let files = Files::new();
    files.write_truth("ring.csv", &pairs());
    let ring = files.text_of("ring.csv");
    for (words, expected) in [
        (&["--pairs", "random:5"][..], 5),
        (&["--pairs", "boundary:6", "--pairs-file", &ring], 6),
        (&["--pairs", "adaptive:2"], 2),
        (
            &["--cost", "pin-ba", "--alpha", "1", "--lambda", "0.01,2,4"],
            4,
        ),
        (
            &[
                "--hidden",
                "20",
                "--threads",
                "1",
                "--rate",
                "0.001",
                "--hold-out",
                "0",
            ],
            4,
        ),
    ] {
        let mut all = words.to_vec();
        all.push("--json");
        let said = json(&files.train_with_truth(&all));
        assert_eq!(said["pairs"], expected, "{words:?}");
    }
    let model = trainer::model::Model::load(files.path("map.safetensors")).unwrap();
    assert_eq!(model.shape(), [2, 20, 2]);
}

#[test]
fn one_or_two_threads_train_the_same_model() {
    let files = Files::new();
    let mut models = Vec::new();
    for threads in ["1", "2"] {
        assert!(
            files
                .train_with_truth(&["--threads", threads])
                .status
                .success()
        );
        models.push(std::fs::read(files.path("map.safetensors")).unwrap());
    }
    assert!(models[0] == models[1]);
}

#[test]
fn a_training_that_stops_and_goes_on_gives_the_same_model_bit_for_bit() {
    let files = Files::new();
    assert!(files.train_with_truth(&[]).status.success());
    let whole = std::fs::read(files.path("map.safetensors")).unwrap();
    std::fs::remove_file(files.path("map.safetensors")).unwrap();
    let state = files.text_of("half.checkpoint");
    // Before the third pair, and in the last stage.
    for epoch in ["213", "427"] {
        let said =
            json(&files.train_with_truth(&["--checkpoint", &state, "--stop-at", epoch, "--json"]));
        assert_eq!(said["stopped_at_epoch"].to_string(), epoch);
        assert!(!files.path("map.safetensors").exists());
        let output = files.train_with_truth(&["--resume", &state]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        let resumed = std::fs::read(files.path("map.safetensors")).unwrap();
        assert!(whole == resumed, "stopped at epoch {epoch}");
        std::fs::remove_file(files.path("map.safetensors")).unwrap();
    }
}

#[test]
fn ctrl_c_keeps_the_state_and_says_how_to_go_on() {
    let files = Files::new();
    let (q, x, truth) = (
        files.text_of("q.csv"),
        files.text_of("x.csv"),
        files.text_of("truth.csv"),
    );
    let (out, state) = (
        files.text_of("map.safetensors"),
        files.text_of("c.checkpoint"),
    );
    let child = command(&[
        "train",
        "--input",
        &q,
        "--target",
        &x,
        "--truth",
        &truth,
        "--out",
        &out,
        "--checkpoint",
        &state,
        "--epochs",
        "1000000",
    ])
    .stdout(std::process::Stdio::piped())
    .stderr(std::process::Stdio::piped())
    .spawn()
    .unwrap();
    std::thread::sleep(std::time::Duration::from_millis(1500));
    interrupt(&child);
    let output = finish(child);
    let said = refusal(&output, 1);
    assert!(
        said.contains("interrupted") && said.contains("c.checkpoint"),
        "{said}"
    );
    assert!(text(&output.stderr).contains("--resume"));
    assert!(files.path("c.checkpoint").exists() && !files.path("map.safetensors").exists());
}

#[test]
fn a_checkpoint_of_another_data_set_is_refused() {
    let files = Files::new();
    let state = files.text_of("half.checkpoint");
    assert!(
        files
            .train_with_truth(&["--checkpoint", &state, "--stop-at", "20"])
            .status
            .success()
    );
    let mut other = pairs();
    other
        .inputs
        .data
        .iter_mut()
        .for_each(|value| *value += 0.001);
    write_samples(files.path("q.csv"), &other.inputs, "q").unwrap();
    let said = files.refused(&["--resume", &state], 1);
    assert!(
        said.contains("another data set") && said.contains("half.checkpoint"),
        "{said}"
    );
}

#[test]
fn a_checkpoint_of_other_options_or_none_at_all_is_refused() {
    let files = Files::new();
    let state = files.text_of("half.checkpoint");
    assert!(
        files
            .train_with_truth(&["--checkpoint", &state, "--stop-at", "20"])
            .status
            .success()
    );
    let said = files.refused(&["--resume", &state, "--cost", "pin"], 1);
    assert!(said.contains("other settings"), "{said}");
    let truth = files.text_of("truth.csv");
    let said = files.refused(&["--resume", &truth], 1);
    assert!(
        said.contains("truth.csv") && said.contains("not a usable checkpoint"),
        "{said}"
    );
    let said = files.refused(&["--resume", "/nowhere/state"], 1);
    assert!(said.contains("/nowhere/state"), "{said}");
}

#[test]
fn fewer_samples_than_pairs_are_counted() {
    let files = Files::new();
    let text = files.read("q.csv");
    let mut few = vec![text.lines().next().unwrap()];
    few.extend(text.lines().skip(1).step_by(13));
    files.write("q.csv", &few.join("\n"));
    let said = files.refused(&["--pairs", "20"], 1);
    assert!(
        said.contains('7') && said.contains("20 reference pairs"),
        "{said}"
    );
}

#[test]
fn a_constant_column_is_named_and_trains_only_when_forced() {
    let files = Files::new();
    let lines: Vec<String> = (files.read("q.csv").lines().enumerate())
        .map(|(i, line)| format!("{line},{}", if i == 0 { "q2" } else { "0.5" }))
        .collect();
    files.write("q.csv", &lines.join("\n"));
    let truth: Vec<String> = (files.read("truth.csv").lines().enumerate())
        .map(|(i, line)| format!("{line},{}", if i == 0 { "q2" } else { "0.5" }))
        .collect();
    files.write("truth.csv", &truth.join("\n"));
    let said = files.refused(&[], 1);
    assert!(
        said.contains("q.csv") && said.contains("q2") && said.contains("0.5"),
        "{said}"
    );
    let output = files.train_with_truth(&["--force"]);
    assert!(output.status.success());
    assert!(
        text(&output.stderr).contains("warning: input column 3"),
        "{}",
        text(&output.stderr)
    );
}

#[test]
fn repeated_rows_are_named_and_train_only_when_forced() {
    let files = Files::new();
    let mut text_of = files.read("x.csv");
    let fifth = text_of.lines().nth(5).unwrap().to_owned();
    text_of.push_str(&fifth);
    files.write("x.csv", &text_of);
    let said = files.refused(&[], 1);
    assert!(
        said.contains("x.csv") && said.contains("row 401 repeats row 5"),
        "{said}"
    );
    let output = files.train_with_truth(&["--force"]);
    assert!(output.status.success());
    assert!(
        text(&output.stderr).contains("warning: 1 of the target samples"),
        "{}",
        text(&output.stderr)
    );
}

#[test]
fn a_nan_is_named_by_row_and_column() {
    for (file, column) in [("q.csv", "q1"), ("x.csv", "x1"), ("truth.csv", "x1")] {
        let files = Files::new();
        let mut lines: Vec<String> = files.read(file).lines().map(str::to_owned).collect();
        let cut = lines[3].rfind(',').unwrap();
        lines[3].truncate(cut);
        lines[3].push_str(",NaN");
        files.write(file, &lines.join("\n"));
        let said = files.refused(&[], 1);
        assert!(
            said.contains(file) && said.contains("row 3") && said.contains(column),
            "{said}"
        );
    }
}

#[test]
fn a_target_of_one_point_is_refused() {
    for text in ["x0,x1\n0.5,0.5\n", "x0,x1\n0.5,0.5\n0.5,0.5\n0.5,0.5\n"] {
        let files = Files::new();
        files.write("x.csv", text);
        let said = files.refused(&[], 1);
        assert!(said.contains("one point") && said.contains("0.5"), "{said}");
    }
}

#[test]
fn other_columns_than_the_data_has_are_counted() {
    let files = Files::new();
    let three: Vec<String> = (files.read("truth.csv").lines().enumerate())
        .map(|(i, line)| format!("{line},{}", if i == 0 { "q2" } else { "0.5" }))
        .collect();
    files.write("truth.csv", &three.join("\n"));
    let said = files.refused(&[], 1);
    assert!(
        said.contains("truth.csv: 3 columns q0…") && said.contains("q.csv has 2"),
        "{said}"
    );
    // Columns by other names.
    let files = Files::new();
    files.write("q.csv", &files.read("q.csv").replace("q0,q1", "a,b"));
    assert!(files.refused(&[], 1).contains("q0"));
    let files = Files::new();
    files.write("x.csv", &files.read("x.csv").replace("x0,x1", "x0,x2"));
    assert!(files.refused(&[], 1).contains("x1"));
}

#[test]
fn a_model_is_not_measured_on_other_columns() {
    let files = Files::new();
    assert!(files.train_with_truth(&[]).status.success());
    let three: Vec<String> = (files.read("q.csv").lines().enumerate())
        .map(|(i, line)| {
            format!(
                "{line},{}",
                if i == 0 {
                    "q2".to_owned()
                } else {
                    i.to_string()
                }
            )
        })
        .collect();
    files.write("q.csv", &three.join("\n"));
    let (model, q, x) = (
        files.text_of("map.safetensors"),
        files.text_of("q.csv"),
        files.text_of("x.csv"),
    );
    let said = refusal(
        &run(&["eval", "--model", &model, "--input", &q, "--target", &x]),
        1,
    );
    assert!(
        said.contains("2 values to 2") && said.contains("3 to 2"),
        "{said}"
    );
}

#[test]
fn pairs_outside_the_domain_are_named() {
    let files = Files::new();
    let mut outside = pairs();
    outside.targets.row_mut(2)[0] = 70.0;
    files.write_truth("truth.csv", &outside);
    let said = files.refused(&[], 1);
    assert!(
        said.contains("pair 3, column x0: 70") && said.contains("x.csv"),
        "{said}"
    );
    files.write_truth("truth.csv", &pairs());
    let mut far = pairs().spaced(3);
    far.inputs.row_mut(1)[1] = -9.0;
    files.write_truth("far.csv", &far);
    let far = files.text_of("far.csv");
    let said = files.refused(&["--pairs-file", &far], 1);
    assert!(said.contains("far.csv: pair 2, column q1: -9"), "{said}");
}

#[test]
fn a_training_that_diverges_says_so_and_leaves_no_model() {
    let files = Files::new();
    for (name, prefix, mut samples) in [("q.csv", "q", pairs().inputs), ("x.csv", "x", targets())] {
        for value in &mut samples.data {
            *value *= 1e25;
        }
        write_samples(files.path(name), &samples, prefix).unwrap();
    }
    let mut large = pairs();
    for value in large.inputs.data.iter_mut().chain(&mut large.targets.data) {
        *value *= 1e25;
    }
    files.write_truth("truth.csv", &large);
    let said = files.refused(&[], 1);
    assert!(
        said.contains("diverged") && said.contains("not finite"),
        "{said}"
    );
}

#[test]
fn a_map_that_leaves_the_target_uncovered_is_warned_of() {
    let files = Files::new();
    // Pins in one corner, λ3 too small to spread.
    let mut corner = pairs();
    corner
        .targets
        .data
        .iter_mut()
        .for_each(|value| *value = 0.02 * *value - 0.9);
    files.write_truth("pairs.csv", &corner.spaced(40));
    let pairs = files.text_of("pairs.csv");
    let output = files.train(&[
        "--pairs-file",
        &pairs,
        "--lambda",
        "0.005,50,0.0001",
        "--json",
    ]);
    assert!(
        text(&output.stderr).contains("warning: the map leaves part of the target uncovered"),
        "{}",
        text(&output.stderr)
    );
    assert!(json(&output)["warnings"].to_string().contains("uncovered"));
}

#[test]
fn a_map_that_folds_is_warned_of() {
    let files = Files::new();
    let mut folded = pairs();
    for row in 0..folded.targets.rows {
        let q = folded.inputs.row(row)[0];
        folded.targets.row_mut(row)[0] = 1.5 * q.abs() + 0.5;
    }
    let some: Vec<usize> = (0..144).step_by(7).collect();
    let folded = Pairs {
        inputs: folded.inputs.select(&some),
        targets: folded.targets.select(&some),
    };
    files.write_truth("pairs.csv", &folded);
    let pairs = files.text_of("pairs.csv");
    let words = [
        "--pairs-file",
        &pairs,
        "--cost",
        "pin",
        "--hold-out",
        "0",
        "--epochs",
        "400",
    ];
    let output = files.train_long(&words);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said = text(&output.stderr);
    assert!(said.contains("warning: the map seems to fold"), "{said}");
}

#[test]
fn wrong_words_say_which_and_what_instead() {
    let files = Files::new();
    for words in [
        &["--pairs", "table3"][..],
        &["--pairs", "boundary"],
        &["--pairs", "zigzag"],
        &["--volume", "6"],
        &["--epsilon", "1", "--volume", "6", "--dim", "2"],
        &["--lambda", "1,2"],
        &["--cost", "cheap"],
        &["--stop-at", "5"],
        &["--poses", "hand.csv"],
    ] {
        let output = files.train_with_truth(words);
        assert_eq!(
            output.status.code(),
            Some(2),
            "{words:?}: {}",
            text(&output.stderr)
        );
    }
    let output = files.train(&[]);
    assert!(refusal(&output, 2).contains("no reference pairs"));
}

#[test]
fn a_model_is_not_written_over_its_samples() {
    let files = Files::new();
    let (q, x, truth) = (
        files.text_of("q.csv"),
        files.text_of("x.csv"),
        files.text_of("truth.csv"),
    );
    let before = files.read("q.csv");
    let output = run(&[
        "train", "--input", &q, "--target", &x, "--truth", &truth, "--out", &q,
    ]);
    assert!(refusal(&output, 2).contains("q.csv"));
    assert_eq!(files.read("q.csv"), before);
}
