use super::*;
use crate::bus::Transaction;
use crate::testing::{Exchange, Port, exchange};
use embedded_hal::i2c::I2c;
use std::vec;

extern crate std;

/// Status answered F0, then the I²C clock written and read back: what every link begins with.
const PROBE: [u8; 3] = [0x52, 0x0A, 0x50];
const SETUP: [u8; 17] = [
    0x57, 0x07, 0x05, 0x08, 0x05, 0x09, 0x07, 0x50, 0x52, 0x07, 0x50, 0x52, 0x08, 0x50, 0x52, 0x09,
    0x50,
];

fn bring_up() -> [Exchange; 2] {
    [
        exchange(&PROBE, &[0xF0]),
        exchange(&SETUP, &[0x05, 0x05, 0x07]),
    ]
}

fn up() -> (Sc18im<Port>, Port) {
    let port = Port::new(bring_up());
    let mut machine = Sc18im::new(port.clone(), Config::default());
    run_until_up(&mut machine, &port);
    (machine, port)
}

fn run_until_up(machine: &mut Sc18im<Port>, port: &Port) {
    for _ in 0..100 {
        assert!(machine.poll(port.now()).is_none());
        if machine.is_up() {
            return;
        }
        port.wait(machine.next_due());
    }
    panic!("never up");
}

fn batch(transactions: &[Transaction]) -> Batch {
    Batch::from_slice(transactions).unwrap()
}

fn one(transaction: Result<Transaction, Error>) -> Batch {
    batch(&[transaction.unwrap()])
}

/// Starts a batch and polls until it is done.
fn run(machine: &mut Sc18im<Port>, port: &Port, batch: &Batch) -> Result<Reply, Error> {
    machine.start(batch, port.now())?;
    for _ in 0..1000 {
        if let Some(result) = machine.poll(port.now()) {
            return result;
        }
        port.wait(machine.next_due());
    }
    panic!("never done");
}

#[test]
fn golden_quaternion_read_of_0x29() {
    let (mut machine, port) = up();
    let bytes = [0x00, 0x40, 1, 2, 3, 4, 5, 6];
    port.expect([exchange(
        &[0x53, 0x52, 0x01, 0x20, 0x53, 0x53, 0x08, 0x50],
        &bytes,
    )]);
    let reply = run(
        &mut machine,
        &port,
        &one(Transaction::write_read(0x29, &[0x20], 8)),
    );
    assert_eq!(reply.unwrap().as_slice(), bytes);
    assert_eq!(port.left(), 0, "no status is asked after a success");
}

#[test]
fn golden_imu_mode_on_0x28_and_channel_0_of_the_mux_are_confirmed_by_their_status() {
    let (mut machine, port) = up();
    port.expect([
        exchange(
            &[0x53, 0x50, 0x02, 0x3D, 0x08, 0x50, 0x52, 0x0A, 0x50],
            &[0xF0],
        ),
        exchange(&[0x53, 0xE0, 0x01, 0x01, 0x50, 0x52, 0x0A, 0x50], &[0xF0]),
    ]);
    assert!(
        run(
            &mut machine,
            &port,
            &one(Transaction::write(0x28, &[0x3D, 0x08]))
        )
        .unwrap()
        .is_empty()
    );
    assert!(
        run(&mut machine, &port, &one(Transaction::write(0x70, &[0x01])))
            .unwrap()
            .is_empty()
    );
}

#[test]
fn the_mux_selection_and_the_first_read_go_in_one_serial_write() {
    let (mut machine, port) = up();
    let command = [
        0x53, 0xE0, 0x01, 0x08, 0x50, 0x53, 0xE1, 0x01, 0x50, 0x53, 0x51, 0x08, 0x50,
    ];
    port.expect([exchange(&command, &[0x08, 1, 2, 3, 4, 5, 6, 7, 8])]);
    let whole = batch(&[
        Transaction::write(0x70, &[0x08]).unwrap(),
        Transaction::read(0x70, 1).unwrap(),
        Transaction::read(0x28, 8).unwrap(),
    ]);
    assert_eq!(
        run(&mut machine, &port, &whole).unwrap().as_slice(),
        [8, 1, 2, 3, 4, 5, 6, 7, 8]
    );
}

