//! Modbus TCP: our line against scripted servers, tokio-modbus' server and the virtual gripper; tokio-modbus' client and
//! the manuals' bytes against the virtual gripper.

use std::future::{Ready, ready};
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use host::clock::Clock;
use host::gripper::driver::ThreeFinger;
use host::gripper::registers::{COMMAND, STATUS, three_finger};
use host::gripper::{Activation, Event, Gripper, Motion, Status};
use host::interrupt::Interrupt;
use host::lines::tcp::{Address, Error, Port, UNIT};
use rig::gripper::{Config, VirtualGripper, tcp};
use tokio_modbus::prelude::{
    ExceptionCode, Reader, Request, Response, Slave, SlaveRequest, Writer,
};
use tokio_modbus::server::Service;

/// Long for a busy machine; every wait here has an end.
const PATIENCE: Duration = Duration::from_secs(20);

fn line(port: u16) -> Port {
    let address = format!("tcp:127.0.0.1:{port}");
    let address = Address::parse(Path::new(&address)).unwrap().unwrap();
    Port::connect(&address, UNIT, &Interrupt::never().unwrap()).unwrap()
}

fn driver(port: u16) -> (ThreeFinger<Port>, Clock) {
    let line = line(port);
    let config = line.driver_config();
    (ThreeFinger::new(line, config), Clock::start())
}

/// Polls until `done`, feeding a fresh motion all the while.
fn until(
    (driver, clock): &mut (ThreeFinger<Port>, Clock),
    motion: Option<Motion<4>>,
    mut done: impl FnMut(&ThreeFinger<Port>, Option<Result<Status<4>, host::gripper::Error>>) -> bool,
) {
    let end = Instant::now() + PATIENCE;
    loop {
        let now = clock.now();
        driver.set_motion(motion, now);
        let heard = driver.poll(now).and_then(Event::ended);
        if done(driver, heard) {
            return;
        }
        assert!(Instant::now() < end, "{:?}", driver.serial_mut().error());
        std::thread::sleep(Duration::from_micros(500));
    }
}

fn hex(text: &str) -> Vec<u8> {
    text.split_whitespace()
        .map(|byte| u8::from_str_radix(byte, 16).unwrap())
        .collect()
}

/// The golden frames' TCP lines: tag, direction, bytes; `None` where the shared data are absent.
fn golden() -> Option<Vec<(String, String, Vec<u8>)>> {
    let text = rig::skip::shared("robotiq/golden_frames.txt")?;
    let lines = text.lines().filter(|line| line.starts_with("TCP"));
    let parse = |line: &str| {
        let (head, _) = line.split_once(';')?;
        let mut words = head.splitn(3, ' ');
        let (tag, way) = (words.next()?.to_owned(), words.next()?.to_owned());
        Some((tag, way, hex(words.next()?)))
    };
    Some(lines.map(|line| parse(line).unwrap()).collect())
}

/// Serves each connection's requests by `answer`: transaction id and PDU in, whole frame out (or `None`: silence).
/// Every PDU asked is told to the receiver.
fn scripted(
    mut answer: impl FnMut([u8; 2], &[u8]) -> Option<Vec<u8>> + Send + 'static,
) -> (u16, Receiver<Vec<u8>>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let (asked, questions) = channel();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            loop {
                let mut header = [0; 7];
                if stream.read_exact(&mut header).is_err() {
                    break;
                }
                let mut pdu = vec![0; usize::from(header[5]) - 1];
                if stream.read_exact(&mut pdu).is_err() || asked.send(pdu.clone()).is_err() {
                    break;
                }
                if let Some(frame) = answer([header[0], header[1]], &pdu)
                    && stream.write_all(&frame).is_err()
                {
                    break;
                }
            }
        }
    });
    (port, questions)
}

/// Ready, open, following nothing: the answer to FC04.
const READY: &str = "04 10 31 FF 00 00 06 00 00 06 00 00 06 00 00 89 00 00";

fn mbap(id: [u8; 2], pdu: &[u8]) -> Vec<u8> {
    let mut frame = vec![id[0], id[1], 0, 0, 0, pdu.len() as u8 + 1, UNIT];
    frame.extend_from_slice(pdu);
    frame
}

/// What a server does with a request.
enum Act {
    Answer(Vec<u8>),
    /// Sends these bytes and ends the connection.
    End(Vec<u8>),
    Hang,
}

