//! A glove that is read by itself, behind a pseudo-terminal.
#![allow(missing_docs, clippy::unwrap_used)]

use std::path::Path;
use std::time::Duration;

use glove::hand::JOINT_COUNT;
use glove::scan::{Finding, Health, State};
use host::clock::Clock;
use host::interrupt::Interrupt;
use host::lines::port::BAUD;
use host::scanning::{self, Scanning, Settings};
use rig::glove::{Config, VirtualGlove};
use rig::pty::{Handle, PtyDevice};

/// Longer than anything takes on a busy machine.
const LONG: Duration = Duration::from_secs(60);

struct Bench {
    glove: VirtualGlove,
    handle: Handle,
    interrupt: Interrupt,
    clock: Clock,
}

impl Bench {
    fn new(link: Option<&Path>) -> Self {
        let pose = |t: f64| [0.3 * (t as f32).sin(); JOINT_COUNT];
        let glove = VirtualGlove::new(Box::new(pose), Config::at_baud(BAUD));
        let handle = PtyDevice::spawn(Box::new(glove.clone()), link).unwrap();
        Self {
            glove,
            handle,
            interrupt: Interrupt::never().unwrap(),
            clock: Clock::start(),
        }
    }

    fn open(&self, settings: Settings) -> Scanning {
        let path = self.handle.path();
        let open = scanning::open(path, settings, self.clock, &self.interrupt).unwrap();
        assert_eq!(open.missing.faults(), 0, "{:?}", open.missing);
        open.scanning
    }
}

#[test]
fn every_scan_comes_in_order_with_the_sensors_ids_and_their_health() {
    let bench = Bench::new(None);
    let mut scanning = bench.open(Settings::default());
    let scans: Vec<_> = (0..20).map(|_| scanning.next(LONG).unwrap()).collect();
    for pair in scans.windows(2) {
        assert_eq!(pair[1].frame.sequence, pair[0].frame.sequence + 1);
        assert!(pair[1].at > pair[0].at);
    }
    assert_eq!(scans[19].frame.good(), u16::MAX);
    assert_eq!(scans[19].starts, [1; 16]);
    let seen = scanning.snapshot().unwrap();
    assert_eq!(
        (seen.state, seen.good(), seen.not_taken),
        (State::Scanning, 16, 0)
    );
    assert!(seen.is_plugged && seen.rate > 0.0 && seen.interval_us.is_some());
    let ids = seen.ids().map(Option::unwrap);
    assert!((1..16).all(|k| !ids[..k].contains(&ids[k])));
    scanning.stop().unwrap();
    assert!(!scanning.running());
}

#[test]
fn scans_that_nobody_takes_are_counted_and_those_that_wait_stay_in_order() {
    let bench = Bench::new(None);
    let mut scanning = bench.open(Settings {
        queue: 2,
        ..Settings::default()
    });
    assert!(scanning.wait(LONG, &bench.interrupt, |seen| seen.not_taken >= 5));
    scanning.stop().unwrap();
    let seen = scanning.snapshot().unwrap();
    let waited: Vec<_> = scanning.waiting().collect();
    assert_eq!(waited.len(), 2);
    assert_eq!(seen.not_taken + 2, seen.frames);
    assert_eq!(waited[0].frame.sequence + 1, waited[1].frame.sequence);
    assert_eq!(scanning.next(LONG), None, "it has ended");
}

#[test]
fn a_sensor_that_freezes_is_found_and_its_lost_scans_are_counted() {
    let bench = Bench::new(None);
    let scanning = bench.open(Settings::default());
    scanning.begin();
    bench.glove.freeze(5, true);
    assert!(scanning.wait(LONG, &bench.interrupt, |seen| seen.sensors[5].lost > 3));
    let seen = scanning.snapshot().unwrap();
    assert!(
        matches!(seen.health()[5], Health::Rejected(_) | Health::Starting),
        "{:?}",
        seen.health()[5]
    );
    assert_eq!(seen.sensors[4].lost, 0);
    let mut before = 0;
    let findings = scanning.findings(&mut before);
    assert!(
        findings.contains(&Finding::Frozen { segment: 5 }),
        "{findings:?}"
    );
    assert!(scanning.findings(&mut before).is_empty());
}

#[test]
fn a_glove_that_is_unplugged_is_waited_for_and_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("glove");
    let bench = Bench::new(Some(&link));
    let interrupt = bench.interrupt.clone();
    let scanning = bench.open(Settings::default());
    drop(bench);
    assert!(scanning.wait(LONG, &interrupt, |seen| !seen.is_plugged));
    let frames = scanning.snapshot().unwrap().frames;
    let _again = Bench::new(Some(&link));
    assert!(scanning.wait(LONG, &interrupt, |seen| seen.frames > frames + 10));
    let seen = scanning.snapshot().unwrap();
    assert!(seen.is_plugged);
    assert_eq!(seen.unplugged, 1);
}

#[test]
fn a_glove_whose_sensors_are_gone_is_refused_by_the_layer_and_the_end_is_heard_while_it_is_waited_for()
 {
    let bench = Bench::new(None);
    bench.glove.unplug_mux(true);
    bench.interrupt.ask();
    let path = bench.handle.path();
    let asked = scanning::open(path, Settings::default(), bench.clock, &bench.interrupt);
    assert!(asked.unwrap_err().to_string().contains("interrupted"));
    let never = Interrupt::never().unwrap();
    let refused = scanning::open(path, Settings::default(), bench.clock, &never);
    let told = refused.unwrap_err().to_string();
    assert!(told.contains("no sensor sent an orientation"), "{told}");
    assert!(told.contains("multiplexer (TCA9548A) is missing"), "{told}");
}
