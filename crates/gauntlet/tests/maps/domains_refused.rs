//! What is wrong with the samples of two domains, their pairs and their checkpoints: one clear line, and no model.

use crate::support;

use host::trainer::data::write_samples;
use support::samples::{Files, pairs, targets};
use support::{refusal, run, text};

#[test]
fn a_checkpoint_of_another_data_set_is_refused() {
    let files = Files::new();
    let state = files.checkpoint("20");
    let mut other = pairs();
    other
        .inputs
        .data
        .iter_mut()
        .for_each(|value| *value += 0.001);
    write_samples(files.path("q.csv"), &other.inputs, "q").unwrap();
    let said = files.refused(&["--resume", &state], 1);
    assert!(said.contains("another data set"), "{said}");
    // Another seed holds other rows out: no other data, but no way on either, and the next step says which.
    let files = Files::new();
    let state = files.checkpoint("20");
    let said = files.refused(&["--resume", &state, "--seed", "9"], 1);
    assert!(
        said.contains("another data set") && said.contains("half.checkpoint"),
        "{said}"
    );
}

#[test]
fn a_checkpoint_of_other_options_or_none_at_all_is_refused() {
    let files = Files::new();
    let state = files.checkpoint("20");
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
fn a_checkpoint_does_not_go_on_with_other_true_pairs() {
    let files = Files::new();
    let state = files.checkpoint("20");
    let mut other = pairs();
    other.targets.row_mut(3)[0] += 0.01;
    files.write_truth("truth.csv", &other);
    let said = files.refused(&["--resume", &state], 1);
    assert!(
        said.contains("other true pairs") && said.contains("--truth"),
        "{said}"
    );
}

#[test]
fn a_flipped_bit_in_a_checkpoint_is_refused() {
    let files = Files::new();
    let state = files.checkpoint("20");
    let bytes = std::fs::read(&state).unwrap();
    let count = bytes.len();
    for place in [9, 40, count / 3, count / 2, count - 1] {
        let mut flipped = bytes.clone();
        flipped[place] ^= 4;
        std::fs::write(&state, flipped).unwrap();
        let said = files.refused(&["--resume", &state], 1);
        assert!(said.contains("not a usable checkpoint"), "{said}");
    }
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
    // Nor do two true pairs answer five times.
    for words in ["5", "random:5"] {
        let files = Files::new();
        files.write_truth("truth.csv", &pairs().spaced(2));
        let said = files.refused(&["--pairs", words], 2);
        assert!(said.contains("2 true pairs, 5 are asked for"), "{said}");
    }
    let files = Files::new();
    let three = files.pairs_file("three.csv", &pairs().spaced(3));
    let said = files.refused(&["--pairs", "fixed:4", "--pairs-file", &three], 2);
    assert!(
        said.contains("3 reference pairs, 4 are asked for"),
        "{said}"
    );
}

#[test]
fn a_constant_column_is_named_and_trains_only_when_forced() {
    let files = Files::new();
    for file in ["q.csv", "truth.csv"] {
        files.add_column(file, "q2", |_| "0.5".to_owned());
    }
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
    files.add_column("truth.csv", "q2", |_| "0.5".to_owned());
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
    files.add_column("q.csv", "q2", |row| row.to_string());
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
    let far = files.pairs_file("far.csv", &far);
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
fn wrong_words_say_which_and_what_instead() {
    let files = Files::new();
    for words in [
        &["--pairs", "table3"][..],
        &["--pairs", "heuristic"],
        &["--pairs", "boundary"],
        &["--pairs", "fixed"],
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
