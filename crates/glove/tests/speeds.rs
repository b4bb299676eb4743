//! The serial bridge's speed: found, raised, kept only where it answers without errors, found again.

#![allow(clippy::unwrap_used, reason = "a test may")]

mod common;

use common::{ALL, Bench, assert_true, cost, waving};
use embedded_io::{ErrorKind, ErrorType, Read, ReadReady, Write};
use glove::sc18im::{BaudRefused, RESET_BAUD, SPEEDS, SetBaud};
use glove::scan::{Config, Frame, Scanner};
use glove::{Duration, Instant};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rig::glove::VirtualGlove;
use rig::{Clock, MemoryWire};
use std::cell::RefCell;
use std::rc::Rc;

/// Raised as far as the chip goes.
fn up_to_460800() -> Config {
    Config {
        raise_to: Some(460_800),
        ..Config::default()
    }
}

/// What goes wrong with one serial write.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fault {
    /// Its bytes never leave.
    Swallowed,
    /// Its n-th byte (from the front, modulo its length) is lost.
    Without(usize),
    /// One bit of a byte of it flips.
    Flipped(usize),
    /// The port fails.
    PortError,
    /// Whatever answers it is lost.
    Unanswered,
    /// The glove's power is cut as it leaves, for 20 ms.
    PowerCut,
}

/// What a port does besides its work.
#[derive(Default)]
struct Plan {
    writes: usize,
    fault: Option<(usize, Fault)>,
    deaf: bool,
    /// Highest speed it makes; `Some(0)`: it makes no other than it has.
    most: Option<u32>,
    /// At this speed and above, one byte in so many is spoiled.
    noisy: Option<(u32, u32)>,
    baud: u32,
    asked: Vec<u32>,
    seed: u64,
}

struct Port {
    wire: MemoryWire,
    glove: VirtualGlove,
    clock: Clock,
    plan: Rc<RefCell<Plan>>,
    random: ChaCha8Rng,
}

impl Port {
    fn spoils(&mut self) -> bool {
        let plan = self.plan.borrow();
        let one_in = plan.noisy.filter(|(from, _)| plan.baud >= *from);
        one_in.is_some_and(|(_, one_in)| self.random.next_u32().is_multiple_of(one_in))
    }
}

impl SetBaud for Port {
    fn set_baud(&mut self, baud: u32) -> Result<(), BaudRefused> {
        let mut plan = self.plan.borrow_mut();
        plan.asked.push(baud);
        match plan.most {
            Some(0) => return Err(BaudRefused::Fixed),
            Some(most) if baud > most => return Err(BaudRefused::Unsupported(baud)),
            _ => {}
        }
        plan.baud = baud;
        self.wire.set_baud(baud);
        Ok(())
    }
}

impl ErrorType for Port {
    type Error = ErrorKind;
}

impl ReadReady for Port {
    fn read_ready(&mut self) -> Result<bool, ErrorKind> {
        if self.plan.borrow().deaf {
            let mut lost = [0; 64];
            while self.wire.read_ready().unwrap() {
                let _ = self.wire.read(&mut lost).unwrap();
            }
        }
        Ok(self.wire.read_ready().unwrap())
    }
}

impl Read for Port {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, ErrorKind> {
        let count = self.wire.read(buffer).unwrap();
        for byte in &mut buffer[..count] {
            if self.spoils() {
                *byte ^= 0x10;
            }
        }
        Ok(count)
    }
}

impl Write for Port {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        let (fault, now) = {
            let mut plan = self.plan.borrow_mut();
            let index = plan.writes;
            plan.writes += 1;
            let fault = plan.fault.filter(|(at, _)| *at == index).map(|(_, f)| f);
            plan.deaf = fault == Some(Fault::Unanswered);
            (fault, self.clock.now())
        };
        let mut sent = bytes.to_vec();
        match fault {
            None | Some(Fault::Unanswered) => {}
            Some(Fault::Swallowed) => sent.clear(),
            Some(Fault::Without(n)) => drop(sent.remove(n % bytes.len())),
            Some(Fault::Flipped(n)) => sent[n % bytes.len()] ^= 0x04,
            Some(Fault::PortError) => return Err(ErrorKind::BrokenPipe),
            Some(Fault::PowerCut) => {
                self.glove.power(false, now);
                self.glove.power(true, now + Duration::from_ticks(20_000));
            }
        }
        for byte in &mut sent {
            if self.spoils() {
                *byte ^= 0x10;
            }
        }
        self.wire.write(&sent).unwrap();
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), ErrorKind> {
        panic!("flush would wait")
    }
}

