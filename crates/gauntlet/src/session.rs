//! The bridge on a thread of its own: [`bridge::App`] over two serial ports, driven by orders, watched through records.
//!
//! Both ways go through bounded queues, and neither side ever waits for the other. Orders that do not fit are refused
//! (the caller tries again with its next heartbeat); records that do not fit are counted. The thread ends in an orderly
//! way: the clutch is opened, the bridge sends the hold, and only then is the gripper's port closed.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use anyhow::Result;
use bridge::calibration::Try;
use bridge::event::Kind;
use bridge::telemetry::Sent;
use bridge::timing::{HEARTBEAT_TIMEOUT, is_within};
use bridge::{App, Epoch, HoldReason, Platform, State, Telemetry, WeightsStore};
use glove::scan::{self, Scanner};
use gripper::driver::ThreeFinger;
use gripper::{Activation, Duration, Instant};

use crate::failure::{Failure, OrFail};
use crate::interrupt::Interrupt;
use crate::line::{Line, Settings};
use crate::platform::{Clock, Pc};
use crate::port::{BAUD, Port, Watch};
use crate::realtime::{self, Scheduling};
use crate::record::{AXES, Command, Frame, Imu, Record, Sort};
use crate::slots::MemorySlot;
use crate::stopped::{HOLD_WAIT, Stopped};

/// The bridge as a PC runs it.
pub type PcApp = App<Pc, Port, ThreeFinger<Line>, MemorySlot, AXES>;

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

/// The thread's side of the queues.
struct Worker {
    orders: Receiver<Given>,
    /// Of the newest closing of the clutch.
    epoch: Option<Epoch>,
    records: SyncSender<Record>,
    snapshot: Arc<Mutex<Option<Snapshot>>>,
    lost: Arc<AtomicU64>,
    seen: Seen,
    /// When the hold was ordered.
    ending: Option<Instant>,
    activation_asked: bool,
}

/// The sequence numbers already handed over.
#[derive(Default)]
struct Seen {
    frame: u32,
    sent: u32,
    status: u32,
    /// Oldest sample of the newest command that followed the hand.
    stamp: Option<Instant>,
}

impl Worker {
    fn run(mut self, app: &mut PcApp) -> Stopped {
        let mut stopped = Stopped::NotConfirmed;
        app.run(|app| {
            self.obey(app);
            self.hand_over(app);
            match self.ended(app.telemetry()) {
                Some(how) => stopped = how,
                None => return false,
            }
            true
        });
        stopped
    }

    fn obey(&mut self, app: &mut PcApp) {
        loop {
            match self.orders.try_recv() {
                // Whoever gave orders is gone: the same as a stop.
                Ok(Given {
                    order: Order::Stop, ..
                })
                | Err(TryRecvError::Disconnected) => return self.end(app),
                Ok(given) => self.obey_one(app, given),
                Err(TryRecvError::Empty) => return,
            }
        }
    }

    fn obey_one(&mut self, app: &mut PcApp, given: Given) {
        let now = app.platform_mut().now();
        let old = !is_within(now, given.at, HEARTBEAT_TIMEOUT);
        if given.order.moves() && (old || self.ending.is_some()) {
            return;
        }
        match given.order {
            Order::Engage => self.epoch = Some(app.engage()),
            Order::Heartbeat => {
                if let Some(epoch) = self.epoch {
                    // Refused where the clutch is open; telemetry tells so.
                    let _ = app.heartbeat(epoch);
                }
            }
            Order::Release => app.release(),
            Order::Activate => {
                self.activation_asked = true;
                app.activate();
            }
            Order::Calibrate(wait) => app.calibrate_flat_hand_within(wait),
            Order::UndoCalibration => app.undo_calibration(),
            Order::Stop => self.end(app),
        }
    }

    fn end(&mut self, app: &mut PcApp) {
        if self.ending.is_none() {
            app.release();
            self.ending = Some(app.telemetry().now);
        }
    }

    /// How the gripper is left: as soon as that is sure, or the wait for it is over.
    fn ended(&self, telemetry: &Telemetry<AXES>) -> Option<Stopped> {
        let since = self.ending?;
        let ready = telemetry
            .status
            .is_some_and(|status| status.activation == Activation::Ready);
        if self.activation_asked && !ready {
            return Some(Stopped::Activating);
        }
        if telemetry.sent_sequence == 0 {
            return Some(Stopped::Untouched);
        }
        if hold_confirmed(telemetry, since) {
            return Some(Stopped::Held);
        }
        let waited = telemetry.now.checked_duration_since(since);
        waited
            .is_some_and(|waited| waited >= HOLD_WAIT)
            .then_some(Stopped::NotConfirmed)
    }

