//! How the virtual 2F-85, 2F-140 and Hand-E behave, and that every golden request is understood.
#![allow(clippy::unwrap_used)]

mod common;

use common::{Bench, framed, hex};
use rig::gripper::{Config, Family};

const ALL: [Family; 3] = [Family::TwoFinger85, Family::TwoFinger140, Family::HandE];

fn active(family: Family) -> Bench {
    let mut bench = Bench::new(Config::of(family));
    bench.activate();
    bench
}

#[test]
fn activation_takes_time_and_a_command_meanwhile_gives_fault_05() {
    for family in ALL {
        let mut bench = Bench::new(Config::of(family));
        bench.command(&[0x08, 0, 0, 0, 0, 0]);
        assert_eq!(bench.status(3)[..3], [0x00, 0, 0x07], "rACT first");
        bench.command(&[0x09, 0, 0, 0x80, 0xFF, 0x40]);
        let status = bench.status(3);
        assert_eq!((status[0] & 0x30, status[2]), (0x10, 0x05), "{family:?}");
        for _ in 0..600 {
            bench.status(1);
        }
        assert_eq!(bench.status(3)[..5], [0xF9, 0, 0, 0x80, 0x80]);
    }
}

#[test]
fn a_second_without_a_request_gives_fault_09_once() {
    let mut bench = active(Family::TwoFinger85);
    bench.wait_ms(900);
    assert_eq!(bench.status(3)[2], 0);
    bench.wait_ms(1_100);
    assert_eq!(bench.status(3)[2], 0x09);
    assert_eq!(
        bench.status(3)[2],
        0,
        "the request itself ended the silence"
    );
}

#[test]
fn contact_shows_in_gobj_and_the_release_goes_the_way_rard_says() {
    for (ard, end) in [(0x20u8, 13.0), (0x00, 230.0)] {
        let mut bench = active(Family::TwoFinger140);
        bench.gripper.set_object(0, Some(120.0));
        bench.command(&[0x09, 0, 0, 0xFF, 0xFF, 0x40]);
        bench.settle();
        assert_eq!(bench.status(3)[..6], [0xB9, 0, 0, 0xFF, 120, 0]);
        bench.gripper.set_object(0, None);
        bench.command(&[0x11 | ard, 0, 0, 0, 0, 0]);
        // In automatic release and after it gSTA is 0, as in reset; gACT stays.
        assert_eq!(bench.status(3)[..3], [0x01, 0, 0x0B]);
        bench.settle();
        bench.status(3);
        assert_eq!(bench.status(3)[..3], [0x01, 0, 0x0F]);
        assert_eq!(bench.gripper.positions()[0], end);
        bench.command(&[0; 6]);
        assert_eq!(bench.status(3)[2], 0);
    }
}

#[test]
fn faults_from_0a_on_but_the_release_stop_until_ract_falls() {
    for code in 1..=15u8 {
        let mut bench = active(Family::HandE);
        bench.command(&[0x09, 0, 0, 0xFF, 0x10, 0x40]);
        bench.gripper.set_fault(Some(code));
        bench.wait_ms(10);
        assert_eq!(bench.gripper.status_block()[2], code);
        let before = bench.gripper.positions()[0];
        bench.wait_ms(200);
        let moves = bench.gripper.positions()[0] > before + 1.0;
        assert_eq!(moves, code < 0x0A || code == 0x0B, "fault {code:X}");
    }
}

#[test]
fn its_block_is_three_registers_long() {
    let mut bench = Bench::new(Config::of(Family::HandE));
    assert_eq!(bench.ask(&framed(&[9, 3, 7, 0xD0, 0, 4])), []);
    assert_eq!(
        bench.ask(&framed(&[9, 0x10, 3, 0xEA, 0, 2, 4, 1, 2, 3, 4])),
        []
    );
    assert_eq!(
        bench.ask(&framed(&[9, 6, 3, 0xE8, 1, 0])),
        [],
        "FC06 is not among its functions"
    );
    assert_eq!(bench.ask(&framed(&[9, 3, 7, 0xD2, 0, 1])).len(), 7);
}

#[test]
fn every_golden_request_on_the_serial_line_is_answered() {
    let Some(text) = rig::skip::shared("robotiq/golden_frames.txt") else {
        return;
    };
    let mut asked = 0;
    for line in text.lines().filter(|l| l.starts_with("RTU")) {
        let bytes = line.split(';').next().unwrap();
        let mut words = bytes.split_whitespace();
        let (tag, direction) = (words.next().unwrap(), words.next().unwrap());
        if direction != "req" {
            continue;
        }
        let family = if tag == "RTU2F" {
            Family::HandE
        } else {
            Family::ThreeFinger
        };
        let request = hex(&words.collect::<Vec<_>>().join(" "));
        let reply = Bench::new(Config::of(family)).ask(&request);
        assert_eq!(reply.get(..2), request.get(..2), "{line}");
        assert_eq!(framed(&reply[..reply.len() - 2]), reply, "{line}");
        asked += 1;
    }
    assert_eq!(asked, 12, "requests in the file");
}
