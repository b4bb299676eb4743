//! A session's log replayed as a session that somebody watches, at its own pace or another.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::Result;
use bridge::{App, Board};

use super::hub::Hub;
use super::orders::{Order, Orders, Queue};
use super::stopped::Stopped;
use super::worker::Worker;
use super::{Session, goes_on};
use crate::clock::Clock;
use crate::failure::{Failure, OrFail};
use crate::recording::traced::Traced;
use crate::replay::{self, Follow, Same};

/// Longest sleep between two looks whether the end was ordered.
const LOOK: Duration = Duration::from_millis(20);

/// How a replay went, once it is over.
#[derive(Debug, Clone, Default)]
pub struct Outcome(Arc<Mutex<Option<Result<Same>>>>);

impl Outcome {
    fn lock(&self) -> MutexGuard<'_, Option<Result<Same>>> {
        // Nothing panics while holding it.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// How it went; `None` before its end, and once it was taken.
    pub fn take(&self) -> Option<Result<Same>> {
        self.lock().take()
    }
}

/// A log being replayed.
#[derive(Debug)]
pub struct Replayed {
    thread: Option<JoinHandle<()>>,
    outcome: Outcome,
    orders: Orders,
    hub: Hub,
}

/// Tells the hub what the bridge does, as fast as the log's time passes.
struct Told {
    worker: Worker,
    orders: Queue,
    started: Instant,
    speed: f64,
}

impl Follow for Told {
    fn turn<B: Board<X>, const X: usize>(&mut self, app: &mut App<B, X>, at: u64) -> bool {
        self.worker.hand_over(app);
        loop {
            // The gripper in the log takes no orders but the end.
            while let Some(order) = self.orders.next() {
                if order == Order::Stop {
                    return false;
                }
            }
            let due = Duration::from_secs_f64(at as f64 * 1e-6 / self.speed);
            let left = due.saturating_sub(self.started.elapsed());
            if left.is_zero() {
                return true;
            }
            std::thread::sleep(left.min(LOOK));
        }
    }
}

impl Replayed {
    /// Replays `traced` with its own bridge, `speed` times as fast as it was.
    ///
    /// # Errors
    /// A failure where the system gives no thread.
    pub fn start(traced: Traced, speed: f64, clock: Clock) -> Result<Self> {
        let (orders, queue) = Orders::queue(clock);
        let (_, none) = Orders::queue(clock);
        let hub = Hub::default();
        let mut told = Told {
            worker: Worker::new(none, hub.clone(), None),
            orders: queue,
            started: Instant::now(),
            speed: speed.max(0.01),
        };
        let outcome = Outcome::default();
        let place = outcome.clone();
        let replay = move || {
            let same = replay::same(&traced, &mut told);
            *place.lock() = Some(same);
        };
        let thread = std::thread::Builder::new()
            .name("replay".to_owned())
            .spawn(replay)
            .or_fail(
                || "the replay cannot start".to_owned(),
                "ending other programs",
            )?;
        Ok(Self {
            thread: Some(thread),
            outcome,
            orders,
            hub,
        })
    }

    /// Where it will be said how it went.
    pub fn result(&self) -> Outcome {
        self.outcome.clone()
    }

    fn end(&mut self) -> Result<()> {
        self.orders.give(Order::Stop);
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(())) | None => Ok(()),
            Some(Err(_)) => Err(Failure::new(
                "the replay stopped on a fault of its own",
                "the same without --speed, and report what it says",
            )
            .into()),
        }
    }
}

impl Session for Replayed {
    fn orders(&self) -> &Orders {
        &self.orders
    }

    fn hub(&self) -> &Hub {
        &self.hub
    }

    fn running(&self) -> bool {
        goes_on(self.thread.as_ref())
    }

    fn ended(&mut self) -> anyhow::Error {
        match self.end() {
            Ok(()) => anyhow::anyhow!("the log is replayed"),
            Err(error) => error,
        }
    }

    fn stop(&mut self) -> Result<Stopped> {
        self.end().map(|()| Stopped::Untouched)
    }
}
