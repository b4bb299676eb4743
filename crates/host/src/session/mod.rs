//! The bridge on a thread of its own: [`bridge::App`] over two serial ports, driven by orders, watched through records.
//!
//! Both ways go through bounded queues, and neither side ever waits for the other. Orders that do not fit are refused
//! (the caller tries again with its next heartbeat); records that do not fit are counted. The thread ends in an orderly
//! way: the clutch is opened, the bridge sends the hold, and only then is the gripper's port closed.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use anyhow::Result;
use bridge::{App, Telemetry, WeightsStore};
use glove::scan::{self, Scanner};
use gripper::driver::ThreeFinger;
use gripper::{Duration, Instant};

use crate::clock::Clock;
use crate::failure::{Failure, OrFail};
use crate::interrupt::Interrupt;
use crate::lines::Pc;
use crate::lines::port::{BAUD, Port, Watch};
use crate::lines::{Line, Settings};
use crate::realtime::{self, Scheduling};
use crate::session::record::{AXES, Record};
use crate::session::slots::MemorySlot;
use crate::session::stopped::Stopped;

pub mod record;
pub mod slots;
pub mod stopped;
mod worker;

use worker::{Seen, Worker};

impl bridge::Board<AXES> for Pc {
    type Glove = Port;
    type Gripper = ThreeFinger<Line>;
    type Flash = MemorySlot;
}

/// The bridge as a PC runs it.
pub type PcApp = App<Pc, AXES>;

/// Orders that may wait; the loop takes them every 10 ms.
const ORDERS: usize = 64;
/// Records that may wait: about 10 s of a run.
const RECORDS: usize = 4096;

/// What the bridge can be told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Close the clutch: an act of a person.
    Engage,
    /// Keep the clutch closed that was closed last: send one every 100 ms. It closes nothing.
    Heartbeat,
    /// Open the clutch: hold.
    Release,
    /// Activate the gripper: the fingers move.
    Activate,
    /// Take the hand as flat, once it has been still for a second; within so long.
    Calibrate(Duration),
    /// Take the newest calibration back.
    UndoCalibration,
    /// Hold, and end.
    Stop,
}

impl Order {
    /// Whether it makes motion possible: then it counts only while it is young.
    fn moves(self) -> bool {
        matches!(self, Self::Engage | Self::Heartbeat | Self::Activate)
    }
}

/// An order, and when it was given. Between that and its being read a process can stand still.
#[derive(Debug, Clone, Copy)]
struct Given {
    order: Order,
    at: Instant,
}

/// The state of everything at one moment.
pub type Snapshot = Telemetry<AXES>;

/// What a session is made of.
#[derive(Debug)]
pub struct Parts {
    /// The glove's port.
    pub glove: Port,
    /// The gripper's line.
    pub gripper: Line,
    /// Unit, speed and patience of that line.
    pub line: Settings,
    /// The weights image.
    pub image: Vec<u8>,
    /// The bridge's configuration.
    pub config: bridge::Config<AXES>,
}

