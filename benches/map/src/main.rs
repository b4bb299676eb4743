//! The map's kernels beside ready-made libraries and the machine's own limit, in one process and in turns; on request
//! the instruction counts of the emulated chip and of valgrind. README.md beside this package says how to read it.

#[cfg(feature = "candle")]
mod candle;
mod chip;
mod network;
mod peers;
mod roof;
mod size;
mod table;
#[cfg(feature = "tract")]
mod tract;

#[path = "../../../crates/hae/qemu-count/src/workload.rs"]
mod workload;

use std::hint::black_box;
use std::path::Path;
use std::process::ExitCode;

use hae::{Kernel, Map, PackedBuffer};
use network::{LEN, Network};

fn main() -> ExitCode {
    // candle spreads one sample over all cores otherwise, which takes longer and disturbs the others.
    // SAFETY: there is no other thread yet.
    unsafe { std::env::set_var("RAYON_NUM_THREADS", "1") };
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match arguments[..] {
        [] => table::print(400),
        ["--rounds", rounds] => match rounds.parse() {
            Ok(rounds) if rounds > 0 => table::print(rounds),
            _ => Err(format!("--rounds {rounds}: give a number from 1")),
        },
        ["--chip", image] => chip::count(image)
            .and_then(|()| size::print(&Path::new(image).with_file_name("footprint"))),
        ["--valgrind"] => chip::valgrind(),
        ["--evaluate", kernel, times] => evaluate(kernel, times),
        _ => {
            eprintln!("usage: map-bench [--rounds N | --chip ELF | --valgrind]");
            return ExitCode::from(2);
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// What valgrind counts: one kernel, so many times, and nothing else that grows with the number.
fn evaluate(kernel: &str, times: &str) -> Result<(), String> {
    let kernel = Kernel::ALL
        .into_iter()
        .find(|k| format!("{k:?}") == kernel)
        .ok_or("no such kernel")?;
    let times: u32 = times.parse().map_err(|_| "not a number")?;
    let network = Network::new();
    let image = network.image();
    let map = Map::<25, 300, 4>::from_image(&image).map_err(|e| e.to_string())?;
    let mut buffer = Box::new(PackedBuffer::<LEN>::new());
    let map = map
        .repack_for(kernel, &mut buffer.0)
        .map_err(|e| e.to_string())?;
    for _ in 0..times {
        let _ = black_box(black_box(&map).eval(black_box(&network.inputs[0])));
    }
    Ok(())
}
