//! The long runs, each behind a chore of `cargo xtask`: `powercut`, `same-bits`, `measure`, `count`.
//!
//! They print counts and end with code 1 at the first fact that does not hold.

use std::process::ExitCode;
use std::time::Duration;

use gauntlet::progress::Progress;
use hae::image::JointOrder;
use loop_tests::chip::{self, bench, firmware};
use loop_tests::emulated::{Loop, alone, cut_power};
use loop_tests::power_cuts::{
    self, UNIT, every_pair, every_single, four_kilobytes, full_size, small,
};
use loop_tests::sessions::{self, Log};
use loop_tests::trace::{self, record};
use loop_tests::{bits, images, slot_contents};

const SEED: u64 = 0x6175_6E74_6C65_7400;
/// Gripper cycles a second that a bridge on the chip must reach.
const LEAST_RATE: f64 = 50.0;

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let outcome = match words.as_slice() {
        ["powercut"] => store().and_then(|()| contents()).and_then(|()| kills()),
        ["powercut", "store"] => store(),
        ["powercut", "contents"] => contents(),
        ["powercut", "qemu"] => kills(),
        ["same-bits"] => same_bits(),
        ["measure"] => measure(),
        ["sessions"] => sessions(),
        ["count"] => counts().map(|text| print!("{text}")),
        _ => Err(
            "usage: campaign powercut [store | contents | qemu] | same-bits | sessions | measure | count"
                .to_owned(),
        ),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Runs `work` under a progress bar; its result and the seconds it took.
fn shown<T>(what: &'static str, work: impl FnOnce(&mut dyn FnMut(u64, u64)) -> T) -> (T, f64) {
    let mut bar = None;
    let result = work(&mut |done, total| {
        bar.get_or_insert_with(|| Progress::start(what, total, false))
            .at(done, String::new);
    });
    let took = bar.map_or(Duration::ZERO, Progress::finish);
    (result, took.as_secs_f64())
}

/// Power cuts in the store, on a flash in memory.
fn store() -> Result<(), String> {
    println!(
        "seed {SEED:#x}; program unit {UNIT} bytes, each a moment to fail before, inside and after"
    );
    let mut bench = full_size();
    let bytes = bench.image_bytes();
    let (cuts, s) = shown("single cuts", |p| every_single(&mut bench, 1, p));
    println!("full size, {bytes} bytes: every single cut, {cuts}: old or new, 0 lost ({s:.0} s)");
    let (cuts, s) = shown("pairs", |p| {
        power_cuts::random(&mut bench, 2, 10_000, SEED, p)
    });
    println!("full size: 10000 random pairs, {cuts} cuts: old or new, 0 lost ({s:.0} s)");
    let mut bench = small();
    let bytes = bench.image_bytes();
    let (cuts, s) = shown("pairs", |p| every_pair(&mut bench, 2, p));
    println!("{bytes} bytes: every pair, {cuts}: old or new, 0 lost ({s:.0} s)");
    let (cuts, s) = shown("triples", |p| {
        power_cuts::random(&mut bench, 3, 900_000, SEED, p)
    });
    println!("{bytes} bytes: 900000 random triples, {cuts} cuts: old or new, 0 lost ({s:.0} s)");
    let mut bench = four_kilobytes();
    let bytes = bench.image_bytes();
    let (cuts, s) = shown("triples", |p| {
        power_cuts::random(&mut bench, 3, 100_000, SEED, p)
    });
    println!("{bytes} bytes: 100000 random triples, {cuts} cuts: old or new, 0 lost ({s:.0} s)");
    Ok(())
}

/// Anything in the slots.
fn contents() -> Result<(), String> {
    let (found, s) = shown("slot contents", |p| {
        slot_contents::mutate(10_000_000, SEED, p)
    });
    println!("10000000 slot contents: {found:?} ({s:.0} s)");
    let hand = |time_s: f64| [0.3 * time_s.sin() as f32; 25];
    let recorded = record(&[], hand, 2, false, SEED);
    let (found, s) = shown("whole bridge", |p| {
        slot_contents::whole_bridge(&recorded.trace, 1_000, SEED, p)
    });
    println!(
        "1000 slot contents under the whole bridge, clutch held: {found:?}; no motion without weights ({s:.0} s)"
    );
    Ok(())
}

/// The emulator killed while weights are flashed.
fn kills() -> Result<(), String> {
    let Some(firmware) = firmware() else {
        return Ok(());
    };
    let (cuts, s) = shown("QEMU killed", |p| {
        cut_power(&firmware, 200, SEED, &mut |done| p(done, 200))
    });
    println!("QEMU killed while flashing: {cuts:?}; a whole image after each restart ({s:.0} s)");
    Ok(())
}

fn same_bits() -> Result<(), String> {
    let bench = bench().ok_or("no chip to compare with")?;
    let (inputs, mix) = bits::inputs(SEED, 25_000);
    for model in 0..4 {
        let image = images::random(images::SHAPE, JointOrder::Hand25, SEED + model);
        let refused = bits::compare(&bench, &image, &inputs)?;
        println!(
            "map {model}: {} inputs ({mix:?}): the same bits from 2 kernels of the chip and 3 here; {refused} refused alike",
            inputs.len()
        );
    }
    for (seed, faulty) in [(1, false), (2, true), (3, true)] {
        let recorded = record(
            &images::gentle(seed),
            recorded_or_moving(),
            60,
            faulty,
            seed,
        );
        let here = trace::replayed(&recorded.trace);
        if here != recorded.trace {
            return Err(format!("trace {seed}: its replay here differs"));
        }
        let chip = chip::run(&bench, chip::REPLAY, &recorded.trace, &[], false)?;
        if here != chip {
            return Err(format!("trace {seed}: the chip's output differs"));
        }
        println!(
            "trace {seed}, faulty {faulty}: {:?}: the same {} bytes when it was taken, here and there",
            trace::counts(&here),
            here.len()
        );
    }
    Ok(())
}

/// Seeded sessions with faults, replayed from their logs.
fn sessions() -> Result<(), String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let (mut time, mut took, mut bytes) = (0.0, 0.0, 0);
    let (mut commands, mut states, mut events) = (0, 0, 0);
    let (outcome, s) = shown("sessions", |p| {
        for seed in 1..=50 {
            let path = folder.path().join(format!("{seed}.mcap"));
            let log = [Log::After, Log::Live][seed as usize % 2];
            let session = sessions::replayed(seed, 30, &path, log);
            let same = &session.same;
            if same.difference.is_some() || same.cut.is_some() {
                return Err(format!("seed {seed}: {same:?}"));
            }
            time += same.time_us as f64 * 1e-6;
            took += session.took.as_secs_f64();
            bytes += session.bytes;
            commands += same.written[1];
            states += same.seen;
            events += session.events;
            p(seed, 50);
        }
        Ok(())
    });
    outcome?;
    println!(
        "50 seeded sessions, {time:.0} s on the virtual clock, {events} faults and acts: 0 of {commands} bytes to the gripper and 0 of {states} \
         frames and states differ; replayed {:.0} times as fast as they were, {:.2} MB of log a minute ({s:.0} s)",
        time / took,
        bytes as f64 / time * 60e-6
    );
    if time / took < 20.0 {
        return Err("a replay must be 20 times as fast as the session".to_owned());
    }
    Ok(())
}

