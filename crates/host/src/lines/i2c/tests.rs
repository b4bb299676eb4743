use super::*;
use embedded_hal::i2c::{ErrorKind, ErrorType, Operation};
use glove::bus::Transaction;
use glove::scan::{BusScanner, Config};
use std::sync::mpsc::{Sender, channel};

/// A bus that hangs in each call until it is let go.
struct Hanging(Receiver<()>);

impl ErrorType for Hanging {
    type Error = ErrorKind;
}

impl I2c for Hanging {
    fn transaction(&mut self, _: u8, operations: &mut [Operation<'_>]) -> Result<(), ErrorKind> {
        self.0.recv().map_err(|_| ErrorKind::Other)?;
        for operation in operations {
            if let Operation::Read(buffer) = operation {
                buffer.fill(7);
            }
        }
        Ok(())
    }
}

fn hanging() -> (Port, Sender<()>) {
    let (go, gate) = channel();
    let port = Port::over(PathBuf::from("i2c:test"), Hanging(gate)).expect("a thread");
    (port, go)
}

fn read() -> Batch {
    Batch::from_slice(&[Transaction::read(0x29, 2).expect("fits")]).expect("fits")
}

/// Looks until there is an answer; it comes from another thread.
fn answer(port: &mut Port, now: Instant) -> Result<Reply, Error> {
    for _ in 0..10_000 {
        if let Some(result) = port.poll(now) {
            return result;
        }
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    panic!("no answer");
}

fn at(us: u64) -> Instant {
    Instant::from_ticks(us)
}

#[test]
fn a_call_that_blocks_holds_up_nobody_and_is_given_up_by_its_deadline() {
    let (mut port, go) = hanging();
    // Each of these would stand still if it made the call itself: nothing lets the bus go yet.
    port.start(&read(), at(0)).expect("idle");
    assert_eq!(port.start(&read(), at(1)), Err(Error::Busy));
    assert_eq!(port.poll(at(DEADLINE.as_ticks() - 1)), None);
    let late = DEADLINE.as_ticks();
    assert_eq!(port.poll(at(late)), Some(Err(Error::BusTimeout)));
    assert!(!port.is_up() && !port.is_dead());
    assert_eq!(port.start(&read(), at(late)), Err(Error::NoAnswer));
    assert_eq!(port.poll(at(late + DEAD.as_ticks())), None);
    assert!(port.is_dead());
    // What comes then is nobody's answer.
    go.send(()).expect("there");
    while !port.is_up() {
        assert_eq!(port.poll(at(late + DEAD.as_ticks() + 1)), None);
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    go.send(()).expect("there");
    port.start(&read(), at(10_000_000)).expect("idle");
    assert_eq!(answer(&mut port, at(10_000_001)).expect("read"), [7, 7]);
}

#[test]
fn an_answer_that_lay_there_past_its_deadline_is_thrown_away() {
    let (mut port, go) = hanging();
    port.start(&read(), at(0)).expect("idle");
    go.send(()).expect("there");
    // Readable: it lies there.
    let readable = port.watch().descriptor().expect("there");
    let mut polled = [rustix::event::PollFd::new(
        &*readable,
        rustix::event::PollFlags::IN,
    )];
    rustix::event::poll(&mut polled, None).expect("polls");
    assert_eq!(port.poll(at(1_000_000)), Some(Err(Error::Stalled)));
    assert!(port.is_up());
}

#[test]
fn a_bus_that_is_gone_is_told_and_the_port_is_dead() {
    struct Panicking;
    impl ErrorType for Panicking {
        type Error = ErrorKind;
    }
    impl I2c for Panicking {
        fn transaction(&mut self, _: u8, _: &mut [Operation<'_>]) -> Result<(), ErrorKind> {
            std::panic::resume_unwind(Box::new("on purpose"));
        }
    }
    let mut port = Port::over(PathBuf::from("i2c:test"), Panicking).expect("a thread");
    port.start(&read(), at(0)).expect("idle");
    assert_eq!(answer(&mut port, at(1)), Err(Error::Port));
    assert!(port.is_dead() && !port.is_up());
}

#[test]
fn sixteen_virtual_sensors_are_brought_up_and_scanned_through_the_thread() {
    let clock = rig::Clock::new();
    clock.set(at(700_000));
    let glove = rig::glove::VirtualGlove::new(
        Box::new(|t: f64| [t.sin() as f32 * 0.3; 25]),
        rig::glove::Config::default(),
    );
    let bus = glove.i2c(&clock, 400_000);
    let port = Port::over(PathBuf::from("i2c:virtual"), bus).expect("a thread");
    let mut scanner = BusScanner::on(port, Config::default());
    let mut whole = 0;
    // The virtual clock: the bus moves it by what a transaction takes, this loop by what is waited for.
    for _ in 0..1_000_000 {
        let now = clock.now();
        if let Some(frame) = scanner.poll(now) {
            whole += u32::from(frame.good() == 0xFFFF);
            if whole == 20 {
                break;
            }
        }
        let watch = scanner.bus_mut().watch();
        let asked = matches!(scanner.bus_mut().state, State::Asked { .. });
        if asked {
            let readable = watch.descriptor().expect("there");
            let mut polled = [rustix::event::PollFd::new(
                &*readable,
                rustix::event::PollFlags::IN,
            )];
            rustix::event::poll(&mut polled, None).expect("polls");
        } else if let Some(due) = scanner.next_due() {
            clock.set(due);
        }
    }
    assert_eq!(whole, 20, "{:?}", scanner.health());
    assert!(clock.now() < at(3_000_000), "{:?}", clock.now());
}
