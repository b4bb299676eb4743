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

/// A machine whose loop was made to stand still.
#[derive(Debug)]
pub struct Hung {
    address: u32,
    was: String,
}

/// Makes the machine's loop stand still where it is just now; its interrupts go on. The watchdog resets it a second later,
/// unless [`resume`] comes before.
///
/// # Panics
/// The debugger port does not do what it is asked.
pub fn hang(port: &Path) -> Hung {
    let mut line = UnixStream::connect(port).expect("the debugger port");
    line.set_read_timeout(Some(PATIENCE)).expect("a socket");
    let stand = format!("{:04x}", JUMP_TO_ITSELF.swap_bytes());
    // Out of whatever it sleeps in with its interrupts masked, and out of any handler.
    for step in 0.. {
        assert!(step < 100_000, "the loop does not come by");
        tell(&mut line, "s");
        while !packet(&mut line).starts_with('T') {}
        if step < 500 {
            continue;
        }
        let registers = ask(&mut line, "g");
        let register = |index: usize| {
            let word = registers.get(8 * index..8 * index + 8).expect("a register");
            u32::from_str_radix(word, 16)
                .expect("hexadecimal digits")
                .swap_bytes()
        };
        let (address, state) = (register(15), register(16));
        if state & 0x1FF == 0 {
            let was = ask(&mut line, &format!("m{address:x},2"));
            assert_eq!(ask(&mut line, &format!("M{address:x},2:{stand}")), "OK");
            assert_eq!(ask(&mut line, "D"), "OK");
            return Hung { address, was };
        }
    }
    unreachable!("the assertion above ends it")
}

/// Lets a loop go on that [`hang`] made stand still.
///
/// # Panics
/// The debugger port does not do what it is asked.
pub fn resume(port: &Path, hung: &Hung) {
    let mut line = UnixStream::connect(port).expect("the debugger port");
    line.set_read_timeout(Some(PATIENCE)).expect("a socket");
    let Hung { address, was } = hung;
    assert_eq!(ask(&mut line, &format!("M{address:x},2:{was}")), "OK");
    assert_eq!(ask(&mut line, "D"), "OK");
}

fn tell(line: &mut UnixStream, text: &str) {
    let sum = text.bytes().fold(0u8, u8::wrapping_add);
    write!(line, "${text}#{sum:02x}").expect("the debugger port");
}

fn ask(line: &mut UnixStream, text: &str) -> String {
    tell(line, text);
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
