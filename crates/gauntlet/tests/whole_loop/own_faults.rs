//! A fault of the program itself, whose signals are caught for the sake of those who send them.
#![cfg(target_os = "linux")]

use std::os::unix::process::ExitStatusExt;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use host::interrupt::Interrupt;

/// Names the fault that a child of these tests runs into.
const FAULT: &str = "GAUNTLET_TEST_FAULT";

fn deep(depth: u64) -> u64 {
    let room = std::hint::black_box([depth; 512]);
    if depth == u64::MAX {
        return 0;
    }
    deep(depth + 1) + room[7]
}

/// Without the variable a test like any other, which does nothing.
#[test]
fn child() {
    let Ok(fault) = std::env::var(FAULT) else {
        return;
    };
    let interrupt = Interrupt::install().unwrap();
    match fault.as_str() {
        "stack" => println!("{}", deep(0)),
        #[cfg(target_arch = "x86_64")]
        "instruction" => {
            // SAFETY: the instruction does nothing but raise SIGILL.
            #[allow(unsafe_code)]
            unsafe {
                core::arch::asm!("ud2")
            }
        }
        other => panic!("no fault {other}"),
    }
    panic!("it went on, asked: {}", interrupt.asked());
}

fn ends(fault: &str) -> Output {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "own_faults::child", "--nocapture"])
        .env(FAULT, fault)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let end = Instant::now() + Duration::from_secs(30);
    while child.try_wait().unwrap().is_none() {
        if Instant::now() > end {
            child.kill().unwrap();
            panic!("{fault}: it meets the same fault for ever");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    child.wait_with_output().unwrap()
}

#[test]
fn a_stack_that_overflows_is_told_and_ends_the_program() {
    let output = ends("stack");
    assert_eq!(
        output.status.signal(),
        Some(rustix::process::Signal::ABORT.as_raw()),
        "{output:?}"
    );
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("overflowed its stack"), "{said}");
}

#[cfg(target_arch = "x86_64")]
#[test]
fn an_instruction_that_is_none_ends_the_program() {
    let output = ends("instruction");
    assert_eq!(
        output.status.signal(),
        Some(rustix::process::Signal::ILL.as_raw()),
        "{output:?}"
    );
}
