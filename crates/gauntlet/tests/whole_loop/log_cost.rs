//! What a log and a page cost the loop: `cargo xtask campaign log-cost`, on a machine with nothing else to do. And how large a log is.

use crate::support;

use std::process::Stdio;
use std::time::{Duration, Instant};

use support::bench::{Bench, Running};
use support::page::{OpenPage, address};
use support::tool;

/// How long each run drives, s.
const SECONDS: u32 = 20;
/// Pairs of runs, in turns.
const PAIRS: usize = 5;
/// What a log, or a page, may make of the time from the oldest sample used to the command, at p99.
const MOST: f64 = 1.1;
/// By how much later 99 of 100 steps of the loop may come beside it, µs: a hundredth of the time between two samples.
const LATER_US: f64 = 100.0;
/// Pictures a second that a page gets which asks for sixty.
const LEAST_PICTURES_HZ: f64 = 50.0;
/// Bytes a minute that a log may take with a glove at 115200 baud and a gripper of four axes.
const A_MINUTE: f64 = 15e6;

/// What the loop does beside driving.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Beside {
    Nothing,
    Log,
    Page,
}

/// What a run came to.
struct Cost {
    /// By how much 99 of 100 steps of the loop came after their time at most, µs.
    step_us: f64,
    /// From the oldest sample used to the command, at p99, µs.
    age_us: f64,
    /// Steps of the loop that came late.
    late: u64,
    /// The latest of them, µs.
    worst_us: u64,
    /// Processor time of its process, s.
    cpu_s: f64,
    /// Bytes of its log.
    bytes: u64,
    /// Pictures that the page was sent, a second.
    pictures_hz: f64,
}

/// Processor time of the process so far, s; from fields 14 and 15 of its `stat`, in hundredths.
fn cpu_s(process: u32) -> Option<f64> {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    let (_, after) = stat.rsplit_once(") ")?;
    let fields: Vec<&str> = after.split(' ').collect();
    let ticks = |field: usize| fields.get(field)?.parse::<f64>().ok();
    Some((ticks(11)? + ticks(12)?) / 100.0)
}

/// Asks for every picture that the page gets, until the run has ended; how many came a second.
fn looked_at(mut page: OpenPage) -> f64 {
    let begun = Instant::now();
    while page.look().is_ok() {}
    page.pictures as f64 / begun.elapsed().as_secs_f64()
}

fn driven(beside: Beside) -> Cost {
    let time = SECONDS.to_string();
    let bench = Bench::new(&["--engage", "--json", "--seconds", &time]);
    let mut words = bench.arguments();
    if beside != Beside::Log {
        let place = words.iter().position(|word| *word == "--log").unwrap();
        words.drain(place..place + 2);
    }
    if beside == Beside::Page {
        words.push("--view");
    }
    let said = match beside {
        Beside::Page => Stdio::piped(),
        _ => Stdio::null(),
    };
    let mut running = Running::start(tool(&words).stdout(Stdio::piped()).stderr(said));
    let page = (beside == Beside::Page).then(|| {
        let page = OpenPage::open(&address(running.0.stderr.take().unwrap()));
        std::thread::spawn(move || looked_at(page))
    });
    bench.until_moving(&mut running.0);
    let mut cpu = 0.0;
    while running.0.try_wait().unwrap().is_none() {
        cpu = cpu_s(running.0.id()).unwrap_or(cpu);
        std::thread::sleep(Duration::from_millis(50));
    }
    let output = running.finish();
    let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let run = &result["run"];
    Cost {
        step_us: run["step_late_p99_us"].as_f64().unwrap(),
        age_us: run["latency_p99_us"].as_f64().unwrap(),
        late: run["late_steps"].as_u64().unwrap(),
        worst_us: run["worst_late_us"].as_u64().unwrap(),
        cpu_s: cpu,
        bytes: bench.log.metadata().map_or(0, |file| file.len()),
        pictures_hz: page.map_or(0.0, |page| page.join().unwrap()),
    }
}

/// The median of five.
fn median(mut of: Vec<f64>) -> f64 {
    of.sort_by(f64::total_cmp);
    of[of.len() / 2]
}

