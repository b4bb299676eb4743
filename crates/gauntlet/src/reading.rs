//! Reading tables, which people have in any size: Ctrl-C ends that at once. Nothing is under way then that an orderly end
//! would be for.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use crate::{note, out};
use host::failure::{self, Failure};
use host::interrupt::Interrupt;

/// Pause between two looks at whether somebody asked for the end.
const LOOK: Duration = Duration::from_millis(50);

/// Does `read`. Where somebody asks for the end meanwhile, says that `what` was not read, and ends this process with the exit
/// code of a failure.
pub fn ended_by<T>(interrupt: &Interrupt, what: &str, read: impl FnOnce() -> T) -> T {
    std::thread::scope(|scope| {
        let (done, over) = channel::<()>();
        let watch = move || {
            while over.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
                if interrupt.asked() {
                    end(what);
                }
            }
        };
        let watcher = std::thread::Builder::new().name("reading".to_owned());
        // Without a thread to spare reading goes on to its end, as it would have.
        let _ = watcher.spawn_scoped(scope, watch);
        let read = read();
        drop(done);
        read
    })
}

fn end(what: &str) -> ! {
    let failure = Failure::new(
        format!("interrupted while {what} was read; nothing was written"),
        "the same again, with a shorter file if that took too long",
    );
    let (text, code) = failure::report(&failure.into());
    note!("{text}");
    out::finish();
    std::process::exit(code.into())
}
