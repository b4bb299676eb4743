//! The bridge on a chip: a conversation over the host protocol on a thread of its own.
//!
//! A heartbeat is asked once and nothing else is waited for between two of them; what the chip counts, and how its sensors and
//! its gripper are, is asked for in the pause behind one. What it does not tell (its events) is absent from what is said at
//! the hub.

use std::sync::mpsc::SyncSender;
use std::thread::JoinHandle;

use anyhow::Result;
use bridge::protocol::message::Sample;

use super::chip_kept::Kept;
use super::chip_stop::SAMPLE_MS;
use super::chip_worker::{Left, Worker};
use super::hub::Hub;
use super::orders::{Order, Orders};
use super::record::Feed;
use super::stopped::Stopped;
use super::{Session, goes_on};
use crate::chip::link::{Address, Error, HostLink};
use crate::clock::Clock;
use crate::failure::OrFail;

/// A bridge on a chip.
#[derive(Debug)]
pub struct OnChip {
    thread: Option<JoinHandle<Left>>,
    left: Option<Stopped>,
    address: Address,
    orders: Orders,
    hub: Hub,
}

impl OnChip {
    /// Begins to watch the bridge behind `link`. Nothing moves, and who else drives it is not disturbed. `samples`: who is
    /// handed every telemetry sample. `feed`: who keeps a log of what the bridge tells.
    ///
    /// # Errors
    /// The line's fault, or the system gives no thread.
    pub fn start(
        mut link: HostLink,
        clock: Clock,
        samples: Option<SyncSender<Sample>>,
        feed: Option<Feed>,
    ) -> Result<Self> {
        let address = link.address().clone();
        let told = |error: Error| error.at(&address);
        let counters = link.counters().map_err(told)?;
        let status = link.status().map_err(told)?;
        let calibration = match link.health() {
            // That of an older bridge, which only watches and is flashed, is not known.
            Err(Error::Older { .. }) => None,
            health => Some(health.map_err(told)?.calibration),
        };
        link.telemetry(SAMPLE_MS).map_err(told)?;
        let (orders, queue) = Orders::queue(clock);
        let hub = Hub::default();
        let kept = feed.map(|feed| Kept::new(feed, clock));
        let told = (status, counters);
        let mut worker = Worker::new(link, queue, hub.clone(), samples, kept, told);
        if let Some(calibration) = calibration {
            worker.knows(calibration.is_calibrated);
        }
        worker.say();
        let thread = std::thread::Builder::new()
            .name("bridge on a chip".to_owned())
            .spawn(move || worker.run())
            .or_fail(
                || "the bridge cannot be watched".to_owned(),
                "ending other programs",
            )?;
        Ok(Self {
            thread: Some(thread),
            left: None,
            address,
            orders,
            hub,
        })
    }

    /// Waits for the thread's end, which is near: every request of its has a deadline.
    fn join(&mut self) -> Option<Error> {
        let thread = self.thread.take()?;
        let left = thread.join().unwrap_or(Left {
            stopped: Stopped::Unheard,
            fault: None,
        });
        self.left = Some(left.stopped);
        left.fault
    }
}

impl Session for OnChip {
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
        match self.join() {
            Some(fault) => fault.at(&self.address).into(),
            None => anyhow::anyhow!("the bridge ended"),
        }
    }

    fn stop(&mut self) -> Result<Stopped> {
        self.orders.give(Order::Stop);
        let fault = self.join();
        match (self.left, fault) {
            (Some(Stopped::Untouched) | None, Some(fault)) => Err(fault.at(&self.address).into()),
            (left, _) => Ok(left.unwrap_or(Stopped::Unheard)),
        }
    }
}

impl Drop for OnChip {
    fn drop(&mut self) {
        if self.thread.is_some() {
            let _ = self.stop();
        }
    }
}