/// Five pairs of runs in turns, without and with something beside the loop.
fn costs_nothing(beside: Beside) {
    let (mut ratios, mut later, mut cpu) = (Vec::new(), Vec::new(), Vec::new());
    let mut slowest = f64::INFINITY;
    for pair in 0..PAIRS {
        // In turns, and first the one and then the other.
        let [without, with] = if pair % 2 == 0 {
            [Beside::Nothing, beside].map(driven)
        } else {
            let [with, without] = [beside, Beside::Nothing].map(driven);
            [without, with]
        };
        println!(
            "pair {}: steps late by {:.0} us at p99 without, {:.0} us with ({beside:?}); age of the samples at p99 {:.2} and {:.2} ms; \
             late steps {} and {}, the latest {:.1} and {:.1} ms; {:.2} and {:.2} s of processor time; {:.2} MB of log, \
             {:.0} pictures a second",
            pair + 1,
            without.step_us,
            with.step_us,
            without.age_us / 1e3,
            with.age_us / 1e3,
            without.late,
            with.late,
            without.worst_us as f64 / 1e3,
            with.worst_us as f64 / 1e3,
            without.cpu_s,
            with.cpu_s,
            with.bytes as f64 / 1e6,
            with.pictures_hz
        );
        ratios.push(with.age_us / without.age_us);
        later.push(with.step_us - without.step_us);
        cpu.push(with.cpu_s - without.cpu_s);
        if beside == Beside::Page {
            slowest = slowest.min(with.pictures_hz);
        }
    }
    let (ratio, later) = (median(ratios), median(later));
    println!(
        "{beside:?}: medians of {PAIRS}: from the oldest sample to the command {ratio:.3} times as long at p99 ({MOST} at most), steps \
         {later:.0} us later at p99 ({LATER_US:.0} at most); {:.1} ms of processor time more a second of driving",
        median(cpu) / f64::from(SECONDS) * 1e3
    );
    assert!(ratio <= MOST, "{ratio:.3}");
    assert!(later <= LATER_US, "{later:.0} us");
    assert!(
        slowest >= LEAST_PICTURES_HZ,
        "{slowest:.0} pictures a second"
    );
}

#[test]
#[ignore = "minutes, on a quiet machine: cargo xtask campaign log-cost"]
fn a_log_makes_commands_no_older_and_steps_no_later() {
    costs_nothing(Beside::Log);
}

#[test]
#[ignore = "minutes, on a quiet machine: cargo xtask campaign view"]
fn a_page_of_sixty_pictures_a_second_makes_commands_no_older_and_steps_no_later() {
    costs_nothing(Beside::Page);
}

/// What is in a log each second does not hang on the machine: fewer frames on a busy one, never more.
#[test]
fn a_minute_of_log_takes_fifteen_megabytes_at_most() {
    let baud = ["--glove-baud", "115200"];
    let more = ["--engage", "--json", "--seconds", "8"];
    let bench = Bench::new(&[&baud[..], &more].concat());
    let mut running = Running::start(
        tool(&bench.arguments())
            .stdout(Stdio::piped())
            .stderr(Stdio::null()),
    );
    bench.until_moving(&mut running.0);
    let output = running.finish();
    let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let file = std::fs::read(&bench.log).unwrap();
    let times: Vec<u64> = mcap::MessageStream::new(&file)
        .unwrap()
        .map(|message| message.unwrap().log_time)
        .collect();
    let span = Duration::from_nanos(times.last().unwrap() - times.first().unwrap());
    let a_minute = file.len() as f64 / span.as_secs_f64() * 60.0;
    println!(
        "{} bytes in {:.1} s, with the bring-up: {:.2} MB a minute, {} frames a second",
        file.len(),
        span.as_secs_f64(),
        a_minute / 1e6,
        result["run"]["glove_frames_per_s"]
    );
    assert_eq!(result["glove_baud"], 115_200, "{result}");
    assert!(a_minute <= A_MINUTE, "{a_minute:.0} bytes a minute");
    // And it is one of a run that did something.
    assert!(
        result["run"]["glove_frames_per_s"].as_f64() > Some(10.0),
        "{result}"
    );
    assert!(a_minute > 1e6, "{a_minute:.0} bytes a minute");
}
