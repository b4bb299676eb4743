//! A machine that stands still in motion, at random moments and for random times, while somebody else moves the gripper:
//! the first command after it is where the gripper is then, not where an answer from before the stall said.

mod common;

use bridge::{Settings, State};
use common::FIST;
use common::bench::{Bench, MS, S};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const STALLS: usize = 1_000;
const SEED: u64 = 13;
/// How far the gripper can go between the status that a command rests on and the command's leaving, counts: 181 counts/s
/// over two cycles, and rounding.
const BETWEEN: f32 = 5.0;

/// One stall in the middle of motion; the farthest that the first command after it lies from the gripper, if one left.
fn stall(bench: &mut Bench, rng: &mut ChaCha8Rng) -> Option<f32> {
    let mut below = |bound: u64| rng.next_u64() % bound;
    bench.set_pose(FIST.map(|angle| angle * (below(100) as f32 / 100.0)));
    // Any moment of a cycle of the gripper and of a scan of the glove, in the middle of a way.
    bench.run(100 * MS + below(200_000));
    let length = match below(4) {
        0 => 100 * MS + below(150_000),
        1 => 250 * MS + below(750_000),
        _ => S + below(9_000_000),
    };
    let before = bench.app.telemetry().sent_sequence;
    bench.clock.advance(rig::Duration::from_micros(length / 2));
    for axis in 0..3 {
        let here = bench.gripper.positions()[axis];
        bench.gripper.set_position(
            axis,
            if here > 128.0 {
                here - 90.0
            } else {
                here + 90.0
            },
        );
    }
    bench
        .clock
        .advance(rig::Duration::from_micros(length - length / 2));
    let end = bench.now() + 300 * MS;
    while bench.now() < end {
        let positions = bench.gripper.positions();
        bench.step();
        let telemetry = bench.app.telemetry();
        if telemetry.sent_sequence != before {
            let sent = telemetry.sent.expect("it left");
            return positions
                .iter()
                .zip(sent.motion.position)
                .map(|(here, told)| (here - f32::from(told)).abs())
                .max_by(f32::total_cmp);
        }
    }
    None
}

#[test]
fn the_first_command_after_a_stall_is_where_the_gripper_is() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut bench = Bench::new(Settings::default());
    bench.ready();
    let (mut worst, mut commands) = (0.0_f32, 0);
    for _ in 0..STALLS {
        if !bench.state().is_moving() {
            // A person opens it, looks, and closes it again.
            bench.release();
            bench.run(50 * MS);
            bench.clutch = true;
            bench.until("following", |bench| bench.state() == State::Following);
        }
        if let Some(off) = stall(&mut bench, &mut rng) {
            commands += 1;
            worst = worst.max(off);
            assert!(off <= BETWEEN, "{off} counts from the gripper");
        }
    }
    println!(
        "seed {SEED}: {STALLS} stalls, {commands} first commands, at most {worst:.1} counts from the gripper"
    );
    assert!(commands > STALLS * 3 / 4, "{commands} commands");
}

/// A laptop's lid closes in motion: the bridge's clock goes on, the ports keep the bytes that were on their way, and somebody
/// moves the gripper meanwhile.
#[test]
fn after_a_sleep_nothing_rests_on_what_lay_in_the_ports() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut bench = Bench::new(Settings::default());
    bench.ready();
    let mut commands = 0;
    for round in 0..400 {
        bench.release();
        bench.run(100 * MS);
        bench.clutch = true;
        bench.until("following", |bench| bench.state() == State::Following);
        bench.set_pose(FIST.map(|angle| angle * (rng.next_u32() % 100) as f32 / 100.0));
        bench.run(100 * MS + rng.next_u64() % 200_000);
        let before = bench.app.telemetry().sent_sequence;
        let woke = bench.sleep([300 * MS, 2 * S, 30 * S][round % 3]);
        // By little it is where it was left; far off nothing is written until a person says so.
        let by = [12.0, 12.0, 12.0, 90.0][round / 3 % 4];
        for axis in 0..3 {
            let here = bench.gripper.positions()[axis];
            let there = if here > 128.0 { here - by } else { here + by };
            bench.gripper.set_position(axis, there);
        }
        let end = bench.now() + 300 * MS;
        let mut first = true;
        while bench.now() < end {
            let positions = bench.gripper.positions();
            bench.step();
            let seen = bench.app.telemetry();
            if seen.sent_sequence != before {
                let sent = seen.sent.expect("it left");
                assert!(sent.stamp >= woke && sent.decided >= woke, "{round}");
                for (here, told) in positions.iter().zip(sent.motion.position) {
                    let off = (here - f32::from(told)).abs();
                    assert!(!first || off <= BETWEEN, "{round}: {off} counts off");
                }
                commands += u32::from(std::mem::take(&mut first));
            }
        }
    }
    println!("seed {SEED}: {commands} first commands");
    assert!(commands > 200, "{commands} commands");
}
