//! The virtual gripper against the worked examples printed in the manuals, byte for byte.
#![allow(clippy::unwrap_used)]

mod common;

use common::{Bench, framed, hex};
use rig::gripper::{Config, Family};

const ACTIVATE: &str = "09 10 03 E8 00 03 06 01 00 00 00 00 00 72 E1";
const RESET: &str = "09 10 03 E8 00 03 06 00 00 00 00 00 00 73 30";
const WRITTEN: &str = "09 10 03 E8 00 03 01 30";
const READ_1: &str = "09 03 07 D0 00 01 85 CF";
const READ_8: &str = "09 03 07 D0 00 08 45 C9";
const CLOSE: &str = "09 10 03 E8 00 03 06 09 00 00 FF FF FF 42 29";
const OPEN: &str = "09 10 03 E8 00 03 06 09 00 00 00 FF FF 72 19";

#[test]
fn activation_answers_as_printed_and_moves_the_fingers() {
    let mut bench = Bench::new(Config::default());
    assert_eq!(bench.ask(&hex(RESET)), hex(WRITTEN));
    assert_eq!(bench.ask(&hex(ACTIVATE)), hex(WRITTEN));
    assert_eq!(bench.ask(&hex(READ_1)), hex("09 03 02 11 00 55 D5"));
    assert!(bench.gripper.is_moving());
    bench.wait_ms(500);
    assert!(bench.gripper.positions()[0] > 50.0);
    for _ in 0..300 {
        bench.wait_ms(20);
    }
    assert_eq!(bench.ask(&hex(READ_1)), hex("09 03 02 31 00 4C 15"));
    assert_eq!(bench.gripper.positions(), [7.0, 6.0, 6.0, 137.0]);
}

#[test]
fn closing_on_an_object_and_opening_answer_as_printed() {
    let mut bench = Bench::new(Config::default());
    bench.activate();
    for (finger, at) in [188.0, 193.0, 189.0].into_iter().enumerate() {
        bench.gripper.set_object(finger, Some(at));
    }
    assert_eq!(bench.ask(&hex(CLOSE)), hex(WRITTEN));
    let moving = hex("09 03 10 39 C0 00 FF 08 0F 00 08 10 00 08 0F 00 89 00 00 73 70");
    let seen = bench.ask(&hex(READ_8));
    // Everything but the positions, which depend on the moment.
    for (i, (a, b)) in seen.iter().zip(&moving).enumerate() {
        let position = matches!(i, 7 | 10 | 13) || i >= 19;
        assert!(position || a == b, "byte {i}: {seen:02X?}");
    }
    bench.settle();
    let stopped = "09 03 10 B9 EA 00 FF BC 00 00 C1 00 00 BD 00 00 89 00 00 4E 17";
    assert_eq!(bench.ask(&hex(READ_8)), hex(stopped));

    assert_eq!(bench.ask(&hex(OPEN)), hex(WRITTEN));
    let opening = hex("09 03 10 39 C0 00 00 B8 0B 00 BD 0E 00 BA 0B 00 89 00 00 10 85");
    let seen = bench.ask(&hex(READ_8));
    for (i, (a, b)) in seen.iter().zip(&opening).enumerate() {
        let position = matches!(i, 7 | 10 | 13) || i >= 19;
        assert!(position || a == b, "byte {i}: {seen:02X?}");
    }
    bench.settle();
    let opened = "09 03 10 F9 FF 00 00 07 00 00 06 00 00 06 00 00 89 00 00 34 8D";
    assert_eq!(bench.ask(&hex(READ_8)), hex(opened));
}

#[test]
fn positions_in_motion_read_as_printed_when_the_fingers_are_there() {
    let mut bench = Bench::new(Config::default());
    bench.activate();
    bench.ask(&hex(CLOSE));
    // The registers are refreshed every 5 ms; 0.9 counts a refresh at full speed.
    for finger in 0..3 {
        bench.gripper.set_position(finger, 6.9);
    }
    bench.wait_ms(5);
    let status = bench.gripper.status_block();
    assert_eq!(
        status[..],
        hex("39 C0 00 FF 08 0F 00 08 10 00 08 0F 00 89 00 00")
    );
}

#[test]
fn all_eight_registers_and_the_release_are_taken() {
    let mut bench = Bench::new(Config::default());
    bench.activate();
    let block = "09 10 03 E8 00 08 10 09 0C 00 80 FF 96 80 FF 96 80 FF 96 80 FF 96 00 DB BA";
    assert_eq!(bench.ask(&hex(block)), hex("09 10 03 E8 00 08 40 F7"));
    bench.settle();
    assert_eq!(bench.gripper.positions(), [128.0; 4]);
    assert_eq!(
        bench.ask(&hex("09 10 03 E8 00 01 02 11 00 E9 E8")),
        framed(&hex("09 10 03 E8 00 01"))
    );
    bench.wait_ms(20);
    assert_eq!(bench.gripper.status_block()[2], 0x0B);
}

#[test]
fn a_hand_e_and_a_2f_answer_as_printed() {
    for family in [Family::TwoFinger85, Family::TwoFinger140, Family::HandE] {
        let mut bench = Bench::new(Config::of(family));
        bench.activate();
        bench.gripper.set_object(0, Some(f32::from(0xBDu8)));
        assert_eq!(bench.ask(&hex(CLOSE)), hex(WRITTEN));
        let seen = bench.ask(&hex("09 03 07 D0 00 03 04 0E"));
        let closing = hex("09 03 06 39 00 00 FF 0E 0A F7 8B");
        assert_eq!(seen[..7], closing[..7]);
        assert_eq!(seen[8], closing[8]);
        bench.settle();
        let gripped = bench.ask(&hex("09 04 07 D0 00 03 B1 CE"));
        assert_eq!(gripped, hex("09 04 06 B9 00 00 FF BD 00 5C 9A"));
        assert_eq!(bench.ask(&hex(OPEN)), hex(WRITTEN));
        bench.settle();
        assert_eq!(
            bench.ask(&hex("09 04 07 D0 00 03 B1 CE")),
            hex("09 04 06 F9 00 00 00 0D 00 17 AA")
        );
        assert_eq!(
            bench.ask(&hex("09 03 07 D0 00 03 04 0E")),
            hex("09 03 06 F9 00 00 00 0D 00 56 4C")
        );
        // Position alone, from the second register on.
        let position = "09 10 03 E9 00 02 04 60 E6 3C C8 EC 7C";
        assert_eq!(bench.ask(&hex(position)), hex("09 10 03 E9 00 02 91 30"));
        assert_eq!(bench.gripper.command_block()[..6], hex("09 00 60 E6 3C C8"));
        let both = "09 17 07 D0 00 02 03 E9 00 02 04 00 E6 3C C8 2D 0C";
        let reply = bench.ask(&hex(both));
        assert_eq!((reply.len(), &reply[..3]), (9, &hex("09 17 04")[..]));
        assert_eq!(reply[6], 0xE6, "the echo of the position");
    }
}
