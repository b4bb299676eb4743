//! Exact transactions, against `embedded-hal-mock`.

use super::ALL;
use crate::bus::{self, Direct};
use crate::scan::{BusScanner, Config, Frame, Health};
use crate::{Instant, imu};
use embedded_hal::i2c::{ErrorKind, NoAcknowledgeSource};
use embedded_hal_mock::eh1::i2c::{Mock, Transaction as Expect};

extern crate std;
use std::vec;
use std::vec::Vec;

#[test]
fn one_scan_on_a_scripted_bus_is_exactly_these_transactions() {
    let mut script = bring_up_of_all();
    script.extend(first_scan());
    // The second scan reads without writing the register pointer; the first selection of channel 2 does not take.
    script.extend(second_scan());
    // The third begins as the second ends.
    script.extend(select(0, 0x01));
    script.push(Expect::read(0x28, ONE.to_vec()));
    let frames = run_script(&script, 2);
    assert_eq!(frames[0].good(), ALL);
    // The failed selection loses sensor 4's sample; sensor 5 selects anew and is read.
    assert_eq!(frames[1].good(), ALL & !(1 << 4));
    let wrong = imu::Error::Mux(bus::Error::Status(0x02));
    assert_eq!(frames[1].samples[4].health, Health::Missing(wrong));
}

#[test]
fn a_selection_that_is_not_acknowledged_is_forgotten() {
    let nack = ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address);
    let mut script = bring_up_of_all();
    script.push(Expect::write(0x70, vec![0x01]).with_error(nack));
    // Sensor 1 does not rely on channel 0.
    script.extend(select(0, 0x01));
    script.extend(first_scan().into_iter().skip(3));
    // Sensor 0 is rechecked between the scans, on a channel selected anew.
    script.extend(select(0, 0x01));
    let frames = run_script(&script, 1);
    assert_eq!(frames[0].good(), ALL & !1);
    let cause = imu::Error::Bus {
        register: 0x20,
        cause: bus::Error::NackAddress,
    };
    assert_eq!(frames[0].samples[0].health, Health::Missing(cause));
}

#[test]
fn a_channel_is_forgotten_on_any_bus_error() {
    let nack = ErrorKind::NoAcknowledge(NoAcknowledgeSource::Data);
    let mut script = bring_up_of_all();
    script.extend(first_scan());
    // The last sensor's read fails on a channel that was selected and read back.
    let last = script.pop().unwrap();
    script.push(last.with_error(nack));
    // It is rechecked at once, and its channel is not believed.
    script.extend(select(7, 0x80));
    let frames = run_script(&script, 1);
    assert_eq!(frames[0].good(), ALL & !(1 << 15));
}

/// Runs a scanner on a scripted I²C bus until it has given so many frames; the script must be used up.
fn run_script(script: &[Expect], count: usize) -> Vec<Frame> {
    let mut scanner = BusScanner::on(Direct::new(Mock::new(script)), Config::default());
    let mut frames = Vec::new();
    let mut now = 0;
    while frames.len() < count {
        frames.extend(scanner.poll(Instant::from_ticks(now)));
        now = scanner
            .next_due()
            .map_or(0, |due| due.as_ticks())
            .max(now + 1);
        assert!(now < 2_000_000);
    }
    scanner.into_bus().release().done();
    frames
}

fn select(channel: u8, read_back: u8) -> [Expect; 2] {
    [
        Expect::write(0x70, vec![1 << channel]),
        Expect::read(0x70, vec![read_back]),
    ]
}

/// The bring-up of 16 sensors: every step for all of them in turn, each sensor's after its channel's selection.
fn bring_up_of_all() -> Vec<Expect> {
    let mut script = Vec::new();
    let mut selected = None;
    let mut step = |lines: &dyn Fn(u8) -> Vec<Expect>| {
        for k in 0..16u8 {
            if selected != Some(k / 2) {
                script.extend(select(k / 2, 1 << (k / 2)));
                selected = Some(k / 2);
            }
            script.extend(lines(0x28 + k % 2));
        }
    };
    let page = |a| Expect::write(a, vec![7, 0]);
    let read = |a, r, v: u8| Expect::write_read(a, vec![r], vec![v]);
    let write = |a, r, v| Expect::write(a, vec![r, v]);
    // All ids the same byte, as no sensor has them: they are not judged.
    let unique = |a| Expect::write_read(a, vec![0x50], vec![0; 16]);
    step(&|a| {
        let page_1 = Expect::write(a, vec![7, 1]);
        vec![
            page(a),
            read(a, 0, 0xA0),
            page_1,
            unique(a),
            unique(a),
            page(a),
        ]
    });
    step(&|a| vec![page(a), read(a, 0x3D, 0)]);
    step(&|a| vec![page(a), write(a, 0x3F, 0x20)]);
    step(&|a| {
        let mut lines = vec![
            page(a),
            read(a, 0, 0xA0),
            page(a),
            write(a, 0x3E, 0),
            page(a),
        ];
        lines.extend([write(a, 0x3F, 0), page(a), read(a, 0x3E, 0)]);
        lines.extend([
            write(a, 0x3B, 0),
            read(a, 0x3B, 0),
            page(a),
            write(a, 0x3D, 8),
        ]);
        lines
    });
    step(&|a| {
        let status = Expect::write_read(a, vec![0x39], vec![5, 0]);
        vec![
            page(a),
            read(a, 0x3D, 8),
            status,
            Expect::read(a, vec![5, 0]),
        ]
    });
    script
}

/// The identity, as registers.
const ONE: [u8; 8] = [0x00, 0x40, 0, 0, 0, 0, 0, 0];

/// Every channel selected and read back, every register pointer written.
fn first_scan() -> Vec<Expect> {
    let mut script = Vec::new();
    for k in 0..16u8 {
        if k % 2 == 0 {
            script.extend(select(k / 2, 1 << (k / 2)));
        }
        script.push(Expect::write_read(0x28 + k % 2, vec![0x20], ONE.to_vec()));
    }
    script
}

/// Plain reads; the selection for sensor 4 reads back another channel.
fn second_scan() -> Vec<Expect> {
    let mut script = Vec::new();
    for k in 0..16u8 {
        if k % 2 == 0 || k == 5 {
            script.extend(select(k / 2, if k == 4 { 0x02 } else { 1 << (k / 2) }));
        }
        script.push(Expect::read(0x28 + k % 2, ONE.to_vec()));
    }
    script
}
