use std::os::fd::OwnedFd;
use std::path::PathBuf;

use bridge::Platform;
use embedded_io::Read;
use gripper::Duration;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

use super::*;
use crate::lines::port::{BAUD, Port};

fn pair() -> (OwnedFd, Port) {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&master).unwrap();
    unlockpt(&master).unwrap();
    let name = ptsname(&master, Vec::new()).unwrap();
    let path = PathBuf::from(name.into_string().unwrap());
    (master, Port::open(&path, BAUD).unwrap())
}

fn platform(port: &Port) -> (Pc, Interrupt) {
    let interrupt = Interrupt::never().unwrap();
    let pc = Pc::new(Clock::start(), [port.watch()], interrupt.clone());
    (pc, interrupt)
}

const LONG: Duration = Duration::from_ticks(20_000_000);

fn waits(pc: &mut Pc, time: Duration) -> Duration {
    let before = pc.now();
    pc.wait_until(before + time);
    pc.now() - before
}

#[test]
fn a_byte_ends_the_wait() {
    let (master, port) = pair();
    let (mut pc, _) = platform(&port);
    rustix::io::write(&master, &[1]).unwrap();
    assert!(waits(&mut pc, LONG) < LONG);
}

#[test]
fn without_a_byte_the_wait_lasts_until_it_is_due_and_no_time_is_none() {
    let (_master, port) = pair();
    let (mut pc, _) = platform(&port);
    let time = Duration::from_ticks(5_000);
    assert!(waits(&mut pc, time) >= time);
    let now = pc.now();
    pc.wait_until(now);
    pc.wait_until(Instant::from_ticks(0));
}

#[test]
fn bytes_that_the_driver_leaves_lying_do_not_make_the_loop_spin() {
    let (master, mut port) = pair();
    let (mut pc, _) = platform(&port);
    rustix::io::write(&master, &[1, 2]).unwrap();
    waits(&mut pc, LONG);
    let time = Duration::from_ticks(5_000);
    assert!(
        waits(&mut pc, time) >= time,
        "it woke for the same bytes again"
    );
    // Once the driver reads, new bytes count again.
    port.read(&mut [0; 8]).unwrap();
    rustix::io::write(&master, &[3]).unwrap();
    assert!(waits(&mut pc, LONG) < LONG);
}

#[test]
fn calendar_time_and_loop_time_advance_together() {
    let clock = Clock::start();
    let first = clock.wall_ns(Instant::from_ticks(0));
    assert_eq!(clock.wall_ns(Instant::from_ticks(1_500)) - first, 1_500_000);
}

#[test]
fn a_suspend_is_seen_by_a_clock_that_goes_on_in_it() {
    use std::sync::atomic::{AtomicU64, Ordering};
    static SLEPT: AtomicU64 = AtomicU64::new(0);
    // The computer's time, and the time it slept, which `std::time::Instant` does not count.
    fn source() -> std::time::Duration {
        let awake = std::time::Duration::from_secs(1_000);
        awake + std::time::Duration::from_secs(SLEPT.load(Ordering::Relaxed))
    }
    let clock = Clock::from_source(source);
    let mut pc = Pc::new(clock, [], Interrupt::never().unwrap());
    assert_eq!(pc.now().as_ticks(), 0);
    SLEPT.store(600, Ordering::Relaxed);
    assert_eq!(
        pc.now().as_ticks(),
        600_000_000,
        "ten minutes with the lid closed"
    );
}

#[cfg(target_os = "linux")]
#[test]
fn the_tools_clock_is_the_systems_time_since_its_start_suspends_included() {
    let uptime = std::fs::read_to_string("/proc/uptime").unwrap();
    let uptime: f64 = uptime.split(' ').next().unwrap().parse().unwrap();
    let ours = crate::clock::since_boot().as_secs_f64();
    assert!(
        (0.0..60.0).contains(&(ours - uptime + 0.01)),
        "{ours} {uptime}"
    );
}