/// Serves one connection after the other by `act`: number of the connection and PDU in. What was asked on which
/// connection is told to the receiver.
fn by_connection(
    mut act: impl FnMut(usize, [u8; 2], &[u8]) -> Act + Send + 'static,
) -> (u16, Receiver<(usize, Vec<u8>)>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let (asked, questions) = channel();
    std::thread::spawn(move || {
        for (number, stream) in listener.incoming().enumerate() {
            let mut stream = stream.unwrap();
            let mut header = [0; 7];
            while stream.read_exact(&mut header).is_ok() {
                let mut pdu = vec![0; usize::from(header[5]) - 1];
                if stream.read_exact(&mut pdu).is_err()
                    || asked.send((number, pdu.clone())).is_err()
                {
                    break;
                }
                match act(number, [header[0], header[1]], &pdu) {
                    Act::Answer(frame) => stream.write_all(&frame).unwrap(),
                    Act::Hang => {}
                    Act::End(bytes) => {
                        stream.write_all(&bytes).unwrap();
                        break;
                    }
                }
            }
        }
    });
    (port, questions)
}

/// A golden reply with the transaction id that was asked.
fn with_id(frame: &[u8], id: [u8; 2]) -> Vec<u8> {
    [&id[..], &frame[2..]].concat()
}

#[test]
fn golden_requests_go_as_raw_bytes_to_the_virtual_gripper() {
    let Some(frames) = golden() else { return };
    let gripper = VirtualGripper::new(Config::default());
    let server = tcp::serve(&gripper, "127.0.0.1:0", &rig::Clock::system()).unwrap();
    let mut stream = TcpStream::connect(server.address()).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let mut count = 0;
    for (_, _, request) in frames.iter().filter(|(_, way, _)| way == "req") {
        stream.write_all(request).unwrap();
        let mut header = [0; 7];
        stream.read_exact(&mut header).unwrap();
        let mut pdu = vec![0; usize::from(header[5]) - 1];
        stream.read_exact(&mut pdu).unwrap();
        assert_eq!(header[..4], request[..4], "transaction and protocol");
        assert_eq!((header[6], pdu[0]), (UNIT, request[7]));
        count += 1;
    }
    println!("{count} golden TCP requests answered, FC03 too");
    assert!(count >= 5);
}

#[test]
fn golden_status_replies_from_a_scripted_server_are_understood() {
    let Some(frames) = golden() else { return };
    let status = frames
        .iter()
        .find(|(tag, way, bytes)| tag == "TCP" && way == "rsp" && bytes.len() == 25)
        .map(|(_, _, bytes)| bytes.clone())
        .unwrap();
    let (port, questions) = scripted(move |id, _| Some(with_id(&status, id)));
    let mut us = driver(port);
    let mut seen = None;
    until(&mut us, None, |_, heard| {
        seen = heard.and_then(Result::ok).or(seen);
        seen.is_some()
    });
    let seen = seen.unwrap();
    assert_eq!(seen.position, [8, 8, 8, 137]);
    assert_eq!(seen.echo[0], 255);
    assert_eq!(seen.activation, Activation::Ready);
    // Byte for byte the manual's request: FC04, 8 registers from 07D0.
    assert_eq!(questions.recv().unwrap(), hex("04 07 D0 00 08"));
}

#[test]
fn every_golden_reply_from_a_scripted_server_is_the_status_or_a_typed_error() {
    let Some(frames) = golden() else { return };
    let replies = frames.iter().filter(|(_, way, _)| way == "rsp");
    let (mut statuses, mut refused) = (0, 0);
    for (tag, _, reply) in replies {
        let sent = reply.clone();
        let (port, _questions) = scripted(move |id, _| Some(with_id(&sent, id)));
        let mut us = driver(port);
        let mut first = None;
        until(&mut us, None, |_, heard| {
            first = heard.or(first);
            first.is_some()
        });
        // Only a read of eight registers answers ours; echoes of writes and shorter reads do not.
        let whole = tag == "TCP" && reply.len() == 25;
        assert_eq!(
            first.is_some_and(|heard| heard.is_ok()),
            whole,
            "{reply:02X?}"
        );
        if whole {
            statuses += 1;
            continue;
        }
        let error = us.0.serial_mut().error();
        assert!(
            matches!(error, Some(Error::Mismatch(_) | Error::Malformed(_))),
            "{reply:02X?}: {error:?}"
        );
        refused += 1;
    }
    println!(
        "golden TCP replies to our client: {statuses} taken, {refused} refused with a typed error"
    );
    assert_eq!((statuses, refused), (1, 5));
}