#[test]
fn the_letters_p_and_r_in_data_are_data() {
    let (mut machine, port) = up();
    let letters = [0x50, 0x52, 0x53, 0x50, 0x52, 0x53, 0x50, 0x50];
    port.expect([exchange(&[0x53, 0x51, 0x08, 0x50], &letters)]);
    assert_eq!(
        run(&mut machine, &port, &one(Transaction::read(0x28, 8)))
            .unwrap()
            .as_slice(),
        letters
    );
}

#[test]
fn golden_baud_change_is_sent_alone_and_then_nothing_for_a_while() {
    let (mut machine, port) = up();
    port.expect([Exchange {
        expect: vec![0x57, 0x00, 0x30, 0x01, 0x00, 0x50],
        answer: vec![],
    }]);
    machine.change_baud(115_200, port.now()).unwrap();
    let sent = port.now();
    assert_eq!(
        machine.start(&one(Transaction::read(0x28, 1)), sent),
        Err(Error::Busy)
    );
    let due = machine.next_due().unwrap();
    assert!(
        crate::timing::since(due, sent).as_ticks() >= 1_000 + 521,
        "six bytes and 1 ms"
    );
    port.wait(Some(due));
    assert!(machine.poll(due).is_none());
    machine.set_line_baud(115_200);
    assert!(machine.require_idle().is_ok());
}

#[test]
fn baud_divisors_of_the_data_sheet() {
    assert_eq!(baud_divisor(9_600), Some(0x02F0));
    assert_eq!(baud_divisor(115_200), Some(0x0030));
    assert_eq!(baud_divisor(230_400), Some(0x0010));
    assert_eq!(baud_divisor(460_800), Some(0x0000));
    for wrong in [0, 1, 100, 500_000, 921_600, 447_000, u32::MAX] {
        assert_eq!(baud_divisor(wrong), None, "{wrong}");
    }
}

#[test]
fn more_than_16_bytes_a_message_are_refused_before_anything_is_sent() {
    let too_long = |length| Err(Error::TooLong { length, limit: 16 });
    assert_eq!(Transaction::write(0x28, &[0; 17]), too_long(17));
    assert_eq!(Transaction::read(0x28, 17), too_long(17));
    assert_eq!(Transaction::write_read(0x28, &[0x55], 22), too_long(22));
    assert_eq!(Transaction::write(0x28, &[]), Err(Error::Unsupported));
    assert_eq!(Transaction::read(0x80, 1), Err(Error::Unsupported));
    let (mut machine, port) = up();
    let long = Transaction::write_read(0x28, &[0; 16], 16).unwrap();
    let whole = batch(&[long.clone(), long.clone(), long]);
    assert!(matches!(
        machine.start(&whole, port.now()),
        Err(Error::TooLong { limit: 64, .. })
    ));
    assert!(matches!(
        machine.start(&Batch::new(), port.now()),
        Err(Error::Unsupported)
    ));
}

#[test]
fn a_read_that_is_not_acknowledged_is_typed_by_the_status() {
    for (status, error) in [
        (0xF1, Error::NackAddress),
        (0xF2, Error::NackData),
        (0xF8, Error::BusTimeout),
        (0xF5, Error::Status(0xF5)),
        (
            0xF0,
            Error::Lost {
                expected: 8,
                received: 0,
            },
        ),
    ] {
        let (mut machine, port) = up();
        port.expect([
            exchange(&[0x53, 0x53, 0x08, 0x50], &[]),
            exchange(&PROBE, &[status]),
        ]);
        let began = port.now();
        assert_eq!(
            run(&mut machine, &port, &one(Transaction::read(0x29, 8))),
            Err(error)
        );
        assert!(
            crate::timing::since(port.now(), began).as_ticks() < 40_000,
            "bounded"
        );
        // The link goes on at once.
        port.expect([exchange(&[0x53, 0x51, 0x01, 0x50], &[7])]);
        assert_eq!(
            run(&mut machine, &port, &one(Transaction::read(0x28, 1)))
                .unwrap()
                .as_slice(),
            [7]
        );
    }
}

