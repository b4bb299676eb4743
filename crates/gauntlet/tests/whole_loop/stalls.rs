//! A program that stood still while somebody else moved the gripper.

use crate::support;

use std::time::Duration;

use rig::gripper::{Config, Family, VirtualGripper};
use rustix::process::{Pid, Signal, kill_process};
use support::devices::behind_pty;
use support::other_master::{command, noted};
use support::told::Told;
use support::{Simulation, interrupt, model, start, wait};

/// Counts by which somebody else moves the gripper while the tool stands still.
const ELSEWHERE: f32 = 16.0;

#[test]
fn the_first_command_after_a_stall_is_where_the_gripper_is() {
    let simulation = Simulation::start(true, false);
    let gripper = VirtualGripper::new(Config::of(Family::ThreeFinger));
    gripper.preset_active();
    let (noted, notes, word) = noted(&gripper);
    let (handle, path) = behind_pty(noted);
    let (glove, model) = (simulation.glove(), model().to_str().unwrap());
    let mut teleop = start(&[
        "teleop",
        "--glove",
        &glove,
        "--gripper",
        &path,
        "--model",
        model,
        "--engage",
        "--ideal",
        "--calibrate-flat",
        "--seconds",
        "120",
    ]);
    let said = Told::by(teleop.stdout.take().unwrap());
    let mut seen = said.until(0, "following");
    let id = Pid::from_raw(i32::try_from(teleop.id()).unwrap()).unwrap();
    let (mut commands, mut moved) = (0, 0.0);
    for stall in 0..4_u64 {
        // It goes on; the stop comes at another place of its cycle each time.
        seen = said.until(seen, "finger A");
        std::thread::sleep(Duration::from_millis(500 + 7 * stall));
        kill_process(id, Signal::STOP).unwrap();
        std::thread::sleep(Duration::from_millis(60));
        // Meanwhile somebody else sends it elsewhere: not so far that a person would have to close the clutch again.
        let mut block = gripper.command_block();
        for (axis, at) in [3, 6, 9].into_iter().enumerate() {
            let here = gripper.positions()[axis];
            let there = if here < 128.0 {
                here + ELSEWHERE
            } else {
                here - ELSEWHERE
            };
            block[at] = there as u8;
        }
        *word.lock().unwrap() = Some(command(&block));
        let before = gripper.positions();
        std::thread::sleep(Duration::from_millis(700));
        gripper.run_until(handle.clock().now());
        moved += f32::abs(gripper.positions()[0] - before[0]);
        notes.lock().unwrap().clear();
        kill_process(id, Signal::CONT).unwrap();
        std::thread::sleep(Duration::from_millis(500));
        let Some((block, at)) = notes.lock().unwrap().first().copied() else {
            continue;
        };
        commands += 1;
        let told = [block[3], block[6], block[9]];
        let off = told
            .iter()
            .zip(at)
            .map(|(told, at)| (f32::from(*told) - at).abs());
        let off = off.fold(0.0, f32::max);
        assert!(off <= 8.0, "stall {stall}: told {told:?} at {at:?}");
    }
    interrupt(&teleop);
    wait(&mut teleop);
    assert!(
        moved > 2.0 * ELSEWHERE,
        "nobody moved the gripper meanwhile: {moved}"
    );
    assert!(commands > 0, "no command came after any of the stalls");
    said.all();
}