#[test]
fn the_misprinted_reply_is_a_typed_error_and_the_connection_is_made_anew() {
    let Some(frames) = golden() else { return };
    let bad = frames
        .iter()
        .find(|(tag, ..)| tag == "TCPX")
        .unwrap()
        .2
        .clone();
    let good = frames
        .iter()
        .find(|(.., bytes)| bytes.len() == 25)
        .unwrap()
        .2
        .clone();
    let mut first = true;
    let (port, _questions) = scripted(move |id, _| {
        let frame = if std::mem::take(&mut first) {
            &bad
        } else {
            &good
        };
        Some(with_id(frame, id))
    });
    let mut us = driver(port);
    let mut failed = None;
    until(&mut us, None, |_, heard| {
        failed = heard.and_then(Result::err).or(failed);
        failed.is_some()
    });
    let error = us.0.serial_mut().error();
    assert!(matches!(error, Some(Error::Malformed(_))), "{error:?}");
    until(&mut us, None, |_, heard| matches!(heard, Some(Ok(_))));
    assert_eq!(us.0.serial_mut().connections(), 2);
    assert_eq!(us.0.serial_mut().error(), None);
}

#[test]
fn frames_that_do_not_answer_are_typed_errors() {
    let words = |count: usize| [&[4, 2 * count as u8][..], &vec![0; 2 * count]].concat();
    let frame = |id: [u8; 2], unit: u8, pdu: &[u8]| {
        let mut frame = vec![id[0], id[1], 0, 0, 0, pdu.len() as u8 + 1, unit];
        frame.extend_from_slice(pdu);
        frame
    };
    type Make = Box<dyn Fn([u8; 2]) -> Vec<u8> + Send>;
    let cases: Vec<(&str, Make)> = vec![
        (
            "unnumbered",
            Box::new(move |id| frame([id[0] ^ 0x55, id[1]], UNIT, &words(8))),
        ),
        ("mismatch", Box::new(move |id| frame(id, 9, &words(8)))),
        ("mismatch", Box::new(move |id| frame(id, UNIT, &words(7)))),
        (
            "mismatch",
            Box::new(move |id| frame(id, UNIT, &[&[3], &words(8)[1..]].concat())),
        ),
        ("exception", Box::new(move |id| frame(id, UNIT, &[0x84, 2]))),
        ("malformed", Box::new(|_| hex("00 00 00 07 00 03 02 04 00"))),
    ];
    for (kind, make) in cases {
        let (port, _questions) = scripted(move |id, _| Some(make(id)));
        let mut us = driver(port);
        let mut failed = false;
        until(&mut us, None, |_, heard| {
            assert!(!matches!(heard, Some(Ok(_))), "{kind} was believed");
            failed |= heard.is_some();
            failed
        });
        let error = us.0.serial_mut().error();
        let right = match kind {
            "mismatch" => matches!(error, Some(Error::Mismatch(_))),
            "exception" => error == Some(Error::Exception(2)),
            "unnumbered" => matches!(
                error,
                Some(Error::Unnumbered { asked, answered }) if asked ^ answered == 0x5500
            ),
            _ => matches!(error, Some(Error::Malformed(_))),
        };
        assert!(right, "{kind}: {error:?}");
    }
}

#[test]
fn a_write_confirmed_for_other_registers_is_a_typed_error() {
    let (port, questions) = scripted(|id, pdu| {
        let answer = match pdu[0] {
            // Ready, open.
            4 => hex("04 10 31 FF 00 00 06 00 00 06 00 00 06 00 00 89 00 00"),
            // Three registers, where eight were written.
            _ => hex("10 03 E8 00 03"),
        };
        let mut frame = vec![id[0], id[1], 0, 0, 0, answer.len() as u8 + 1, UNIT];
        frame.extend_from_slice(&answer);
        Some(frame)
    });
    let mut us = driver(port);
    let mut failed = false;
    until(&mut us, Some(motion([100; 4])), |_, heard| {
        failed |= matches!(heard, Some(Err(_)));
        failed
    });
    let error = us.0.serial_mut().error();
    assert!(matches!(error, Some(Error::Mismatch(_))), "{error:?}");
    assert!(questions.try_iter().any(|pdu| pdu[0] == 0x10));
}

