//! The bridge's ARM firmware in QEMU, in real time: weights over the host protocol, the whole loop by counters, power cuts
//! while flashing, bad input. Skipped, with a word, where QEMU or the firmware is missing.
#![allow(missing_docs)]

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use bridge::protocol::message::{Answer, Call, Refusal, Restart};
use bridge::{HoldReason, State};
use hae::image::JointOrder;
use host::chip::link::{Error, HostLink};
use host::interrupt::Interrupt;
use loop_tests::chip::firmware;
use loop_tests::debugger;
use loop_tests::emulated::{
    Loop, active, alone, bare, cut_power, debugged, flash, flood, hold_clutch, restarted,
};
use loop_tests::images::{self, SHAPE, index_finger};
use rig::skip::{Need, skipped};

/// A machine with much to do can keep the emulator waiting for longer than a sample may be old; the bridge then holds, as
/// it should, and the stretch says nothing about the loop.
const STRETCHES: usize = 5;
/// A thread that wanted to sleep for a millisecond and slept so long was kept waiting, and so was the emulator: as long as two
/// of the glove's frames are apart, after which the newest sample is too old.
const BUSY: Duration = Duration::from_millis(60);

/// Does `work`; the longest that a thread of this test had to wait for the processor meanwhile.
fn kept_waiting<T>(work: impl FnOnce() -> T) -> (T, Duration) {
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let watch = scope.spawn(|| {
            let mut longest = Duration::ZERO;
            while !done.load(Ordering::Relaxed) {
                let before = Instant::now();
                std::thread::sleep(Duration::from_millis(1));
                longest = longest.max(before.elapsed());
            }
            longest
        });
        let outcome = work();
        done.store(true, Ordering::Relaxed);
        (outcome, watch.join().expect("no panic"))
    })
}

