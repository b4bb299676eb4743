//! The same inputs give the same bits here and on the emulated chip: the map, and the whole bridge over a stored trace.
//! Skipped, with a word, where QEMU or the firmware is missing.
#![allow(missing_docs)]

use hae::image::JointOrder;
use loop_tests::bits::{self, compare};
use loop_tests::chip::{self, bench};
use loop_tests::emulated::alone;
use loop_tests::images::{self, SHAPE};
use loop_tests::replay::{self, GLOVE, GRIPPER, HOST, Record, VALUES, records};
use loop_tests::trace::{short, slots, worn};

const SEED: u64 = 1;

#[test]
fn the_map_gives_the_same_bits_here_and_on_the_chip() {
    let Some(bench) = bench() else { return };
    let _alone = alone();
    let (inputs, mix) = bits::inputs(SEED, 4_000);
    let image = images::random(SHAPE, JointOrder::Hand25, SEED);
    let refused = compare(&bench, &image, &inputs).expect("the same bits");
    println!(
        "seed {SEED}: {} inputs ({mix:?}), {refused} refused on both",
        inputs.len()
    );
    assert!(inputs.len() >= 10_000 && refused > 50);
}

fn replayed_here(trace: &[u8]) -> Vec<u8> {
    let mut room = vec![0; 5 << 20];
    let length = replay::run(trace, &mut room, slots(), slots()).expect("room");
    room.truncate(length);
    room
}

/// A write to the gripper that carries a command (FC23).
fn is_motion(record: &Record<'_>) -> bool {
    record.port == GRIPPER && record.bytes.get(1) == Some(&0x17)
}

fn sorts(output: &[u8]) -> [usize; 4] {
    [HOST, GLOVE, GRIPPER, VALUES].map(|port| records(output).filter(|r| r.port == port).count())
}

#[test]
fn a_stored_trace_commands_the_gripper_and_twice_in_the_same_way() {
    let recorded = short(SEED, false);
    let (following, holds) = (recorded.following_frames, recorded.holds);
    assert!(following > 100 && holds <= 1, "{following} {holds}");
    let output = replayed_here(&recorded.trace);
    let [host, glove, gripper, values] = sorts(&output);
    println!("{host} host, {glove} glove, {gripper} gripper writes, {values} frames");
    assert!(values as u32 > following);
    let motions = |all: &[u8]| records(all).filter(is_motion).count();
    assert!(motions(&output) > 500, "{}", motions(&output));
    assert!(
        replayed_here(&recorded.trace) == output,
        "the second replay differs"
    );
}

#[test]
fn a_stored_trace_gives_the_same_commands_here_and_on_the_chip() {
    let Some(bench) = bench() else { return };
    let _alone = alone();
    for faulty in [false, true] {
        let recorded = short(SEED, faulty);
        let here = replayed_here(&recorded.trace);
        let chip = chip::run(&bench, chip::REPLAY, &recorded.trace, &[], false).expect("an output");
        let pairs = records(&here).zip(records(&chip));
        for (number, (here, chip)) in pairs.enumerate() {
            assert_eq!(here, chip, "record {number}, faulty {faulty}");
        }
        assert!(here == chip, "one output goes on after the other's end");
        println!(
            "faulty {faulty}: {} bytes in, {:?} writes and frames, {} bytes out: all the same",
            recorded.trace.len(),
            sorts(&here),
            here.len()
        );
        assert!(records(&here).filter(is_motion).count() > 500);
    }
}

#[test]
fn an_honest_glove_with_its_profile_gives_the_same_bits_here_and_on_the_chip() {
    let recorded = worn(SEED);
    let recorded_frames = recorded.following_frames;
    assert!(recorded_frames > 100, "{recorded_frames}");
    let here = replayed_here(&recorded.trace);
    let motions = records(&here).filter(is_motion).count();
    println!("{recorded_frames} frames followed, {motions} commands");
    // Calibrated by its profile it follows; where the replay's moments drift from the recording's, bytes come at others on both.
    assert!(motions > 50, "{motions}");
    let Some(bench) = bench() else { return };
    let _alone = alone();
    let chip = chip::run(&bench, chip::REPLAY, &recorded.trace, &[], false).expect("an output");
    for (number, (here, chip)) in records(&here).zip(records(&chip)).enumerate() {
        assert_eq!(here, chip, "record {number}");
    }
    assert!(here == chip, "one output goes on after the other's end");
    println!(
        "{} bytes in, {:?} writes and frames: all the same",
        recorded.trace.len(),
        sorts(&here)
    );
}