/// The RTU frame of an FC23 whose block is `mark`, as the driver gives it to the port.
fn marked(mark: u8) -> Vec<u8> {
    let block = [mark; 16];
    let request = host::gripper::rtu::Request::ReadWrite {
        read_address: STATUS,
        read_quantity: 8,
        write_address: COMMAND,
        values: host::gripper::rtu::Registers::from_bytes(&block).unwrap(),
    };
    let mut frame = vec![0; request.buffer_len()];
    request.emit(UNIT, &mut frame).unwrap();
    frame
}

#[test]
fn a_block_handed_over_for_a_lost_connection_never_leaves_on_the_next() {
    use embedded_io::{ReadReady, Write as _};
    // Each case: what the first connection does with the first block, while the second one waits in the queue. Both
    // blocks are fresh for 200 ms, the next connection is there after 100 ms.
    for (case, end) in [("closed", true), ("silent", false)] {
        let (port, questions) = by_connection(move |number, id, pdu| match (number, pdu[0]) {
            (0, _) if end => {
                // So that the second block is in the queue.
                std::thread::sleep(Duration::from_millis(30));
                Act::End(Vec::new())
            }
            (0, _) => Act::Hang,
            (_, 4) => Act::Answer(mbap(id, &hex(READY))),
            _ => Act::Answer(mbap(id, &pdu[..5])),
        });
        let mut line = line(port);
        assert_eq!(line.write(&marked(0xA1)), Ok(29));
        // The task has taken the first job; this one waits behind it.
        let (_, first) = questions.recv_timeout(PATIENCE).unwrap();
        assert_eq!(first[6..], [0xA1; 16]);
        if !end {
            std::thread::sleep(Duration::from_millis(150));
        }
        let queued = line.write(&marked(0xA2));
        let deadline = Instant::now() + PATIENCE;
        while line.connections() < 2 {
            assert!(Instant::now() < deadline, "{:?}", line.error());
            let _ = line.read_ready();
            std::thread::sleep(Duration::from_micros(200));
        }
        // Longer than any job lives.
        std::thread::sleep(Duration::from_millis(400));
        let _ = line.read_ready();
        // What is handed over now does leave: the connection works.
        let sent = Instant::now();
        while line.write(&marked(0xA3)).is_err() {
            assert!(sent.elapsed() < PATIENCE, "{:?}", line.error());
            std::thread::sleep(Duration::from_millis(1));
        }
        let later = loop {
            let (number, pdu) = questions.recv_timeout(PATIENCE).unwrap();
            if pdu[0] == 0x10 {
                break (number, pdu);
            }
        };
        println!(
            "{case}: queued {queued:?}, then on connection {}: {:02X?}",
            later.0, later.1
        );
        assert!(later.0 >= 1);
        assert_eq!(later.1[6..], [0xA3; 16], "{case}: an old block left later");
    }
}

#[test]
fn a_stream_that_ends_inside_a_frame_is_told_as_such_and_made_anew() {
    let whole = mbap([0, 0], &hex(READY)).len();
    for cut in 0..whole {
        for answered in [0, 3] {
            let mut count = 0;
            let (port, _questions) = by_connection(move |number, id, _| {
                let frame = mbap(id, &hex(READY));
                count += 1;
                match number {
                    0 if count > answered => Act::End(frame[..cut].to_vec()),
                    _ => Act::Answer(frame),
                }
            });
            let mut us = driver(port);
            let mut failed = 0;
            until(&mut us, None, |_, heard| {
                failed += u32::from(matches!(heard, Some(Err(_))));
                failed > 0
            });
            let error = us.0.serial_mut().error();
            let expected = if cut == 0 { Error::Closed } else { Error::Cut };
            assert_eq!(error, Some(expected), "after {cut} of {whole} bytes");
            until(&mut us, None, |_, heard| matches!(heard, Some(Ok(_))));
            assert_eq!(us.0.serial_mut().connections(), 2);
            assert_eq!(us.0.serial_mut().error(), None);
        }
    }
    println!(
        "{} streams that end after 0 to {} bytes of an answer: told, and made anew",
        2 * whole,
        whole - 1
    );
}

