//! Work without ports for the emulated chip: the host lays an order and its input into the PSRAM's file, this image does
//! it, puts the results behind it and ends through semihosting. Interrupts stay off.
//!
//! | order | input | output |
//! |---|---|---|
//! | 1 bits | an image, then inputs of 25 f32 | for each input 4 f32 of the chip's kernel and 4 of the portable one; a refusal is a NaN, the input's number, its bits and a zero |
//! | 2 replay | a trace | what the bridge puts out (`replay`) |
//! | 3 count | an image's bytes, then a trace | lines of text: instructions by name |
//! | 4 session | a recorded calibration session | its profile, and the angles of the use after it (`session`) |
#![no_std]
#![no_main]

mod count;
#[path = "../../board/flash.rs"]
#[allow(dead_code)]
mod flash;
mod memory;
#[path = "../../replay.rs"]
#[allow(dead_code)]
mod replay;
mod session;

use bridge::hae::Map;
use memory::{Memory, exit};

/// A result that is no number, beside the input it was refused for.
const REFUSED: u32 = 0x7fc0_0000;

#[cortex_m_rt::entry]
fn main() -> ! {
    let done = memory::take().and_then(|memory| match memory.order {
        1 => bits(memory),
        2 => replayed(memory),
        3 => count::all(memory),
        4 => session::run(memory.first, memory.output),
        _ => None,
    });
    memory::finish(done);
    exit(done.is_some())
}

/// f of every input by both kernels. Returns the bytes put out.
fn bits(memory: Memory) -> Option<usize> {
    let Memory {
        first,
        second,
        output,
        ..
    } = memory;
    let map = Map::<25, 300, 4>::from_image(first).ok()?;
    let portable = map.portable()?;
    let mut places = output.chunks_exact_mut(16);
    let mut count = 0;
    for input in second.chunks_exact(100) {
        let mut q = [0.0; 25];
        for (q, bytes) in q.iter_mut().zip(input.as_chunks::<4>().0) {
            *q = f32::from_le_bytes(*bytes);
        }
        for map in [&map, &portable] {
            let words = match map.eval(&q) {
                Ok(outputs) => outputs.map(f32::to_bits),
                Err(error) => [REFUSED, error.input as u32, error.value.to_bits(), 0],
            };
            let place = places.next()?;
            for (bytes, word) in place.chunks_exact_mut(4).zip(words) {
                bytes.copy_from_slice(&word.to_le_bytes());
            }
            count += 16;
        }
    }
    Some(count)
}

fn replayed(memory: Memory) -> Option<usize> {
    let (slots, profile) = (flash::slots(), flash::profile_slots());
    replay::run(memory.first, memory.output, slots, profile)
}

/// No interrupt is ever enabled.
// SAFETY: the name and the section are those that cortex-m-rt's linker script expects; no other item has them.
#[unsafe(link_section = ".vector_table.interrupts")]
#[unsafe(no_mangle)]
static __INTERRUPTS: [extern "C" fn(); 1] = [unexpected];

extern "C" fn unexpected() {
    exit(false);
}

#[cortex_m_rt::exception]
unsafe fn HardFault(_frame: &cortex_m_rt::ExceptionFrame) -> ! {
    exit(false)
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    exit(false)
}
