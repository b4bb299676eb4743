//! Wrong files and wrong words: one clear line, a next step, exit code 1 or 2.

use crate::support;

use std::path::Path;
use support::{JOINTS, model, poses_file, poses_text, refusal, run, text};

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Trains on a file with this content and returns the refusal.
fn train_refusal(content: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let poses = folder.path().join("poses.csv");
    std::fs::write(&poses, content).unwrap();
    let out = folder.path().join("model.safetensors");
    let output = run(&[
        "train",
        "--poses",
        path(&poses),
        "--out",
        path(&out),
        "--epochs",
        "5",
    ]);
    assert!(!out.exists(), "a model was written from a wrong file");
    let error = refusal(&output, 1);
    assert!(
        error.contains("poses.csv"),
        "the file is not named: {error}"
    );
    error
}

#[test]
fn a_missing_column_is_named() {
    let error = train_refusal(&poses_text(60).replace("ring_pip_flex", "ring_pip"));
    assert!(error.contains("ring_pip_flex"), "{error}");
}

#[test]
fn a_nan_is_named_by_row_and_column() {
    let mut lines: Vec<String> = poses_text(60).lines().map(str::to_owned).collect();
    let mut fields: Vec<&str> = lines[7].split(',').collect();
    fields[1 + 6] = "NaN";
    lines[7] = fields.join(",");
    let error = train_refusal(&lines.join("\n"));
    assert!(
        error.contains("row 7") && error.contains(JOINTS[6]),
        "{error}"
    );
}

#[test]
fn a_word_among_the_numbers_is_named_by_row_and_column() {
    let error = train_refusal(&poses_text(60).replacen("0.0000,", "zero,", 1));
    assert!(
        error.contains("row 1") && error.contains("time_s"),
        "{error}"
    );
}

#[test]
fn too_few_rows_are_counted() {
    let error = train_refusal(&poses_text(12));
    assert!(error.contains("12 rows") && error.contains("50"), "{error}");
    let header = poses_text(0);
    let error = train_refusal(&header);
    assert!(error.contains("0 rows") && error.contains("50"), "{error}");
    train_refusal("");
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let output = run(&[
        "train",
        "--poses",
        "/nowhere/hand.csv",
        "--out",
        "/tmp/never.safetensors",
    ]);
    assert!(refusal(&output, 1).contains("/nowhere/hand.csv"));
}

#[test]
fn a_model_that_cannot_be_written_is_refused_before_training() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 60);
    let output = run(&[
        "train",
        "--poses",
        path(&poses),
        "--out",
        "/nowhere/m.safetensors",
    ]);
    assert!(refusal(&output, 2).contains("/nowhere/m.safetensors"));
}

#[test]
fn a_recording_is_not_written_over_by_its_model() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 60);
    let before = std::fs::read(&poses).unwrap();
    for arguments in [
        ["train", "--poses", path(&poses), "--out", path(&poses)],
        ["demo", "--poses", path(&poses), "--log", path(&poses)],
    ] {
        assert!(refusal(&run(&arguments), 2).contains("poses.csv"));
        assert_eq!(std::fs::read(&poses).unwrap(), before);
    }
    let other = folder.path().join("thesis.txt");
    std::fs::write(&other, "three years of work").unwrap();
    let output = run(&["train", "--poses", path(&poses), "--out", path(&other)]);
    assert!(refusal(&output, 2).contains("not a safetensors file"));
}

#[test]
fn a_result_that_the_disk_does_not_take_is_a_failure() {
    let full = std::fs::OpenOptions::new()
        .write(true)
        .open("/dev/full")
        .unwrap();
    let child = support::command(&["ports", "--json"])
        .stdout(full)
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(refusal(&output, 1).contains("standard output"));
}

#[test]
fn a_file_that_is_no_model_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 60);
    let output = run(&["eval", "--model", path(&poses), "--poses", path(&poses)]);
    let error = refusal(&output, 1);
    assert!(error.contains("not a safetensors file"), "{error}");
}

