//! Devices behind pseudo-terminals, opened as a client opens a serial port.
#![allow(clippy::unwrap_used)]

mod common;

use std::io::ErrorKind;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use common::{framed, hex};
use rig::glove::VirtualGlove;
use rig::gripper::{Config, VirtualGripper};
use rig::pty::{Handle, PtyDevice};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// A serial port without any library for it.
struct Client(OwnedFd);

impl Client {
    fn open(path: &Path, baud: u32) -> Self {
        let fd = rustix::fs::open(path, OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).unwrap();
        let mut settings = tcgetattr(&fd).unwrap();
        settings.set_speed(baud).unwrap();
        tcsetattr(&fd, OptionalActions::Now, &settings).unwrap();
        Self(fd)
    }

    fn write(&self, bytes: &[u8]) {
        assert_eq!(rustix::io::write(&self.0, bytes).unwrap(), bytes.len());
    }

    /// Reads until `count` bytes are there or `limit` is over.
    fn read(&self, count: usize, limit: Duration) -> Vec<u8> {
        let end = Instant::now() + limit;
        let mut all = Vec::new();
        while all.len() < count {
            let left = end.saturating_duration_since(Instant::now());
            let timeout = Timespec {
                tv_sec: left.as_secs() as i64,
                tv_nsec: i64::from(left.subsec_nanos()),
            };
            if poll(&mut [PollFd::new(&self.0, PollFlags::IN)], Some(&timeout)).unwrap() == 0 {
                break;
            }
            let mut chunk = [0; 256];
            let got = rustix::io::read(&self.0, &mut chunk).unwrap();
            all.extend_from_slice(&chunk[..got]);
        }
        all
    }

    fn ask(&self, frame: &[u8], count: usize) -> Vec<u8> {
        std::thread::sleep(Duration::from_millis(6));
        self.write(frame);
        self.read(count, Duration::from_secs(2))
    }
}

fn gripper(config: Config) -> (VirtualGripper, Handle) {
    let gripper = VirtualGripper::new(config);
    let handle = PtyDevice::spawn(Box::new(gripper.clone()), None).unwrap();
    (gripper, handle)
}

/// A folder that is removed again.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("rig-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[test]
fn the_terminal_is_raw_before_the_first_byte() {
    let (gripper, handle) = gripper(Config::default());
    let client = Client::open(handle.path(), 115_200);
    // Interrupt, end of file, newline, return, start, stop: none may be eaten or turned.
    let bytes = [0x03, 0x04, 0x0A, 0x0D, 0x11, 0x13, 0x1A, 0x1C, 0x7F, 0xFF];
    let mut write = vec![9, 0x10, 0x03, 0xE9, 0, 5, 10];
    write.extend(bytes);
    assert_eq!(
        client.ask(&framed(&write), 8),
        framed(&[9, 0x10, 0x03, 0xE9, 0, 5])
    );
    assert_eq!(gripper.command_block()[2..12], bytes);
    let mut back = vec![9, 3, 10];
    back.extend(bytes);
    assert_eq!(
        client.ask(&framed(&[9, 3, 0x03, 0xE9, 0, 5]), 15),
        framed(&back)
    );
}

#[test]
fn a_reply_never_comes_before_its_bytes_have_passed_at_the_clients_baud() {
    let read = hex("09 03 07 D0 00 08 45 C9");
    for baud in [9_600u32, 115_200] {
        let (_, handle) = gripper(Config {
            baud,
            ..Config::default()
        });
        let client = Client::open(handle.path(), baud);
        let start = Instant::now();
        client.write(&read);
        assert_eq!(client.read(21, Duration::from_secs(2)).len(), 21);
        let on_the_line = f64::from(8 + 21) * 10.0 / f64::from(baud) + 1.75e-3;
        assert!(
            start.elapsed().as_secs_f64() >= on_the_line,
            "{:?} at {baud}",
            start.elapsed()
        );
    }
}

#[test]
fn at_a_wrong_baud_there_is_noise_and_no_answer() {
    let (gripper, handle) = gripper(Config::default());
    let client = Client::open(handle.path(), 9_600);
    let good = framed(&[9, 3, 7, 0xD0, 0, 8]);
    let mut seen = Vec::new();
    for _ in 0..4 {
        client.write(&good);
        seen.extend(client.read(64, Duration::from_millis(40)));
    }
    assert!(!seen.is_empty());
    assert!(!seen.starts_with(&[9, 3, 16]));
    assert_eq!(gripper.requests().0, 0);
    // The same port, at the right one.
    drop(client);
    let client = Client::open(handle.path(), 115_200);
    assert_eq!(client.ask(&good, 21).len(), 21);
}

