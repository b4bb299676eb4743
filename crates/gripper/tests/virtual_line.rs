//! Rates, lateness and cut wires, against the rig's virtual 3-Finger gripper.
#![allow(clippy::unwrap_used)]

mod bench;

use bench::*;
use gripper::driver::{Config, ThreeFinger};
use gripper::{Duration, Event, Gripper, Instant, Motion};
use rig::gripper::Config as Virtual;

#[test]
fn a_hundred_hertz_is_held_for_a_hundred_thousand_cycles() {
    let mut bench = three();
    bench.activate();
    let period = Duration::from_millis(10);
    bench.driver = ThreeFinger::new(
        bench.wire.clone(),
        Config {
            cycle: period,
            ..Config::default()
        },
    );
    let motion = |count: u32| Motion {
        position: [100 + (count / 50 % 40) as u8; 4],
        speed: [255; 4],
        force: [100; 4],
    };
    bench.cycle();
    let (start, writes) = (bench.clock.now(), bench.truth.writes());
    for count in 0..100_000 {
        bench
            .driver
            .set_motion(Some(motion(count)), bench.clock.now());
        bench.cycle();
    }
    let span = (bench.clock.now() - start).as_micros();
    let counters = bench.driver.counters();
    println!(
        "100000 cycles in {span} µs, {} commands, {counters:?}",
        bench.truth.writes() - writes
    );
    assert!(span <= 100_000 * 10_000 + 10_000);
    assert_eq!(bench.truth.writes() - writes, 100_000);
    assert_eq!((counters.timeouts, counters.crc, counters.noise), (0, 0, 0));
}

#[test]
fn the_cycle_takes_what_bytes_silences_and_the_five_millisecond_rule_allow() {
    for (name, silence) in [
        ("1.75 ms", gripper::timing::silence(115_200)),
        ("3.5 characters", gripper::timing::short_silence(115_200)),
    ] {
        let (clock, wire, truth) = wire(Virtual {
            frame_gap: silence,
            ..Virtual::default()
        });
        let config = Config {
            silence: Some(silence),
            ..Config::default()
        };
        let mut bench: Three = Bench {
            driver: ThreeFinger::new(wire.clone(), config),
            clock,
            wire,
            truth,
        };
        bench.activate();
        let motion = Motion {
            position: [100; 4],
            speed: [255; 4],
            force: [100; 4],
        };
        let mut start = Instant::from_ticks(0);
        for cycle in 0..1_100 {
            if cycle == 100 {
                start = bench.clock.now();
            }
            bench.driver.set_motion(Some(motion), bench.clock.now());
            bench.cycle();
        }
        let took = (bench.clock.now() - start).as_micros() / 1_000;
        // 29 + 21 characters and two silences, or 5 ms.
        let allowed = ((50.0 * 10e6 / 115_200.0) as u64 + 2 * silence.as_micros()).max(5_000);
        println!(
            "silences of {name}: a cycle takes {took} µs of {allowed} µs allowed, {} Hz",
            1_000_000 / took
        );
        assert!(
            took * 95 <= allowed * 100,
            "{took} µs where {allowed} µs are allowed"
        );
    }
}

#[test]
fn a_dropped_reply_costs_one_cycle() {
    let mut bench = three();
    bench.activate();
    let motion = Motion {
        position: [100; 4],
        speed: [255; 4],
        force: [100; 4],
    };
    let (mut last, mut gaps) = (bench.clock.now(), Vec::new());
    for cycle in 0..400 {
        if cycle % 40 == 39 {
            bench.truth.mute(1);
        }
        bench.driver.set_motion(Some(motion), bench.clock.now());
        if bench.next(Duration::from_millis(100)).unwrap().is_ok() {
            gaps.push((bench.clock.now() - last).as_micros());
            last = bench.clock.now();
        }
    }
    gaps.sort_unstable();
    let (usual, worst) = (gaps[200], *gaps.last().unwrap());
    println!("status every {usual} µs; {worst} µs around a dropped reply");
    // One cycle of 10 ms is lost, and the next one reads.
    assert!(worst <= 22_000);
    assert_eq!(bench.driver.counters().timeouts, 10);
}

