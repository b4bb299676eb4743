//! How the virtual 3-Finger gripper behaves, asked with plain Modbus frames.
#![allow(clippy::unwrap_used)]

mod common;

use common::{Bench, framed, hex};
use embedded_io::Write;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rig::gripper::Config;

/// rACT, rGTO, rICF, rICS with positions of A, B, C, S at full speed and force `force`.
fn individual(positions: [u8; 4], force: u8) -> Vec<u8> {
    let mut block = vec![0x09, 0x0C, 0];
    for p in positions {
        block.extend([p, 0xFF, force]);
    }
    block
}

fn active() -> Bench {
    let mut bench = Bench::new(Config::default());
    bench.activate();
    bench
}

#[test]
fn bad_requests_get_silence() {
    let mut bench = Bench::new(Config::default());
    let good = hex("09 03 07 D0 00 08 45 C9");
    assert_eq!(bench.ask(&good).len(), 21);
    let mut flipped = good.clone();
    flipped[3] ^= 0x10;
    let silent: Vec<(&str, Vec<u8>)> = vec![
        ("bad CRC", flipped),
        ("truncated", good[..7].to_vec()),
        ("one byte more", [&good[..], &[0]].concat()),
        ("other unit", framed(&[8, 3, 7, 0xD0, 0, 8])),
        ("FC04 on the serial line", framed(&[9, 4, 7, 0xD0, 0, 8])),
        ("FC01", framed(&[9, 1, 7, 0xD0, 0, 8])),
        ("behind the block", framed(&[9, 3, 7, 0xD0, 0, 9])),
        ("before the block", framed(&[9, 3, 7, 0xCF, 0, 1])),
        ("no registers", framed(&[9, 3, 7, 0xD0, 0, 0])),
        ("write into the status", framed(&[9, 6, 7, 0xD0, 0, 1])),
        (
            "write too far",
            framed(&[9, 0x10, 3, 0xEF, 0, 2, 4, 1, 2, 3, 4]),
        ),
        ("byte count", framed(&[9, 0x10, 3, 0xE8, 0, 2, 3, 1, 2, 3])),
    ];
    for (what, frame) in silent {
        assert_eq!(bench.ask(&frame), [], "{what}");
    }
    assert_eq!(bench.gripper.writes(), 0);
    assert_eq!(bench.ask(&good).len(), 21);
}

#[test]
fn functions_3_6_16_and_23_are_served() {
    let mut bench = Bench::new(Config::default());
    assert_eq!(
        bench.ask(&framed(&[9, 6, 3, 0xE9, 0x00, 0x80])),
        framed(&[9, 6, 3, 0xE9, 0x00, 0x80])
    );
    assert_eq!(bench.gripper.command_block()[3], 0x80);
    assert_eq!(
        bench.ask(&framed(&[9, 3, 3, 0xE8, 0, 2])),
        framed(&[9, 3, 4, 0, 0, 0, 0x80])
    );
    let both = [9, 0x17, 7, 0xD0, 0, 8, 3, 0xE8, 0, 1, 2, 0x01, 0x00];
    let reply = bench.ask(&framed(&both));
    assert_eq!((reply.len(), reply[1], reply[2]), (21, 0x17, 16));
    assert_eq!(reply[3], 0x00, "the status is as old as the last refresh");
    assert_eq!(bench.status(1)[0], 0x11);
}

#[test]
fn the_reply_comes_after_the_silence_that_ends_the_frame() {
    let mut bench = Bench::new(Config::default());
    bench.wire.write(&hex("09 03 07 D0 00 08 45 C9")).unwrap();
    // 8 x 86.8 us + 1,750 us + 21 x 86.8 us = 4,267 us.
    bench.clock.set(rig::Instant::from_ticks(4_265));
    assert_eq!(bench.drain().len(), 20);
    bench.clock.set(rig::Instant::from_ticks(4_270));
    assert_eq!(bench.drain().len(), 1);
}

