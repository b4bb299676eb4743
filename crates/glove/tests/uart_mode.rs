//! The scanner on sensors in UART mode behind a channel selector: real bytes, byte-timed wire, virtual clock.

#![allow(clippy::unwrap_used, reason = "a test may")]

mod common;

use common::{ALL, assert_measured, waving};
use glove::imu;
use glove::scan::{BusScanner, Config, Frame, Health};
use glove::uart::{BAUD, SensorUart};
use glove::{Instant, bus, mux};
use rig::glove::{UartGlove, UartSelector, UartUpset, VirtualGlove};
use rig::{Clock, MemoryWire};

/// The sensors have booted, µs.
const BOOTED: u64 = 700_000;

struct Bench {
    clock: Clock,
    glove: VirtualGlove,
    uart: UartGlove,
    wire: MemoryWire,
    scanner: BusScanner<SensorUart<MemoryWire, UartSelector>>,
}

impl Bench {
    fn new() -> Self {
        let clock = Clock::new();
        clock.set(Instant::from_ticks(BOOTED));
        let glove = VirtualGlove::new(Box::new(waving), rig::glove::Config::default());
        let (uart, selector) = glove.uart();
        let wire = MemoryWire::new(&clock, uart.clone(), BAUD);
        let bus = SensorUart::new(wire.clone(), selector, mux::ADDRESS);
        Self {
            scanner: BusScanner::on(bus, Config::default()),
            clock,
            glove,
            uart,
            wire,
        }
    }

    fn up() -> Self {
        let mut bench = Self::new();
        while bench.next_frame().good() != ALL {}
        bench
    }

    fn now(&self) -> u64 {
        self.clock.now().as_ticks()
    }

    /// Runs until the next frame or `end`.
    fn frame_until(&mut self, end: u64) -> Option<Frame> {
        let end = Instant::from_ticks(end);
        while self.clock.now() < end {
            let now = self.clock.now();
            if let Some(frame) = self.scanner.poll(now) {
                assert_measured(&self.glove, &[frame]);
                return Some(frame);
            }
            let due = self.scanner.next_due().unwrap_or(end).min(end);
            self.clock
                .wait_until(due.max(Instant::from_ticks(now.as_ticks() + 1)));
        }
        None
    }

    fn next_frame(&mut self) -> Frame {
        let end = self.now() + 4_000_000;
        self.frame_until(end)
            .unwrap_or_else(|| panic!("no frame: {:?}", self.scanner.health()))
    }

    fn for_ms(&mut self, ms: u64) -> Vec<Frame> {
        let end = self.now() + ms * 1_000;
        core::iter::from_fn(|| self.frame_until(end)).collect()
    }
}

#[test]
fn all_sixteen_sensors_come_up_and_are_scanned_at_the_pace_of_the_bytes() {
    let mut bench = Bench::up();
    println!("up after {} ms", (bench.now() - BOOTED) / 1_000);
    let frames = bench.for_ms(5_000);
    assert!(frames.iter().all(|frame| frame.good() == ALL));
    // 224 bytes, 16 turns of the selector, and 0.3 ms that each sensor thinks.
    let arithmetic = 1e6 / (224.0 * 86.8 + 16.0 * (87.0 + 300.0));
    let rate = frames.len() as f64 / 5.0;
    println!("{rate:.1} scans a second, by arithmetic {arithmetic:.1}");
    assert!(rate >= 0.9 * arithmetic);
    let counters = *bench.scanner.bus_mut().counters();
    assert_eq!((counters.overruns, counters.garbled), (0, 0));
    assert_eq!(
        (0..16).filter(|k| bench.glove.sensor_mode(*k) == 8).count(),
        16
    );
}

#[test]
fn overruns_cost_time_and_no_samples() {
    for share in [0.02, 0.1, 0.5] {
        let mut bench = Bench::new();
        bench.uart.overruns(share, 7);
        while bench.next_frame().good() != ALL {}
        let frames = bench.for_ms(3_000);
        println!("{share}: {:.1} scans a second", frames.len() as f64 / 3.0);
        assert!(frames.iter().all(|frame| frame.good() == ALL));
        assert!(bench.uart.counters().overruns > 10);
    }
}