    fn hand_over(&mut self, app: &mut PcApp) {
        let telemetry = *app.telemetry();
        if telemetry.frame_sequence != self.seen.frame
            && let Some(frame) = frame_record(&telemetry)
        {
            self.send(Record::Frame(Box::new(frame)));
        }
        if let Some(sent) = telemetry.sent
            && telemetry.sent_sequence != self.seen.sent
        {
            self.send(Record::Command(self.command_record(&sent)));
        }
        if let Some(status) = telemetry.status
            && telemetry.status_sequence != self.seen.status
        {
            self.send(Record::Status(status));
        }
        while let Some(event) = app.next_event() {
            self.send(Record::Event {
                at: event.at,
                sort: sort(&event.kind),
                text: event.kind.to_string(),
                kind: event.kind,
            });
        }
        // An activation that has ended is over, whatever the gripper does later.
        let ready = telemetry.status.is_some_and(|status| {
            status.activation == Activation::Ready && telemetry.state.is_moving()
        });
        self.activation_asked &= !ready;
        self.seen = Seen {
            frame: telemetry.frame_sequence,
            sent: telemetry.sent_sequence,
            stamp: telemetry
                .sent
                .filter(|sent| sent.follows)
                .map(|sent| sent.stamp),
            status: telemetry.status_sequence,
        };
        *lock(&self.snapshot) = Some(telemetry);
    }

    fn command_record(&self, sent: &Sent<AXES>) -> Command {
        let age = sent.at.checked_duration_since(sent.stamp);
        Command {
            at: sent.at,
            motion: sent.motion,
            age_us: age.filter(|_| sent.follows).map(|age| age.as_micros()),
            first: sent.follows && self.seen.stamp != Some(sent.stamp),
        }
    }

    fn send(&self, record: Record) {
        if self.records.try_send(record).is_err() {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// Whether a hold left after `since`, and a later status repeats its positions.
fn hold_confirmed(telemetry: &Telemetry<AXES>, since: Instant) -> bool {
    let (Some(sent), Some(status)) = (&telemetry.sent, &telemetry.status) else {
        return false;
    };
    !sent.follows
        && sent.at >= since
        // A status is as old as its request, and the request that carries the hold asks for its own.
        && status.stamp >= sent.at
        && status.echo == sent.motion.position
}

/// Whether an event is something wrong, or merely something that happened.
fn sort(kind: &Kind) -> Sort {
    let fault = match kind {
        // A hold is a fault where it ends motion; which reason follows which is only told.
        Kind::State { from, to } => match to {
            State::Holding(HoldReason::Settling | HoldReason::GripperNotReady(_)) => false,
            State::Holding(_) | State::SafeAction(_) => from.is_moving(),
            State::Faulted(_) => !matches!(from, State::Faulted(_)),
            State::Idle | State::Blending | State::Following => false,
        },
        Kind::GripperFault(fault) => *fault != gripper::Fault::None,
        Kind::SensorLost { .. }
        | Kind::SensorRestarted { .. }
        | Kind::Sensors(_)
        | Kind::AxisStands { .. }
        | Kind::Glove { answers: false }
        | Kind::Gripper { answers: false }
        | Kind::Calibration(Try::Refused(_))
        | Kind::NoWeights
        | Kind::Refused(_) => true,
        _ => false,
    };
    if fault { Sort::Fault } else { Sort::Note }
}

fn frame_record(telemetry: &Telemetry<AXES>) -> Option<Frame> {
    let frame = telemetry.frame.as_ref()?;
    let imus = frame.samples.map(|sample| {
        let quaternion = sample.orientation.as_ref();
        Imu {
            quaternion: [quaternion.w, quaternion.i, quaternion.j, quaternion.k],
            stamp: sample.stamp,
            health: sample.health,
        }
    });
    Some(Frame {
        at: telemetry.now,
        sequence: frame.sequence,
        imus,
        angles: telemetry.angles,
        angles_valid: telemetry.angles_valid,
        map_output: telemetry.map_output,
        following: telemetry.state.is_moving(),
    })
}
