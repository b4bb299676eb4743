//! A whole session at a bench: the tool between a virtual glove, whose hand can be told to move, and a virtual gripper.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant, SystemTime};

use rig::glove::VirtualGlove;
use rig::gripper::{Config, VirtualGripper};
use rig::pty::Handle;
use rustix::process::{Pid, Signal, kill_process};

use super::{devices, model, wait};

/// An orderly end: 1.5 s for the hold, 2 s for what is printed, and a busy machine.
pub const SOON: Duration = Duration::from_secs(12);
/// For a run to be brought up and to move.
pub const BRINGUP: Duration = Duration::from_secs(40);

/// A glove whose hand lies flat until something is commanded, and an active gripper whose true state can be looked at.
pub struct Bench {
    pub gripper: VirtualGripper,
    _gripper_port: Handle,
    pub glove: VirtualGlove,
    pub glove_port: Option<Handle>,
    moves: Arc<AtomicBool>,
    pub arguments: Vec<String>,
    pub log: PathBuf,
    folder: tempfile::TempDir,
}

/// Flat, then all fingers bend and stretch every 4 s, from flat each time.
pub fn hand(moves: Arc<AtomicBool>) -> impl Fn(f64) -> [f32; 25] {
    let since = Mutex::new(None);
    move |time| {
        let mut angles = [0.0; 25];
        let mut since = since.lock().unwrap();
        if !moves.load(Ordering::Relaxed) {
            // No hand jumps from flat into the midst of a movement.
            *since = None;
        } else {
            let begin = *since.get_or_insert(time);
            let bent = 0.5 - 0.5 * ((time - begin) * std::f64::consts::FRAC_PI_2).cos();
            for finger in 1..5 {
                angles[5 * finger] = bent as f32;
                angles[5 * finger + 3] = bent as f32;
            }
        }
        angles
    }
}

impl Bench {
    /// The gripper is active; `more` options for the run.
    pub fn new(more: &[&str]) -> Self {
        let bench = Self::inactive(more);
        bench.gripper.preset_active();
        bench
    }

    pub fn inactive(more: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let moves = Arc::new(AtomicBool::new(false));
        let glove = VirtualGlove::new(
            Box::new(hand(Arc::clone(&moves))),
            rig::glove::Config::at_baud(115_200),
        );
        let (glove_port, glove_path) = devices::behind_pty(glove.clone());
        let (gripper, gripper_port, gripper_path) = devices::gripper(Config::default());
        let log = folder.path().join("run.mcap");
        let words = [
            "teleop",
            "--glove",
            &glove_path,
            "--gripper",
            &gripper_path,
            "--model",
            model().to_str().unwrap(),
            "--ideal",
            "--calibrate-flat",
            "--log",
            log.to_str().unwrap(),
        ];
        let arguments = words.iter().chain(more).map(|word| (*word).to_owned());
        Self {
            gripper,
            arguments: arguments.collect(),
            _gripper_port: gripper_port,
            glove,
            glove_port: Some(glove_port),
            moves,
            log,
            folder,
        }
    }

    /// From now on the hand moves.
    pub fn hand_moves(&self) {
        self.moves.store(true, Ordering::Relaxed);
    }

    /// From now on it lies flat.
    pub fn hand_lies_flat(&self) {
        self.moves.store(false, Ordering::Relaxed);
    }

    /// The next run's log is another file.
    pub fn log_to(&mut self, name: &str) {
        let path = self.folder.path().join(name);
        self.log_at(&path);
    }

    /// The same at any place.
    pub fn log_at(&mut self, path: &Path) {
        let place = self.arguments.iter().position(|word| word == "--log");
        self.arguments[place.unwrap() + 1] = path.to_str().unwrap().to_owned();
        self.log = path.to_owned();
    }