/// One command of bring-up and three scans fails, in each way: the sensor and the register are named where it is not asked again,
/// frames are true (checked in each), at most one of them is not whole, and it does not last.
#[test]
fn any_one_command_may_fail() {
    let mut bench = Bench::new();
    let mut whole = 0;
    let (mut until_first, mut first_at) = (0, 0);
    while whole < 3 {
        if bench.next_frame().good() == ALL {
            whole += 1;
            if whole == 1 {
                (until_first, first_at) = (bench.uart.counters().commands, bench.now());
            }
        }
    }
    let commands = bench.uart.counters().commands;
    println!("{commands} commands, {until_first} of them until the first whole frame");
    let overrun = |times| UartUpset::Refused { status: 7, times };
    let refused = |status| UartUpset::Refused { status, times: 1 };
    let kinds = [
        (overrun(1), false),
        (overrun(5), false),
        (overrun(6), true),
        (refused(2), false),
        (refused(4), true),
        (refused(9), true),
        (UartUpset::Silent, true),
        (UartUpset::Short(1), false),
        (UartUpset::Flipped { byte: 0, bit: 3 }, false),
        (UartUpset::Flipped { byte: 1, bit: 0 }, false),
        (UartUpset::Flipped { byte: 3, bit: 7 }, false),
        (UartUpset::Noise(0x00), false),
        (UartUpset::Noise(0xBB), false),
        (UartUpset::Noise(0xEE), false),
    ];
    for (upset, is_named) in kinds {
        let mut latest = 0;
        for number in 0..commands {
            let mut bench = Bench::new();
            bench.uart.upset(number, upset);
            let (mut since, mut spoiled, mut whole_at) = (0, 0, None);
            while since < 3 || whole_at.is_none() {
                let frame = bench.next_frame();
                if bench.uart.upset_met().is_none() {
                    continue;
                }
                since += 1;
                match frame.good() {
                    ALL => whole_at = whole_at.or(Some(bench.now())),
                    _ if since <= 3 => spoiled += 1,
                    _ => {}
                }
            }
            let met = bench.uart.upset_met().unwrap();
            let troubles = bench.scanner.troubles();
            let told: Vec<_> = (0..16)
                .filter_map(|k| Some((k, troubles[k]?.error)))
                .collect();
            let about = format!("{upset:?} in {number}, {met:02X?}: {told:?}");
            let (sensor, register) = met;
            let resets = register == 0x3F && told.is_empty();
            assert!(
                !is_named || !told.is_empty() || resets,
                "not named: {about}"
            );
            for (k, error) in &told {
                let named = match error {
                    imu::Error::Bus { register, .. } | imu::Error::ReadBack { register, .. } => {
                        *register
                    }
                    imu::Error::ChipId(_) => 0x00,
                    imu::Error::NotRunning { .. } => 0x39,
                    imu::Error::Rejected(_) => 0x20,
                    other => panic!("{other:?}: {about}"),
                };
                assert_eq!((*k, named), (sensor, register), "{about}");
            }
            assert!(number < until_first || spoiled <= 1, "{spoiled}: {about}");
            let late = whole_at.unwrap().saturating_sub(first_at);
            assert!(late < 250_000, "{late} us: {about}");
            latest = latest.max(late);
            assert!((0..16).all(|k| bench.glove.sensor_mode(k) == 8), "{about}");
            assert!((0..16).all(|k| bench.glove.sensor_register(k, 0, 0x3B) == 0));
        }
        println!("{upset:?}: whole {latest} us later at most");
    }
}

#[test]
fn a_sensor_that_is_silent_is_named_and_comes_back_while_the_others_go_on() {
    let mut bench = Bench::up();
    bench.glove.unplug(9, true);
    let frames = bench.for_ms(3_000);
    assert_eq!(frames.last().unwrap().good(), ALL & !(1 << 9));
    // For a second it is asked once a scan, 26 ms each, since it may only be booting.
    assert!(frames.len() > 60, "{} frames", frames.len());
    let silent = |health| {
        matches!(
            health,
            Health::Missing(imu::Error::Bus {
                cause: bus::Error::Lost { received: 0, .. },
                ..
            })
        )
    };
    assert!(silent(frames.last().unwrap().samples[9].health));
    bench.glove.unplug(9, false);
    assert_eq!(bench.for_ms(4_000).last().unwrap().good(), ALL);
}

