//! What is left of a log whose run is killed, or whose disk takes no more, and what the run says of it. The long forms:
//! `cargo xtask campaign sessions`.

use crate::support;

use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use host::recording::salvage;
use host::recording::traced::Traced;
use host::replay;
use rig::skip::{Need, skipped};
use support::bench::{Bench, Running};
use support::told::Told;
use support::{interrupt, refusal, text, tool, wait};

/// What a killed run may lose.
const MAY_BE_LOST: f64 = 1.0;
/// By then a full disk is told.
const TOLD: Duration = Duration::from_secs(2);
/// Where this process was kept waiting for so long, the machine is too busy for a word about a second.
const BUSY: Duration = Duration::from_millis(150);

/// Longest time for which this process was kept waiting, while it lives.
struct Stalls {
    worst_us: Arc<AtomicU64>,
    over: Arc<AtomicBool>,
}

impl Stalls {
    fn watch() -> Self {
        let (worst_us, over) = (
            Arc::new(AtomicU64::new(0)),
            Arc::new(AtomicBool::new(false)),
        );
        let (worst, ended) = (Arc::clone(&worst_us), Arc::clone(&over));
        std::thread::spawn(move || {
            let pause = Duration::from_millis(5);
            while !ended.load(Ordering::Relaxed) {
                let began = Instant::now();
                std::thread::sleep(pause);
                let late = began.elapsed().saturating_sub(pause);
                worst.fetch_max(late.as_micros() as u64, Ordering::Relaxed);
            }
        });
        Self { worst_us, over }
    }

    fn worst(&self) -> Duration {
        Duration::from_micros(self.worst_us.load(Ordering::Relaxed))
    }
}

impl Drop for Stalls {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
    }
}

/// The messages that the field's own reader takes from a file's start, and the newest of their log times, s since 1970. A file
/// without an end is read up to there.
fn readable(path: &Path) -> (usize, f64) {
    let bytes = std::fs::read(path).unwrap();
    let options = mcap::read::Options::IgnoreEndMagic.into();
    let Ok(stream) = mcap::read::MessageStream::new_with_options(&bytes, options) else {
        return (0, 0.0);
    };
    stream
        .map_while(Result::ok)
        .fold((0, 0.0_f64), |(count, newest), message| {
            (count + 1, newest.max(message.log_time as f64 * 1e-9))
        })
}

fn since_1970() -> f64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap()
        .as_secs_f64()
}

/// A run that drives is killed `after` its log was made: how much of what had happened by then is missing, s, and how
/// long this process was kept waiting. What can be read is replayed with no difference.
fn killed(bench: &mut Bench, number: usize, after: Duration) -> (f64, Duration) {
    bench.log_to(&format!("killed-{number}.mcap"));
    bench.hand_lies_flat();
    let mut running = Running::start(
        tool(&bench.arguments())
            .stdout(Stdio::null())
            .stderr(Stdio::null()),
    );
    bench.until_logged(&mut running.0);
    let made = since_1970();
    let stalls = Stalls::watch();
    bench.hand_moves();
    std::thread::sleep(after);
    running.0.kill().unwrap();
    let killed = since_1970();
    let stalled = stalls.worst();
    running.0.wait().unwrap();
    let (messages, newest) = readable(&bench.log);
    let traced = Traced::read(&bench.log);
    if messages == 0 {
        // Before its first chunk is closed it has nothing yet, and says so.
        let error = traced.unwrap_err().to_string();
        assert!(error.contains("cannot be replayed"), "{error}");
        return (killed - made, stalled);
    }
    let traced = traced.unwrap_or_else(|error| panic!("killed after {after:?}: {error:#}"));
    assert!(!traced.found.finished, "nobody finished it");
    let same = replay::same(&traced, &mut ()).unwrap();
    assert_eq!(same.difference, None, "killed after {after:?}");
    assert!(same.seen > 0, "killed after {after:?}: {same:?}");
    (killed - newest, stalled)
}

#[test]
fn a_run_killed_in_motion_leaves_a_log_that_is_whole_until_a_second_before() {
    let mut bench = Bench::new(&["--engage"]);
    for (number, ms) in [200, 900, 2_300].into_iter().enumerate() {
        let (lost, stalled) = killed(&mut bench, number, Duration::from_millis(ms));
        if lost > MAY_BE_LOST && stalled > BUSY {
            return skipped(Need::Machine, &format!("it stands still for {stalled:?}"));
        }
        assert!(
            lost <= MAY_BE_LOST,
            "{lost:.2} s missing, killed after {ms} ms"
        );
    }
}