/// A glove at `chip` baud behind a port open at `config.baud`.
struct Loop {
    clock: Clock,
    glove: VirtualGlove,
    plan: Rc<RefCell<Plan>>,
    scanner: Scanner<Port>,
}

impl Loop {
    fn new(chip: u32, config: Config, plan: Plan) -> Self {
        let clock = Clock::new();
        let glove = VirtualGlove::new(Box::new(waving), rig::glove::Config::at_baud(chip));
        let wire = MemoryWire::new(&clock, glove.clone(), config.baud);
        let seed = plan.seed;
        let plan = Rc::new(RefCell::new(Plan {
            baud: config.baud,
            ..plan
        }));
        let port = Port {
            wire,
            glove: glove.clone(),
            clock: clock.clone(),
            plan: plan.clone(),
            random: ChaCha8Rng::seed_from_u64(seed),
        };
        let scanner = Scanner::new(port, config).with_set_baud();
        Self {
            clock,
            glove,
            plan,
            scanner,
        }
    }

    /// Runs until `done`, `most` µs at the longest; what it took.
    fn until(&mut self, most: u64, done: impl Fn(&Scanner<Port>, Option<&Frame>) -> bool) -> u64 {
        let began = self.clock.now().as_ticks();
        loop {
            let now = self.clock.now();
            let frame = self.scanner.poll(now);
            if done(&self.scanner, frame.as_ref()) {
                return now.as_ticks() - began;
            }
            assert!(
                now.as_ticks() - began < most,
                "not within {most} us: {:?} at {} baud, chip at {}, {:?}",
                self.scanner.state(),
                self.scanner.baud(),
                rig::Device::baud(&self.glove),
                self.scanner.link_counters()
            );
            let due = self.scanner.next_due().unwrap_or(now);
            let next = Instant::from_ticks(now.as_ticks() + 1);
            self.clock.wait_until(due.max(next));
        }
    }

    fn clone_of_glove(&self) -> VirtualGlove {
        self.glove.clone()
    }

    fn cut_power(&mut self) {
        let now = self.clock.now();
        self.glove.power(false, now);
        self.glove.power(true, now);
    }

    fn until_whole(&mut self, most: u64) -> u64 {
        self.until(most, |_, frame| frame.is_some_and(|f| f.good() == ALL))
    }
}

#[test]
fn a_chip_is_found_at_each_of_four_speeds_whatever_the_ports_is_and_raised_to_the_limit() {
    let (mut longest, mut slowest) = (0, 0.0f64);
    for chip in SPEEDS {
        for port in SPEEDS {
            for limit in SPEEDS.into_iter().filter(|limit| *limit >= port) {
                let config = Config {
                    baud: port,
                    raise_to: Some(limit),
                    ..Config::default()
                };
                let mut bench = Loop::new(chip, config, Plan::default());
                let took = bench.until(4_000_000, |s, _| s.state() != glove::scan::State::Resync);
                longest = longest.max(took);
                assert_eq!(bench.scanner.baud(), limit, "chip {chip}, port {port}");
                let whole = bench.until_whole(cost::bring_up(limit));
                slowest = slowest.max(whole as f64 / cost::bring_up(limit) as f64);
                assert_eq!(rig::Device::baud(&bench.glove), limit);
            }
        }
    }
    println!(
        "in step {} ms after the start at the latest; then whole in {slowest:.2} of the arithmetic ({} ms at 9,600 baud)",
        longest / 1_000,
        cost::bring_up(RESET_BAUD) / 1_000
    );
}

#[test]
fn without_a_limit_the_ports_own_speed_is_kept() {
    for chip in SPEEDS {
        let mut bench = Loop::new(chip, Config::default(), Plan::default());
        bench.until_whole(6_000_000);
        assert_eq!(bench.scanner.baud(), 115_200, "chip at {chip}");
    }
}

#[test]
fn a_limit_between_two_speeds_is_the_lower_of_them() {
    let config = Config {
        raise_to: Some(400_000),
        ..Config::default()
    };
    let mut bench = Loop::new(RESET_BAUD, config, Plan::default());
    bench.until_whole(6_000_000);
    assert_eq!(bench.scanner.baud(), 230_400);
}

