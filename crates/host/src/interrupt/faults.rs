//! SIGILL, SIGFPE, SIGSEGV and SIGBUS. Sent by somebody they ask for the end as every other signal does. Raised by the
//! processor for an instruction of this program they end it at once: nothing it did from there on could be trusted, and
//! going on would run into the same instruction for ever.
//!
//! Linux tells the two apart: `si_code` is above zero only where the kernel raised the signal for a fault.

use std::ffi::{c_int, c_void};
use std::io;
use std::mem::MaybeUninit;
use std::ptr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

const FAULTS: [c_int; 4] = [libc::SIGILL, libc::SIGFPE, libc::SIGSEGV, libc::SIGBUS];

/// What was done on each of them before, which is done again on a fault: the standard library's own handler tells of a
/// stack that overflowed.
static BEFORE: [OnceLock<libc::sigaction>; 4] = [const { OnceLock::new() }; 4];

/// What says that somebody asked for the end, for the handler.
static ASKED: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Catches all four from here on. `asked` becomes true where one was sent.
///
/// # Errors
/// The system's error where a handler cannot be installed.
#[allow(unsafe_code)]
pub(super) fn install(asked: &Arc<AtomicBool>) -> io::Result<()> {
    // The handler must find it.
    let _ = ASKED.set(Arc::clone(asked));
    for (signal, before) in FAULTS.into_iter().zip(&BEFORE) {
        let mut old = MaybeUninit::<libc::sigaction>::uninit();
        // SAFETY: nothing is set; `old` has room for the answer.
        done(unsafe { libc::sigaction(signal, ptr::null(), old.as_mut_ptr()) })?;
        // SAFETY: the call succeeded, so it wrote the whole of it. The handler must find it, so it is kept first.
        let _ = before.set(unsafe { old.assume_init() });
        // SAFETY: all fields of a sigaction may be zero: no flags, an empty mask.
        let mut new: libc::sigaction = unsafe { MaybeUninit::zeroed().assume_init() };
        new.sa_sigaction = caught as *const () as usize;
        // On the stack that the standard library keeps for it: the thread's own may have overflowed.
        new.sa_flags = libc::SA_SIGINFO | libc::SA_ONSTACK | libc::SA_RESTART;
        // SAFETY: `new` is a whole sigaction, and its handler has the form that SA_SIGINFO asks for.
        done(unsafe { libc::sigaction(signal, &raw const new, ptr::null_mut()) })?;
    }
    Ok(())
}

fn done(result: c_int) -> io::Result<()> {
    match result {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

/// The handler: only atomics and `sigaction`, which POSIX allows here.
#[allow(unsafe_code)]
extern "C" fn caught(signal: c_int, info: *mut libc::siginfo_t, _context: *mut c_void) {
    // SAFETY: with SA_SIGINFO the kernel hands over a siginfo that lives as long as the handler runs.
    let was_sent = unsafe { info.as_ref() }.is_some_and(|info| info.si_code <= 0);
    if let Some(asked) = ASKED.get().filter(|_| was_sent) {
        return asked.store(true, Ordering::SeqCst);
    }
    let mut known = FAULTS.iter().zip(&BEFORE);
    if let Some(before) =
        known.find_map(|(known, before)| before.get().filter(|_| *known == signal))
    {
        // SAFETY: `before` is what the kernel gave. The instruction runs again on return, and meets it.
        unsafe { libc::sigaction(signal, before, ptr::null_mut()) };
    }
}
