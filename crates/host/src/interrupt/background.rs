//! SIGTTOU: what a terminal with `stty tostop` stops a program with that prints from the background. In motion that would be a
//! stop without a hold. A handler would not do: the write would begin again for ever.

use std::io;
use std::mem::MaybeUninit;
use std::ptr;

/// As long as it lives such output is printed, and stops nobody.
pub(super) struct Output {
    before: libc::sigaction,
}

impl std::fmt::Debug for Output {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Output")
    }
}

impl Output {
    /// Ignores the signal.
    ///
    /// # Errors
    /// The system's error where it cannot be ignored.
    #[allow(unsafe_code)]
    pub(super) fn ignore_stop() -> io::Result<Self> {
        // SAFETY: all fields of a sigaction may be zero: no flags, an empty mask.
        let mut new: libc::sigaction = unsafe { MaybeUninit::zeroed().assume_init() };
        new.sa_sigaction = libc::SIG_IGN;
        let mut old = MaybeUninit::<libc::sigaction>::uninit();
        // SAFETY: `new` is a whole sigaction, and `old` has room for the one before.
        match unsafe { libc::sigaction(libc::SIGTTOU, &raw const new, old.as_mut_ptr()) } {
            0 => Ok(Self {
                // SAFETY: the call succeeded, so it wrote the whole of it.
                before: unsafe { old.assume_init() },
            }),
            _ => Err(io::Error::last_os_error()),
        }
    }
}

impl Drop for Output {
    #[allow(unsafe_code)]
    fn drop(&mut self) {
        // SAFETY: `before` is what the kernel gave.
        unsafe { libc::sigaction(libc::SIGTTOU, &raw const self.before, ptr::null_mut()) };
    }
}
