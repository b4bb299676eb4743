//! What goes over the wires, to the byte: scripts to read as the protocol's documentation. `embedded-hal-mock` plays the I²C bus
//! and ends a test at the first transaction that is not the script's; the serial line has a script of the same kind.

#![allow(clippy::unwrap_used, reason = "a test may")]

use embedded_hal::i2c::{ErrorKind, NoAcknowledgeSource};
use embedded_hal_mock::eh1::i2c::{Mock, Transaction as Expect};
use glove::bus::{self, Batch, Bus, Direct};
use glove::imu::bringup::{BringUp, Next, Outcome, Step};
use glove::imu::{self, UniqueId};
use glove::sc18im::{BaudRefused, Sc18im, SetBaud};
use glove::scan::{BusScanner, Config, Frame, Health};
use glove::{Instant, timing};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

/// The multiplexer.
const MUX: u8 = 0x70;
/// The sensors of a channel: the even one, the odd one.
const EVEN: u8 = 0x28;

const ID: UniqueId = [3, 1, 4, 1, 5, 9, 2, 6, 5, 3, 5, 8, 9, 7, 9, 3];

// ---- a sensor's bring-up ----

/// Who is it? The chip id, then the unique id from page 1, twice, so that a flipped bit is not taken for another sensor.
fn identify(a: u8, id: UniqueId) -> Vec<Expect> {
    let mut script = vec![
        write(a, 0x07, 0x00), // PAGE_ID: the registers of page 0
        read(a, 0x00, &[0xA0]),
    ];
    script.extend(unique_id(a, id));
    script
}

fn unique_id(a: u8, id: UniqueId) -> [Expect; 5] {
    [
        write(a, 0x07, 0x01), // page 1
        read(a, 0x50, &id),
        read(a, 0x50, &id),
        write(a, 0x07, 0x00),
        read(a, 0x07, &[0x00]),
    ]
}

/// CONFIG mode, the only one in which it takes a reset. A sensor that is in it already is told nothing.
fn stop(a: u8, mode: u8) -> Vec<Expect> {
    let mut script = vec![write(a, 0x07, 0x00), read(a, 0x3D, &[mode])];
    if mode != 0x00 {
        script.extend([write(a, 0x07, 0x00), write(a, 0x3D, 0x00)]);
    }
    script
}

/// SYS_TRIGGER: reset. The sensor acknowledges nothing for 650 ms.
fn reset(a: u8) -> Vec<Expect> {
    vec![write(a, 0x07, 0x00), write(a, 0x3F, 0x20)]
}

/// Power mode, clock and units, read back; then the fusion mode.
fn configure(a: u8) -> Vec<Expect> {
    vec![
        write(a, 0x07, 0x00),
        read(a, 0x00, &[0xA0]),
        write(a, 0x07, 0x00),
        write(a, 0x3E, 0x00), // PWR_MODE: normal
        write(a, 0x07, 0x00),
        write(a, 0x3F, 0x00), // SYS_TRIGGER: no external crystal
        write(a, 0x07, 0x00),
        read(a, 0x3E, &[0x00]),
        write(a, 0x3B, 0x00), // UNIT_SEL
        read(a, 0x3B, &[0x00]),
        write(a, 0x07, 0x00),
        write(a, 0x3D, 0x08), // OPR_MODE: IMU
    ]
}

/// The mode read back; is it still the same sensor? SYS_STATUS 5 and SYS_ERR 0; and once more without naming the register: does the
/// pointer stay?
fn verify(a: u8) -> Vec<Expect> {
    let mut script = recheck(a, 0x08, ID);
    script.extend([read(a, 0x39, &[5, 0]), Expect::read(a, vec![5, 0])]);
    script
}

/// What does a sensor do that fell silent, and is it still the same?
fn recheck(a: u8, mode: u8, id: UniqueId) -> Vec<Expect> {
    let mut script = vec![write(a, 0x07, 0x00), read(a, 0x3D, &[mode])];
    script.extend(unique_id(a, id));
    script
}

#[test]
fn a_sensor_that_fell_silent_is_asked_for_its_unique_id_before_it_is_sampled_or_set_up() {
    for (mode, next) in [(0x08, None), (0x00, Some(Step::Configure))] {
        let outcome = run_step(Step::Recheck, &recheck(EVEN, mode, ID));
        assert_eq!((outcome.next, outcome.unique_id), (next, Some(ID)));
    }
}

#[test]
fn reading_a_unique_id() {
    let outcome = run_step(Step::Identify, &identify(EVEN, ID));
    assert_eq!(outcome.unique_id, Some(ID));
}