#[test]
fn a_write_that_is_not_acknowledged_is_known_without_waiting_for_a_deadline() {
    let (mut machine, port) = up();
    port.expect([exchange(
        &[0x53, 0x50, 0x02, 0x07, 0x00, 0x50, 0x52, 0x0A, 0x50],
        &[0xF1],
    )]);
    let began = port.now();
    assert_eq!(
        run(&mut machine, &port, &one(Transaction::write(0x28, &[7, 0]))),
        Err(Error::NackAddress)
    );
    assert!(crate::timing::since(port.now(), began).as_ticks() <= 1_000);
}

#[test]
fn a_lost_reply_byte_is_named_and_costs_no_resync() {
    let (mut machine, port) = up();
    port.expect([
        exchange(&[0x53, 0x53, 0x08, 0x50], &[1, 2, 3, 4, 5, 6, 7]),
        exchange(&PROBE, &[0xF0]),
    ]);
    let result = run(&mut machine, &port, &one(Transaction::read(0x29, 8)));
    assert_eq!(
        result,
        Err(Error::Lost {
            expected: 8,
            received: 7
        })
    );
    assert_eq!(
        (machine.counters().lost, machine.counters().resyncs),
        (1, 0)
    );
}

#[test]
fn late_bytes_are_not_taken_for_the_status_nor_for_the_next_reply() {
    let (mut machine, port) = up();
    // The reply comes while its status is awaited, byte by byte, and its first byte looks like a status.
    let reply = [0xF1, 2, 3, 4, 5, 6, 7, 8];
    let late = reply
        .iter()
        .zip(0..)
        .map(|(b, n)| (30_500 + 87 * n, vec![*b]))
        .collect();
    port.expect([
        Exchange {
            expect: vec![0x53, 0x53, 0x08, 0x50],
            answer: late,
        },
        exchange(&PROBE, &[]),
        exchange(&PROBE, &[0xF0]),
    ]);
    let result = run(&mut machine, &port, &one(Transaction::read(0x29, 8)));
    assert_eq!(
        result,
        Err(Error::Lost {
            expected: 8,
            received: 0
        })
    );
    assert_eq!(machine.counters().stray, 8);
    // Bytes that come when nothing is asked are not the next reply either.
    port.inject(100, &[9, 9, 9]);
    port.wait(None);
    port.expect([exchange(&[0x53, 0x51, 0x01, 0x50], &[7])]);
    assert_eq!(
        run(&mut machine, &port, &one(Transaction::read(0x28, 1)))
            .unwrap()
            .as_slice(),
        [7]
    );
    assert_eq!(machine.counters().stray, 11);
}

#[test]
fn a_reply_in_single_bytes_just_within_the_deadline_is_taken() {
    let (mut machine, port) = up();
    let slow = (0..8u8)
        .map(|b| (3_000 * u64::from(b + 1), vec![b]))
        .collect();
    port.expect([Exchange {
        expect: vec![0x53, 0x53, 0x08, 0x50],
        answer: slow,
    }]);
    let reply = run(&mut machine, &port, &one(Transaction::read(0x29, 8))).unwrap();
    assert_eq!(reply.as_slice(), [0, 1, 2, 3, 4, 5, 6, 7]);
}

#[test]
fn a_reply_that_lay_unread_past_its_deadline_is_thrown_away_and_the_next_is_its_own() {
    let (mut machine, port) = up();
    port.expect([exchange(&[0x53, 0x51, 0x01, 0x50], &[7])]);
    machine
        .start(&one(Transaction::read(0x28, 1)), port.now())
        .unwrap();
    let deadline = machine.next_due().unwrap();
    port.wait(None);
    // The caller stands still until the very deadline, and longer.
    port.wait(Some(deadline));
    assert_eq!(machine.poll(port.now()), Some(Err(Error::Stalled)));
    assert_eq!(machine.counters().stalled, 1);
    port.expect([exchange(&[0x53, 0x51, 0x01, 0x50], &[8])]);
    let again = run(&mut machine, &port, &one(Transaction::read(0x28, 1)));
    assert_eq!(again.unwrap().as_slice(), [8]);
}