    /// Until the run has made its log: driving begins.
    pub fn until_logged(&self, child: &mut Child) {
        let end = Instant::now() + BRINGUP;
        while !self.log.exists() {
            assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
            assert!(Instant::now() < end, "no log was made");
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Until something is commanded.
    pub fn until_commanded(&self, child: &mut Child) {
        let end = Instant::now() + BRINGUP;
        while self.gripper.writes() == 0 {
            assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
            assert!(Instant::now() < end, "nothing was commanded");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    pub fn arguments(&self) -> Vec<&str> {
        self.arguments.iter().map(String::as_str).collect()
    }

    /// Until the gripper has gone some way after the hand.
    pub fn until_moving(&self, child: &mut Child) {
        self.until_commanded(child);
        self.hand_moves();
        let begin = self.gripper.positions();
        let moved = |now: [f32; 4]| begin.iter().zip(now).any(|(a, b)| (a - b).abs() > 8.0);
        let end = Instant::now() + BRINGUP;
        while !moved(self.gripper.positions()) {
            assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
            assert!(Instant::now() < end, "it did not move");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Whether anything is commanded anew for `time`.
    pub fn stands_for(&self, time: Duration) -> bool {
        let begin = self.gripper.command_block();
        let end = Instant::now() + time;
        while Instant::now() < end {
            if self.gripper.command_block() != begin {
                return false;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        true
    }

    /// The commands of the finished log.
    pub fn commands(&self) -> Vec<serde_json::Value> {
        self.logged("/gripper/command")
    }

    /// What the finished log has of a topic.
    pub fn logged(&self, topic: &str) -> Vec<serde_json::Value> {
        self.logged_at_times(topic)
            .map(|(_, value)| value)
            .collect()
    }

    /// What finger A was seen to reach is in the finished log, one after the other.
    pub fn assert_logged(&self, seen: &[f64]) {
        let positions = self.logged("/gripper/status");
        let mut logged = positions
            .iter()
            .filter_map(|status| status["gPOA"].as_f64());
        for number in seen {
            let is_there = logged.any(|logged| logged == *number);
            assert!(
                is_there,
                "{number} of {seen:?} is not in the log, or not then"
            );
        }
    }

    /// A command that rests on no sample left soon after `closed`, by the stamps of the finished log.
    pub fn assert_held_within_half_a_second_of(&self, closed: SystemTime) {
        let (at, _) = self
            .logged_at_times("/gripper/command")
            .find(|(at, command)| *at >= closed && command["age_us"].is_null())
            .expect("a hold in the log");
        let later = at.duration_since(closed).unwrap();
        println!("the hold left {} ms later", later.as_millis());
        assert!(later <= Duration::from_millis(500), "{later:?}");
    }

    fn logged_at_times(
        &self,
        topic: &str,
    ) -> impl Iterator<Item = (SystemTime, serde_json::Value)> {
        let bytes = std::fs::read(&self.log).unwrap();
        assert!(mcap::Summary::read(&bytes).unwrap().is_some(), "no index");
        let messages: Vec<_> = mcap::MessageStream::new(&bytes)
            .unwrap()
            .map(Result::unwrap)
            .filter(|message| message.channel.topic == topic)
            .collect();
        messages.into_iter().map(|message| {
            (
                SystemTime::UNIX_EPOCH + Duration::from_nanos(message.publish_time),
                serde_json::from_slice(&message.data).unwrap(),
            )
        })
    }

    pub fn last_command_is_a_hold(&self) {
        let commands = self.commands();
        let last = commands.last().expect("something was commanded");
        assert!(last["age_us"].is_null(), "no hold at the end: {last}");
    }
}

/// A child that does not outlive a test that fails: it would go on looking for its ports, which others get.
pub struct Running(pub Child);

impl Running {
    pub fn start(command: &mut Command) -> Self {
        Self(command.spawn().unwrap())
    }

    /// What it said, once it has ended.
    pub fn finish(mut self) -> std::process::Output {
        let read = |from: Option<&mut dyn Read>| {
            let mut bytes = Vec::new();
            from.map(|from| from.read_to_end(&mut bytes).unwrap());
            bytes
        };
        let stdout = read(self.0.stdout.as_mut().map(|from| from as &mut dyn Read));
        let stderr = read(self.0.stderr.as_mut().map(|from| from as &mut dyn Read));
        let status = wait(&mut self.0);
        std::process::Output {
            status,
            stdout,
            stderr,
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Its exit code, or a failure where it does not end.
pub fn ends_soon(child: &mut Child) -> Option<i32> {
    let end = Instant::now() + SOON;
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status.code();
        }
        if Instant::now() > end {
            child.kill().unwrap();
            panic!("it did not end in {SOON:?}");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

pub fn send(child: &Child, signal: Signal) {
    let id = Pid::from_raw(i32::try_from(child.id()).unwrap()).unwrap();
    kill_process(id, signal).unwrap();
}

/// From now on none of its axes moves, whatever it is told.
pub fn jam(gripper: &VirtualGripper) {
    for (axis, at) in gripper.positions().into_iter().enumerate() {
        gripper.set_limits(axis, Some((at, at)));
    }
}

/// A sensor jumps as no hand does; several times, since in the pauses that a busy machine makes a hand may turn by half.
pub fn jumps(glove: &VirtualGlove, sensor: usize) {
    for heading in [3.0, 0.0, 3.0, 0.0, 3.0] {
        glove.set_heading(sensor, heading);
        std::thread::sleep(Duration::from_millis(500));
    }
}

/// A sensor turns slowly, as a hand could, to where no hand can be.
pub fn creeps(glove: &VirtualGlove, sensor: usize) {
    for degree in 1..=120 {
        glove.set_heading(sensor, (degree as f32).to_radians());
        std::thread::sleep(Duration::from_millis(30));
    }
}

/// As the system tells it: `T` is stopped.
pub fn state(child: &Child) -> char {
    let stat = std::fs::read_to_string(format!("/proc/{}/stat", child.id())).unwrap();
    let (_, after) = stat.rsplit_once(") ").unwrap();
    after.chars().next().unwrap()
}
