//! How deep the stack has been: the memory below it is painted at the start, and searched for paint that is gone.

/// Bytes below the stack's start that are painted.
const DEPTH: usize = 64 * 1024;
/// Bytes below the stack pointer that are left alone while painting.
const MARGIN: usize = 256;
const PAINT: u32 = 0xA5A5_5A5A;
/// Words read in one go.
const WORDS_A_SCAN: usize = 64;

unsafe extern "C" {
    /// The stack's first address, from cortex-m-rt's linker script.
    static _stack_start: u32;
}

/// Searches for the deepest use, a few words at a time, from the bottom up.
pub struct StackWatch {
    at: usize,
    used: u32,
}

fn top() -> usize {
    (&raw const _stack_start).addr()
}

impl StackWatch {
    /// Paints what the stack has not reached yet.
    pub(super) fn start() -> Self {
        let bottom = top() - DEPTH;
        let end = (cortex_m::register::msp::read() as usize)
            .saturating_sub(MARGIN)
            .clamp(bottom, top());
        for address in (bottom..end).step_by(4) {
            // SAFETY: between the end of the data (some 10 KB of 4 MB) and the stack pointer lies memory that nothing uses.
            unsafe { core::ptr::write_volatile(address as *mut u32, PAINT) };
        }
        Self {
            at: bottom,
            used: 0,
        }
    }

    /// The next few words; returns the most bytes that were ever in use, as far as it is known.
    pub fn scan(&mut self) -> u32 {
        for _ in 0..WORDS_A_SCAN {
            // SAFETY: an aligned word of the painted memory; reading it has no effect.
            let painted = unsafe { core::ptr::read_volatile(self.at as *const u32) } == PAINT;
            if !painted || self.at + 4 >= top() {
                self.used = self.used.max((top() - self.at) as u32);
                self.at = top() - DEPTH;
                break;
            }
            self.at += 4;
        }
        self.used
    }
}
