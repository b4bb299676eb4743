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
use bridge::event::Kind;
use bridge::telemetry::Sent;
use bridge::{App, HoldReason, State, Telemetry, WeightsStore};
use glove::scan::{self, Scanner};
use gripper::driver::ThreeFinger;
use gripper::{Activation, Duration, Instant};
use serde::Serialize;

use crate::failure::{Failure, OrFail};
use crate::interrupt::Interrupt;
use crate::line::{Line, Settings};
use crate::platform::{Clock, Pc};
use crate::port::{BAUD, Port, Watch};
use crate::realtime::{self, Scheduling};
use crate::record::{AXES, Command, Frame, Imu, Record, Sort};
use crate::slots::MemorySlot;

/// The bridge as a PC runs it.
pub type PcApp = App<Pc, Port, ThreeFinger<Line>, MemorySlot, AXES>;

/// Orders that may wait; the loop takes them every 10 ms.
const ORDERS: usize = 64;
/// Records that may wait: about 10 s of a run.
const RECORDS: usize = 4096;
/// The hold must be confirmed this long after the clutch opened; then the thread ends whatever the gripper does.
/// Some fifteen replies may be lost meanwhile.
const HOLD_WAIT: Duration = Duration::from_ticks(1_500_000);

/// How the gripper was left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Stopped {
    /// Nothing was ever commanded.
    Untouched,
    /// The hold left, and the gripper repeated its positions.
    Held,
    /// It was told to activate and is not ready: no command stops that.
    Activating,
    /// It was commanded before, and did not confirm the hold.
    NotConfirmed,
}

impl Stopped {
    /// What a person should know.
    ///
    /// # Errors
    /// A failure where the gripper may still move.
    pub fn judge(self) -> Result<&'static str> {
        match self {
            Self::Untouched => Ok("the gripper was not commanded"),
            Self::Held => Ok("the gripper is held where it is"),
            Self::Activating => Err(Failure::new(
                "the gripper is activating and cannot be held: its fingers move until that is done",
                "waiting for its end; in danger switch off the gripper's 24 V supply",
            )
            .into()),
            Self::NotConfirmed => Err(Failure::new(
                format!(
                    "the hold was not confirmed: the gripper gave no right answer in {:.1} s",
                    HOLD_WAIT.as_micros() as f64 / 1e6
                ),
                "look at the gripper: an axis comes to rest at most 40 counts from where it was; \
                 in danger switch off its 24 V supply",
            )
            .into()),
        }
    }
}

/// What the bridge can be told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// The clutch's heartbeat: send one every 100 ms to keep it closed.
    Engage,
    /// Open the clutch: hold.
    Release,
    /// Activate the gripper: the fingers move.
    Activate,
    /// Take the next good frame as the flat hand.
    Calibrate,
    /// Hold, and end.
    Stop,
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
    /// The weights image.
    pub image: Vec<u8>,
    /// The bridge's configuration.
    pub config: bridge::Config<AXES>,
}

/// A running bridge.
#[derive(Debug)]
pub struct Session {
    thread: Option<JoinHandle<Stopped>>,
    orders: SyncSender<Order>,
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
                );
                let config = parts.gripper.driver_config(Settings::default());
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
            records,
            snapshot,
            lost,
            ports,
            scheduling,
        })
    }

    /// Tells the bridge something. Returns whether it was taken: not when the queue is full or the bridge has ended.
    pub fn order(&self, order: Order) -> bool {
        self.orders.try_send(order).is_ok()
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
    orders: Receiver<Order>,
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
                Ok(Order::Engage) if self.ending.is_none() => app.engage(),
                Ok(Order::Activate) if self.ending.is_none() => {
                    self.activation_asked = true;
                    app.activate();
                }
                Ok(Order::Calibrate) if self.ending.is_none() => app.calibrate_flat_hand(),
                Ok(Order::Engage | Order::Activate | Order::Calibrate) => {}
                Ok(Order::Release) => app.release(),
                // Whoever gave orders is gone: the same as a stop.
                Ok(Order::Stop) | Err(TryRecvError::Disconnected) => return self.end(app),
                Err(TryRecvError::Empty) => return,
            }
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
        && status.stamp > sent.at
        && status.echo == sent.motion.position
}

/// Whether an event is something wrong, or merely something that happened.
fn sort(kind: &Kind) -> Sort {
    let fault = match kind {
        Kind::Calibrated => return Sort::Calibrated,
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
        | Kind::Glove { answers: false }
        | Kind::Gripper { answers: false }
        | Kind::CalibrationFailed { .. }
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