/// A running bridge.
#[derive(Debug)]
pub struct Session {
    thread: Option<JoinHandle<Stopped>>,
    orders: SyncSender<Given>,
    clock: Clock,
    records: Receiver<Record>,
    snapshot: Arc<Mutex<Option<Snapshot>>>,
    lost: Arc<AtomicU64>,
    ports: [Watch; 2],
    scheduling: Scheduling,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Session {
    /// Starts the bridge. Nothing moves: the clutch is open, and the gripper is only read.
    ///
    /// # Errors
    /// A failure where the image is refused or the system gives no thread.
    pub fn start(parts: Parts, clock: Clock, interrupt: &Interrupt) -> Result<Self> {
        let (orders, order_queue) = sync_channel(ORDERS);
        let (record_queue, records) = sync_channel(RECORDS);
        let snapshot = Arc::new(Mutex::new(None));
        let lost = Arc::new(AtomicU64::new(0));
        let ports = [parts.glove.watch(), parts.gripper.watch()];
        let platform = Pc::new(clock, ports.clone(), interrupt.clone());
        let mut store = WeightsStore::new(
            [MemorySlot::new(), MemorySlot::new()],
            bridge::app::expected(AXES),
        );
        load(&mut store, &parts.image)?;
        let worker = Worker {
            orders: order_queue,
            epoch: None,
            records: record_queue,
            snapshot: Arc::clone(&snapshot),
            lost: Arc::clone(&lost),
            seen: Seen::default(),
            ending: None,
            activation_asked: false,
        };
        let bridge = std::thread::Builder::new().name("bridge".to_owned());
        let start = move || {
            bridge.spawn(move || {
                let scanner = Scanner::new(
                    parts.glove,
                    scan::Config {
                        baud: BAUD,
                        ..scan::Config::default()
                    },
                )
                .with_set_baud(Port::set_baud);
                let config = parts.gripper.driver_config(parts.line);
                let gripper = ThreeFinger::new(parts.gripper, config);
                let mut app: PcApp = App::new(platform, scanner, gripper, store, parts.config);
                worker.run(&mut app)
            })
        };
        let refused = || "the bridge cannot start".to_owned();
        let next = "ending other programs";
        let (thread, scheduling) = realtime::starting(start).or_fail(refused, next)?;
        let thread = thread.or_fail(refused, next)?;
        Ok(Self {
            thread: Some(thread),
            orders,
            clock,
            records,
            snapshot,
            lost,
            ports,
            scheduling,
        })
    }

    /// Tells the bridge something. Returns whether it was taken: not when the queue is full or the bridge has ended.
    pub fn order(&self, order: Order) -> bool {
        let at = self.clock.now();
        self.orders.try_send(Given { order, at }).is_ok()
    }

    /// What happened since the last call, in order. Never waits.
    pub fn records(&self) -> impl Iterator<Item = Record> + '_ {
        self.records.try_iter()
    }

    /// The state now; `None` before the first step.
    pub fn snapshot(&self) -> Option<Snapshot> {
        *lock(&self.snapshot)
    }

    /// Records that did not fit their queue.
    pub fn lost(&self) -> u64 {
        self.lost.load(Ordering::Relaxed)
    }

    /// The glove's and the gripper's port.
    pub fn ports(&self) -> &[Watch; 2] {
        &self.ports
    }

    /// How the bridge's thread is scheduled.
    pub fn scheduling(&self) -> Scheduling {
        self.scheduling
    }

    /// Whether the bridge's thread still runs.
    pub fn running(&self) -> bool {
        self.thread
            .as_ref()
            .is_some_and(|thread| !thread.is_finished())
    }

    /// Holds the gripper where it is and ends the bridge, within two seconds. Returns how the gripper was left.
    ///
    /// # Errors
    /// What ended the bridge before.
    pub fn stop(&mut self) -> Result<Stopped> {
        // A full queue is drained by the loop within 10 ms; the bound is for a loop that has ended.
        for _ in 0..100 {
            if self.order(Order::Stop) || !self.running() {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(stopped)) => Ok(stopped),
            Some(Err(_)) | None => Err(Failure::new(
                "the bridge stopped on a fault of its own: the gripper was not held",
                "look at the gripper; then the same again with --log, and report what it says",
            )
            .into()),
        }
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        let _ = self.stop();
    }
}

/// Puts the image into the store the way it comes over a line: begun, in chunks, committed last.
fn load(store: &mut WeightsStore<MemorySlot>, image: &[u8]) -> Result<()> {
    let refused = || "the weights image was refused".to_owned();
    let next = "training the model again";
    store.begin(image.len()).or_fail(refused, next)?;
    for (index, chunk) in image.chunks(bridge::store::PAGE).enumerate() {
        store
            .chunk(index * bridge::store::PAGE, chunk)
            .or_fail(refused, next)?;
    }
    store.commit().or_fail(refused, next)
}
