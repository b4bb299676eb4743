//! The emulator's debugger port, for what no input can bring about: the chip's code is damaged while it runs.
//!
//! GDB's remote protocol: `$text#sum`, where the sum is that of the bytes, in two hexadecimal digits. A debugger that connects
//! stops the machine, one that detaches lets it run.

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

/// An instruction that jumps to itself.
pub const JUMP_TO_ITSELF: u16 = 0xE7FE;
/// An instruction that is undefined for ever: it faults.
pub const UNDEFINED: u16 = 0xDE00;

/// Place of an exception's vector: a word for each exception from address 0.
const SYSTICK_VECTOR: u32 = 15 * 4;
/// Far more than an answer takes.
const PATIENCE: Duration = Duration::from_secs(20);

/// Puts `instruction` at the start of the handler of the machine's tick, which comes every millisecond.
///
/// # Panics
/// The debugger port does not do what it is asked.
pub fn patch_tick(port: &Path, instruction: u16) {
    let mut line = UnixStream::connect(port).expect("the debugger port");
    line.set_read_timeout(Some(PATIENCE)).expect("a socket");
    let vector = ask(&mut line, &format!("m{SYSTICK_VECTOR:x},4"));
    let vector = u32::from_str_radix(&vector, 16).expect("a word in hexadecimal digits");
    // Memory is little-endian, and bit 0 of a vector says Thumb.
    let handler = vector.swap_bytes() & !1;
    let [low, high] = instruction.to_le_bytes();
    let patched = ask(&mut line, &format!("M{handler:x},2:{low:02x}{high:02x}"));
    assert_eq!(patched, "OK", "the handler at {handler:#x}");
    assert_eq!(ask(&mut line, "D"), "OK");
}

fn ask(line: &mut UnixStream, text: &str) -> String {
    let sum = text.bytes().fold(0u8, u8::wrapping_add);
    write!(line, "${text}#{sum:02x}").expect("the debugger port");
    loop {
        let answer = packet(line);
        // Where the machine stopped when the debugger came is told unasked.
        if !answer.starts_with('T') {
            return answer;
        }
    }
}

fn packet(line: &mut UnixStream) -> String {
    let mut next = || {
        let mut byte = [0];
        line.read_exact(&mut byte).expect("an answer in time");
        byte[0]
    };
    while next() != b'$' {}
    let mut answer = String::new();
    loop {
        match next() {
            b'#' => break,
            byte => answer.push(byte.into()),
        }
    }
    next();
    next();
    line.write_all(b"+").expect("the debugger port");
    answer
}