#[test]
fn bringing_up_one_sensor_that_ran_in_ndof_mode() {
    let then = |outcome: Outcome| (outcome.next, outcome.pause.as_millis());
    let identified = run_step(Step::Identify, &identify(EVEN, ID));
    assert_eq!(then(identified), (Some(Step::Stop), 0));
    let stopped = run_step(Step::Stop, &stop(EVEN, 0x0C));
    assert_eq!(then(stopped), (Some(Step::Reset), 20));
    let told = run_step(Step::Reset, &reset(EVEN));
    assert_eq!(then(told), (Some(Step::Configure), 650));
    let configured = run_step(Step::Configure, &configure(EVEN));
    assert_eq!(then(configured), (Some(Step::Verify), 10));
    let up = run_step(Step::Verify, &verify(EVEN));
    assert_eq!((then(up), up.pointer_stays), ((None, 0), Some(true)));
    assert_eq!(up.unique_id, Some(ID));
}

/// Runs a step of the bring-up of the even sensor; the script must be used up.
fn run_step(step: Step, script: &[Expect]) -> Outcome {
    let mut bus = Direct::new(Mock::new(script));
    let mut bring_up = BringUp::new(step, EVEN, imu::Config::default());
    let now = Instant::from_ticks(0);
    loop {
        match bring_up.next() {
            Next::Transaction(transaction) => {
                let batch = Batch::from_slice(&[transaction]).unwrap();
                bus.start(&batch, now).unwrap();
                bring_up.supply(bus.poll(now).unwrap().as_deref().map_err(|e| *e));
            }
            Next::Done(outcome) => {
                bus.release().done();
                return outcome;
            }
            Next::Failed(error) => panic!("{error}"),
        }
    }
}

// ---- scans ----

/// The identity, as registers 20 to 27: w, x, y, z, a count is 2⁻¹⁴.
const ONE: [u8; 8] = [0x00, 0x40, 0, 0, 0, 0, 0, 0];

/// A channel is connected by its bit, and what is connected is read back.
fn select(channel: u8, read_back: u8) -> [Expect; 2] {
    [
        Expect::write(MUX, vec![1 << channel]),
        Expect::read(MUX, vec![read_back]),
    ]
}

/// Every channel selected and read back, every register pointer written.
fn first_scan() -> Vec<Expect> {
    let mut script = Vec::new();
    for k in 0..16 {
        if k % 2 == 0 {
            script.extend(select(k / 2, 1 << (k / 2)));
        }
        script.push(read(EVEN + k % 2, 0x20, &ONE));
    }
    script
}

/// Plain reads; the selection for sensor 4 reads back another channel.
fn second_scan() -> Vec<Expect> {
    let mut script = Vec::new();
    for k in 0..16 {
        if k % 2 == 0 || k == 5 {
            script.extend(select(k / 2, if k == 4 { 0x02 } else { 1 << (k / 2) }));
        }
        script.push(Expect::read(EVEN + k % 2, ONE.to_vec()));
    }
    script
}

#[test]
fn one_scan() {
    let mut script = bring_up_of_all();
    script.extend(first_scan());
    // The next one begins as it ends.
    script.extend(select(0, 0x01));
    script.push(Expect::read(EVEN, ONE.to_vec()));
    assert_eq!(run_scanner(&script, 1)[0].good(), ALL);
}

#[test]
fn a_selection_that_reads_back_otherwise_costs_one_sample_and_is_told() {
    let mut script = bring_up_of_all();
    script.extend(first_scan());
    script.extend(second_scan());
    script.extend(select(0, 0x01));
    script.push(Expect::read(EVEN, ONE.to_vec()));
    let frames = run_scanner(&script, 2);
    // Sensor 5 selects anew and is read.
    assert_eq!(frames[1].good(), ALL & !(1 << 4));
    let wrong = imu::Error::Mux(bus::Error::Status(0x02));
    assert_eq!(frames[1].samples[4].health, Health::Missing(wrong));
}

#[test]
fn a_selection_that_is_not_acknowledged_is_forgotten() {
    let nack = ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address);
    let mut script = bring_up_of_all();
    script.push(Expect::write(MUX, vec![0x01]).with_error(nack));
    // Sensor 1 does not rely on channel 0.
    script.extend(select(0, 0x01));
    script.extend(first_scan().into_iter().skip(3));
    // Sensor 0 is rechecked between the scans, on a channel selected anew.
    script.extend(select(0, 0x01));
    let frames = run_scanner(&script, 1);
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
    let frames = run_scanner(&script, 1);
    assert_eq!(frames[0].good(), ALL & !(1 << 15));
}

const ALL: u16 = 0xFFFF;

/// The bring-up of 16 sensors: every step for all of them in turn, each channel selected before its two.
fn bring_up_of_all() -> Vec<Expect> {
    // All ids the same byte, as no sensor has them: they are not judged.
    let identify = |a| identify(a, [0; 16]);
    let stop = |a| stop(a, 0x00);
    let steps: [&dyn Fn(u8) -> Vec<Expect>; 5] = [&identify, &stop, &reset, &configure, &verify];
    let mut script = Vec::new();
    for step in steps {
        for k in 0..16 {
            if k % 2 == 0 {
                script.extend(select(k / 2, 1 << (k / 2)));
            }
            script.extend(step(EVEN + k % 2));
        }
    }
    script
}