#[test]
fn a_port_that_cannot_change_its_speed_says_so_and_stays() {
    let plan = Plan {
        most: Some(0),
        ..Plan::default()
    };
    let mut bench = Loop::new(115_200, up_to_460800(), plan);
    bench.until_whole(3_000_000);
    assert!(bench.scanner.bus_mut().is_fixed_speed());
    assert_eq!(bench.scanner.baud(), 115_200);
    assert_eq!(bench.plan.borrow().asked, [460_800], "asked once");
    assert_eq!(bench.scanner.link_counters().speed_changes, 0);
    // A glove that lost its power is silent then, and costs nothing.
    bench.glove.reset_bridge(bench.clock.now());
    bench.until(6_000_000, |s, _| s.state() == glove::scan::State::NoAnswer);
    assert_eq!(bench.plan.borrow().asked, [460_800]);
}

#[test]
fn a_speed_that_the_port_cannot_make_is_never_told_to_the_chip() {
    let plan = Plan {
        most: Some(230_400),
        ..Plan::default()
    };
    let mut bench = Loop::new(RESET_BAUD, up_to_460800(), plan);
    bench.until_whole(5_000_000);
    assert_eq!(bench.scanner.baud(), 230_400);
    let counters = *bench.scanner.link_counters();
    assert_eq!((counters.speed_changes, counters.speeds_refused), (1, 1));
}

#[test]
fn a_speed_at_which_bytes_are_spoiled_is_left_for_the_next_lower_one() {
    let (mut lost, mut all) = (0, 0);
    for one_in in [12, 25, 60, 150] {
        for from in [460_800, 230_400] {
            let lower = if from == 460_800 { 230_400 } else { 115_200 };
            let mut longest = 0;
            for seed in 0..10 {
                all += 1;
                let plan = Plan {
                    noisy: Some((from, one_in)),
                    seed,
                    ..Plan::default()
                };
                let mut bench = Loop::new(RESET_BAUD, up_to_460800(), plan);
                let glove = bench.clone_of_glove();
                // The divisor itself may be spoiled on its way: then the chip is where nobody looks.
                let gone = move || !SPEEDS.contains(&rig::Device::baud(&glove));
                let is_gone = gone.clone();
                longest = longest.max(bench.until(60_000_000, move |s, frame| {
                    s.baud() == lower && frame.is_some_and(|f| f.good() == ALL) || is_gone()
                }));
                if gone() {
                    lost += 1;
                    continue;
                }
                for _ in 0..50 {
                    bench.until_whole(400_000);
                }
                assert_eq!(bench.scanner.baud(), lower, "and stays there");
            }
            println!(
                "one byte in {one_in} spoiled from {from} on: at {lower} after {} ms at the latest",
                longest / 1_000
            );
        }
    }
    println!("{lost} of {all} chips were sent to another speed by a spoiled divisor");
    assert!(lost * 10 <= all, "{lost} of {all}");
}

#[test]
fn whatever_fails_in_a_baud_change_at_whatever_write_the_chip_is_found_again() {
    let faults = [
        Fault::Swallowed,
        Fault::PortError,
        Fault::Unanswered,
        Fault::PowerCut,
    ];
    let bytes = (0..6).flat_map(|n| [Fault::Without(n), Fault::Flipped(n)]);
    let (mut longest, mut cases, mut gone) = (0, 0, Vec::new());
    for fault in faults.into_iter().chain(bytes) {
        // From 9,600 and from 115,200: status, trial, the new speed, its trial, the clock, the first transactions.
        for (chip, writes) in [(RESET_BAUD, 10), (115_200, 8)] {
            for at in 0..writes {
                let plan = Plan {
                    fault: Some((at, fault)),
                    ..Plan::default()
                };
                let mut bench = Loop::new(chip, up_to_460800(), plan);
                let known = bench.clone_of_glove();
                let lost = move || !SPEEDS.contains(&rig::Device::baud(&known));
                let is_lost = lost.clone();
                let took = bench.until(12_000_000, move |_, frame| {
                    frame.is_some_and(|f| f.good() == ALL) || is_lost()
                });
                if lost() {
                    gone.push((fault, chip, at));
                    bench.cut_power();
                    bench.until_whole(12_000_000);
                }
                longest = longest.max(took);
                assert!(bench.plan.borrow().writes > at);
                // One fault is no reason for a lower speed.
                assert_eq!(bench.scanner.baud(), 460_800, "{fault:?} at write {at}");
                cases += 1;
            }
        }
    }
    println!(
        "{cases} cases: whole frames {} ms after the start at the latest; by a power cut only: {gone:?}",
        longest / 1_000
    );
    // A lost byte never does it. A flipped bit can be in the divisor, in the register's number, or make `S` (a transaction) a
    // `W` whose data are a divisor then.
    let flipped = |fault: &Fault| matches!(fault, Fault::Flipped(_));
    assert!(gone.iter().all(|(fault, ..)| flipped(fault)), "{gone:?}");
    assert!(gone.len() * 20 < cases, "{gone:?}");
}