#[test]
fn a_request_sooner_than_5_ms_after_the_last_gets_silence() {
    let read = hex("09 03 07 D0 00 01 85 CF");
    for (spacing_us, served) in [(4_000, 1), (4_900, 1), (5_000, 2), (6_000, 2)] {
        let mut bench = Bench::new(Config::default());
        bench.wire.write(&read).unwrap();
        bench.clock.advance(rig::Duration::from_micros(spacing_us));
        bench.drain();
        bench.wire.write(&read).unwrap();
        bench.wait_ms(20);
        bench.drain();
        assert_eq!(bench.gripper.requests().0, served, "{spacing_us} us apart");
    }
}

#[test]
fn a_command_counts_when_its_echo_stands_in_the_status() {
    let mut bench = active();
    let command = individual([100, 110, 120, 130], 50);
    let mut request = vec![9, 0x17, 7, 0xD0, 0, 8, 3, 0xE8, 0, 8, 16];
    request.extend(&command);
    request.push(0);
    let reply = bench.ask(&framed(&request));
    assert_eq!(
        (reply[3] & 0x08, reply[6]),
        (0, 0),
        "read before the refresh: old echo, gGTO 0"
    );
    let status = bench.status(8);
    assert_eq!(status[0] & 0x08, 0x08);
    assert_eq!(
        [status[3], status[6], status[9], status[12]],
        [100, 110, 120, 130]
    );
    bench.settle();
    let status = bench.status(8);
    assert_eq!(status[..2], [0xF9, 0xFF]);
    assert_eq!(
        [status[4], status[7], status[10], status[13]],
        [100, 110, 120, 130]
    );
}

#[test]
fn nothing_moves_without_activation_and_fault_07_says_so() {
    let mut bench = Bench::new(Config::default());
    bench.command(&[0x08, 0, 0, 0xFF, 0xFF, 0xFF]);
    bench.settle();
    let status = bench.status(8);
    assert_eq!((status[0], status[2]), (0x00, 0x07));
    assert_eq!(bench.gripper.motions(), 0);
}

#[test]
fn a_command_while_activating_is_late_with_fault_05() {
    let mut bench = Bench::new(Config::default());
    bench.command(&[0x09, 0, 0, 0x80, 0xFF, 0xFF]);
    let status = bench.status(8);
    assert_eq!(
        (status[0], status[2], status[3]),
        (0x11, 0x05, 0),
        "no echo before it counts"
    );
    for _ in 0..500 {
        bench.wait_ms(10);
    }
    let status = bench.status(8);
    assert_eq!(
        (status[0], status[2], status[3], status[4]),
        (0xF9, 0x00, 0x80, 0x80)
    );
}

#[test]
fn every_activation_runs_the_fingers_through_their_stroke_one_after_a_reset_too() {
    let mut bench = active();
    bench.command(&individual([100, 110, 120, 130], 255));
    bench.settle();
    bench.command(&[0; 16]);
    assert_eq!(bench.status(1)[0], 0x00);
    bench.command(&[1, 0, 0, 0, 0, 0]);
    let mut farthest = [0.0f32; 3];
    for _ in 0..500 {
        let positions = bench.gripper.positions();
        for (most, now) in farthest.iter_mut().zip(positions) {
            *most = most.max(now);
        }
        if bench.status(1)[0] & 0x30 == 0x30 {
            assert!(farthest.iter().all(|most| *most > 240.0), "{farthest:?}");
            assert!(
                positions[..3].iter().all(|now| *now < 10.0),
                "{positions:?}"
            );
            return;
        }
    }
    panic!("never ready");
}

#[test]
fn a_finger_goes_at_22_to_110_mm_a_second() {
    for (register, counts_per_s) in [(0u8, 36.2), (255, 181.0), (128, 108.9)] {
        let mut bench = active();
        bench.command(&[0x09, 0, 0, 0xFF, register, 0xFF]);
        let before = bench.gripper.positions()[0];
        bench.wait_ms(500);
        let moved = bench.gripper.positions()[0] - before;
        assert!(
            (moved - counts_per_s * 0.5).abs() < 1.0,
            "{moved} at speed {register}"
        );
    }
}

