//! The bridge's ARM firmware in QEMU, in real time: weights over the host protocol, the whole loop by counters, power cuts
//! while flashing, bad input. Skipped, with a word, where QEMU or the firmware is missing.
#![allow(missing_docs)]

use std::time::Duration;

use bridge::{HoldReason, State};
use loop_tests::chip::firmware;
use loop_tests::emulated::{Loop, active, alone, bare, cut_power, flash, hold_clutch};
use loop_tests::images::index_finger;

/// A machine with much to do can keep the emulator waiting for longer than a sample may be old; the bridge then holds, as
/// it should, and the stretch says nothing about the loop.
const STRETCHES: usize = 3;

#[test]
fn every_fresh_glove_frame_is_answered_and_no_byte_is_lost_in_the_queues() {
    let Some(firmware) = firmware() else { return };
    let _alone = alone();
    let mut whole = Loop::start(&firmware);
    let stretches: Vec<_> = (0..STRETCHES)
        .map(|_| {
            let stretch = whole.follow(Duration::from_secs(10));
            println!("{stretch:?}");
            stretch
        })
        .scan(false, |done, stretch| {
            let last = std::mem::replace(done, stretch.followed_throughout);
            (!last).then_some(stretch)
        })
        .collect();
    for stretch in &stretches {
        let grown = stretch.grown;
        // The newest frame of a look may be answered after it.
        assert!(grown.following_frames.abs_diff(grown.answered_frames) <= 1);
        assert_eq!(grown.bytes_lost, [0; 3]);
    }
    let Some(calm) = stretches.iter().find(|stretch| stretch.followed_throughout) else {
        println!("skipped: this machine kept the emulator waiting in every stretch of 10 s");
        return;
    };
    assert!(calm.grown.frames > 100, "{calm:?}");
    assert_eq!(calm.grown.unusable_frames, 0);
    assert!(
        calm.grown.frames.abs_diff(calm.grown.answered_frames) <= 1,
        "{calm:?}"
    );
    assert!(calm.moved, "the gripper did not move");
    let stack = calm.grown.stack_used;
    println!("stack: {stack} bytes at most");
    assert!((1_000..32_768).contains(&stack), "{stack} bytes of stack");
}

#[test]
fn a_power_cut_while_flashing_leaves_a_whole_image() {
    let Some(firmware) = firmware() else { return };
    let _alone = alone();
    let cuts = cut_power(&firmware, 20, 0x5EED, &mut |_| {});
    println!("{cuts:?}");
    assert!(cuts.inside > 5 && cuts.inside < cuts.cuts, "{cuts:?}");
}

#[test]
fn weights_and_an_open_line_alone_do_not_move() {
    let Some(firmware) = firmware() else { return };
    let _alone = alone();
    let mut emulator = bare(&firmware);
    let mut link = emulator.link().expect("a bridge");
    let held = hold_clutch(&mut link, Duration::from_millis(300));
    assert!(!held.is_empty() && held.iter().all(|state| !state.is_moving()));
    link.release().expect("taken");
    flash(&mut link, &index_finger(3)).expect("weights");
    assert_eq!(active(&mut link), Some(3));
    let held = hold_clutch(&mut link, Duration::from_millis(300));
    assert!(
        held.iter()
            .all(|state| !state.is_moving() && *state != State::Holding(HoldReason::NoWeights)),
        "{held:?}"
    );
}
