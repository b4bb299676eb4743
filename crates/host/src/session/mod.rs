//! A bridge that is driven and watched, wherever it runs: in this process, or on a chip.
//!
//! One trait, [`Session`], with two implementations: [`InProcess`], [`bridge::App`] on a thread of its own over two ports,
//! and [`OnChip`], a conversation over the host protocol on one. Both take the same [`Order`]s through one bounded queue,
//! from as many givers as like; both say what is so at a [`Hub`], which as many watch as like; and both end in an orderly
//! way, with the same judgement of how the gripper was left. Neither side ever waits for the other: orders that do not fit
//! are refused (the giver tries again with its next heartbeat), and of the state the newest wins. The number of the
//! gripper's axes is a constant inside the thread and erased here ([`axes::Axes`]).

use std::thread::JoinHandle;

use anyhow::Result;
use glove::calibration::Bound;

use crate::lines::port::Watch;
use crate::realtime::Scheduling;

pub mod axes;
mod calibrating;
mod chip_calibrating;
mod chip_devices;
mod chip_kept;
mod chip_stop;
mod chip_worker;
mod devices;
mod driven;
mod ending;
mod hub;
mod in_process;
mod lasting;
mod numbers;
mod obeyed;
mod on_chip;
#[cfg(test)]
mod on_chip_tests;
mod orders;
pub mod record;
mod replayed;
pub mod replies;
#[cfg(test)]
mod scripted;
pub mod slots;
pub mod snapshot;
pub mod stopped;
pub(crate) mod stored;
mod summary;
mod totals;
mod worker;

pub use calibrating::{kept, refused};
pub use chip_stop::SAMPLE_MS;
pub use devices::Devices;
pub use driven::Driven;
pub use ending::{CLOSED_TOO_LATE, Driver, Ending};
pub use hub::{Happened, Hub};
pub use in_process::{Driving, InProcess, Parts};
pub use numbers::Progress;
pub use on_chip::OnChip;
pub use orders::{Order, Orders};
pub use replayed::{Outcome, Replayed};
pub use snapshot::Snapshot;
pub use stopped::Stopped;
pub use stored::check_image;
pub use summary::Summary;

/// A running bridge.
pub trait Session: core::fmt::Debug {
    /// Tells it something; clones give into the same queue.
    fn orders(&self) -> &Orders;

    /// Says what it does; clones watch the same.
    fn hub(&self) -> &Hub;

    /// The ports that this process holds open for it, and what hangs on each: usually none.
    fn ports(&self) -> &[(&'static str, Watch)] {
        &[]
    }

    /// Whether it still runs.
    fn running(&self) -> bool;

    /// Holds the gripper where it is and ends, within seconds. Returns how the gripper was left. Once.
    ///
    /// # Errors
    /// What ended it before, where nobody saw what became of the gripper.
    fn stop(&mut self) -> Result<Stopped>;

    /// What ended it, where it no longer runs.
    fn ended(&mut self) -> anyhow::Error;

    /// How its thread is scheduled; `None` where that is no matter.
    fn scheduling(&self) -> Option<Scheduling> {
        None
    }

    /// The state now; `None` before the bridge first told it.
    fn snapshot(&self) -> Option<Snapshot> {
        self.hub().snapshot()
    }

    /// Tells the bridge something. Returns whether it was taken: not when the queue is full or the bridge has ended.
    fn order(&self, order: Order) -> bool {
        self.orders().give(order)
    }

    /// Gives the glove another profile, or none: [`Orders::set_profile`].
    fn set_profile(&self, profile: Option<Bound>) {
        self.orders().set_profile(profile);
    }
}

/// Whether a session's thread, if it has one, still runs.
fn goes_on<T>(thread: Option<&JoinHandle<T>>) -> bool {
    thread.is_some_and(|thread| !thread.is_finished())
}
