use super::*;
use crate::bus::Transaction;
use crate::testing::{Exchange, Port, exchange};
use crate::timing;
use std::vec::Vec;

extern crate std;

const STATUS: [u8; 3] = [0x52, 0x0A, 0x50];
const SETUP: [u8; 17] = [
    0x57, 0x07, 0x05, 0x08, 0x05, 0x09, 0x07, 0x50, 0x52, 0x07, 0x50, 0x52, 0x08, 0x50, 0x52, 0x09,
    0x50,
];

fn trial(status: u8) -> Exchange {
    exchange(&STATUS.repeat(TRIAL), &[status; TRIAL])
}

fn told(low: u8, high: u8) -> Exchange {
    exchange(&[0x57, 0x00, low, 0x01, high, 0x50], &[])
}

fn machine(port: &Port, raise_to: Option<u32>, status_checks: bool) -> Sc18im<Port> {
    let config = Config {
        raise_to,
        status_checks,
        ..Config::default()
    };
    Sc18im::new(port.clone(), config).with_set_baud()
}

/// Runs until the machine is up; when the port was at which speed.
fn run_until_up(machine: &mut Sc18im<Port>, port: &Port) -> Vec<(u32, Instant)> {
    let mut speeds = Vec::new();
    for _ in 0..500 {
        assert!(machine.poll(port.now()).is_none());
        if speeds
            .last()
            .is_none_or(|(baud, _)| *baud != machine.baud())
        {
            speeds.push((machine.baud(), port.now()));
        }
        if machine.is_up() {
            return speeds;
        }
        port.wait(machine.next_due());
    }
    panic!("never up");
}

#[test]
fn golden_change_of_baud_from_9600_to_460800() {
    let port = Port::new([
        // Nobody at 115,200; at 9,600 one status, then eight; the divisor 0000; eight at 460,800; the clock.
        exchange(&STATUS, &[]),
        exchange(&STATUS, &[0xF0]),
        trial(0xF0),
        told(0x00, 0x00),
        trial(0xF0),
        exchange(&SETUP, &[0x05, 0x05, 0x07]),
    ]);
    let mut machine = machine(&port, Some(460_800), false);
    let speeds = run_until_up(&mut machine, &port);
    assert_eq!(port.left(), 0);
    let bauds: Vec<u32> = speeds.iter().map(|(baud, _)| *baud).collect();
    assert_eq!(bauds, [115_200, 9_600, 460_800]);
    // The port is tried at 460,800 before the chip is told.
    assert_eq!(port.bauds(), [9_600, 460_800, 9_600, 460_800]);
    let counters = machine.counters();
    assert_eq!((counters.restarts, counters.speed_changes), (1, 1));
}

#[test]
fn after_the_new_speed_was_told_nothing_is_sent_until_the_bytes_have_left_and_the_chip_has_settled()
{
    let port = Port::new([exchange(&STATUS, &[0xF0]), trial(0xF0), told(0x10, 0x00)]);
    let mut machine = machine(&port, Some(230_400), false);
    while port.left() > 0 {
        assert!(machine.poll(port.now()).is_none());
        if port.left() > 0 {
            port.wait(machine.next_due());
        }
    }
    let (sent, due) = (port.now(), machine.next_due().unwrap());
    let least = timing::serial(6, 115_200) + timing::BAUD_SETTLE;
    assert!(timing::since(due, sent) >= least);
    // What comes meanwhile, a status of before among it, is nobody's answer.
    port.inject(100, &[0xF0, 0xF0]);
    while port.now() < due {
        assert!(machine.poll(port.now()).is_none());
        assert_eq!(machine.baud(), 115_200);
        port.wait(machine.next_due());
    }
    port.expect([trial(0xF0), exchange(&SETUP, &[0x05, 0x05, 0x07])]);
    run_until_up(&mut machine, &port);
    assert_eq!(machine.baud(), 230_400);
}

#[test]
fn a_status_that_noise_made_is_not_the_chip() {
    // The first is noise: what must follow does not.
    let noise = [0xF0, 0x13, 0xF0, 0xF0];
    let port = Port::new([
        exchange(&STATUS, &[0xF3]),
        exchange(&STATUS.repeat(TRIAL), &noise),
        exchange(&STATUS, &[0xF0]),
        exchange(&STATUS.repeat(TRIAL), &[0xF0; TRIAL - 1]),
        // At 9,600 one byte of the trial is missing. 460,800 is above what the port is to run at: a chip there is told, unheard.
        told(0x30, 0x00),
        trial(0xF0),
        exchange(&SETUP, &[0x05, 0x05, 0x07]),
    ]);
    let mut machine = machine(&port, Some(115_200), false);
    let speeds = run_until_up(&mut machine, &port);
    assert_eq!(speeds.last().map(|(baud, _)| *baud), Some(115_200));
}

#[test]
fn golden_reads_with_status_checks_ask_for_the_status_in_the_same_write() {
    let port = Port::new([
        exchange(&STATUS, &[0xF0]),
        trial(0xF0),
        exchange(&SETUP, &[0x05, 0x05, 0x07]),
    ]);
    let mut machine = machine(&port, None, true);
    run_until_up(&mut machine, &port);
    port.expect([exchange(
        &[
            0x53, 0xE0, 0x01, 0x08, 0x50, 0x53, 0xE1, 0x01, 0x50, 0x53, 0x51, 0x08, 0x50, 0x52,
            0x0A, 0x50,
        ],
        &[8, 1, 2, 3, 4, 5, 6, 7, 8, 0xF0],
    )]);
    let whole = [
        Transaction::write(0x70, &[0x08]).unwrap(),
        Transaction::read(0x70, 1).unwrap(),
        Transaction::read(0x28, 8).unwrap(),
    ];
    let reply = run(&mut machine, &port, &whole).unwrap();
    assert_eq!(reply.as_slice(), [8, 1, 2, 3, 4, 5, 6, 7, 8]);
    // Bytes of a read that the bus gave up: not data, whatever they are.
    port.expect([exchange(
        &[0x53, 0x53, 0x02, 0x50, 0x52, 0x0A, 0x50],
        &[1, 2, 0xF8],
    )]);
    let read = [Transaction::read(0x29, 2).unwrap()];
    assert_eq!(
        run(&mut machine, &port, &read),
        Err(crate::bus::Error::BusTimeout)
    );
}

fn run(machine: &mut Sc18im<Port>, port: &Port, whole: &[Transaction]) -> Result<Reply, Error> {
    machine.start(&Batch::from_slice(whole).unwrap(), port.now())?;
    for _ in 0..1000 {
        if let Some(result) = machine.poll(port.now()) {
            return result;
        }
        port.wait(machine.next_due());
    }
    panic!("never done");
}