/// A long form of the same.
#[test]
#[ignore = "a quarter of an hour: cargo xtask campaign sessions"]
fn a_hundred_runs_killed_at_random_moments_lose_a_second_at_most() {
    let mut bench = Bench::new(&["--engage"]);
    let mut lost = Vec::new();
    let mut worst_stall = Duration::ZERO;
    let mut random = 0x5EED_u64;
    for number in 0..100 {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let after = Duration::from_millis((random >> 33) % 5_000);
        let (missing, stalled) = killed(&mut bench, number, after);
        println!(
            "killed {:.2} s after its log began: {missing:.3} s missing",
            after.as_secs_f64()
        );
        worst_stall = worst_stall.max(stalled);
        lost.push(missing);
        std::fs::remove_file(&bench.log).unwrap();
    }
    lost.sort_by(f64::total_cmp);
    println!(
        "100 runs of teleop killed, seed 0x5eed: {:.3} s missing in the median, {:.3} s at most; longest stall of this process \
         {worst_stall:?}",
        lost[50], lost[99]
    );
    assert!(lost[99] <= MAY_BE_LOST);
}

/// What keeps a log from growing.
#[derive(Debug, Clone, Copy)]
enum Full {
    /// Files of this process may have so many blocks of 1,024 bytes.
    Limit(u64),
    /// A disk of so many kilobytes.
    Disk(u64),
}

/// A disk in memory, unmounted with it.
struct Mounted(tempfile::TempDir);

impl Mounted {
    /// `None` where this user may mount none.
    fn new(kilobytes: u64) -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let size = format!("size={kilobytes}k");
        let mounted = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &size, "gauntlet-test"])
            .arg(folder.path())
            .stderr(Stdio::null())
            .status();
        mounted
            .is_ok_and(|status| status.success())
            .then(|| Self(folder))
    }
}

impl Drop for Mounted {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("-l").arg(self.0.path()).status();
    }
}

