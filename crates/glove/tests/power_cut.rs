//! A glove whose power is cut and comes back: the serial bridge speaks 9,600 baud again, the sensors are as after power-on.

mod common;

use common::{ALL, Bench, assert_true, waving};
use glove::Duration;
use glove::scan::{Frame, Scanner, State};

/// A glove on a port whose speed can be changed.
fn bench() -> Bench {
    let mut bench = Bench::new(waving);
    bench.scanner =
        Scanner::new(bench.wire.clone(), glove::scan::Config::default()).with_set_baud();
    bench
}

/// Cuts the power for `off` µs and counts how long after it came back every sensor was good again.
fn cut(bench: &mut Bench, off: u64) -> u64 {
    bench.glove.power(false, bench.clock.now());
    bench.until(bench.clock.now().as_ticks() + off);
    let on = bench.clock.now();
    bench.glove.power(true, on);
    for _ in 0..100 {
        let frames = bench.until_timed(bench.clock.now().as_ticks() + 100_000);
        if let Some((at, _)) = frames.iter().find(|(_, frame)| frame.good() == ALL) {
            return (*at - on).as_ticks();
        }
    }
    panic!(
        "no whole frame for 10 s: {:?}, {:?}",
        bench.scanner.state(),
        bench.scanner.health()
    );
}

#[test]
fn frames_are_back_by_themselves_within_seconds_of_a_power_cut_at_any_moment() {
    let seed = 0x5EED_0003_u64;
    println!("seed {seed:#x}");
    let (mut random, mut longest) = (seed, 0);
    for round in 0..300 {
        let mut bench = if round % 3 == 0 {
            bench()
        } else {
            bench().up()
        };
        for _ in 0..1 + round % 2 {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            let (before, off) = ((random >> 40) % 1_500_000, (random >> 20) % 4_000_000);
            bench.until(bench.clock.now().as_ticks() + before);
            longest = longest.max(cut(&mut bench, off));
        }
        let frames = bench.for_ms(200);
        assert!(frames.iter().all(|frame| frame.good() == ALL));
        assert_true(&bench, &frames);
        assert!(bench.scanner.link_counters().restarts >= 1);
    }
    println!(
        "whole frames {} ms after power at the latest",
        longest / 1_000
    );
    assert!(longest < 6_000_000, "{longest}");
}

#[test]
fn every_sensor_counts_as_started_anew_after_a_power_cut() {
    let mut bench = bench().up();
    assert_eq!(bench.scanner.counters().starts, [1; 16]);
    cut(&mut bench, 50_000);
    let starts = bench.scanner.counters().starts;
    assert!(starts.iter().all(|starts| *starts >= 2), "{starts:?}");
}

#[test]
fn a_glove_without_power_for_a_minute_is_told_and_comes_back_as_soon() {
    let mut bench = bench().up();
    bench.glove.power(false, bench.clock.now());
    let frames = bench.for_ms(60_000);
    assert!(frames.iter().all(|f: &Frame| f.sequence > 0));
    assert_eq!(bench.scanner.state(), State::NoAnswer);
    assert!(cut(&mut bench, 0) < 6_000_000);
}

#[test]
fn a_glove_fresh_from_power_on_is_found_at_9600_by_the_scanner_alone() {
    let mut bench = Bench::on(
        rig::glove::Config::default(),
        waving,
        glove::scan::Config::default(),
    );
    bench.scanner =
        Scanner::new(bench.wire.clone(), glove::scan::Config::default()).with_set_baud();
    let frames = bench.until(4_000_000);
    assert_eq!(frames.last().map(Frame::good), Some(ALL));
}

#[test]
fn a_search_at_two_speeds_takes_no_longer_in_a_poll_than_one() {
    let mut bench = bench().up();
    bench.glove.power(false, bench.clock.now());
    bench.for_ms(10_000);
    let before = bench.polls;
    bench.clock.advance(Duration::from_ticks(1));
    bench.for_ms(4_000);
    assert!(bench.polls - before < 100, "{} polls", bench.polls - before);
}
