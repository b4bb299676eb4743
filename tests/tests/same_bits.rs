//! The same inputs give the same bits here and on the emulated chip: the map, calibration and headings over recorded sessions, and the
//! whole bridge over a stored trace.
//! Skipped, with a word, where QEMU or the firmware is missing.
#![allow(missing_docs)]

use bridge::trace::{Difference, Entry, GRIPPER, Reader};
use hae::image::JointOrder;
use loop_tests::bits::{self, compare};
use loop_tests::chip::{self, bench};
use loop_tests::emulated::alone;
use loop_tests::golden;
use loop_tests::images::{self, SHAPE};
use loop_tests::replay;
use loop_tests::trace::{at_the_devices, counts, first_difference, replayed, short, worn};

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

#[test]
fn recorded_sessions_give_the_same_profile_and_the_same_angles_here_and_on_the_chip() {
    for name in golden::SESSIONS {
        let Some(recorded) = golden::session(name) else {
            return;
        };
        let here = golden::here(&recorded);
        assert!(here.len() > 2_000 * 26 * 4, "{name}: {} bytes", here.len());
        let Some(bench) = bench() else { return };
        let _alone = alone();
        let rows = golden::rows(&recorded);
        let chip = chip::run(&bench, chip::SESSION, &rows, &[], false).expect("an output");
        let differ = here.iter().zip(&chip).position(|(here, chip)| here != chip);
        assert_eq!((chip.len(), differ), (here.len(), None), "{name}");
        println!("{name}: {} bytes, all the same", chip.len());
    }
}

#[test]
fn a_trace_commands_the_gripper_and_its_replay_is_the_same_trace() {
    for faulty in [false, true] {
        let recorded = short(SEED, faulty);
        let (following, holds) = (recorded.following_frames, recorded.holds);
        assert!(
            following > 100 && (faulty || holds <= 1),
            "{following} {holds}"
        );
        let counts = counts(&recorded.trace);
        println!(
            "faulty {faulty}: {} bytes, {counts:?}",
            recorded.trace.len()
        );
        assert!(
            counts.seen > following && counts.commands > 500,
            "{counts:?}"
        );
        assert_eq!(first_difference(&recorded.trace), None, "faulty {faulty}");
        assert!(replayed(&recorded.trace) == recorded.trace);
    }
}

#[test]
fn an_honest_glove_with_its_profile_replays_to_its_end_as_it_was_recorded() {
    let recorded = worn(SEED);
    let frames = recorded.following_frames;
    assert!(frames > 100, "{frames}");
    let counts = counts(&recorded.trace);
    println!("{frames} frames followed, {counts:?}");
    assert!(counts.commands > 50, "{counts:?}");
    assert_eq!(first_difference(&recorded.trace), None);
    assert!(replayed(&recorded.trace) == recorded.trace);
    let Some(bench) = bench() else { return };
    let _alone = alone();
    let chip = chip::run(&bench, chip::REPLAY, &recorded.trace, &[], false).expect("an output");
    assert!(chip == recorded.trace, "the chip's trace is another one");
}

#[test]
fn a_trace_gives_the_same_trace_on_the_chip() {
    let Some(bench) = bench() else { return };
    let _alone = alone();
    for faulty in [false, true] {
        let recorded = short(SEED, faulty);
        let chip = chip::run(&bench, chip::REPLAY, &recorded.trace, &[], false).expect("an output");
        assert!(chip == recorded.trace, "faulty {faulty}");
        println!(
            "faulty {faulty}: {} bytes, {:?}: all the same",
            chip.len(),
            counts(&chip)
        );
    }
}

#[test]
fn bytes_of_the_devices_get_their_instants_on_the_chip_or_here_and_replay_in_the_other_home() {
    let bytes = at_the_devices(&short(SEED, true).trace);
    assert!(!replay::has_turns(&bytes));
    let here = replayed(&bytes);
    assert!(replay::has_turns(&here) && counts(&here).commands > 100);
    assert_eq!(first_difference(&here), None, "taken here, replayed here");
    let Some(bench) = bench() else { return };
    let _alone = alone();
    let run = |trace: &[u8]| chip::run(&bench, chip::REPLAY, trace, &[], false).expect("an output");
    let there = run(&bytes);
    assert!(
        replayed(&there) == there,
        "taken on the chip, replayed here"
    );
    assert!(run(&here) == here, "taken here, replayed on the chip");
}

#[test]
fn a_status_with_another_byte_in_it_is_a_difference_that_is_named() {
    let mut trace = short(SEED, false).trace;
    let mut reader = Reader::new(&trace);
    let mut place = None;
    while let Ok(Some(entry)) = reader.read() {
        if let Entry::Read {
            port: GRIPPER,
            bytes,
        } = entry
            && bytes.len() > 10
            && reader.at() > 21_000_000
        {
            place = Some((reader.offset() - 3, reader.at()));
            break;
        }
    }
    let (offset, at) = place.expect("a status");
    trace[offset] ^= 1;
    let (found, difference) = first_difference(&trace).expect("a difference");
    println!("{} µs after the changed byte: {difference}", found - at);
    // The frame's checksum is wrong: the driver waits for an answer, or reads on.
    assert!(found >= at && found - at < 1_000_000);
    assert!(
        matches!(
            difference,
            Difference::Call { .. } | Difference::Byte { .. } | Difference::Seen { .. }
        ),
        "{difference:?}"
    );
}