#[test]
fn software_limits_lie_inside_the_stops_and_count_as_at_position() {
    let mut bench = active();
    bench.command(&individual([255, 255, 255, 137], 255));
    bench.settle();
    let status = bench.status(8);
    assert_eq!(status[..2], [0xF9, 0xFF]);
    assert_eq!([status[4], status[7], status[10]], [249; 3]);
    bench.command(&individual([0, 0, 0, 0], 255));
    bench.settle();
    let status = bench.status(8);
    assert_eq!(
        [status[4], status[7], status[10], status[13]],
        [7, 6, 6, 16],
        "scissor range reduced"
    );
    bench.command(&individual([0, 0, 0, 255], 255));
    bench.settle();
    assert_eq!(bench.status(8)[13], 239);
}

#[test]
fn contact_of_one_two_and_three_fingers_shows_in_gsta_and_gdtx() {
    for fingers in 1..=3 {
        let mut bench = active();
        for finger in 0..fingers {
            bench.gripper.set_object(finger, Some(90.0));
        }
        bench.command(&individual([180, 180, 180, 137], 100));
        bench.settle();
        let status = bench.status(8);
        assert_eq!(status[0] >> 6, if fingers == 3 { 2 } else { 1 });
        for finger in 0..3 {
            let expected = if finger < fingers { (2, 90) } else { (3, 180) };
            let seen = (status[1] >> (2 * finger) & 3, status[4 + 3 * finger]);
            assert_eq!(seen, expected, "finger {finger} of {fingers}");
        }
    }
}

#[test]
fn opening_against_something_is_contact_1() {
    let mut bench = active();
    bench.command(&individual([200, 6, 6, 137], 100));
    bench.settle();
    bench.gripper.set_inner_object(0, Some(150.0));
    bench.command(&individual([50, 6, 6, 137], 100));
    bench.settle();
    let status = bench.status(8);
    assert_eq!((status[1] & 3, status[4], status[0] >> 6), (1, 150, 1));
}

#[test]
fn after_contact_only_opposite_force_or_go_toggle_moves_a_finger() {
    let mut bench = active();
    bench.gripper.set_object(0, Some(100.0));
    bench.command(&individual([200, 6, 6, 137], 100));
    bench.settle();
    bench.gripper.set_object(0, None);
    bench.command(&individual([220, 6, 6, 137], 100));
    bench.settle();
    assert_eq!(bench.gripper.positions()[0], 100.0);
    let mut stop = individual([220, 6, 6, 137], 100);
    stop[0] = 0x01;
    bench.command(&stop);
    bench.command(&individual([220, 6, 6, 137], 100));
    bench.settle();
    assert_eq!(bench.gripper.positions()[0], 220.0);
}

#[test]
fn a_change_of_speed_starts_no_motion() {
    let mut bench = active();
    bench.command(&individual([100, 100, 100, 137], 100));
    bench.settle();
    let motions = bench.gripper.motions();
    let mut slow = individual([100, 100, 100, 137], 100);
    slow[4] = 10;
    bench.command(&slow);
    bench.settle();
    assert_eq!(bench.gripper.motions(), motions);
}

#[test]
fn clearing_rgto_stops_a_motion_where_it_is() {
    let mut bench = active();
    bench.command(&individual([249, 6, 6, 137], 100));
    bench.wait_ms(300);
    let mut stop = individual([249, 6, 6, 137], 100);
    stop[0] = 0x01;
    bench.command(&stop);
    let at = bench.gripper.positions()[0];
    assert!(at > 50.0 && at < 120.0, "{at}");
    bench.settle();
    assert_eq!(bench.gripper.positions()[0], at);
    assert_eq!(bench.status(8)[..2], [0x31, 0x00]);
}

#[test]
fn simplified_control_moves_b_and_c_with_a() {
    let mut bench = active();
    bench.command(&[0x09, 0, 0, 120, 255, 100]);
    bench.settle();
    assert_eq!(bench.gripper.positions(), [120.0, 120.0, 120.0, 137.0]);
    assert_eq!(bench.status(8)[6], 0, "the echo of B is B's own request");
}

