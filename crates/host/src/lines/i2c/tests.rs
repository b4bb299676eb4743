use super::*;
use embedded_hal::i2c::{ErrorKind, ErrorType, Operation};
use glove::bus::Transaction;
use glove::scan::{BusScanner, Config};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
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

/// A bus that can be unplugged: each call of one that was fails from then on, and it is opened anew only once it is back.
struct Pluggable<I> {
    bus: I,
    plugged: Arc<AtomicBool>,
    gone: bool,
}

impl<I: I2c> ErrorType for Pluggable<I> {
    type Error = ErrorKind;
}

impl<I: I2c> I2c for Pluggable<I> {
    fn transaction(
        &mut self,
        address: u8,
        operations: &mut [Operation<'_>],
    ) -> Result<(), ErrorKind> {
        self.gone |= !self.plugged.load(Ordering::SeqCst);
        match self.gone {
            true => Err(ErrorKind::Other),
            false => {
                let done = self.bus.transaction(address, operations);
                done.map_err(|error| embedded_hal::i2c::Error::kind(&error))
            }
        }
    }
}

/// Looks, at times 20 ms apart, until it is so.
fn until(port: &mut Port, us: &mut u64, what: impl Fn(&Port) -> bool) {
    for _ in 0..10_000 {
        *us += 20_000;
        assert_eq!(port.poll(at(*us)), None);
        if what(port) {
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    panic!("it never is: {:?}", port.state);
}

#[test]
fn a_port_that_is_unplugged_says_so_and_is_opened_again_once_it_is_back() {
    let (go, gate) = channel();
    let plugged = Arc::new(AtomicBool::new(true));
    let opened = Arc::new(AtomicU32::new(0));
    let first = Pluggable {
        bus: Hanging(gate),
        plugged: Arc::clone(&plugged),
        gone: false,
    };
    let (again, gate) = channel();
    let mut next = Some(gate);
    let (is_there, tries) = (Arc::clone(&plugged), Arc::clone(&opened));
    let open = move || {
        tries.fetch_add(1, Ordering::SeqCst);
        let plugged = Arc::clone(&is_there);
        let there = plugged.load(Ordering::SeqCst);
        next.take_if(|_| there).map(|gate| Pluggable {
            bus: Hanging(gate),
            plugged,
            gone: false,
        })
    };
    let name = PathBuf::from("i2c:test");
    let mut port = Port::reopened(name, first, |bus| bus.gone, open).expect("a thread");
    let watch = port.watch();
    go.send(()).expect("there");
    port.start(&read(), at(0)).expect("idle");
    assert_eq!(answer(&mut port, at(1)).expect("read"), [7, 7]);
    assert!(watch.plugged() && port.is_up());

    plugged.store(false, Ordering::SeqCst);
    port.start(&read(), at(2)).expect("idle");
    assert_eq!(answer(&mut port, at(3)), Err(Error::Port));
    assert!(!watch.plugged() && !port.is_up() && watch.losses() == 1);
    assert_eq!(port.start(&read(), at(4)), Err(Error::Port));
    let mut us = 4;
    until(&mut port, &mut us, |_| opened.load(Ordering::SeqCst) >= 6);
    assert!(us > 6 * PORT_RETRY.as_ticks(), "tried too often: {us} µs");
    assert!(
        port.is_dead() && port.next_due().is_some(),
        "and waited for"
    );
    assert!(go.send(()).is_err(), "the old one was closed");

    plugged.store(true, Ordering::SeqCst);
    until(&mut port, &mut us, Port::is_up);
    assert!(watch.plugged() && !port.is_dead());
    again.send(()).expect("there");
    port.start(&read(), at(us)).expect("idle");
    assert_eq!(answer(&mut port, at(us + 1)).expect("read"), [7, 7]);
}

#[test]
fn a_glove_whose_adapter_was_unplugged_is_scanned_again() {
    let clock = rig::Clock::new();
    clock.set(at(700_000));
    let glove = rig::glove::VirtualGlove::new(
        Box::new(|t: f64| [t.sin() as f32 * 0.3; 25]),
        rig::glove::Config::default(),
    );
    let plugged = Arc::new(AtomicBool::new(true));
    let (there, time) = (Arc::clone(&plugged), clock.clone());
    let open = move || {
        there.load(Ordering::SeqCst).then(|| Pluggable {
            bus: glove.i2c(&time, 400_000),
            plugged: Arc::clone(&there),
            gone: false,
        })
    };
    let first = open().expect("plugged in");
    let name = PathBuf::from("i2c:virtual");
    let port = Port::reopened(name, first, |bus| bus.gone, open).expect("a thread");
    let mut scanner = BusScanner::on(port, Config::default());
    let mut whole = 0;
    let mut lost = None;
    for _ in 0..1_000_000 {
        let now = clock.now();
        if let Some(frame) = scanner.poll(now) {
            whole += u32::from(frame.good() == 0xFFFF);
            if whole == 20 && lost.is_none() {
                plugged.store(false, Ordering::SeqCst);
                (lost, whole) = (Some(now), 0);
            }
            if whole == 20 {
                break;
            }
        }
        if lost.is_some_and(|lost| now >= lost + DEAD) {
            plugged.store(true, Ordering::SeqCst);
        }
        if matches!(
            scanner.bus_mut().state,
            State::Asked { .. } | State::Away { asked: Some(_), .. }
        ) {
            let wake = &scanner.bus_mut().readable;
            let mut polled = [rustix::event::PollFd::new(
                &**wake,
                rustix::event::PollFlags::IN,
            )];
            rustix::event::poll(&mut polled, None).expect("polls");
        } else if let Some(due) = scanner.next_due() {
            clock.set(due.max(now));
        }
    }
    assert_eq!(whole, 20, "{:?}", scanner.health());
    let took = clock.now().checked_duration_since(lost.expect("unplugged"));
    assert!(
        took.is_some_and(|took| took.as_millis() < 7_000),
        "{took:?}"
    );
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