/// Runs a scanner on a scripted I²C bus until it has given so many frames; the script must be used up.
fn run_scanner(script: &[Expect], count: usize) -> Vec<Frame> {
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

fn write(address: u8, register: u8, value: u8) -> Expect {
    Expect::write(address, vec![register, value])
}

fn read(address: u8, register: u8, values: &[u8]) -> Expect {
    Expect::write_read(address, vec![register], values.to_vec())
}

// ---- a change of baud, behind the serial bridge ----

/// One line of a serial script.
#[derive(Debug, Clone, PartialEq)]
enum Line {
    /// The port is set to this speed.
    Speed(u32),
    /// These bytes go out, those come back.
    Exchange(&'static [u8], &'static [u8]),
}
use Line::{Exchange, Speed};

#[test]
fn a_bridge_fresh_from_power_on_is_raised_from_9600_to_460800_baud() {
    let port = ScriptPort::new(&[
        // I2CStat asked for at 115,200: silence for 660 ms.
        Exchange(b"R\x0AP", b""),
        // At 9,600, its speed after power-on: F0. Eight in a row, so that it is no noise.
        Speed(9_600),
        Exchange(b"R\x0AP", b"\xF0"),
        Exchange(
            b"R\x0APR\x0APR\x0APR\x0APR\x0APR\x0APR\x0APR\x0AP",
            b"\xF0\xF0\xF0\xF0\xF0\xF0\xF0\xF0",
        ),
        // Can the port go so fast? It says yes, and goes back.
        Speed(460_800),
        Speed(9_600),
        // BRG0 = 00, BRG1 = 00: 7,372,800 / 460,800 − 16 = 0. Nothing answers; then a pause.
        Exchange(b"W\x00\x00\x01\x00P", b""),
        Speed(460_800),
        Exchange(
            b"R\x0APR\x0APR\x0APR\x0APR\x0APR\x0APR\x0APR\x0AP",
            b"\xF0\xF0\xF0\xF0\xF0\xF0\xF0\xF0",
        ),
        // I2CClkL and I2CClkH = 5: 369 kHz. I2CTO = 07: 13 ms. All three read back.
        Exchange(
            b"W\x07\x05\x08\x05\x09\x07PR\x07PR\x08PR\x09P",
            b"\x05\x05\x07",
        ),
    ]);
    let config = glove::sc18im::Config {
        raise_to: Some(460_800),
        ..Default::default()
    };
    let mut bridge = Sc18im::new(port.clone(), config).with_set_baud();
    let mut now = Instant::from_ticks(0);
    let late = Instant::from_ticks(3 * timing::IDLE_TIMEOUT.as_ticks());
    while !bridge.is_up() {
        assert!(now < late, "{:?} not asked", port.left());
        assert_eq!(bridge.poll(now), None);
        now = bridge.next_due().unwrap_or(now).max(now);
        now = Instant::from_ticks(now.as_ticks() + 1);
    }
    assert_eq!((port.left(), bridge.baud()), (vec![], 460_800));
}

/// A serial port that plays a script.
#[derive(Debug, Clone)]
struct ScriptPort(Rc<RefCell<(VecDeque<Line>, VecDeque<u8>)>>);

impl ScriptPort {
    fn new(script: &[Line]) -> Self {
        let script = script.iter().cloned().collect();
        Self(Rc::new(RefCell::new((script, VecDeque::new()))))
    }

    /// What was not played.
    fn left(&self) -> Vec<Line> {
        self.0.borrow().0.iter().cloned().collect()
    }
}

impl SetBaud for ScriptPort {
    fn set_baud(&mut self, baud: u32) -> Result<(), BaudRefused> {
        assert_eq!(self.0.borrow_mut().0.pop_front(), Some(Speed(baud)));
        Ok(())
    }
}

impl embedded_io::ErrorType for ScriptPort {
    type Error = embedded_io::ErrorKind;
}

impl embedded_io::ReadReady for ScriptPort {
    fn read_ready(&mut self) -> Result<bool, Self::Error> {
        Ok(!self.0.borrow().1.is_empty())
    }
}

impl embedded_io::Read for ScriptPort {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Self::Error> {
        let answers = &mut self.0.borrow_mut().1;
        let count = buffer.len().min(answers.len());
        for (slot, byte) in buffer.iter_mut().zip(answers.drain(..count)) {
            *slot = byte;
        }
        Ok(count)
    }
}

impl embedded_io::Write for ScriptPort {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
        let (script, answers) = &mut *self.0.borrow_mut();
        match script.pop_front() {
            Some(Exchange(asked, answer)) if asked == bytes => answers.extend(answer),
            other => panic!("{bytes:02X?} sent, {other:02X?} expected"),
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}