#[test]
fn an_answer_that_stops_inside_a_frame_while_the_stream_stays_ends_at_the_deadline() {
    let (port, _questions) = by_connection(|number, id, _| {
        let frame = mbap(id, &hex(READY));
        match number {
            0 => Act::Answer(frame[..11].to_vec()),
            _ => Act::Answer(frame),
        }
    });
    let mut us = driver(port);
    let mut failed = false;
    until(&mut us, None, |_, heard| {
        failed |= matches!(heard, Some(Err(_)));
        failed
    });
    assert_eq!(us.0.serial_mut().error(), Some(Error::Timeout));
    until(&mut us, None, |_, heard| matches!(heard, Some(Ok(_))));
    assert_eq!(us.0.serial_mut().connections(), 2);
}

#[test]
fn a_client_that_leaves_inside_a_request_does_not_end_the_virtual_gripper() {
    let gripper = VirtualGripper::new(Config::default());
    let server = tcp::serve(&gripper, "127.0.0.1:0", &rig::Clock::system()).unwrap();
    let request = hex("71 EE 00 00 00 0D 02 10 03 E8 00 03 06 09 00 00 FF FF FF");
    for cut in 0..request.len() {
        let mut stream = TcpStream::connect(server.address()).unwrap();
        stream.write_all(&request[..cut]).unwrap();
    }
    let mut us = driver(server.address().port());
    until(&mut us, None, |_, heard| matches!(heard, Some(Ok(_))));
    assert_eq!(gripper.writes(), 0, "no half of a request counts");
}

#[test]
fn silence_ends_within_the_deadline_and_only_reads_leave() {
    let (port, questions) = scripted(|_, _| None);
    let mut us = driver(port);
    let start = Instant::now();
    let mut failures = 0;
    until(&mut us, Some(motion([200; 4])), |_, heard| {
        assert!(!matches!(heard, Some(Ok(_))));
        failures += u32::from(heard.is_some());
        failures >= 2
    });
    println!("two failures after {:?}", start.elapsed());
    // Never answered: so nothing but reads ever left.
    assert!(questions.try_iter().all(|pdu| pdu[0] == 4));
}

#[test]
fn a_port_without_a_listener_is_refused_with_a_next_step() {
    let port = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port();
    let address = Address {
        host: "127.0.0.1".to_owned(),
        port,
    };
    let refused = Port::connect(&address, UNIT, &Interrupt::never().unwrap()).unwrap_err();
    let (text, code) = host::failure::report(&refused);
    assert!(text.contains("refused") && text.contains("try:"), "{text}");
    assert_eq!(code, 1);
}

fn motion(position: [u8; 4]) -> Motion<4> {
    Motion {
        position,
        speed: [255; 4],
        force: [0; 4],
    }
}

#[test]
fn the_virtual_gripper_is_activated_and_moved_over_tcp_only_when_told() {
    let gripper = VirtualGripper::new(Config::default());
    let server = tcp::serve(&gripper, "127.0.0.1:0", &rig::Clock::system()).unwrap();
    let mut us = driver(server.address().port());
    let mut reads = 0;
    until(&mut us, Some(motion([100, 90, 80, 137])), |_, heard| {
        reads += u32::from(matches!(heard, Some(Ok(_))));
        reads >= 10
    });
    assert_eq!(gripper.writes(), 0, "not activated: nothing is written");
    us.0.activate();
    until(
        &mut us,
        None,
        |_, heard| matches!(heard, Some(Ok(status)) if status.activation == Activation::Ready),
    );
    let target = motion([100, 90, 80, 137]);
    until(&mut us, Some(target), |driver, heard| {
        driver.accepted() && matches!(heard, Some(Ok(status)) if status.position == target.position)
    });
    assert!(us.0.counters().writes > 2);
}

#[test]
fn a_server_that_goes_away_is_connected_to_again() {
    let gripper = VirtualGripper::new(Config::default());
    let clock = rig::Clock::system();
    let server = tcp::serve(&gripper, "127.0.0.1:0", &clock).unwrap();
    let address = server.address();
    let mut us = driver(address.port());
    until(&mut us, None, |_, heard| matches!(heard, Some(Ok(_))));
    drop(server);
    until(&mut us, None, |_, heard| matches!(heard, Some(Err(_))));
    let _server = tcp::serve(&gripper, address, &clock).unwrap();
    until(&mut us, None, |_, heard| matches!(heard, Some(Ok(_))));
    assert!(us.0.serial_mut().connections() >= 2);
}