#[test]
fn a_model_of_another_shape_is_refused_with_both_shapes() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 60);
    let other = folder.path().join("other.safetensors");
    let network = |inputs: usize, hidden: usize, outputs: usize| host::trainer::network::Network {
        inputs,
        hidden,
        outputs,
        w1: vec![0.1; inputs * hidden],
        b1: vec![0.0; hidden],
        w2: vec![0.1; hidden * outputs],
        b2: vec![0.0; outputs],
    };
    let save = |inputs, hidden, outputs| {
        host::trainer::model::Model {
            f: network(inputs, hidden, outputs),
            g: network(outputs, hidden, inputs),
            q: host::trainer::model::Normalisation::identity(inputs),
            x: host::trainer::model::Normalisation::identity(outputs),
            metadata: Default::default(),
        }
        .save(&other)
        .unwrap();
        let output = run(&["eval", "--model", path(&other), "--poses", path(&poses)]);
        refusal(&output, 1)
    };
    let error = save(2, 300, 2);
    assert!(
        error.contains("2 values to 2") && error.contains("25 to 4"),
        "{error}"
    );
    let error = save(25, 64, 4);
    assert!(error.contains("64") && error.contains("300"), "{error}");
}

#[test]
fn a_damaged_model_is_refused_with_its_tensor() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 60);
    let damaged = folder.path().join("damaged.safetensors");
    let mut bytes = std::fs::read(model()).unwrap();
    let end = bytes.len();
    bytes[end - 4..].copy_from_slice(&f32::NAN.to_le_bytes());
    std::fs::write(&damaged, &bytes).unwrap();
    let output = run(&["eval", "--model", path(&damaged), "--poses", path(&poses)]);
    let error = refusal(&output, 1);
    assert!(error.contains("NaN"), "{error}");
    std::fs::write(&damaged, &bytes[..end / 2]).unwrap();
    let output = run(&["eval", "--model", path(&damaged), "--poses", path(&poses)]);
    refusal(&output, 1);
}

#[test]
fn wrong_words_are_usage_errors() {
    for arguments in [
        &["fly"][..],
        &["demo", "--seconds", "0"],
        &["train", "--poses", "a.csv"],
        &["simulate", "--glove", "/tmp/a", "--gripper-model", "2f85"],
        &["simulate", "--gripper", "/tmp/a", "--poses", "a.csv"],
        &["teleop", "--glove", "/tmp/a"],
    ] {
        let output = run(arguments);
        assert_eq!(
            output.status.code(),
            Some(2),
            "{arguments:?}: {}",
            text(&output.stderr)
        );
        assert!(text(&output.stderr).contains("error: "), "{arguments:?}");
    }
}

#[test]
fn help_of_every_verb_shows_an_example() {
    for verb in ["demo", "train", "eval", "simulate", "teleop", "ports"] {
        let output = run(&[verb, "--help"]);
        assert_eq!(output.status.code(), Some(0));
        let help = text(&output.stdout);
        assert!(
            help.contains("Examples:") && help.contains(&format!("gauntlet {verb}")),
            "{help}"
        );
    }
}

/// The model without its digests, as earlier versions wrote it.
fn earlier(bytes: &[u8]) -> Vec<u8> {
    let length = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let mut header: serde_json::Value = serde_json::from_slice(&bytes[8..8 + length]).unwrap();
    let metadata = header["__metadata__"].as_object_mut().unwrap();
    metadata.remove("weights_sha256").unwrap();
    metadata.remove("metadata_sha256").unwrap();
    let header = header.to_string();
    let mut all = (header.len() as u64).to_le_bytes().to_vec();
    all.extend_from_slice(header.as_bytes());
    all.extend_from_slice(&bytes[8 + length..]);
    all
}

#[test]
fn every_verb_refuses_a_model_with_a_flipped_bit_and_takes_an_earlier_one_with_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 60);
    let file = folder.path().join("flipped.safetensors");
    let image = folder.path().join("weights.hae");
    let bytes = std::fs::read(model()).unwrap();
    let verbs = [
        &["eval", "--model", path(&file), "--poses", path(&poses)][..],
        &["export", path(&file), "--out", path(&image)],
        &["flash", path(&file), "--bridge", "unix:/nowhere"],
        &[
            "teleop",
            "--model",
            path(&file),
            "--glove",
            "/nowhere",
            "--gripper",
            "/nowhere",
        ],
    ];
    // In a weight, in a digit of what is said, in the name of the digest.
    let find = |word: &str| {
        bytes
            .windows(word.len())
            .position(|w| w == word.as_bytes())
            .unwrap()
    };
    for place in [
        bytes.len() - 4001,
        find("\"seed\":\"") + 8,
        find("weights_sha256"),
    ] {
        let mut flipped = bytes.clone();
        flipped[place] ^= 1;
        std::fs::write(&file, &flipped).unwrap();
        for verb in verbs {
            let error = refusal(&run(verb), 1);
            assert!(
                error.contains("flipped.safetensors") && error.contains("damaged"),
                "{}: {error}",
                verb[0]
            );
        }
    }
    assert!(!image.exists());
    std::fs::write(&file, earlier(&bytes)).unwrap();
    for verb in &verbs[..2] {
        let output = run(verb);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        assert!(text(&output.stderr).contains("no digest"), "{}", verb[0]);
    }
}