#[test]
fn a_gripper_that_was_late_for_a_while_is_back_as_soon_as_it_answers_in_time() {
    let mut worst = 0;
    for delay in [5, 8, 10, 12, 15, 20, 30, 50, 100, 300] {
        for span in [1, 10, 45, 100, 500, 3_000] {
            let mut bench = three();
            bench.activate();
            let motion = Motion {
                position: [100; 4],
                speed: [255; 4],
                force: [100; 4],
            };
            let end = bench.clock.now() + Duration::from_millis(span);
            bench.truth.set_reply_delay(Duration::from_millis(delay));
            while bench.clock.now() < end {
                bench.driver.set_motion(Some(motion), bench.clock.now());
                let _ = bench.next(end - bench.clock.now());
            }
            bench.truth.set_reply_delay(Duration::from_millis(0));
            let (back, writes) = (bench.clock.now(), bench.truth.writes());
            while bench.truth.writes() == writes {
                bench.driver.set_motion(Some(motion), bench.clock.now());
                let _ = bench.next(Duration::from_millis(10));
                assert!(
                    bench.clock.now() < back + Duration::from_millis(1_000),
                    "{delay} ms late for {span} ms"
                );
            }
            worst = worst.max((bench.clock.now() - back).as_millis());
        }
    }
    println!("60 spells of lateness: commanded again at most {worst} ms after the end");
    assert!(worst <= 400);
}

/// A gripper that closes by full stroke, never told more than 40 counts past where it is, on a wire that is cut after `cut`
/// characters. Returns how far each axis went on after that, and how many characters passed.
fn stroke_cut_after(cut: u64) -> ([f32; 4], u64) {
    const TARGET: [u8; 4] = [250, 250, 250, 100];
    let mut bench = three();
    bench.truth.preset_active();
    let mut status = bench.cycle();
    let before = bench.wire.passed();
    bench.wire.cut_after(cut);
    let end = bench.clock.now() + Duration::from_millis(5_000);
    let mut at_cut = bench.truth.positions();
    while !bench.wire.is_cut() && bench.clock.now() < end {
        // Taken before the characters of this turn pass.
        at_cut = bench.truth.positions();
        if status.position[..3].iter().all(|count| *count >= 245) {
            break;
        }
        let motion = Motion {
            position: core::array::from_fn(|axis| {
                let here = status.position[axis];
                TARGET[axis].clamp(here.saturating_sub(40), here.saturating_add(40))
            }),
            speed: [255; 4],
            force: [100; 4],
        };
        bench.driver.set_motion(Some(motion), bench.clock.now());
        let now = bench.clock.now();
        match bench.driver.poll(now) {
            Some(Event::Status(fresh)) => status = fresh,
            Some(Event::Failed(error)) => panic!("{error}"),
            Some(Event::Sent) | None => bench
                .clock
                .wait_until(bench.driver.next_due().max(now + Duration::from_micros(1))),
        }
        bench.truth.run_until(bench.clock.now());
    }
    bench.wire.cut_after(0);
    bench.clock.advance(Duration::from_millis(3_000));
    bench.truth.run_until(bench.clock.now());
    let after = bench.truth.positions();
    let further = core::array::from_fn(|axis| (after[axis] - at_cut[axis]).abs());
    (further, bench.wire.passed() - before)
}

#[test]
fn cutting_the_wire_at_every_byte_leaves_no_axis_more_than_forty_counts_further() {
    let (_, whole) = stroke_cut_after(u64::MAX);
    let mut worst = 0.0_f32;
    for cut in 0..whole {
        let (further, passed) = stroke_cut_after(cut);
        assert_eq!(passed, cut);
        for (axis, counts) in further.into_iter().enumerate() {
            assert!(
                counts <= 40.0,
                "cut after {cut} bytes: axis {axis} went on by {counts}"
            );
            worst = worst.max(counts);
        }
    }
    println!("{whole} cuts, one at every byte of a full stroke: at most {worst:.1} counts further");
    assert!(whole > 3_000 && worst > 20.0);
}