#[test]
fn tokio_modbus_as_client_reads_and_writes_the_virtual_gripper() {
    let gripper = VirtualGripper::new(Config::default());
    let server = tcp::serve(&gripper, "127.0.0.1:0", &rig::Clock::system()).unwrap();
    let address = server.address();
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    runtime.block_on(async {
        let mut client = tokio_modbus::client::tcp::connect_slave(address, Slave(UNIT))
            .await
            .unwrap();
        let words = client
            .read_input_registers(STATUS, 8)
            .await
            .unwrap()
            .unwrap();
        assert_eq!(words[0], 0, "not activated");
        client
            .write_multiple_registers(COMMAND, &[0x0100, 0, 0])
            .await
            .unwrap()
            .unwrap();
        let end = Instant::now() + PATIENCE;
        loop {
            let words = client
                .read_holding_registers(STATUS, 8)
                .await
                .unwrap()
                .unwrap();
            if words[0] >> 8 & 0x31 == 0x31 {
                break;
            }
            assert!(Instant::now() < end);
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    });
    assert_eq!(gripper.writes(), 1);
}

/// tokio-modbus' server over two blocks; a written command is activated and reached at once.
#[derive(Clone)]
struct Peer(Arc<Mutex<[u8; 16]>>);

impl Service for Peer {
    type Request = SlaveRequest<'static>;
    type Response = Response;
    type Exception = ExceptionCode;
    type Future = Ready<Result<Response, ExceptionCode>>;

    fn call(&self, request: SlaveRequest<'static>) -> Self::Future {
        let mut command = self.0.lock().unwrap();
        ready(match request.request {
            Request::WriteMultipleRegisters(COMMAND, words) if words.len() == 8 => {
                for (bytes, word) in command.chunks_exact_mut(2).zip(words.iter()) {
                    bytes.copy_from_slice(&word.to_be_bytes());
                }
                Ok(Response::WriteMultipleRegisters(COMMAND, 8))
            }
            Request::ReadInputRegisters(STATUS, 8) => {
                let status = status_of(&command);
                let words = status
                    .chunks_exact(2)
                    .map(|b| u16::from_be_bytes([b[0], b[1]]));
                Ok(Response::ReadInputRegisters(words.collect()))
            }
            _ => Err(ExceptionCode::IllegalFunction),
        })
    }
}

fn status_of(command: &[u8; 16]) -> [u8; 16] {
    let asked = three_finger::Command::decode(command).unwrap();
    let mut status = [0; 16];
    if asked.activate {
        status[0] = 0xF1 | u8::from(asked.go_to) << 3;
        status[1] = 0xFF;
        for (k, axis) in asked.axes.iter().enumerate() {
            (status[3 + 3 * k], status[4 + 3 * k]) = (axis.position, axis.position);
        }
    }
    status
}

#[test]
fn our_line_drives_tokio_modbus_as_server() {
    let peer = Peer(Arc::new(Mutex::new([0; 16])));
    let service = peer.clone();
    let (told, port) = channel();
    std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .unwrap();
        runtime.block_on(async {
            let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
            told.send(listener.local_addr().unwrap().port()).unwrap();
            let server = tokio_modbus::server::tcp::Server::new(listener);
            let connected = move |stream, address| {
                let service = service.clone();
                async move {
                    tokio_modbus::server::tcp::accept_tcp_connection(stream, address, |_| {
                        Ok(Some(service.clone()))
                    })
                }
            };
            server.serve(&connected, |_| {}).await.unwrap();
        });
    });
    let mut us = driver(port.recv().unwrap());
    us.0.activate();
    until(
        &mut us,
        None,
        |_, heard| matches!(heard, Some(Ok(status)) if status.activation == Activation::Ready),
    );
    let target = motion([10, 20, 30, 40]);
    until(&mut us, Some(target), |driver, heard| {
        driver.accepted() && heard.is_some()
    });
    let block = *peer.0.lock().unwrap();
    // The manual's layout: rACT rGTO, rICF rICS, then position, speed, force an axis.
    let expected = [9, 12, 0, 10, 255, 0, 20, 255, 0, 30, 255, 0, 40, 255, 0, 0];
    assert_eq!(block, expected);
}