#[test]
fn a_reply_read_late_but_before_its_deadline_is_taken() {
    let (mut machine, port) = up();
    port.expect([exchange(&[0x53, 0x51, 0x01, 0x50], &[7])]);
    machine
        .start(&one(Transaction::read(0x28, 1)), port.now())
        .unwrap();
    let before = machine.next_due().unwrap().as_ticks() - 1;
    port.wait(None);
    let late = Instant::from_ticks(before);
    assert_eq!(machine.poll(late).unwrap().unwrap().as_slice(), [7]);
}

#[test]
fn however_much_lies_in_the_port_before_a_question_none_of_it_is_the_answer() {
    let (mut machine, port) = up();
    port.inject(0, &[0xAA; 3_000]);
    port.expect([exchange(&[0x53, 0x51, 0x02, 0x50], &[1, 2])]);
    let reply = run(&mut machine, &port, &one(Transaction::read(0x28, 2)));
    assert_eq!(reply.unwrap().as_slice(), [1, 2]);
    assert_eq!(machine.counters().stray, 3_000);
    // More than any system's buffer holds is a line that babbles: nothing is asked on it.
    port.inject(0, &[0xAA; 9_000]);
    assert_eq!(
        machine.start(&one(Transaction::read(0x28, 2)), port.now()),
        Err(Error::NoAnswer)
    );
    assert!(!machine.is_up());
}

#[test]
fn a_silent_bridge_is_left_alone_for_its_idle_timeout_then_asked_until_it_answers() {
    let (mut machine, port) = up();
    port.expect([
        exchange(&[0x53, 0x53, 0x08, 0x50], &[]),
        exchange(&PROBE, &[]),
    ]);
    let result = run(&mut machine, &port, &one(Transaction::read(0x29, 8)));
    assert_eq!(result, Err(Error::NoAnswer));
    assert!(!machine.is_up());
    assert_eq!(
        machine.start(&one(Transaction::read(0x29, 8)), port.now()),
        Err(Error::NoAnswer)
    );
    let lost = port.now();
    // Once nothing, once garbage, then a status: back.
    port.expect([
        exchange(&PROBE, &[]),
        exchange(&PROBE, &[0x4F, 0x4B]),
        exchange(&PROBE, &[0xF8]),
    ]);
    port.expect(bring_up().into_iter().skip(1));
    run_until_up(&mut machine, &port);
    let took = crate::timing::since(port.now(), lost).as_ticks();
    assert!((3 * 655_000..3 * 760_000).contains(&took), "{took}");
    assert_eq!((port.left(), machine.counters().resyncs), (0, 1));
}

#[test]
fn a_dead_bridge_is_asked_a_bounded_number_of_times_then_rarely() {
    let port = Port::default();
    let mut machine = Sc18im::new(port.clone(), Config::default());
    port.expect((0..20).map(|_| exchange(&PROBE, &[])));
    let mut asked_at_dead = None;
    while port.now().as_ticks() < 20_000_000 {
        assert!(machine.poll(port.now()).is_none());
        if machine.is_dead() && asked_at_dead.is_none() {
            asked_at_dead = Some(20 - port.left());
        }
        port.wait(machine.next_due());
    }
    assert_eq!(asked_at_dead, Some(5));
    assert!(
        (5 + 6..=5 + 9).contains(&(20 - port.left())),
        "every 2 s: {}",
        20 - port.left()
    );
}

