//! What a log costs the loop: `cargo xtask campaign log-cost`, on a machine with nothing else to do.

use crate::support;

use std::process::Stdio;

use support::bench::{Bench, Running};
use support::tool;

/// How long each run drives, s.
const SECONDS: u32 = 20;

/// What a run came to.
struct Cost {
    /// From the oldest sample used to the command, at p99, µs.
    p99_us: f64,
    /// Steps of the loop that came late.
    late: u64,
    /// The latest of them, µs.
    worst_us: u64,
    /// Processor time of its process, s.
    cpu_s: f64,
    /// Bytes of its log.
    bytes: u64,
}

/// Processor time of the process so far, s; from fields 14 and 15 of its `stat`, in hundredths.
fn cpu_s(process: u32) -> Option<f64> {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    let (_, after) = stat.rsplit_once(") ")?;
    let fields: Vec<&str> = after.split(' ').collect();
    let ticks = |field: usize| fields.get(field)?.parse::<f64>().ok();
    Some((ticks(11)? + ticks(12)?) / 100.0)
}

fn driven(logged: bool) -> Cost {
    let time = SECONDS.to_string();
    let bench = Bench::new(&["--engage", "--json", "--seconds", &time]);
    let mut words = bench.arguments();
    if !logged {
        let place = words.iter().position(|word| *word == "--log").unwrap();
        words.drain(place..place + 2);
    }
    let mut running = Running::start(tool(&words).stdout(Stdio::piped()).stderr(Stdio::null()));
    bench.until_moving(&mut running.0);
    let mut cpu = 0.0;
    while running.0.try_wait().unwrap().is_none() {
        cpu = cpu_s(running.0.id()).unwrap_or(cpu);
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    let output = running.finish();
    let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let run = &result["run"];
    Cost {
        p99_us: run["latency_p99_us"].as_f64().unwrap(),
        late: run["late_steps"].as_u64().unwrap(),
        worst_us: run["worst_late_us"].as_u64().unwrap(),
        cpu_s: cpu,
        bytes: bench.log.metadata().map_or(0, |file| file.len()),
    }
}

/// The median of five.
fn median(mut of: Vec<f64>) -> f64 {
    of.sort_by(f64::total_cmp);
    of[of.len() / 2]
}

#[test]
#[ignore = "minutes, on a quiet machine: cargo xtask campaign log-cost"]
fn a_log_costs_the_loop_no_latency() {
    let (mut latency, mut cpu) = (Vec::new(), Vec::new());
    for pair in 1..=5 {
        // In turns, and first the one and then the other.
        let [without, with] = if pair % 2 == 1 {
            [false, true].map(driven)
        } else {
            let [with, without] = [true, false].map(driven);
            [without, with]
        };
        println!(
            "pair {pair}: p99 {:.2} ms without a log, {:.2} ms with one; late steps {} and {}, the latest {:.1} and {:.1} ms; \
             {:.2} and {:.2} s of processor time; {:.2} MB of log",
            without.p99_us / 1e3,
            with.p99_us / 1e3,
            without.late,
            with.late,
            without.worst_us as f64 / 1e3,
            with.worst_us as f64 / 1e3,
            without.cpu_s,
            with.cpu_s,
            with.bytes as f64 / 1e6
        );
        latency.push(with.p99_us / without.p99_us);
        cpu.push(with.cpu_s - without.cpu_s);
    }
    let ratio = median(latency);
    println!(
        "median of five ratios of p99: {ratio:.3} (goal: 1.1 at most); {:.1} ms of processor time more a second of driving",
        median(cpu) / f64::from(SECONDS) * 1e3
    );
}
