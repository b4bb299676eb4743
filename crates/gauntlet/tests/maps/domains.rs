//! `train` and `eval` on samples of any two domains.

use crate::support;

use host::trainer::algorithm::Schedule;
use host::trainer::data::{Pairs, write_samples};
use support::samples::{Files, pairs};
use support::told::interrupted_at;
use support::{json, refusal, run, text};

#[test]
fn any_two_domains_train_and_the_four_measures_come_out() {
    let files = Files::new();
    let said =
        json(&files.train_with_truth(&["--pairs", "3", "--volume", "6", "--dim", "2", "--json"]));
    // A stage before each pair, and the last.
    let stage = Schedule::Fast.plan_for(2).stage_epochs;
    assert_eq!(said["epochs"], 3 * stage + 40);
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
    let model = host::trainer::model::Model::load(files.path("map.safetensors")).unwrap();
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
fn a_map_that_true_pairs_speak_against_is_warned_of() {
    let files = Files::new();
    let mut mirrored = pairs().spaced(8);
    for x in mirrored.targets.data.chunks_exact_mut(2) {
        x[0] = -x[0];
    }
    let mirrored = files.pairs_file("mirrored.csv", &mirrored);
    let said =
        json(&files.train_with_truth(&["--pairs-file", &mirrored, "--pairs", "fixed", "--json"]));
    let nmse = said["quality"]["nmse"].as_f64().unwrap();
    assert!(nmse > 0.5, "{said}");
    let warned = said["warnings"].to_string();
    assert!(warned.contains(&format!("NMSE {nmse:.2}")), "{warned}");
}

#[test]
fn what_cannot_be_measured_is_null_with_a_word_why() {
    let files = Files::new();
    let pairs = files.pairs_file("pairs.csv", &pairs().spaced(4));
    let said = json(&files.train(&["--pairs-file", &pairs, "--json"]));
    assert!(said["quality"]["volume_occupancy"].is_null() && said["quality"]["nmse"].is_null());
    let unknown = said["quality"]["unknown"].to_string();
    assert!(
        unknown.contains("--volume") && unknown.contains("--truth"),
        "{unknown}"
    );
    let metadata = host::trainer::model::Model::load(files.path("map.safetensors"))
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
    let model = host::trainer::model::Model::load(files.path("map.safetensors")).unwrap();
    assert!(model.x.scale[0] > 1.1 * model.x.scale[1], "{:?}", model.x);
}

#[test]
fn every_kind_of_pairs_trains() {
    let files = Files::new();
    let ring = files.pairs_file("ring.csv", &pairs());
    for (words, expected) in [
        (&["--pairs", "random:5"][..], 5),
        (&["--pairs", "boundary:6", "--pairs-file", &ring], 6),
        (&["--pairs", "fixed:7", "--pairs-file", &ring], 7),
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
    let model = host::trainer::model::Model::load(files.path("map.safetensors")).unwrap();
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
        let on = said["commands"][0].as_array().unwrap();
        assert!(!on.iter().any(|word| word == "--stop-at"), "{said}");
        assert_eq!(on[on.len() - 2..], ["--resume", state.as_str()], "{said}");
        assert!(!files.path("map.safetensors").exists());
        let output = files.train_with_truth(&["--resume", &state]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        let resumed = std::fs::read(files.path("map.safetensors")).unwrap();
        assert!(whole == resumed, "stopped at epoch {epoch}");
        std::fs::remove_file(files.path("map.safetensors")).unwrap();
    }
}

#[test]
fn several_starts_are_told_with_their_costs_and_go_on_from_a_checkpoint_bit_for_bit() {
    let files = Files::new();
    let words = ["--starts", "5", "--pairs", "1"];
    let told =
        |more: &[&str]| json(&files.train_with_truth(&[&words[..], more, &["--json"]].concat()));
    let said = told(&[]);
    let whole = std::fs::read(files.path("map.safetensors")).unwrap();
    let starts = said["starts"].as_array().unwrap();
    assert_eq!(starts.len(), 5);
    assert_eq!(starts[0]["seed"], said["seed"].to_string());
    let taken: Vec<_> = starts
        .iter()
        .filter(|start| start["taken"] == true)
        .collect();
    assert_eq!(taken.len(), 1);
    assert_eq!(taken[0]["epochs"], said["epochs"]);
    let cost = |start: &serde_json::Value| start["cost"].as_f64().unwrap();
    let rivals = starts
        .iter()
        .filter(|start| start["epochs"] == said["epochs"]);
    assert!(
        rivals
            .into_iter()
            .all(|rival| cost(taken[0]) <= cost(rival)),
        "{said}"
    );
    assert!(
        starts
            .iter()
            .any(|start| start["epochs"].as_u64() < said["epochs"].as_u64())
    );

    let state = files.text_of("half.checkpoint");
    // In the early stage, after the first cut, and after the fit to the mean.
    for epoch in ["113", "158", "180"] {
        let paused = told(&["--checkpoint", &state, "--stop-at", epoch]);
        assert_eq!(paused["stopped_at_epoch"].to_string(), epoch);
        assert_eq!(
            told(&["--resume", &state, "--threads", "1"])["starts"],
            said["starts"]
        );
        assert!(std::fs::read(files.path("map.safetensors")).unwrap() == whole);
    }
    let one = files.train_with_truth(&["--resume", &state, "--pairs", "1"]);
    let said = refusal(&one, 1);
    assert!(said.contains("5 starts"), "{said}");
    let said = text(&one.stderr);
    assert!(said.contains("--starts 5"), "{said}");
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
    let words = [
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
    ];
    let (output, _) = interrupted_at("\ntraining ", &words);
    let said = refusal(&output, 1);
    assert!(
        said.contains("interrupted") && said.contains("c.checkpoint"),
        "{said}"
    );
    let whole = format!("try: `gauntlet train --input {q} --target {x} ");
    let stderr = text(&output.stderr);
    assert!(
        stderr.contains(&whole) && stderr.contains(&format!(" --resume {state}`")),
        "{stderr}"
    );
    assert!(files.path("c.checkpoint").exists() && !files.path("map.safetensors").exists());
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
    let pairs = files.pairs_file("pairs.csv", &corner.spaced(40));
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
    let pairs = files.pairs_file("pairs.csv", &folded);
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
    assert!(said.contains(" (epoch "), "the epoch is named: {said}");
}