#[test]
fn outputs_that_cannot_be_written_are_refused_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 60);
    let long = folder.path().join("n".repeat(250));
    let out = folder.path().join("m.safetensors");
    let same = folder.path().join(".").join("m.safetensors");
    for (out, checkpoint) in [
        (&long, None),
        (&std::path::PathBuf::from("/proc/m"), None),
        (&out, Some(&long)),
        (&out, Some(&same)),
    ] {
        let mut words = vec!["train", "--poses", path(&poses), "--out", path(out)];
        words.extend(["--schedule", "paper"]);
        if let Some(checkpoint) = checkpoint {
            words.extend(["--checkpoint", path(checkpoint)]);
        }
        let error = refusal(&run(&words), 2);
        assert!(error.contains("is not written"), "{error}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// A verb that is to write `out`, on a disk of its own mounted with `options`; `None` where this machine lets nobody mount one.
fn on_a_disk(options: &str, words: &[&str]) -> Option<std::process::Output> {
    let folder = tempfile::tempdir().unwrap();
    let script = format!(
        "mount -t tmpfs -o {options} tmpfs '{}' || exit 77; exec \"$@\"",
        path(folder.path())
    );
    let out = folder.path().join("out");
    let words = words.iter().map(|word| match *word {
        "OUT" => path(&out),
        word => word,
    });
    let output = std::process::Command::new("unshare")
        .args(["--user", "--map-root-user", "--mount", "sh", "-c", &script])
        .args(["sh", env!("CARGO_BIN_EXE_gauntlet")])
        .args(words)
        .output()
        .ok()?;
    let mounted = output.status.code() != Some(77) && !text(&output.stderr).contains("unshare:");
    mounted.then_some(output)
}

#[test]
fn a_disk_that_is_full_or_read_only_has_one_exit_code_in_every_verb_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let poses = poses_file(folder.path(), 60);
    let (poses, model) = (path(&poses), path(model()));
    let checkpoint = folder.path().join("m");
    let teleop = "teleop --glove /nowhere/a --gripper /nowhere/b --log OUT --model";
    let verbs: [Vec<&str>; 6] = [
        vec!["train", "--poses", poses, "--out", "OUT"],
        vec![
            "train",
            "--poses",
            poses,
            "--out",
            path(&checkpoint),
            "--checkpoint",
            "OUT",
        ],
        vec!["export", model, "--out", "OUT"],
        vec!["demo", "--poses", poses, "--log", "OUT"],
        teleop.split(' ').chain([model]).collect(),
        "bridge log --bridge unix:/nowhere/c --out OUT"
            .split(' ')
            .collect(),
    ];
    for (options, told) in [("size=4k", "no space left"), ("ro", "read-only")] {
        for words in &verbs {
            let Some(output) = on_a_disk(options, words) else {
                rig::skip::skipped(rig::skip::Need::Machine, "no disk can be mounted here");
                return;
            };
            let error = refusal(&output, 1);
            assert!(error.contains(told), "{words:?}: {error}");
            assert!(error.contains("/out is not written"), "{words:?}: {error}");
        }
    }
}

#[test]
fn text_in_another_encoding_is_named_with_the_way_out() {
    let folder = tempfile::tempdir().unwrap();
    let poses = folder.path().join("poses.csv");
    let wide: Vec<u8> = poses_text(60)
        .encode_utf16()
        .flat_map(u16::to_le_bytes)
        .collect();
    std::fs::write(&poses, &wide).unwrap();
    let out = folder.path().join("m");
    let output = run(&["train", "--poses", path(&poses), "--out", path(&out)]);
    let error = refusal(&output, 1);
    assert!(
        error.contains("UTF-16") && error.contains("UTF-8"),
        "{error}"
    );
    assert!(text(&output.stderr).contains("try: iconv -f UTF-16LE"));
}