/// One stretch without a hold is enough. Where none is, that is the loop's fault, but where this machine was seen to be busy
/// in every one of them; and a chip that answered nothing at all is never excused.
#[test]
fn every_fresh_glove_frame_is_answered_no_byte_is_lost_and_a_glove_whose_power_was_cut_comes_back()
{
    let Some(firmware) = firmware() else { return };
    let _alone = alone();
    let mut whole = Loop::start(&firmware);
    whole.cut_glove_power();
    let mut seen = Vec::new();
    for _ in 0..STRETCHES {
        let (stretch, waited) = kept_waiting(|| whole.follow(Duration::from_secs(10)));
        println!("{stretch:?}, this test was kept waiting for up to {waited:?}");
        let grown = stretch.grown;
        // The newest frame of a look may be answered after it.
        assert!(grown.following_frames.abs_diff(grown.answered_frames) <= 1);
        assert_eq!(grown.bytes_lost, [0; 3]);
        seen.push((stretch, waited));
        if stretch.followed_throughout {
            break;
        }
    }
    let Some((calm, _)) = seen.iter().find(|(stretch, _)| stretch.followed_throughout) else {
        let answered: u32 = seen.iter().map(|(s, _)| s.grown.answered_frames).sum();
        assert!(answered > 0, "the chip never followed: {seen:?}");
        let calm = seen.iter().filter(|(_, waited)| *waited < BUSY).count();
        assert_eq!(
            calm, 0,
            "held in every stretch, on a machine with time: {seen:?}"
        );
        let why = "this machine kept the emulator waiting in every stretch of 10 s";
        return skipped(Need::Machine, why);
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
    assert!((1_000..40_960).contains(&stack), "{stack} bytes of stack");
}

#[test]
fn bytes_that_find_the_queue_full_are_counted_and_the_bridge_goes_on() {
    let Some(firmware) = firmware() else { return };
    let _alone = alone();
    let sent = 6_000;
    let mut tries = (0..5).filter_map(|_| flood(&firmware, sent)).peekable();
    if tries.peek().is_none() {
        return skipped(
            Need::Machine,
            "the chip's loop stood for longer than its watchdog waits",
        );
    }
    // In a try without a loss the emulator had not delivered the bytes when the loop went on. A bridge that does not
    // count loses none in every try.
    let [host, glove, gripper] = tries.find(|[host, ..]| *host > 0).unwrap_or_default();
    println!("{sent} bytes to a bridge that takes none: {host} lost");
    // The queue holds 2,048. A machine with much to do may not have delivered all when the loop goes on; on one with
    // little to do the next host's first words still find the queue full.
    let greeting = 64;
    assert!(
        (1..=sent as u32 - 2_048 + greeting).contains(&host),
        "{host}"
    );
    assert_eq!((glove, gripper), (0, 0), "the others' queues are their own");
}

#[test]
fn a_loop_that_hangs_or_faults_starts_again_with_its_weights_and_an_open_clutch() {
    let Some(firmware) = firmware() else { return };
    let _alone = alone();
    let mut emulator = debugged(&firmware);
    let mut link = emulator.link().expect("a bridge");
    flash(&mut link, &index_finger(4)).expect("weights");
    // The first is for the watchdog, the second for the fault handler.
    for (instruction, cause) in [
        (debugger::JUMP_TO_ITSELF, Restart::Watchdog),
        (debugger::UNDEFINED, Restart::Software),
    ] {
        hold_clutch(&mut link, Duration::from_millis(300));
        let before = link.status().expect("an answer").now_us;
        drop(link);
        debugger::patch_tick(&emulator.debugger(), instruction);
        link = restarted(&mut emulator, before);
        println!("{instruction:04x}: started again");
        assert_eq!(active(&mut link), Some(4));
        assert!(!link.status().expect("an answer").engaged);
        let health = link.health().expect("an answer");
        assert_eq!(health.restart, cause);
        assert!(!health.calibration.is_calibrated);
    }
}

#[test]
fn a_power_cut_while_flashing_leaves_a_whole_image() {
    let Some(firmware) = firmware() else { return };
    let _alone = alone();
    let cuts = cut_power(&firmware, 20, 0x5EED, &mut |_| {});
    println!("{cuts:?}");
    // How many come after the end depends on the machine's pace.
    assert!(cuts.cuts == 20 && cuts.inside > 5, "{cuts:?}");
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

/// What is wrong with an image, its bytes, and words that the refusal must have.
fn bad_images() -> Vec<(&'static str, Vec<u8>, &'static str)> {
    let good = index_finger(9);
    let mut future = good.clone();
    future[8] = 2;
    let mut damaged = good.clone();
    damaged[5_000] ^= 4;
    let too_long = vec![0x55; 200_000];
    vec![
        (
            "another joint order",
            images::random(SHAPE, JointOrder::Columns, 9),
            "Columns",
        ),
        (
            "another shape",
            images::random([25, 300, 1], JointOrder::Hand25, 9),
            "[25, 300, 1]",
        ),
        ("a future version", future, "format"),
        ("a wrong CRC", damaged, "CRC"),
        ("longer than the slot", too_long, "200000 bytes"),
        ("no image at all", vec![0x55; 4_096], "not a weights image"),
    ]
}

#[test]
fn bad_images_are_refused_in_words_and_leave_the_bridge_as_it_was() {
    let Some(firmware) = firmware() else { return };
    let _alone = alone();
    let mut emulator = bare(&firmware);
    let mut link = emulator.link().expect("a bridge");
    flash(&mut link, &index_finger(5)).expect("weights");
    let before = link.slots().expect("an answer");
    for (what, image, word) in bad_images() {
        let refused = flash(&mut link, &image).expect_err(what);
        let failure = refused.at(&emulator.address());
        println!("{what}: {failure}; try {}", failure.next_step());
        assert!(failure.to_string().contains(word), "{what}: {failure}");
        assert!(!failure.next_step().is_empty(), "{what}");
        let after = link.slots().expect("an answer");
        assert_eq!(
            (after.active, active(&mut link)),
            (before.active, Some(5)),
            "{what}"
        );
    }
}

#[test]
fn while_engaged_limits_and_weights_stay_as_they_are() {
    let Some(firmware) = firmware() else { return };
    let _alone = alone();
    let mut emulator = bare(&firmware);
    let mut link = emulator.link().expect("a bridge");
    flash(&mut link, &index_finger(5)).expect("weights");
    let configuration = |link: &mut HostLink| match link.call(&Call::ConfigurationGet) {
        Ok(Answer::Configuration(configuration)) => configuration,
        other => panic!("{other:?}"),
    };
    let before = configuration(&mut link);
    let mut other = before.clone();
    other.lead = 20;
    hold_clutch(&mut link, Duration::from_millis(300));
    // Each request must come within the heartbeat's 250 ms.
    link.engage().expect("taken");
    let refused = link.call(&Call::ConfigurationSet(other.clone()));
    assert_eq!(refused, Err(Error::Refused(Refusal::Engaged)));
    link.engage().expect("taken");
    let refused = flash(&mut link, &index_finger(6)).expect_err("engaged");
    assert!(
        refused.to_string().contains("clutch is closed"),
        "{refused}"
    );
    link.release().expect("taken");
    assert_eq!(configuration(&mut link), before);
    assert_eq!(active(&mut link), Some(5));
    // The same is taken with the clutch open.
    let end = Instant::now() + Duration::from_secs(10);
    while link.status().expect("an answer").engaged && Instant::now() < end {}
    assert!(link.call(&Call::ConfigurationSet(other)).is_ok());
    flash(&mut link, &index_finger(6)).expect("weights");
}

#[test]
fn a_host_that_vanishes_in_the_middle_leaves_the_old_weights_and_the_next_goes_on() {
    let Some(firmware) = firmware() else { return };
    let _alone = alone();
    let mut emulator = bare(&firmware);
    let mut link = emulator.link().expect("a bridge");
    flash(&mut link, &index_finger(5)).expect("weights");
    let stop = Interrupt::never().expect("an interrupt");
    let half = link.flash(&index_finger(6), &stop, &mut |done| {
        if done > 18_000 {
            stop.ask();
        }
    });
    assert!(matches!(half, Err(Error::Stopped { .. })), "{half:?}");
    drop(link);
    let mut next = emulator.link().expect("the next host");
    assert_eq!(active(&mut next), Some(5));
    let never = Interrupt::never().expect("an interrupt");
    let flashed = next
        .flash(&index_finger(6), &never, &mut |_| {})
        .expect("the rest");
    assert!(flashed.resumed_at > 18_000, "{flashed:?}");
    assert_eq!(active(&mut next), Some(6));
}

#[test]
fn a_host_that_vanishes_while_engaged_leaves_a_hold_that_the_next_one_can_end() {
    let Some(firmware) = firmware() else { return };
    let _alone = alone();
    let mut emulator = bare(&firmware);
    let mut link = emulator.link().expect("a bridge");
    flash(&mut link, &index_finger(5)).expect("weights");
    hold_clutch(&mut link, Duration::from_millis(300));
    drop(link);
    // The next host is refused until the first one's session has ended: `link` is patient for so long.
    let mut next = emulator.link().expect("the next host");
    let status = next.status().expect("an answer");
    assert!(
        status.engaged && !status.heartbeat && !status.state.is_moving(),
        "{status:?}"
    );
    let refused = flash(&mut next, &index_finger(6)).expect_err("a hold");
    let refused = refused.at(&emulator.address());
    assert!(
        refused.next_step().contains("gauntlet bridge release"),
        "{refused}; try {}",
        refused.next_step()
    );
    assert_eq!(active(&mut next), Some(5));
    next.release().expect("taken");
    let end = Instant::now() + Duration::from_secs(10);
    while next.status().expect("an answer").engaged && Instant::now() < end {}
    flash(&mut next, &index_finger(6)).expect("weights");
    assert_eq!(active(&mut next), Some(6));
}
