//! The pose to mimic on a gripper that is there, where that was asked for: by `gauntlet gripper move`, in a process of its own, so that
//! all it promises holds here, too (never more than 40 counts ahead of the gripper; a hold when it is ended, or this program is killed).

use std::io::Read;
use std::os::unix::process::CommandExt;
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
const ENDS: Duration = Duration::from_secs(5);
const LOOK: Duration = Duration::from_millis(10);

/// A gripper that shows poses.
#[derive(Debug)]
pub(super) struct Shower {
    /// The tool: this program.
    tool: PathBuf,
    gripper: PathBuf,
    model: Model,
    moving: Option<Child>,
    /// What comes next, once the move that was ended has held.
    next: Option<Vec<f32>>,
    /// A move went wrong: none begins until a person says so.
    halted: bool,
}

impl Shower {
    /// # Errors
    /// This program's own path is not known.
    pub fn new(gripper: &Path, model: Model) -> std::io::Result<Self> {
        Ok(Self::by(std::env::current_exe()?, gripper, model))
    }

    fn by(tool: PathBuf, gripper: &Path, model: Model) -> Self {
        Self {
            tool,
            gripper: gripper.to_owned(),
            model,
            moving: None,
            next: None,
            halted: false,
        }
    }

    /// Shows `counts` as soon as the move before has ended. Never waits.
    pub fn show(&mut self, counts: &[f32]) {
        self.next = Some(counts.to_vec());
        self.end();
    }

    /// Whether it waits for a person's word after a move that went wrong.
    pub fn is_halted(&self) -> bool {
        self.halted
    }

    /// The person's word: it shows what is asked for now.
    pub fn go_on(&mut self) {
        self.halted = false;
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
        if wrong.is_none()
            && !self.halted
            && let Some(counts) = self.next.take()
        {
            match self.begin(&counts) {
                Ok(child) => self.moving = Some(child),
                Err(error) => wrong = Some(format!("it cannot be moved: {error}")),
            }
        }
        let wrong = wrong?;
        self.halted = true;
        Some(format!(
            "the gripper does not show it: {wrong}; g: show poses again"
        ))
    }

    /// Ends a move that is under way and waits for it: what it said of how the gripper was left. `None` where none was.
    pub fn finish(&mut self) -> Option<String> {
        self.next = None;
        self.end();
        let mut child = self.moving.take()?;
        let until = Instant::now() + ENDS;
        loop {
            match child.try_wait() {
                Ok(Some(status)) if status.success() => return None,
                Ok(None) if Instant::now() < until => std::thread::sleep(LOOK),
                Ok(Some(_)) => return Some(format!("the gripper: {}", said(&mut child))),
                Ok(None) | Err(_) => {
                    let seconds = ENDS.as_secs();
                    return Some(format!(
                        "the gripper: the move that was ended goes on after {seconds} s; look at it"
                    ));
                }
            }
        }
    }

    /// Holds it before this program is stopped.
    pub fn pause(&mut self) -> Option<String> {
        let left = self.finish();
        self.halted |= left.is_some();
        left
    }

    fn begin(&self, counts: &[f32]) -> std::io::Result<Child> {
        let to: Vec<String> = counts.iter().map(|count| format!("{count:.0}")).collect();
        Command::new(&self.tool)
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
            // What is typed at the terminal is this program's to hear: it ends the move itself.
            .process_group(0)
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
        let _ = self.finish();
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
    error.unwrap_or("it says not why").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Looks until the move has ended; what went wrong with it.
    fn ended(shower: &mut Shower) -> Option<String> {
        while shower.moving.is_some() {
            if let Some(wrong) = shower.look() {
                return Some(wrong);
            }
            std::thread::sleep(LOOK);
        }
        None
    }

    #[test]
    fn after_a_move_that_went_wrong_none_begins_until_the_person_says_so() {
        let mut shower = Shower::by("false".into(), Path::new("/dev/null"), Model::ThreeFinger);
        shower.show(&[0.0; 4]);
        assert_eq!(shower.look(), None);
        let wrong = ended(&mut shower).expect("`false` fails");
        assert!(wrong.ends_with("g: show poses again"), "{wrong}");
        assert!(shower.is_halted());
        for _ in 0..3 {
            shower.show(&[255.0; 4]);
            assert_eq!(shower.look(), None);
            assert!(shower.moving.is_none(), "nobody said that it may");
        }
        shower.go_on();
        shower.show(&[255.0; 4]);
        assert_eq!(shower.look(), None);
        assert!(shower.moving.is_some());
    }
}
