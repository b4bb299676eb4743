//! A glove that is read by itself: no gripper, no map, nothing moves.
//!
//! [`Scanning`] runs [`glove::scan::BusScanner`] over an open glove line on a thread of its own. Every frame goes through a
//! bounded queue, in order; those that nobody takes in time are counted. Beside it stands the newest [`Snapshot`], which
//! as many as like may look at. A glove that is unplugged is waited for; a thread that ends by a fault says so.

mod bringup;
mod hand;
mod shared;
mod snapshot;
mod worker;

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::Result;
use glove::scan::Finding;

use crate::clock::Clock;
use crate::failure::{Failure, OrFail};
use crate::interrupt::Interrupt;
use crate::lines::glove::{GloveLine, Reading};
use crate::lines::port::Watch;
use crate::realtime;
use crate::trace::TraceLog;

pub use bringup::{BringUp, open};
pub use hand::{Flat, Hand, Pose};
pub use shared::Scanned;
use shared::Shared;
pub use snapshot::{Sensor, Snapshot};

/// Frames that wait to be taken: three seconds at the fastest line.
pub const QUEUE: usize = 256;
/// Pause between two looks of a waiting caller.
const LOOK: Duration = Duration::from_millis(20);

/// How a glove is read.
#[derive(Debug, Clone)]
pub struct Settings {
    /// What a person chose of it.
    pub reading: Reading,
    /// Frames that may wait to be taken, 1 at least.
    pub queue: usize,
    /// Where the port's bytes go, with the instants at which they were read and written.
    pub trace: TraceLog,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            reading: Reading::default(),
            queue: QUEUE,
            trace: TraceLog::default(),
        }
    }
}

/// A glove that is read. Ends when it is dropped.
#[derive(Debug)]
pub struct Scanning {
    thread: Option<JoinHandle<()>>,
    shared: Arc<Shared>,
    frames: Receiver<Scanned>,
    watch: Watch,
}

impl Scanning {
    /// Reads the glove on `line`, with stamps of `clock`. A signal caught by `interrupt` ends a wait, not the reading.
    ///
    /// # Errors
    /// A failure where the system gives no thread.
    pub fn start(
        line: GloveLine,
        settings: Settings,
        clock: Clock,
        interrupt: &Interrupt,
    ) -> Result<Self> {
        let shared = Arc::new(Shared::default());
        let (hand, frames) = sync_channel(settings.queue.max(1));
        let watch = line.watch();
        let worker = worker::Worker::new(
            line,
            settings.reading,
            settings.trace,
            clock,
            interrupt,
            hand,
            Arc::clone(&shared),
        );
        let builder = std::thread::Builder::new().name("glove".to_owned());
        let refused = || "the glove cannot be read".to_owned();
        let next = "ending other programs";
        let start = move || builder.spawn(move || worker.run());
        let (thread, _) = realtime::starting(start).or_fail(refused, next)?;
        Ok(Self {
            thread: Some(thread.or_fail(refused, next)?),
            shared,
            frames,
            watch,
        })
    }

    /// The next scan, waited for by `time` at most. `None` when none came, or the reading has ended.
    pub fn next(&self, time: Duration) -> Option<Scanned> {
        self.frames.recv_timeout(time).ok()
    }

    /// The scans that wait, without waiting for more; at most [`Settings::queue`].
    pub fn waiting(&self) -> impl Iterator<Item = Scanned> + '_ {
        self.frames.try_iter().take(QUEUE)
    }

    /// The newest state; `None` before the first.
    pub fn snapshot(&self) -> Option<Snapshot> {
        let mut snapshot = self.shared.lock().snapshot()?;
        snapshot.is_plugged = self.watch.plugged();
        snapshot.unplugged = self.watch.losses();
        Some(snapshot)
    }

    /// What was found out about the sensors since `seen` findings were; `seen` is how many are now. Of many the newest 32.
    pub fn findings(&self, seen: &mut u64) -> Vec<Finding> {
        self.shared.lock().findings(seen)
    }

    /// Forgets what was counted so far, the bring-up's say; the ids, the sensors' starts and the frames that wait stay.
    pub fn begin(&self) {
        self.shared.begin.store(true, Ordering::Release);
    }

    /// The glove's line.
    pub fn port(&self) -> &Watch {
        &self.watch
    }

    /// Waits until `done` says so, by `time` at most, and less where the end is asked for or the reading ends. Returns whether it did.
    pub fn wait(
        &self,
        time: Duration,
        interrupt: &Interrupt,
        done: impl Fn(&Snapshot) -> bool,
    ) -> bool {
        let end = Instant::now() + time;
        loop {
            if self.snapshot().as_ref().is_some_and(&done) {
                return true;
            }
            if !self.running() || Instant::now() >= end || interrupt.sleep(LOOK) {
                return false;
            }
        }
    }

    /// Whether it still reads.
    pub fn running(&self) -> bool {
        let thread = self.thread.as_ref();
        thread.is_some_and(|thread| !thread.is_finished())
    }

    /// Ends the reading, within 100 ms, and frees the port. Frames that wait can still be taken. Once.
    ///
    /// # Errors
    /// What ended it before.
    pub fn stop(&mut self) -> Result<()> {
        self.shared.stop.store(true, Ordering::Release);
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(())) | None => Ok(()),
            Some(Err(_)) => Err(fault().into()),
        }
    }

    /// What ended it, where it no longer runs.
    pub fn ended(&mut self) -> anyhow::Error {
        match self.stop() {
            Ok(()) => anyhow::anyhow!("the glove is not read any more"),
            Err(error) => error,
        }
    }
}

impl Drop for Scanning {
    fn drop(&mut self) {
        let _ = self.stop();
    }
}

fn fault() -> Failure {
    Failure::new(
        "reading the glove stopped on a fault of the program's own",
        "the same again, and report what it says",
    )
}

#[cfg(test)]
mod i2c_tests;