/// A run whose log finds no more room: it goes on and says so, and its end says how the gripper was left, the numbers, and
/// how much of the log is whole. Returns how long after the file's last growth it was told, and how many messages are whole.
fn filled(bench: &mut Bench, number: usize, full: Full) -> Option<(Duration, usize)> {
    let name = format!("full-{number}.mcap");
    let mut mounted = None;
    let mut limit = String::new();
    match full {
        Full::Limit(blocks) => {
            bench.log_to(&name);
            limit = format!("ulimit -f {blocks}; ");
        }
        Full::Disk(kilobytes) => {
            let disk = Mounted::new(kilobytes)?;
            bench.log_at(&disk.0.path().join(&name));
            mounted = Some(disk);
        }
    }
    bench.hand_lies_flat();
    let program = tool(&[]).get_program().to_str().unwrap().to_owned();
    let mut shell = Command::new("bash");
    let line = format!("{limit}exec '{program}' \"$@\"");
    shell.args(["-c", &line, "bash"]).args(&bench.arguments);
    tool(&[]).get_envs().for_each(|(name, value)| {
        shell.env(name, value.unwrap_or_default());
    });
    let mut running = Running::start(
        shell
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped()),
    );
    let said = Told::by(running.0.stdout.take().unwrap());
    let errors = Told::by(running.0.stderr.take().unwrap());
    bench.until_logged(&mut running.0);
    bench.hand_moves();
    let (mut length, mut grown) = (0, Instant::now());
    let end = Instant::now() + Duration::from_secs(120);
    while !said.so_far().contains("the run goes on without it") {
        assert!(
            Instant::now() < end,
            "{full:?} is never told: {}",
            said.so_far()
        );
        let now = std::fs::metadata(&bench.log).unwrap().len();
        if now != length {
            (length, grown) = (now, Instant::now());
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let told = grown.elapsed();
    // It drives on.
    assert!(
        !bench.stands_for(Duration::from_secs(4)),
        "{full:?}: nothing is commanded any more: {}",
        said.so_far()
    );
    interrupt(&running.0);
    let output = std::process::Output {
        status: wait(&mut running.0),
        stdout: said.all().into_bytes(),
        stderr: errors.all().into_bytes(),
    };
    let error = refusal(&output, 1);
    let (messages, _) = readable(&bench.log);
    assert!(error.contains("is incomplete"), "{full:?}: {error}");
    assert!(
        error.contains(&format!(" {messages} messages, are whole")),
        "{full:?}: {messages}, {error}"
    );
    let said = text(&output.stdout);
    assert!(
        said.contains("the gripper is held where it is"),
        "{full:?}: {said}"
    );
    assert!(said.contains("rates "), "{full:?}: {said}");
    drop(mounted);
    Some((told, messages))
}

#[test]
fn a_log_that_a_full_disk_ends_is_told_and_the_run_drives_on() {
    let mut bench = Bench::new(&["--engage"]);
    for (number, full) in [Full::Limit(200), Full::Disk(300)].into_iter().enumerate() {
        let stalls = Stalls::watch();
        let Some((told, _)) = filled(&mut bench, number, full) else {
            skipped(
                Need::Machine,
                &format!("{full:?}: this user mounts no disk"),
            );
            continue;
        };
        if told > TOLD && stalls.worst() > BUSY {
            return skipped(
                Need::Machine,
                &format!("it stands still for {:?}", stalls.worst()),
            );
        }
        assert!(
            told <= TOLD,
            "{full:?} was told {told:?} after the last byte"
        );
    }
}

/// A long form of the same.
#[test]
#[ignore = "minutes: cargo xtask campaign sessions"]
fn a_disk_full_at_twenty_sizes_is_told_in_two_seconds_and_the_run_drives_on() {
    let mut bench = Bench::new(&["--engage"]);
    let mut worst = Duration::ZERO;
    for number in 0..20 {
        // From little more than what is tried before the bring-up.
        let kilobytes = 130 + 67 * number as u64;
        let full = match number % 2 {
            0 => Full::Limit(kilobytes),
            _ => Full::Disk(kilobytes),
        };
        let went = filled(&mut bench, number, full);
        // Who may mount no disk has a limit at every size.
        let went = went.or_else(|| {
            skipped(Need::Machine, &format!("{full:?}: a limit in its place"));
            filled(&mut bench, number, Full::Limit(kilobytes))
        });
        let (told, messages) = went.unwrap();
        println!(
            "{full:?} KiB: told {:.2} s after the last byte, {messages} messages whole",
            told.as_secs_f64()
        );
        worst = worst.max(told);
    }
    println!(
        "20 sizes: told {:.2} s after the last byte at most",
        worst.as_secs_f64()
    );
    assert!(worst <= TOLD);
}

#[test]
fn a_disk_without_room_for_a_logs_first_half_second_is_told_before_anything_is_brought_up() {
    let bench = Bench::new(&["--engage"]);
    let program = tool(&[]).get_program().to_str().unwrap().to_owned();
    for blocks in [0, 8, 63] {
        let output = Command::new("bash")
            .args([
                "-c",
                &format!("ulimit -f {blocks}; exec '{program}' \"$@\""),
                "bash",
            ])
            .args(&bench.arguments)
            .stdin(Stdio::null())
            .output()
            .unwrap();
        let error = refusal(&output, 1);
        assert!(
            error.contains("run.mcap is not written"),
            "{blocks}: {error}"
        );
        assert_eq!(bench.gripper.writes(), 0, "{blocks}");
        assert!(!bench.log.exists(), "{blocks}");
    }
}

#[test]
fn the_log_of_a_left_hand_says_so_and_its_export_is_a_left_one() {
    let bench = Bench::new(&["--hand", "left", "--engage", "--json", "--seconds", "3"]);
    let output = support::run(&bench.arguments());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let mut hands = Vec::new();
    let file = std::fs::read(&bench.log).unwrap();
    salvage::read(&file, |message| {
        hands.extend(message.channel.metadata.get("hand").cloned());
    })
    .unwrap();
    hands.dedup();
    assert_eq!(hands, ["left"]);
    let table = bench.log.with_extension("csv");
    let [log, table] = [&bench.log, &table].map(|path| path.to_str().unwrap());
    let exported = support::json(&support::run(&["export", log, "--openxr", table, "--json"]));
    let error = exported["openxr_angle_error_deg"].as_f64();
    assert!(error < Some(0.01), "{exported}");
    let text = std::fs::read_to_string(table).unwrap();
    let mut lines = text.lines().map(|line| line.split(','));
    let column = lines.next().unwrap().position(|name| name == "thumb_tip_x");
    let mut first = lines.next().unwrap();
    let x: f64 = first.nth(column.unwrap()).unwrap().parse().unwrap();
    // A left hand's thumb is to the right of its wrist, seen from its back with the fingers ahead.
    assert!(x > 0.03, "{x}");
}
