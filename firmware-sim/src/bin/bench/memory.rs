//! The order in the PSRAM, and the way out through semihosting.
//!
//! From 1 MB on: the order u32, the lengths u32 of two inputs, and at the next multiple of 64 the first input, then at
//! the next such multiple the second. From 10 MB on: the length u32 of the output, and 64 bytes on the output. Below 1 MB
//! are the slots of the weights flash.

use core::arch::asm;

const ORDER: usize = 0x2110_0000;
const OUTPUT: usize = 0x21A0_0000;
const END: usize = 0x2200_0000;
const ALIGNMENT: usize = 64;

/// What is to be done.
pub struct Memory {
    pub order: u32,
    pub first: &'static [u8],
    pub second: &'static [u8],
    pub output: &'static mut [u8],
}

/// The order; `None` if its lengths do not fit. Call it once.
pub fn take() -> Option<Memory> {
    let [order, first, second] = [0, 4, 8].map(|offset| {
        // SAFETY: an aligned word in the board's PSRAM, which nothing else in this program uses.
        unsafe { core::ptr::read_volatile((ORDER + offset) as *const u32) }
    });
    let first_at = ORDER + ALIGNMENT;
    let second_at = first_at
        .checked_add(first as usize)?
        .next_multiple_of(ALIGNMENT);
    if second_at.checked_add(second as usize)? > OUTPUT {
        return None;
    }
    // SAFETY: the three ranges lie in the PSRAM and do not meet, nothing else refers to them, and this is called once.
    unsafe {
        Some(Memory {
            order,
            first: core::slice::from_raw_parts(first_at as *const u8, first as usize),
            second: core::slice::from_raw_parts(second_at as *const u8, second as usize),
            output: core::slice::from_raw_parts_mut(
                (OUTPUT + ALIGNMENT) as *mut u8,
                END - OUTPUT - ALIGNMENT,
            ),
        })
    }
}

/// Tells how many bytes were put out.
pub fn finish(length: Option<usize>) {
    // SAFETY: an aligned word in the PSRAM, before the output and apart from it.
    unsafe { core::ptr::write_volatile(OUTPUT as *mut u32, length.unwrap_or(0) as u32) }
}

/// Ends the emulator: SYS_EXIT with ADP_Stopped_ApplicationExit or …RunTimeErrorUnknown.
pub fn exit(well: bool) -> ! {
    let reason = if well { 0x20026 } else { 0x20023 };
    loop {
        // SAFETY: a semihosting call; the debugger reads no memory for this one.
        unsafe { asm!("bkpt #0xab", inout("r0") 0x18 => _, in("r1") reason) };
    }
}