#[test]
fn a_brown_out_in_mid_session_is_back_at_the_raised_speed_by_itself() {
    let mut longest = 0;
    for round in 0..60u64 {
        let mut bench = Loop::new(115_200, up_to_460800(), Plan::default());
        bench.until_whole(6_000_000);
        for cut in 0..3u64 {
            // At another moment of a scan each time.
            let moment = bench.clock.now().as_ticks() + (round * 7_919 + cut * 613) % 25_000;
            let clock = bench.clock.clone();
            bench.until(100_000, move |_, _| clock.now().as_ticks() >= moment);
            bench.cut_power();
            // Frames of before may still come: the bridge must have gone down.
            let restarts = bench.scanner.link_counters().restarts;
            longest = longest.max(bench.until(8_000_000, |s, frame| {
                s.link_counters().restarts > restarts && frame.is_some_and(|f| f.good() == ALL)
            }));
            assert_eq!(bench.scanner.baud(), 460_800);
        }
    }
    println!(
        "whole frames {} ms after the cut at the latest",
        longest / 1_000
    );
    assert!(longest < 6_000_000);
}

#[test]
fn a_cable_pulled_for_long_and_put_back_costs_no_speed() {
    let mut bench = Bench::on(rig::glove::Config::at_baud(115_200), waving, up_to_460800());
    bench.scanner = Scanner::new(bench.wire.clone(), up_to_460800()).with_set_baud();
    let mut bench = bench.up();
    assert_eq!(bench.scanner.baud(), 460_800);
    for _ in 0..10 {
        bench.wire.unplug(true);
        bench.for_ms(7_000);
        bench.wire.unplug(false);
        let frames = bench.for_ms(5_000);
        assert_eq!(frames.last().map(Frame::good), Some(ALL));
        assert_true(&bench, &frames);
        assert_eq!(bench.scanner.baud(), 460_800);
    }
}

/// Scans a second at `baud`, on a wire that takes its time for every byte.
fn rate(baud: u32, status_checks: bool) -> f64 {
    let config = Config {
        status_checks,
        ..Config::default()
    };
    let mut bench = Bench::with(waving, baud, config).up();
    let frames = bench.until_timed(5_000_000);
    assert!(frames.iter().all(|(_, f)| f.good() == ALL));
    let (first, last) = (frames[0].0, frames[frames.len() - 1].0);
    (frames.len() - 1) as f64 * 1e6 / (last - first).as_ticks() as f64
}

#[test]
fn rates_are_nine_tenths_of_the_arithmetic_or_more_with_status_checks_and_without() {
    for baud in [115_200, 230_400, 460_800] {
        for checks in [false, true] {
            // 272 bytes a scan (timing.rs), four more a read with its status; 4.3 ms on the bus.
            let bytes = if checks { 272 + 16 * 4 } else { 272 };
            let arithmetic = 1e6 / (f64::from(bytes) * 1e7 / f64::from(baud) + 4_300.0);
            let rate = rate(baud, checks);
            let with = if checks { "with" } else { "without" };
            println!(
                "{baud} baud {with} status checks: {rate:.1} scans/s, arithmetic {arithmetic:.1}"
            );
            assert!(rate >= 0.9 * arithmetic, "{baud} {with}: {rate}");
            let least = match (baud, checks) {
                (460_800, false) => 80.0,
                (460_800, true) => 67.0,
                _ => 0.0,
            };
            assert!(rate >= least, "{baud} {with}: {rate}");
        }
    }
}

#[test]
fn with_status_checks_a_failed_read_is_named_as_without() {
    let config = Config {
        status_checks: true,
        ..Config::default()
    };
    let mut bench = Bench::with(waving, 115_200, config).up();
    bench.glove.nack(5, 1);
    let frames = bench.for_ms(400);
    let lost = frames.iter().filter(|f| f.good() != ALL).count();
    assert!((1..=2).contains(&lost), "{lost}");
    assert_eq!(bench.scanner.counters().starts[5], 1);
    assert_eq!(bench.scanner.link_counters().resyncs, 0);
}