#[test]
fn a_sensor_that_resets_itself_is_set_up_again() {
    let mut bench = Bench::up();
    bench.glove.reset_sensor(5, bench.clock.now());
    let frames = bench.for_ms(2_500);
    assert!(frames.iter().all(|frame| frame.good() | 1 << 5 == ALL));
    assert_eq!(frames.last().unwrap().good(), ALL);
    assert_eq!(bench.scanner.counters().starts[5], 2);
}

#[test]
fn a_selector_that_does_not_switch_is_told_and_no_finger_shows_another() {
    let mut bench = Bench::up();
    bench.uart.stick_selector(true);
    let frames = bench.for_ms(500);
    assert_eq!(frames.last().map_or(0, Frame::good), 0);
    let failed = |trouble: Option<glove::scan::Trouble>| {
        matches!(
            trouble.map(|trouble| trouble.error),
            Some(imu::Error::Bus {
                cause: bus::Error::Other,
                ..
            })
        )
    };
    assert!(bench.scanner.troubles().into_iter().all(failed));
    bench.uart.stick_selector(false);
    assert_eq!(bench.for_ms(6_000).last().unwrap().good(), ALL);
}

#[test]
fn a_port_that_fails_is_tried_twice_a_second_and_used_again() {
    let mut bench = Bench::up();
    bench.wire.unplug(true);
    let mut polls = 0;
    let end = bench.now() + 10_000_000;
    while bench.now() < end {
        polls += 1;
        let now = bench.clock.now();
        bench.scanner.poll(now);
        let due = bench.scanner.next_due().unwrap().as_ticks();
        bench
            .clock
            .set(Instant::from_ticks(due.clamp(now.as_ticks() + 1, end)));
    }
    assert!(polls < 200, "{polls} polls");
    assert_eq!(bench.scanner.state(), glove::scan::State::NoAnswer);
    bench.wire.unplug(false);
    assert_eq!(bench.for_ms(3_000).last().unwrap().good(), ALL);
}

#[test]
fn bytes_nobody_asked_for_never_make_a_wrong_frame() {
    use embedded_io::Write;
    let mut bench = Bench::up();
    let mut state = 99u64;
    for _ in 0..400 {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        bench.for_ms(state >> 59);
        let noise = state.to_le_bytes();
        // What reaches a sensor between two commands is the start of a wrong one.
        let bytes = noise[..1 + (state >> 61) as usize % 4].iter();
        let bytes: Vec<u8> = bytes.map(|b| if *b == 0xAA { 0 } else { *b }).collect();
        bench
            .scanner
            .bus_mut()
            .serial_mut()
            .write_all(&bytes)
            .unwrap();
    }
    assert_eq!(bench.for_ms(5_000).last().unwrap().good(), ALL);
}

#[test]
fn a_line_that_loses_doubles_and_flips_bytes_is_outlived() {
    use rig::faulty::{Faults, Faulty};
    let clock = Clock::new();
    clock.set(Instant::from_ticks(BOOTED));
    let glove = VirtualGlove::new(Box::new(waving), rig::glove::Config::default());
    let (uart, selector) = glove.uart();
    let bad = Faults {
        drop: 0.01,
        flip: 0.01,
        duplicate: 0.01,
        delay: 0.01,
        ..Faults::default()
    };
    let line = Faulty::new(MemoryWire::new(&clock, uart, BAUD), &clock, 13, bad, bad);
    let faults = line.control();
    let bus = SensorUart::new(line, selector, mux::ADDRESS);
    let mut scanner = BusScanner::on(bus, Config::default());
    let (mut frames, mut whole) = (0, 0);
    while clock.now().as_ticks() < 20_000_000 {
        if clock.now().as_ticks() > 15_000_000 {
            faults.to_device(Faults::default());
            faults.to_client(Faults::default());
        }
        let now = clock.now();
        if let Some(frame) = scanner.poll(now) {
            frames += 1;
            whole = if frame.good() == ALL { whole + 1 } else { 0 };
        }
        let due = scanner.next_due().unwrap_or(now);
        clock.wait_until(due.max(Instant::from_ticks(now.as_ticks() + 1)));
    }
    println!("{frames} frames, {:?}", scanner.bus_mut().counters());
    assert!(
        whole > 50,
        "{whole} of {frames} since: {:?}",
        scanner.health()
    );
}