#[test]
fn a_mode_change_is_a_motion_and_commands_meanwhile_give_fault_06() {
    let mut bench = active();
    for (mode, scissor) in [(2u8, 6u8), (1, 249), (3, 137), (0, 137)] {
        bench.command(&[0x09 | mode << 1, 0, 0, 60, 255, 100]);
        let status = bench.status(8);
        if mode != 0 {
            assert_eq!((status[0] >> 4 & 3, status[2]), (2, 0x06), "mode {mode}");
        }
        bench.settle();
        bench.settle();
        let status = bench.status(8);
        assert_eq!(status[0], 0xF9 | mode << 1);
        let lateral = if mode == 3 { 60 } else { scissor };
        assert_eq!(
            status[13], lateral,
            "mode {mode}: rPRA drives the scissor in scissor mode"
        );
    }
}

#[test]
fn rics_ignores_the_mode() {
    let mut bench = active();
    let mut block = individual([50, 60, 70, 90], 100);
    block[0] |= 1 << 1;
    bench.command(&block);
    bench.settle();
    assert_eq!(bench.gripper.positions(), [50.0, 60.0, 70.0, 90.0]);
    assert_eq!(bench.status(8)[0] >> 4 & 3, 3);
}

#[test]
fn automatic_release_opens_slowly_overrides_and_ends_in_fault_0f() {
    let mut bench = active();
    bench.command(&individual([100, 100, 100, 137], 100));
    bench.settle();
    let mut release = individual([200, 200, 200, 137], 100);
    release[0] |= 0x10;
    bench.command(&release);
    let status = bench.status(8);
    assert_eq!((status[0] >> 4 & 3, status[2]), (0, 0x0B));
    let before = bench.gripper.positions()[0];
    bench.wait_ms(1_000);
    let moved = before - bench.gripper.positions()[0];
    assert!((moved - 36.2).abs() < 1.0, "22 mm/s: {moved}");
    bench.settle();
    let status = bench.status(8);
    assert_eq!((status[2], status[4]), (0x0F, 7));
    // Only rACT 1 -> 0 -> 1 helps.
    bench.command(&individual([100, 100, 100, 137], 100));
    bench.settle();
    assert_eq!(bench.status(8)[2], 0x0F);
    bench.command(&[0; 6]);
    bench.command(&individual([100, 100, 100, 137], 100));
    // Through the whole stroke first.
    bench.wait_ms(4_000);
    bench.settle();
    assert_eq!(
        (bench.status(8)[2], bench.gripper.positions()[0]),
        (0, 100.0)
    );
}

#[test]
fn fingers_barred_by_the_scissor_give_fault_0a_and_0e_after_20_s() {
    let mut bench = active();
    bench.command(&individual([6, 6, 6, 230], 100));
    bench.settle();
    bench.command(&individual([200, 200, 200, 230], 100));
    bench.settle();
    let status = bench.status(8);
    assert_eq!(status[2], 0x0A);
    let [a, b, c, _] = bench.gripper.positions();
    assert!(a + b.max(c) <= 310.0);
    // Making room frees them without more ado.
    bench.command(&individual([200, 200, 200, 100], 100));
    bench.settle();
    assert_eq!(bench.status(8)[2], 0);
    assert_eq!(bench.gripper.positions(), [200.0, 200.0, 200.0, 100.0]);
    bench.command(&individual([200, 200, 200, 230], 100));
    bench.wait_ms(19_000);
    assert_eq!(bench.gripper.status_block()[2], 0x0A);
    bench.wait_ms(3_000);
    assert_eq!(bench.gripper.status_block()[2], 0x0E);
}

