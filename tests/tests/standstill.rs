//! 50 stalls of 0.1 to 3 s each with real processes, on the PC and in QEMU: `cargo xtask campaign stalls`. The short forms
//! run with all the other tests: on the virtual clock in `crates/bridge/tests/stalls.rs`, with a process in the tool's
//! tests.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use loop_tests::chip::firmware;
use loop_tests::emulated::Loop;
use loop_tests::images;
use loop_tests::standstill::{Stalls, length, stop};
use rig::glove::VirtualGlove;
use rig::gripper::VirtualGripper;
use rig::pty::PtyDevice;
use rustix::process::{Pid, Signal, kill_process};

const COUNT: u64 = 50;
const SEED: u64 = 7;
const PATIENCE: Duration = Duration::from_secs(60);

/// A run of the tool that follows the hand.
struct Teleop {
    child: Child,
    lines: Receiver<String>,
}

impl Teleop {
    fn start(program: &str, glove: &Path, gripper: &Path, image: &Path) -> Self {
        let mut child = Command::new(program)
            .args([
                "teleop",
                "--ideal",
                "--calibrate-flat",
                "--engage",
                "--seconds",
                "3600",
            ])
            .args([Path::new("--glove"), glove, Path::new("--gripper"), gripper])
            .args([Path::new("--model"), image])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::inherit())
            .spawn()
            .expect("the tool");
        let out = BufReader::new(child.stdout.take().expect("a pipe"));
        let (give, lines) = channel();
        std::thread::spawn(move || {
            for line in out.lines().map_while(Result::ok) {
                let _ = give.send(line);
            }
        });
        Self { child, lines }
    }

    /// Waits for a line that says so, from now on.
    fn until_following(&self) {
        while self.lines.try_recv().is_ok() {}
        let end = Instant::now() + PATIENCE;
        while let Ok(line) = self
            .lines
            .recv_timeout(end.saturating_duration_since(Instant::now()))
        {
            if line.contains("following") {
                return;
            }
        }
        panic!("it does not follow");
    }

    fn end(mut self) -> Option<i32> {
        let process = Pid::from_raw(self.child.id() as i32).expect("a process");
        kill_process(process, Signal::INT).expect("a process");
        self.child.wait().expect("its end").code()
    }
}

/// An index finger that opens and closes where `moves` says so.
fn waving(moves: Arc<AtomicBool>) -> impl FnMut(f64) -> [f32; 25] + Send {
    move |time_s| {
        let mut pose = [0.0; 25];
        if moves.load(Ordering::Relaxed) {
            pose[5] = 0.6 * (1.0 - (1.5 * time_s).cos()) as f32;
        }
        pose
    }
}

#[test]
#[ignore = "minutes: cargo xtask campaign stalls"]
fn no_command_of_the_tool_rests_on_bytes_that_waited_while_it_stood_still() {
    let program = std::env::var("GAUNTLET").expect("the tool's path in GAUNTLET");
    let folder = tempfile::tempdir().expect("a folder");
    let image = folder.path().join("map.hae");
    std::fs::write(&image, images::index_finger(1)).expect("room");
    let moves = Arc::new(AtomicBool::new(false));
    let glove = VirtualGlove::new(
        Box::new(waving(Arc::clone(&moves))),
        rig::glove::Config::at_baud(115_200),
    );
    let gripper = VirtualGripper::new(rig::gripper::Config::default());
    gripper.preset_active();
    let glove = PtyDevice::spawn(Box::new(glove), None).expect("a terminal");
    let device = PtyDevice::spawn(Box::new(gripper.clone()), None).expect("a terminal");
    let start = || {
        // However long the sensors take on a busy machine: it lies flat until it is calibrated.
        moves.store(false, Ordering::Relaxed);
        let teleop = Teleop::start(&program, glove.path(), device.path(), &image);
        teleop.until_following();
        moves.store(true, Ordering::Relaxed);
        teleop
    };
    let (mut stalls, mut opened) = (Stalls::default(), 0);
    let mut teleop = start();
    for stall in 0..COUNT {
        let time = length(SEED + stall);
        stalls.add(
            time,
            stop(teleop.child.id(), time, &gripper, device.clock()),
        );
        if time < Duration::from_millis(800) {
            teleop.until_following();
            continue;
        }
        if time > Duration::from_millis(1_200) {
            // Nobody closed the clutch again: it stays where it is.
            std::thread::sleep(Duration::from_secs(1));
            let held = gripper.positions();
            std::thread::sleep(Duration::from_secs(1));
            assert_eq!(gripper.positions(), held, "{time:?}");
            assert_eq!(
                teleop.end(),
                Some(1),
                "{time:?}: a run that nobody attended"
            );
            opened += 1;
        } else {
            teleop.end();
        }
        teleop = start();
    }
    teleop.end();
    println!("seed {SEED}, PC: {stalls:?}, the clutch opened by itself {opened} times");
    assert!(stalls.commands >= 40);
}

#[test]
#[ignore = "minutes: cargo xtask campaign stalls"]
fn no_command_of_the_chip_rests_on_bytes_that_waited_while_it_stood_still() {
    let firmware = firmware().expect("the firmware and QEMU");
    let mut whole = Loop::start(&firmware);
    let (mut stalls, mut restarts) = (Stalls::default(), 0);
    for stall in 0..COUNT {
        if !whole.knows_session() {
            // The emulator's clock went on while it stood still: the watchdog may have taken the chip for hung.
            restarts += u32::from(whole.bring_back());
        }
        whole.follow(Duration::from_secs(1));
        let time = length(SEED + stall);
        let (process, clock) = (whole.process(), whole.clock().clone());
        stalls.add(time, stop(process, time, &whole.gripper, &clock));
        // Nobody keeps the clutch: it has opened by itself before a person closes it again.
        std::thread::sleep(Duration::from_millis(1_500));
    }
    println!("seed {SEED}, QEMU: {stalls:?}, the watchdog started the chip anew {restarts} times");
    assert!(stalls.commands >= 25, "{stalls:?}");
}
