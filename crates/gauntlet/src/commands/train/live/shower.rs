//! The pose to mimic on a gripper that is there, where that was asked for: by `gauntlet gripper move`, in a process of its own, so that
//! all it promises holds here, too (never more than 40 counts ahead of the gripper; a hold when it is ended, or this program is killed).

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use host::lines::Model;
use rustix::process::{Pid, Signal, kill_process};

/// How fast the fingers go, of 255: a full stroke takes some five seconds.
const SPEED: &str = "30";
/// How hard they press: as little as can be.
const FORCE: &str = "0";
/// A move that was ended has held the gripper by then.
const ENDS: Duration = Duration::from_secs(3);
const LOOK: Duration = Duration::from_millis(10);

/// A gripper that shows poses.
#[derive(Debug)]
pub(super) struct Shower {
    gripper: PathBuf,
    model: Model,
    moving: Option<Child>,
    /// What comes next, once the move that was ended has held.
    next: Option<Vec<f32>>,
}

impl Shower {
    pub fn new(gripper: &Path, model: Model) -> Self {
        Self {
            gripper: gripper.to_owned(),
            model,
            moving: None,
            next: None,
        }
    }

    /// Shows `counts` as soon as the move before has ended. Never waits.
    pub fn show(&mut self, counts: &[f32]) {
        self.next = Some(counts.to_vec());
        self.end();
    }

    /// Looks after the move; what went wrong with it, in a line.
    pub fn look(&mut self) -> Option<String> {
        let mut wrong = None;
        if let Some(child) = &mut self.moving {
            match child.try_wait() {
                Ok(None) => return None,
                Ok(Some(status)) => {
                    let ended_here = self.next.is_some();
                    if !status.success() && !ended_here {
                        wrong = Some(said(child));
                    }
                }
                Err(error) => wrong = Some(error.to_string()),
            }
            self.moving = None;
        }
        if let Some(counts) = self.next.take() {
            match self.begin(&counts) {
                Ok(child) => self.moving = Some(child),
                Err(error) => wrong = Some(format!("the gripper cannot be moved: {error}")),
            }
        }
        wrong
    }

    fn begin(&self, counts: &[f32]) -> std::io::Result<Child> {
        let to: Vec<String> = counts.iter().map(|count| format!("{count:.0}")).collect();
        Command::new(std::env::current_exe()?)
            .args(["gripper", "move", "--gripper"])
            .arg(&self.gripper)
            .args([
                "--gripper-model",
                self.model.option(),
                "--to",
                &to.join(","),
            ])
            .args(["--speed", SPEED, "--force", FORCE])
            // It holds also where this program is killed outright.
            .args(["--ends-with", &std::process::id().to_string()])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
    }

    /// Asks a move under way for its end: it holds the gripper.
    fn end(&mut self) {
        let id = self
            .moving
            .as_ref()
            .and_then(|child| i32::try_from(child.id()).ok());
        if let Some(id) = id.and_then(Pid::from_raw) {
            // One that has just ended does not hear it.
            let _ = kill_process(id, Signal::INT);
        }
    }
}

impl Drop for Shower {
    fn drop(&mut self) {
        self.next = None;
        self.end();
        let until = Instant::now() + ENDS;
        while let Some(child) = &mut self.moving {
            let is_over = !matches!(child.try_wait(), Ok(None));
            if is_over || Instant::now() > until {
                break;
            }
            std::thread::sleep(LOOK);
        }
    }
}

/// What a move that failed said.
fn said(child: &mut Child) -> String {
    let mut text = String::new();
    if let Some(stderr) = &mut child.stderr {
        // What cannot be read is not said.
        let _ = stderr.take(4096).read_to_string(&mut text);
    }
    let error = text.lines().find_map(|line| line.strip_prefix("error: "));
    format!(
        "the gripper does not show it: {}",
        error.unwrap_or("it says not why")
    )
}
