//! The emulated chip: the firmware, and the image `bench`, which does work without ports and hands its results back.

use std::fs::OpenOptions;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use host::chip::emulator::{FIRMWARE, QEMU, qemu_is_there};
use rig::skip::{Need, skipped};

/// Order: the map's bits. First input an image, second the inputs of 25 f32 each.
pub const BITS: u32 = 1;
/// Order: a trace replayed. First input the trace.
pub const REPLAY: u32 = 2;
/// Order: instruction counts. First input an image, second a trace.
pub const COUNT: u32 = 3;
/// Order: a recorded calibration session ([`crate::golden`]).
pub const SESSION: u32 = 4;

const ORDER_AT: u64 = 1 << 20;
const OUTPUT_AT: u64 = 10 << 20;
const MEMORY: u64 = 16 << 20;
const ALIGNMENT: u64 = 64;
/// Far more than any order takes.
const PATIENCE: Duration = Duration::from_secs(600);

/// The firmware's ELF file, where the environment names it and QEMU is there; else says why not.
#[track_caller]
pub fn firmware() -> Option<PathBuf> {
    let Some(path) = std::env::var_os(FIRMWARE).map(PathBuf::from) else {
        let why = format!("{FIRMWARE} names no firmware (`cargo xtask test` builds it)");
        skipped(Need::Chip, &why);
        return None;
    };
    if !qemu_is_there() {
        skipped(Need::Chip, &format!("{QEMU} is not installed"));
        return None;
    }
    Some(path)
}

/// The image `bench`, which is built beside the firmware; `None`, with a word, as [`firmware`].
#[track_caller]
pub fn bench() -> Option<PathBuf> {
    let path = firmware()?.with_file_name("bench");
    if path.is_file() {
        Some(path)
    } else {
        skipped(Need::Chip, &format!("{} is not there", path.display()));
        None
    }
}

/// Has the chip do `order` and returns what it put out. `counted` runs it under `-icount shift=6`.
///
/// # Errors
/// What did not work, in words.
pub fn run(
    bench: &Path,
    order: u32,
    first: &[u8],
    second: &[u8],
    counted: bool,
) -> Result<Vec<u8>, String> {
    let folder = tempfile::tempdir().map_err(words)?;
    let memory = folder.path().join("memory");
    let file = OpenOptions::new()
        .create_new(true)
        .read(true)
        .write(true)
        .open(&memory)
        .map_err(words)?;
    let first_at = ORDER_AT + ALIGNMENT;
    let second_at = (first_at + first.len() as u64).next_multiple_of(ALIGNMENT);
    if second_at + second.len() as u64 > OUTPUT_AT {
        return Err("the inputs do not fit into the chip's memory".to_owned());
    }
    file.set_len(MEMORY).map_err(words)?;
    let header = [order, first.len() as u32, second.len() as u32].map(u32::to_le_bytes);
    file.write_all_at(header.as_flattened(), ORDER_AT)
        .map_err(words)?;
    file.write_all_at(first, first_at).map_err(words)?;
    file.write_all_at(second, second_at).map_err(words)?;
    let mut qemu = Command::new(QEMU);
    qemu.args(["-machine", "mps2-an386,memory-backend=flash"])
        .args(["-display", "none", "-monitor", "none", "-serial", "none"])
        .args(["-semihosting-config", "enable=on,target=native"])
        .args(if counted {
            &["-icount", "shift=6"][..]
        } else {
            &[]
        })
        .arg("-object")
        .arg(format!(
            "memory-backend-file,id=flash,size=16M,share=on,mem-path={}",
            memory.display()
        ))
        .arg("-kernel")
        .arg(bench)
        .stdin(Stdio::null());
    wait(qemu.spawn().map_err(words)?)?;
    let mut length = [0; 4];
    file.read_exact_at(&mut length, OUTPUT_AT).map_err(words)?;
    let mut output = vec![0; u32::from_le_bytes(length) as usize];
    file.read_exact_at(&mut output, OUTPUT_AT + ALIGNMENT)
        .map_err(words)?;
    Ok(output)
}

fn wait(mut child: Child) -> Result<(), String> {
    let end = Instant::now() + PATIENCE;
    loop {
        match child.try_wait().map_err(words)? {
            Some(status) if status.success() => return Ok(()),
            Some(status) => return Err(format!("the chip did not do its work ({status})")),
            None if Instant::now() >= end => {
                // One that has just ended cannot be killed.
                let _ = child.kill();
                let _ = child.wait();
                return Err(format!("the chip was not done after {PATIENCE:?}"));
            }
            None => std::thread::sleep(Duration::from_millis(5)),
        }
    }
}

fn words(error: std::io::Error) -> String {
    error.to_string()
}