/// The recorded hand where it is there, else one that moves all joints.
fn recorded_or_moving() -> impl Fn(f64) -> bits::Pose + Send {
    let hand = bits::recorded_hand();
    move |time_s: f64| match hand.len() {
        0 => {
            core::array::from_fn(|joint| 0.4 * (time_s * (1.0 + joint as f64 / 10.0)).sin() as f32)
        }
        length => hand[(time_s * 30.0) as usize % length],
    }
}

fn counts() -> Result<String, String> {
    let bench = bench().ok_or("no chip to count on")?;
    let recorded = loop_tests::trace::short(1, false);
    let image = images::gentle(1);
    let trace = trace::with_longer_reads(&recorded.trace);
    let text = chip::run(&bench, chip::COUNT, &image, &trace, true)?;
    String::from_utf8(text).map_err(|error| error.to_string())
}

fn measure() -> Result<(), String> {
    let firmware = firmware().ok_or("no chip to measure")?;
    let _alone = alone();
    let mut whole = Loop::start(&firmware);
    let stretch = whole.follow(Duration::from_secs(60));
    let grown = stretch.grown;
    let rate = |count: u32| f64::from(count) / stretch.seconds;
    println!(
        "60 s in real time, {:.3} s by the bridge's own clock for {:.3} s here",
        stretch.bridge_seconds, stretch.seconds
    );
    println!(
        "glove      {:.1} frames/s ({}), {} followed, {} answered",
        rate(grown.frames),
        grown.frames,
        grown.following_frames,
        grown.answered_frames
    );
    println!(
        "gripper    {:.1} cycles/s ({}), {:.1} commands/s, {} errors",
        rate(grown.statuses),
        grown.statuses,
        rate(grown.commands),
        grown.gripper_errors
    );
    println!(
        "loop       {:.1} steps/s, {} late, worst {} µs since the start; holds {}, faults {}",
        rate(grown.steps),
        grown.late_steps,
        grown.worst_late_us,
        grown.holds,
        grown.faults
    );
    println!(
        "lost bytes host {}, glove {}, gripper {}; the gripper moved: {}",
        grown.bytes_lost[0], grown.bytes_lost[1], grown.bytes_lost[2], stretch.moved
    );
    println!("stack      {} bytes at most", grown.stack_used);
    if grown.bytes_lost != [0; 3] {
        return Err("bytes were lost".to_owned());
    }
    if rate(grown.statuses) < LEAST_RATE {
        return Err(format!(
            "{:.1} gripper cycles a second, {LEAST_RATE} are the least: the same on a machine with less to do",
            rate(grown.statuses)
        ));
    }
    Ok(())
}
