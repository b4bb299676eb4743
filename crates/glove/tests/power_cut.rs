//! A glove whose power is cut and comes back: the serial bridge speaks 9,600 baud again, the sensors are as after power-on.

mod common;

use common::{ALL, Bench, assert_true, waving};
use glove::Duration;
use glove::imu::{self, UniqueId};
use glove::scan::{Finding, Frame, Scanner, State};

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
    let (mut random, mut longest, mut met) = (seed, 0, Vec::new());
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
            if round % 4 == 3 {
                // It comes back for a moment only: cut again while the scanner may still look for it.
                let (away, back) = ((random >> 30) % 5_000_000, (random >> 10) % 1_500_000);
                bench.glove.power(false, bench.clock.now());
                bench.until(bench.clock.now().as_ticks() + away);
                bench.glove.power(true, bench.clock.now());
                bench.until(bench.clock.now().as_ticks() + back);
            }
            met.push(bench.scanner.state());
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
    for state in [
        State::NoAnswer,
        State::Resync,
        State::Starting,
        State::Scanning,
    ] {
        let cuts = met.iter().filter(|met| **met == state).count();
        println!("{cuts} cuts in {state:?}");
        assert!(cuts > 0, "never in {state:?}");
    }
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

/// Each sensor is another, built as number 40 and on.
fn exchange_all(bench: &Bench) {
    for k in 0..16 {
        bench.glove.exchange_sensor(k, 40 + k);
    }
}

/// Every frame of `ms`: whoever gives a good sample in it has told its id since, another than in `before`. How many were whole.
fn none_used_unasked(bench: &mut Bench, before: &[Option<UniqueId>; 16], ms: u64) -> usize {
    let (mut whole, end) = (0, bench.clock.now().as_ticks() + ms * 1_000);
    while bench.clock.now().as_ticks() < end {
        let Some(frame) = bench.next_frame_until(end) else {
            break;
        };
        let ids = bench.scanner.ids();
        for k in (0..16).filter(|k| frame.good() >> k & 1 == 1) {
            assert!(ids[k].is_some() && ids[k] != before[k], "{k}: {:?}", ids[k]);
        }
        whole += usize::from(frame.good() == ALL);
    }
    whole
}

#[test]
fn another_glove_on_the_same_port_gives_no_sample_before_it_was_asked_who_it_is() {
    // Its supply is cut and it comes back as after power-on; and a cable pulled out of one glove and put into another that runs.
    for is_power in [true, false] {
        let mut bench = bench().up();
        bench.for_ms(1_000);
        let before = bench.scanner.ids();
        assert!(before.iter().all(Option::is_some));
        match is_power {
            true => bench.glove.power(false, bench.clock.now()),
            false => bench.wire.unplug(true),
        }
        bench.for_ms(700);
        exchange_all(&bench);
        match is_power {
            true => bench.glove.power(true, bench.clock.now()),
            false => bench.wire.unplug(false),
        }
        let whole = none_used_unasked(&mut bench, &before, 9_000);
        assert!(whole > 20, "power: {is_power}, {whole} whole frames");
        let named = core::iter::from_fn(|| bench.scanner.next_finding()).filter(|finding| {
            let other = imu::Error::OtherSensor;
            matches!(finding, Finding::WrongSensor { error, .. } if *error == other)
        });
        assert_eq!(named.count(), 16, "power: {is_power}");
    }
}

#[test]
fn the_same_glove_on_a_line_that_was_away_goes_on_without_a_start() {
    let mut bench = bench().up();
    let ids = bench.scanner.ids();
    bench.wire.unplug(true);
    bench.for_ms(700);
    bench.wire.unplug(false);
    let frames = bench.for_ms(3_000);
    assert_eq!(frames.last().map(Frame::good), Some(ALL));
    assert_eq!(bench.scanner.counters().starts, [1; 16]);
    assert_eq!(bench.scanner.ids(), ids);
}

#[test]
fn one_sensor_exchanged_within_half_a_second_is_asked_who_it_is() {
    let mut bench = bench().up();
    let before = bench.scanner.ids();
    bench.glove.unplug(6, true);
    bench.for_ms(300);
    bench.glove.exchange_sensor(6, 40);
    bench.glove.reset_sensor(6, bench.clock.now());
    bench.glove.unplug(6, false);
    let end = bench.clock.now().as_ticks() + 4_000_000;
    while let Some(frame) = bench.next_frame_until(end) {
        let id = bench.scanner.ids()[6];
        assert!(!frame.samples[6].health.is_good() || id != before[6]);
    }
    assert_ne!(bench.scanner.ids()[6], before[6]);
    assert_eq!(bench.scanner.ids()[5], before[5]);
    assert_eq!(bench.for_ms(100).last().map(Frame::good), Some(ALL));
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
