//! Real-time priority for the threads that carry the bytes, where the system grants it.
//!
//! A scan of the glove is dozens of short exchanges, and a thread that waits a few milliseconds for a processor at each of
//! them makes samples too old to follow. Linux grants the priority to root, to a program with `CAP_SYS_NICE`, and to users
//! with an `rtprio` limit; elsewhere everything runs as any program does.

use std::{fmt, io};

use serde::{Serialize, Serializer};
use thread_priority::unix::{
    RealtimeThreadSchedulePolicy, ThreadSchedulePolicy, set_thread_priority_and_policy,
    thread_native_id,
};
use thread_priority::{ThreadPriority, ThreadPriorityValue};

/// What helps where the bridge's own steps come late, as a next step.
pub const LESS_TO_DO: &str = "a computer with less to do: close other programs, or allow this user real-time priority \
                              (docs/tool.md, rtprio)";

/// Above every ordinary program, below the kernel's own threads (50).
const PRIORITY: u8 = 10;

/// How the threads that carry the bytes are scheduled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scheduling {
    /// They run before every ordinary program.
    Realtime,
    /// They share the processor with all other programs.
    Shared,
}

impl Scheduling {
    /// The same in the middle of a sentence, without what is there already.
    pub fn less_to_do(self) -> &'static str {
        match self {
            Self::Realtime => "close other programs",
            Self::Shared => {
                "close other programs, or allow this user real-time priority (docs/tool.md, rtprio)"
            }
        }
    }
}

impl fmt::Display for Scheduling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Realtime => "realtime",
            Self::Shared => "shared",
        })
    }
}

impl Serialize for Scheduling {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Runs `start` on a thread of real-time priority: threads started in it inherit that. Returns what `start` did, and whether
/// the priority was granted.
///
/// # Errors
/// The system gives no thread.
pub fn starting<T: Send>(start: impl FnOnce() -> T + Send) -> io::Result<(T, Scheduling)> {
    // A thread of its own, so that the caller's scheduling need not be put back.
    std::thread::scope(|scope| {
        let starter = std::thread::Builder::new().spawn_scoped(scope, || {
            let scheduling = raise();
            (start(), scheduling)
        })?;
        match starter.join() {
            Ok(started) => Ok(started),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}

fn raise() -> Scheduling {
    let priority = ThreadPriorityValue::try_from(PRIORITY)
        .map_or(ThreadPriority::Min, ThreadPriority::Crossplatform);
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::RoundRobin);
    match set_thread_priority_and_policy(thread_native_id(), priority, policy) {
        Ok(()) => Scheduling::Realtime,
        Err(_) => Scheduling::Shared,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use thread_priority::unix::thread_schedule_policy;

    #[test]
    fn threads_started_inherit_what_was_granted_and_the_caller_keeps_its_own() {
        let before = thread_schedule_policy().expect("a policy");
        let (inner, scheduling) = starting(|| {
            std::thread::spawn(thread_schedule_policy)
                .join()
                .expect("the thread ends")
                .expect("a policy")
        })
        .expect("a thread");
        let realtime = matches!(inner, ThreadSchedulePolicy::Realtime(_));
        assert_eq!(realtime, scheduling == Scheduling::Realtime);
        assert_eq!(thread_schedule_policy().expect("a policy"), before);
    }
}