#[test]
fn fingers_that_meet_while_the_mode_has_the_scissor_touch_and_closed_ones_stop_a_mode_change() {
    let mut bench = active();
    // Pinch, each finger on its own.
    let fingers = |mode: u8, to: u8| {
        let mut block = individual([to, to, to, 0], 100);
        (block[0], block[1]) = (block[0] | mode << 1, 0x04);
        block
    };
    bench.command(&fingers(1, 6));
    bench.settle();
    bench.command(&fingers(1, 250));
    bench.wait_ms(25_000);
    let status = bench.status(8);
    assert_eq!((status[2], status[1] & 3), (0, 2), "a contact, no fault");
    bench.command(&fingers(0, 6));
    bench.settle();
    bench.command(&fingers(0, 250));
    bench.settle();
    bench.command(&fingers(1, 250));
    bench.wait_ms(3_000);
    assert_eq!(bench.status(8)[2], 0x0A);
    assert!(bench.gripper.positions()[3] < 201.0);
    bench.command(&fingers(0, 250));
    bench.wait_ms(3_000);
    assert_eq!(bench.status(8)[2], 0);
}

#[test]
fn every_fault_can_be_shown_and_major_ones_stop_until_ract_falls() {
    for code in 1..=15u8 {
        let mut bench = active();
        bench.command(&individual([249, 249, 249, 137], 100));
        bench.gripper.set_fault(Some(code));
        bench.wait_ms(10);
        assert_eq!(bench.gripper.status_block()[2], code);
        let before = bench.gripper.positions()[0];
        bench.wait_ms(300);
        let moves = bench.gripper.positions()[0] > before + 1.0;
        assert_eq!(moves, code < 0x0D, "fault {code:X}");
        bench.command(&[0; 6]);
        if code >= 0x0D {
            assert_eq!(bench.status(8)[2], 0, "fault {code:X} cleared by rACT = 0");
        }
    }
}

#[test]
fn connecting_and_reading_moves_nothing() {
    let mut bench = active();
    bench.command(&individual([120, 120, 120, 137], 100));
    bench.settle();
    let (motions, writes, block) = (
        bench.gripper.motions(),
        bench.gripper.writes(),
        bench.gripper.command_block(),
    );
    for _ in 0..50 {
        bench.status(8);
    }
    assert_eq!(motions, bench.gripper.motions());
    assert_eq!(writes, bench.gripper.writes());
    assert_eq!(block, bench.gripper.command_block());
}

#[test]
fn a_gripper_found_active_has_not_moved() {
    let config = Config {
        start: [90.0, 90.0, 90.0, 137.0],
        ..Config::default()
    };
    let mut bench = Bench::new(config);
    bench.gripper.preset_active();
    bench.wait_ms(20);
    assert_eq!(bench.status(8)[..5], [0x31, 0, 0, 0, 90]);
    assert_eq!((bench.gripper.motions(), bench.gripper.writes()), (0, 0));
    bench.command(&individual([100, 90, 90, 137], 100));
    bench.settle();
    assert_eq!(bench.gripper.positions()[0], 100.0);
}

#[test]
fn a_muted_gripper_obeys_and_says_nothing() {
    let mut bench = active();
    bench.gripper.mute(1);
    assert_eq!(bench.ask(&framed(&[9, 6, 3, 0xE9, 0, 77])), []);
    assert_eq!(bench.gripper.command_block()[3], 77);
    assert_eq!(bench.status(1)[0], 0x31);
    bench
        .gripper
        .set_reply_delay(rig::Duration::from_millis(40));
    assert_eq!(bench.ask(&framed(&[9, 3, 7, 0xD0, 0, 1])), []);
    bench.wait_ms(40);
    assert_eq!(bench.drain().len(), 7);
}

#[test]
fn random_bytes_never_break_it_nor_move_it() {
    for seed in 0..50 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut bench = active();
        let motions = bench.gripper.motions();
        for _ in 0..100 {
            let mut noise = vec![0; (rng.next_u32() % 300) as usize];
            rng.fill_bytes(&mut noise);
            if let Some(first) = noise.first_mut() {
                *first = 9;
            }
            bench.wire.write(&noise).unwrap();
            bench.wait_ms(u64::from(rng.next_u32() % 40));
        }
        bench.wait_ms(100);
        bench.drain();
        assert_eq!(bench.status(1)[0], 0x31);
        assert_eq!(bench.gripper.motions(), motions);
    }
}