#[test]
fn babble_that_never_ends_becomes_no_answer_and_never_holds_a_poll() {
    let (mut machine, port) = up();
    port.expect([exchange(&[0x53, 0x53, 0x08, 0x50], &[])]);
    machine
        .start(&one(Transaction::read(0x29, 8)), port.now())
        .unwrap();
    // The first eight bytes of it are indistinguishable from a reply; then it is stray.
    let first = loop {
        port.inject(0, &[0xAA; 5]);
        if let Some(result) = machine.poll(port.now()) {
            break result;
        }
        port.wait(Some(Instant::from_ticks(port.now().as_ticks() + 400)));
    };
    assert_eq!(first.unwrap().as_slice(), [0xAA; 8]);
    port.inject(0, &[0x55; 4_000]);
    machine.poll(port.now());
    assert!(
        machine.counters().stray < 200,
        "one poll takes a bounded number of bytes"
    );
}

#[test]
fn a_port_that_fails_is_a_typed_error_and_the_link_comes_back_with_the_port() {
    let (mut machine, port) = up();
    port.break_line(true);
    assert_eq!(
        machine.start(&one(Transaction::read(0x28, 1)), port.now()),
        Err(Error::Port)
    );
    for _ in 0..10 {
        assert!(machine.poll(port.now()).is_none());
        port.wait(machine.next_due());
    }
    assert!(!machine.is_up());
    port.break_line(false);
    port.expect(bring_up());
    run_until_up(&mut machine, &port);
}

#[test]
fn a_clock_the_chip_does_not_keep_is_counted_and_does_not_stop_the_glove() {
    let port = Port::new([
        exchange(&PROBE, &[0xF0]),
        exchange(&SETUP, &[0x05, 0x13, 0x07]),
    ]);
    let mut machine = Sc18im::new(port.clone(), Config::default());
    run_until_up(&mut machine, &port);
    assert_eq!(machine.counters().clock_refused, 1);
}

#[test]
fn the_blocking_wrapper_reads_and_writes_and_refuses_what_the_chip_cannot() {
    let port = Port::new(bring_up());
    let mut machine = Sc18im::new(port.clone(), Config::default());
    let clock = |due| port.wait(due);
    let mut i2c = Blocking::new(&mut machine, clock);
    port.expect([
        exchange(&[0x53, 0x50, 0x01, 0x00, 0x53, 0x51, 0x01, 0x50], &[0xA0]),
        exchange(
            &[0x53, 0x50, 0x02, 0x3D, 0x08, 0x50, 0x52, 0x0A, 0x50],
            &[0xF2],
        ),
        exchange(&[0x53, 0x51, 0x02, 0x50], &[1, 2]),
    ]);
    let mut id = [0];
    i2c.write_read(0x28, &[0x00], &mut id).unwrap();
    assert_eq!(id, [0xA0]);
    assert_eq!(i2c.write(0x28, &[0x3D, 0x08]), Err(Error::NackData));
    let mut two = [0; 2];
    i2c.read(0x28, &mut two).unwrap();
    assert_eq!(two, [1, 2]);
    assert_eq!(
        i2c.write(0x28, &[0; 23]),
        Err(Error::TooLong {
            length: 23,
            limit: 16
        })
    );
    let mut after_read = [0];
    let mut wrong = [
        embedded_hal::i2c::Operation::Read(&mut after_read),
        embedded_hal::i2c::Operation::Write(&[1]),
    ];
    assert_eq!(i2c.transaction(0x28, &mut wrong), Err(Error::Unsupported));
}

#[test]
fn the_blocking_wrapper_ends_when_nobody_answers_and_when_the_clock_stands_still() {
    let port = Port::new((0..10).map(|_| exchange(&PROBE, &[])));
    let mut machine = Sc18im::new(port.clone(), Config::default());
    let clock = |due| port.wait(due);
    let mut id = [0];
    assert_eq!(
        Blocking::new(&mut machine, clock).read(0x28, &mut id),
        Err(Error::NoAnswer)
    );
    assert!(port.now().as_ticks() < 5_000_000);
    let still = Port::new([exchange(&PROBE, &[])]);
    let mut machine = Sc18im::new(still, Config::default());
    let stopped = |_| Instant::from_ticks(0);
    assert_eq!(
        Blocking::new(&mut machine, stopped).read(0x28, &mut id),
        Err(Error::ClockStopped)
    );
}
