//! Samples of two small domains as files, and trainings on them.

use std::path::PathBuf;

use host::trainer::data::{Matrix, Pairs, write_pairs, write_samples};

use super::{refusal, run, text};

/// A square of the plane and its image, stretched and moved: a map that is easy to learn.
pub struct Files {
    pub folder: tempfile::TempDir,
}

impl Files {
    pub fn new() -> Self {
        let files = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        let pairs = pairs();
        write_samples(files.path("q.csv"), &pairs.inputs, "q").unwrap();
        write_samples(files.path("x.csv"), &targets(), "x").unwrap();
        files.write_truth("truth.csv", &pairs);
        files
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn text_of(&self, name: &str) -> String {
        self.path(name).to_str().unwrap().to_owned()
    }

    pub fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    /// The file with one more column, `value` of the row's number (from 1) in each.
    pub fn add_column(&self, name: &str, column: &str, value: impl Fn(usize) -> String) {
        let lines: Vec<String> = (self.read(name).lines().enumerate())
            .map(|(row, line)| match row {
                0 => format!("{line},{column}"),
                row => format!("{line},{}", value(row)),
            })
            .collect();
        self.write(name, &lines.join("\n"));
    }

    /// A file of pairs, by its path.
    pub fn pairs_file(&self, name: &str, pairs: &Pairs) -> String {
        self.write_truth(name, pairs);
        self.text_of(name)
    }

    /// A state of the training at this epoch, by its path.
    pub fn checkpoint(&self, epoch: &str) -> String {
        let state = self.text_of("half.checkpoint");
        let output = self.train_with_truth(&["--checkpoint", &state, "--stop-at", epoch]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        state
    }

    pub fn write_truth(&self, name: &str, pairs: &Pairs) {
        write_pairs(self.path(name), pairs, &["q0", "q1"], &["x0", "x1"]).unwrap();
    }

    /// `train` in a few epochs, with more words; one start where they name no number.
    pub fn train(&self, words: &[&str]) -> std::process::Output {
        let mut all = vec!["--epochs", "40"];
        if !words.contains(&"--starts") {
            all.extend(["--starts", "1"]);
        }
        all.extend(words);
        self.train_long(&all)
    }

    pub fn train_long(&self, words: &[&str]) -> std::process::Output {
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
    pub fn train_with_truth(&self, words: &[&str]) -> std::process::Output {
        let truth = self.text_of("truth.csv");
        let mut all = vec!["--truth", truth.as_str()];
        all.extend(words);
        self.train(&all)
    }

    /// The refusal of a training, after seeing that nothing was written.
    pub fn refused(&self, words: &[&str], code: i32) -> String {
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

pub fn pairs() -> Pairs {
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

pub fn targets() -> Matrix {
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
