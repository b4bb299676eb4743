//! Runs the tool as a person does, with deadlines.
#![allow(dead_code, missing_docs, clippy::unwrap_used)]

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant, UNIX_EPOCH};

pub mod bench;
pub mod browser;
pub mod devices;
pub mod lines;
pub mod other_master;
pub mod page;
pub mod samples;
pub mod terminal;
pub mod told;

use rustix::process::{Pid, Signal, kill_process};

/// No command of these tests may take longer, on a busy machine too.
const DEADLINE: Duration = Duration::from_secs(300);

pub fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gauntlet"));
    command.args(arguments).stdin(Stdio::null());
    // Whatever the person who runs the tests prefers.
    command.env("GAUNTLET_CONFIG", settings());
    command
}

/// The same with the program that `GAUNTLET` names, where it does: campaigns measure a release build.
pub fn tool(arguments: &[&str]) -> Command {
    let usual = command(arguments);
    let Some(program) = std::env::var_os("GAUNTLET") else {
        return usual;
    };
    let mut command = Command::new(program);
    command.args(arguments).stdin(Stdio::null());
    command.env("GAUNTLET_CONFIG", settings());
    command
}

/// A folder for settings and profiles that no test puts any into.
fn settings() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("no-settings")
}

/// Starts it; what it says is kept.
pub fn start(arguments: &[&str]) -> Child {
    command(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Runs to the end.
pub fn run(arguments: &[&str]) -> Output {
    finish(start(arguments))
}

/// Collects what a child says until it ends.
pub fn finish(mut child: Child) -> Output {
    let mut stdout = child.stdout.take().unwrap();
    let mut stderr = child.stderr.take().unwrap();
    let out = std::thread::spawn(move || drain(&mut stdout));
    let err = std::thread::spawn(move || drain(&mut stderr));
    let status = wait(&mut child);
    Output {
        status,
        stdout: out.join().unwrap(),
        stderr: err.join().unwrap(),
    }
}

fn drain(from: &mut impl Read) -> Vec<u8> {
    let mut bytes = Vec::new();
    from.read_to_end(&mut bytes).unwrap();
    bytes
}

pub fn wait(child: &mut Child) -> std::process::ExitStatus {
    let end = Instant::now() + DEADLINE;
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        if Instant::now() > end {
            child.kill().unwrap();
            panic!("the command did not end in {DEADLINE:?}");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// What Ctrl-C sends.
pub fn interrupt(child: &Child) {
    let id = Pid::from_raw(i32::try_from(child.id()).unwrap()).unwrap();
    kill_process(id, Signal::INT).unwrap();
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

pub fn json(output: &Output) -> serde_json::Value {
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("standard output is JSON and nothing else")
}

/// Whether a run failed because this computer had no time for it, and says so.
pub fn kept_waiting(output: &Output) -> bool {
    let said = text(&output.stderr);
    let busy = ["a computer with less to do", "nor has so much to do"];
    output.status.code() == Some(1) && busy.iter().any(|words| said.contains(words))
}

/// The one line that says what is wrong, after checking its form, the next step and the exit code.
pub fn refusal(output: &Output, code: i32) -> String {
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{stderr}");
    let errors: Vec<&str> = stderr
        .lines()
        .filter(|l| l.starts_with("error: "))
        .collect();
    assert_eq!(errors.len(), 1, "{stderr}");
    assert!(stderr.contains("\n  try: "), "no next step in: {stderr}");
    assert!(!stderr.contains("panicked"), "{stderr}");
    errors[0].to_owned()
}

/// Joint names as files carry them, in order.
pub const JOINTS: [&str; 25] = host::glove::hand::JOINT_NAMES;

/// A poses file of `rows` rows from the generator, and the same with a change.
pub fn poses_file(folder: &Path, rows: usize) -> PathBuf {
    let path = folder.join("poses.csv");
    std::fs::write(&path, poses_text(rows)).unwrap();
    path
}

pub fn poses_text(rows: usize) -> String {
    let frames = host::trainer::hand::motion::Generator::new(&host::glove::hand::LIMITS, 5)
        .frames(rows, 9.2);
    let mut text = format!("time_s,{}\n", JOINTS.join(","));
    for (index, row) in frames.iter_rows().enumerate() {
        let values: Vec<String> = row.iter().map(f32::to_string).collect();
        text.push_str(&format!("{:.4},{}\n", index as f64 / 9.2, values.join(",")));
    }
    text
}

/// A model trained in a few epochs: good enough to move something. The first test of a build trains it for all, also where
/// each has a process of its own.
pub fn model() -> &'static Path {
    static MODEL: OnceLock<PathBuf> = OnceLock::new();
    MODEL.get_or_init(|| {
        let tool = std::fs::metadata(env!("CARGO_BIN_EXE_gauntlet")).unwrap();
        let built = tool.modified().unwrap().duration_since(UNIX_EPOCH).unwrap();
        let name = format!("model-{}.safetensors", built.as_nanos());
        let kept = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        if !kept.exists() {
            train_model(&kept);
        }
        kept
    })
}

/// The file appears whole: another test may be about to look.
fn train_model(kept: &Path) {
    let folder = tempfile::tempdir_in(kept.parent().unwrap()).unwrap();
    let poses = poses_file(folder.path(), 200);
    let model = folder.path().join("model.safetensors");
    let output = run(&[
        "train",
        "--poses",
        poses.to_str().unwrap(),
        "--out",
        model.to_str().unwrap(),
        "--schedule",
        "short",
        "--epochs",
        "30",
        "--pairs",
        "1",
        "--starts",
        "1",
    ]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    std::fs::rename(model, kept).unwrap();
}

/// The words of `teleop` with the test's model.
pub fn teleop(glove: &str, gripper: &str, more: &[&str]) -> Vec<String> {
    let mut arguments = vec!["teleop", "--glove", glove, "--gripper", gripper, "--model"];
    arguments.push(model().to_str().unwrap());
    arguments.extend(more);
    arguments.into_iter().map(str::to_owned).collect()
}

pub fn run_owned(arguments: &[String]) -> Output {
    run(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
}

/// Reads lines until one contains `word`; the rest is read by a thread, so that the child never waits for its reader.
pub fn until_line(stdout: ChildStdout, word: &str) -> std::thread::JoinHandle<String> {
    let mut reader = BufReader::new(stdout);
    let mut said = String::new();
    while !said.contains(word) {
        let read = reader.read_line(&mut said).unwrap();
        assert!(read > 0, "ended before it said {word}: {said}");
    }
    std::thread::spawn(move || {
        reader.read_to_string(&mut said).unwrap();
        said
    })
}

/// A running `simulate`, ended with the test.
pub struct Simulation {
    pub folder: tempfile::TempDir,
    pub child: Child,
    pub said: Vec<String>,
}

impl Simulation {
    /// Starts it, a glove's sensors sitting straight, and waits for `ready`.
    pub fn start(glove: bool, gripper: bool) -> Self {
        let ideal: &[&str] = if glove { &["--ideal"] } else { &[] };
        Self::with(glove, gripper.then_some("gripper"), ideal)
    }

    /// The same with the gripper at `gripper`, a link in the folder or an address, and `more` options.
    pub fn with(glove: bool, gripper: Option<&str>, more: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
        let gripper = gripper.map(|place| match place.strip_prefix("tcp:") {
            Some(_) => place.to_owned(),
            None => at(place),
        });
        let glove = glove.then(|| at("glove"));
        let mut arguments = vec!["simulate"];
        if let Some(path) = &glove {
            arguments.extend(["--glove", path]);
        }
        if let Some(place) = &gripper {
            arguments.extend(["--gripper", place]);
        }
        arguments.extend(more);
        let mut child = command(&arguments)
            .env("GAUNTLET_CONFIG", folder.path().join("config"))
            .stdout(Stdio::piped())
            .stderr(Stdio::inherit())
            .spawn()
            .unwrap();
        let said = until_ready(child.stdout.take().unwrap());
        Self {
            folder,
            child,
            said,
        }
    }

    /// Where the gripper is, as it says.
    pub fn gripper_place(&self) -> String {
        let line = self.said.iter().find(|line| line.starts_with("gripper"));
        line.unwrap().split_whitespace().nth(1).unwrap().to_owned()
    }

    /// The folder with the profile that it wrote.
    pub fn config(&self) -> String {
        self.path("config")
    }

    pub fn glove(&self) -> String {
        self.path("glove")
    }

    pub fn gripper(&self) -> String {
        self.path("gripper")
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).to_str().unwrap().to_owned()
    }

    /// Ends it in order; returns its exit code.
    pub fn end(&mut self) -> Option<i32> {
        interrupt(&self.child);
        wait(&mut self.child).code()
    }
}

impl Drop for Simulation {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn until_ready(stdout: ChildStdout) -> Vec<String> {
    let mut said = Vec::new();
    for line in BufReader::new(stdout).lines() {
        let line = line.unwrap();
        let ready = line == "ready";
        said.push(line);
        if ready {
            return said;
        }
    }
    panic!("simulate ended before it was ready: {said:?}");
}
