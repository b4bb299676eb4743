//! The gripper's TCP face against the manual's worked examples, as raw bytes.
#![allow(clippy::unwrap_used)]

mod common;

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use common::hex;
use rig::gripper::{Config, VirtualGripper, tcp};
use rig::{Clock, Instant};

struct Client(TcpStream);

impl Client {
    fn new(server: &tcp::TcpHandle) -> Self {
        let stream = TcpStream::connect(server.address()).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_millis(500)))
            .unwrap();
        Self(stream)
    }

    fn ask(&mut self, text: &str, count: usize) -> Vec<u8> {
        self.0.write_all(&hex(text)).unwrap();
        let mut reply = vec![0; count];
        self.0.read_exact(&mut reply).unwrap();
        reply
    }
}

#[test]
fn requests_and_replies_are_as_printed() {
    let clock = Clock::new();
    let gripper = VirtualGripper::new(Config::default());
    let server = tcp::serve(&gripper, "127.0.0.1:0", &clock).unwrap();
    let mut client = Client::new(&server);
    let activation = client.ask(
        "33 9A 00 00 00 0D 02 10 03 E8 00 03 06 01 00 00 00 00 00",
        12,
    );
    assert_eq!(activation, hex("33 9A 00 00 00 06 02 10 03 E8 00 03"));
    clock.set(Instant::from_ticks(20_000));
    // Asked with FC03, as the manual prints the bytes: answered with FC03.
    let status = client.ask("45 33 00 00 00 06 02 03 07 D0 00 01", 11);
    assert_eq!(status, hex("45 33 00 00 00 05 02 03 02 11 00"));
    let status = client.ask("45 33 00 00 00 06 02 04 07 D0 00 01", 11);
    assert_eq!(status, hex("45 33 00 00 00 05 02 04 02 11 00"));
    clock.set(Instant::from_ticks(10_000_000));
    let close = client.ask(
        "71 EE 00 00 00 0D 02 10 03 E8 00 03 06 09 00 00 FF FF FF",
        12,
    );
    assert_eq!(close, hex("71 EE 00 00 00 06 02 10 03 E8 00 03"));
    clock.set(Instant::from_ticks(10_005_000));
    gripper.run_until(clock.now());
    for finger in 0..3 {
        gripper.set_position(finger, 6.9);
    }
    clock.set(Instant::from_ticks(10_010_000));
    let moving = client.ask("77 6B 00 00 00 06 02 04 07 D0 00 08", 25);
    let printed = "77 6B 00 00 00 13 02 04 10 39 C0 00 FF 08 0F 00 08 10 00 08 0F 00 89 00 00";
    assert_eq!(moving, hex(printed));
    let open = client.ask(
        "34 AB 00 00 00 0D 02 10 03 E8 00 03 06 09 00 00 00 FF FF",
        12,
    );
    assert_eq!(open, hex("34 AB 00 00 00 06 02 10 03 E8 00 03"));
    clock.set(Instant::from_ticks(10_015_000));
    gripper.run_until(clock.now());
    for (finger, at) in [184.0, 189.0, 186.0].into_iter().enumerate() {
        gripper.set_position(finger, at + 0.9);
    }
    clock.set(Instant::from_ticks(10_020_000));
    let opening = client.ask("D6 05 00 00 00 06 02 04 07 D0 00 08", 25);
    // The manual prints a length of 0D here; true is 13 hex.
    let true_reply = "D6 05 00 00 00 13 02 04 10 39 C0 00 00 B8 0B 00 BD 0E 00 BA 0B 00 89 00 00";
    assert_eq!(opening, hex(true_reply));
}

#[test]
fn foreign_units_and_functions_get_silence_and_a_broken_header_ends_it() {
    let gripper = VirtualGripper::new(Config::default());
    let server = tcp::serve(&gripper, "127.0.0.1:0", &Clock::new()).unwrap();
    let mut client = Client::new(&server);
    // Unit 9, FC23, FC06: then a good one in two halves. Only that is answered.
    for silent in [
        "00 01 00 00 00 06 09 04 07 D0 00 01",
        "00 02 00 00 00 0D 02 17 07 D0 00 01 03 E8 00 01 02 01 00",
        "00 03 00 00 00 06 02 06 03 E8 01 00",
        "00 04 00 00 00",
    ] {
        client.0.write_all(&hex(silent)).unwrap();
    }
    let reply = client.ask("06 02 04 07 D0 00 01", 11);
    assert_eq!(reply, hex("00 04 00 00 00 05 02 04 02 00 00"));
    assert_eq!(gripper.writes(), 0);
    client.0.write_all(&hex("00 05 00 07 00 06 02 04")).unwrap();
    let closed = client.0.read(&mut [0; 8]);
    let over = match &closed {
        Ok(count) => *count == 0,
        Err(e) => e.kind() == ErrorKind::ConnectionReset,
    };
    assert!(over, "{closed:?}");
}