#[test]
fn a_client_may_leave_and_come_back() {
    let (_, handle) = gripper(Config::default());
    for _ in 0..5 {
        let client = Client::open(handle.path(), 115_200);
        assert_eq!(client.ask(&hex("09 03 07 D0 00 01 85 CF"), 7).len(), 7);
        drop(client);
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(handle.is_running());
    handle.stop().unwrap();
}

#[test]
fn a_still_line_lets_the_thread_sleep() {
    let start = Instant::now();
    let (_, handle) = gripper(Config::default());
    std::thread::sleep(Duration::from_millis(300));
    let awake = u128::from(handle.counters().wakeups);
    let elapsed = start.elapsed().as_millis();
    assert!(
        awake <= elapsed / 20 + 3,
        "{awake} times awake in {elapsed} ms"
    );
}

#[test]
fn a_client_that_reads_nothing_does_not_stop_the_device() {
    let (_, handle) = gripper(Config {
        request_spacing: rig::Duration::from_ticks(0),
        ..Config::default()
    });
    let client = Client::open(handle.path(), 115_200);
    for _ in 0..50 {
        client.write(&hex("09 03 07 D0 00 08 45 C9"));
        std::thread::sleep(Duration::from_millis(3));
    }
    assert!(handle.is_running());
    drop(client);
    let start = Instant::now();
    handle.stop().unwrap();
    assert!(start.elapsed() < Duration::from_secs(2));
}

#[test]
fn the_link_leads_to_the_terminal_and_goes_with_the_handle() {
    let folder = Folder::new("link");
    let path = folder.0.join("gripper");
    let device = || Box::new(VirtualGripper::new(Config::default()));
    let handle = PtyDevice::spawn(device(), Some(&path)).unwrap();
    assert_eq!(handle.path(), path);
    let client = Client::open(&path, 115_200);
    assert_eq!(client.ask(&hex("09 03 07 D0 00 01 85 CF"), 7).len(), 7);
    // It is in use: a second device is refused, and says where.
    let refused = PtyDevice::spawn(device(), Some(&path)).unwrap_err();
    assert_eq!(refused.kind(), ErrorKind::AlreadyExists);
    assert!(refused.to_string().contains("gripper"), "{refused}");
    drop(handle);
    assert!(std::fs::symlink_metadata(&path).is_err());
}

#[test]
fn only_a_dead_link_to_a_terminal_is_replaced() {
    let folder = Folder::new("dead");
    let path = folder.0.join("port");
    let spawn = || {
        PtyDevice::spawn(
            Box::new(VirtualGripper::new(Config::default())),
            Some(&path),
        )
    };
    std::os::unix::fs::symlink("/dev/pts/987654", &path).unwrap();
    let handle = spawn().unwrap();
    assert_eq!(std::fs::read_link(&path).unwrap(), handle.terminal());
    // Someone else's link in its place stays when ours would go.
    std::fs::remove_file(&path).unwrap();
    std::os::unix::fs::symlink("/dev/null", &path).unwrap();
    drop(handle);
    assert_eq!(std::fs::read_link(&path).unwrap(), Path::new("/dev/null"));
    assert_eq!(spawn().unwrap_err().kind(), ErrorKind::AlreadyExists);
    std::fs::remove_file(&path).unwrap();
    std::fs::write(&path, "a letter").unwrap();
    assert_eq!(spawn().unwrap_err().kind(), ErrorKind::AlreadyExists);
    assert_eq!(std::fs::read(&path).unwrap(), b"a letter");
    std::fs::remove_file(&path).unwrap();
    std::os::unix::fs::symlink(folder.0.join("nowhere"), &path).unwrap();
    assert_eq!(spawn().unwrap_err().kind(), ErrorKind::AlreadyExists);
    let missing = folder.0.join("no/such/folder");
    let device = Box::new(VirtualGripper::new(Config::default()));
    assert!(
        PtyDevice::spawn(device, Some(&missing))
            .unwrap_err()
            .to_string()
            .contains("folder")
    );
}

#[test]
fn the_glove_changes_its_baud_on_a_terminal() {
    let glove = VirtualGlove::new(Box::new(|_| [0.0; 25]), rig::glove::Config::default());
    let handle = PtyDevice::spawn(Box::new(glove), None).unwrap();
    let client = Client::open(handle.path(), 9_600);
    assert_eq!(client.read(2, Duration::from_secs(1)), b"OK");
    client.write(&[0x57, 0x00, 0x00, 0x01, 0x00, 0x50]);
    std::thread::sleep(Duration::from_millis(60));
    drop(client);
    let client = Client::open(handle.path(), 460_800);
    assert_eq!(client.ask(&[0x52, 0x0A, 0x50], 1), [0xF0]);
    // After the boot time: channel 0, chip id of 0x28.
    std::thread::sleep(Duration::from_millis(650));
    client.write(&[0x53, 0xE0, 0x01, 0x01, 0x50]);
    let id = client.ask(&[0x53, 0x50, 0x01, 0x00, 0x53, 0x51, 0x04, 0x50], 4);
    assert_eq!(id, [0xA0, 0xFB, 0x32, 0x0F]);
}

/// A scan as a client makes it: select, two plain reads, eight times.
fn scan(client: &Client) {
    for channel in 0..8u8 {
        for (request, count) in [
            (
                &[0x53, 0xE0, 0x01, 1 << channel, 0x50, 0x53, 0x51, 0x08, 0x50][..],
                8,
            ),
            (&[0x53, 0x53, 0x08, 0x50][..], 8),
        ] {
            client.write(request);
            assert_eq!(client.read(count, Duration::from_secs(1)).len(), count);
        }
    }
}

#[test]
#[ignore = "prints rates: cargo test -p rig --test pty -- --ignored --nocapture"]
fn rates_on_a_terminal() {
    for baud in [115_200, 460_800] {
        let glove = VirtualGlove::new(Box::new(|_| [0.0; 25]), rig::glove::Config::at_baud(baud));
        let handle = PtyDevice::spawn(Box::new(glove), None).unwrap();
        let client = Client::open(handle.path(), baud);
        std::thread::sleep(Duration::from_millis(700));
        client.write(&[0x57, 0x07, 0x05, 0x08, 0x05, 0x50]);
        let start = Instant::now();
        (0..50).for_each(|_| scan(&client));
        println!(
            "glove at {baud}: {:.1} scans/s",
            50.0 / start.elapsed().as_secs_f64()
        );
    }
    let (_, handle) = gripper(Config::default());
    let client = Client::open(handle.path(), 115_200);
    let mut cycle = vec![9, 0x17, 7, 0xD0, 0, 8, 3, 0xE8, 0, 8, 16];
    cycle.extend([0; 16]);
    let cycle = framed(&cycle);
    let start = Instant::now();
    for _ in 0..200 {
        client.write(&cycle);
        assert_eq!(client.read(21, Duration::from_secs(1)).len(), 21);
    }
    println!(
        "gripper at 115200: {:.1} cycles/s",
        200.0 / start.elapsed().as_secs_f64()
    );
}

#[test]
#[ignore = "prints how far ahead of the clock it simulates"]
fn speed_on_a_virtual_clock() {
    let mut bench = common::Bench::new(Config::default());
    bench.activate();
    let mut cycle = vec![9, 0x17, 7, 0xD0, 0, 8, 3, 0xE8, 0, 8, 16, 0x09, 0x0C, 0];
    cycle.extend([
        200, 255, 100, 200, 255, 100, 200, 255, 100, 137, 255, 100, 0,
    ]);
    let cycle = framed(&cycle);
    let (start, from) = (Instant::now(), bench.clock.now().as_ticks());
    for _ in 0..10_000 {
        assert_eq!(bench.ask(&cycle).len(), 21);
    }
    let simulated = (bench.clock.now().as_ticks() - from) as f64 * 1e-6;
    println!(
        "gripper: {:.0} times real time",
        simulated / start.elapsed().as_secs_f64()
    );
}

/// A device that says nothing and counts how often its port was opened.
struct Counting(std::sync::Arc<std::sync::atomic::AtomicU32>);

impl rig::Device for Counting {
    fn receive(&mut self, _: &[u8], _: rig::Instant) {}
    fn transmit(&mut self, _: rig::Instant, _: &mut [u8]) -> usize {
        0
    }
    fn next_due(&self) -> Option<rig::Instant> {
        None
    }
    fn baud(&self) -> u32 {
        115_200
    }
    fn opened(&mut self) {
        self.0.fetch_add(1, std::sync::atomic::Ordering::SeqCst);
    }
}

#[test]
fn a_device_learns_when_its_port_is_opened_and_not_of_a_second_client() {
    let count = std::sync::Arc::default();
    let device = Counting(std::sync::Arc::clone(&count));
    let handle = PtyDevice::spawn(Box::new(device), None).unwrap();
    let seen = |wanted| {
        std::thread::sleep(Duration::from_millis(100));
        assert_eq!(count.load(std::sync::atomic::Ordering::SeqCst), wanted);
    };
    seen(0);
    let first = Client::open(handle.path(), 115_200);
    seen(1);
    let second = Client::open(handle.path(), 115_200);
    drop(first);
    let third = Client::open(handle.path(), 115_200);
    drop(second);
    seen(1);
    drop(third);
    seen(1);
    let _again = Client::open(handle.path(), 115_200);
    seen(2);
}
