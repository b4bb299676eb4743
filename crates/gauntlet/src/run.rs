//! A run of the bridge as a person sees it: heartbeat, keys, live view, log and numbers, until its time is over.

pub mod calibrating;
mod numbers;

use std::collections::VecDeque;
use std::io::IsTerminal;
use std::time::{Duration, Instant};

use anyhow::Result;
use bridge::State;
use bridge::clutch::Position;
use glove::hand::LIMITS;
use gripper::Activation;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::failure::OrFail;
use crate::interrupt::Interrupt;
use crate::live::{Axis, Finger, Key, Live, View};
use crate::platform::Clock;
use crate::record::{AXES, Record, Sort};
use crate::session::{Order, Session, Snapshot};
use crate::session_log::{SessionLog, Written};
use crate::stopped::Stopped;
use crate::{out, words};

pub use numbers::{Numbers, Summary};

/// Pause between two rounds: heartbeats, keys and records are looked after this often.
const ROUND: Duration = Duration::from_millis(20);
/// Pause between two heartbeats of the clutch.
const HEARTBEAT: Duration = Duration::from_micros(bridge::timing::HEARTBEAT.as_micros());
/// After this long the bridge has seen that the clutch was closed.
const CLUTCH_SETTLES: Duration = Duration::from_millis(500);
/// Faults shown at once.
const SHOWN_FAULTS: usize = 5;
/// How long a fault stays on the view after it happened.
const FAULT_SHOWN: Duration = Duration::from_secs(4);

/// How a run goes.
#[derive(Debug)]
pub struct Options {
    /// Heading of the view.
    pub title: &'static str,
    /// When it ends by itself, counted from the start of [`Run::drive`].
    pub seconds: Option<Duration>,
    /// Whether the clutch is closed from the start.
    pub engage: bool,
    /// No view at all (for `--json`).
    pub quiet: bool,
}

/// Why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// Its time was over.
    Time,
    /// A person asked for it.
    Asked,
}

/// What is left when a run is over.
#[derive(Debug)]
pub struct Finished {
    /// Its numbers.
    pub summary: Summary,
    /// Its log.
    pub log: Option<Written>,
    /// How the gripper was left.
    pub stopped: Stopped,
}

/// A session that somebody watches.
#[derive(Debug)]
pub struct Run {
    session: Session,
    log: Option<SessionLog>,
    clock: Clock,
    interrupt: Interrupt,
    numbers: Numbers,
    clutch: bool,
    /// When a person closed it last.
    engaged: Option<Instant>,
    heartbeat: Option<Instant>,
    recent_faults: VecDeque<(Instant, String)>,
}

impl Run {
    /// Watches `session`, and writes what it sees into `log`.
    pub fn new(
        session: Session,
        log: Option<SessionLog>,
        clock: Clock,
        interrupt: Interrupt,
    ) -> Self {
        Self {
            session,
            log,
            clock,
            interrupt,
            numbers: Numbers::default(),
            clutch: false,
            engaged: None,
            heartbeat: None,
            recent_faults: VecDeque::new(),
        }
    }

    /// The session.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// What was counted so far.
    pub fn numbers(&self) -> &Numbers {
        &self.numbers
    }

    /// Looks after the session until `done` says so, for `time` at most, without a view. Returns whether it did.
    ///
    /// # Errors
    /// What ended the bridge.
    pub fn wait(
        &mut self,
        time: Duration,
        mut done: impl FnMut(&Snapshot) -> bool,
    ) -> Result<bool> {
        let end = Instant::now() + time;
        loop {
            self.round()?;
            if self
                .session
                .snapshot()
                .is_some_and(|snapshot| done(&snapshot))
            {
                return Ok(true);
            }
            if Instant::now() >= end || self.interrupt.sleep(ROUND) {
                return Ok(false);
            }
        }
    }

    /// Asks a person, while the session is looked after. `false` where there is no terminal to ask on.
    ///
    /// # Errors
    /// What ended the bridge.
    pub fn ask_yes(&mut self, question: &str) -> Result<bool> {
        let stdin = std::io::stdin();
        if !stdin.is_terminal() || !std::io::stderr().is_terminal() {
            return Ok(false);
        }
        out::ask(format_args!("{question}"));
        while !self.interrupt.sleep(ROUND) {
            self.round()?;
            let mut descriptors = [PollFd::new(&stdin, PollFlags::IN)];
            let nothing = Timespec {
                tv_sec: 0,
                tv_nsec: 0,
            };
            if poll(&mut descriptors, Some(&nothing)).is_ok_and(|ready| ready > 0) {
                let mut answer = String::new();
                let read = stdin.read_line(&mut answer);
                return Ok(read.is_ok() && answer.trim().eq_ignore_ascii_case("yes"));
            }
        }
        Ok(false)
    }

    /// Tells the bridge something.
    pub fn order(&self, order: Order) {
        self.session.order(order);
    }

    /// Runs with heartbeat, keys and view until the time is over or somebody asks for the end.
    ///
    /// # Errors
    /// What ended the bridge, or the terminal's fault.
    pub fn drive(&mut self, options: &Options) -> Result<End> {
        let terminal = || "the terminal does not work".to_owned();
        let next = "`gauntlet … | cat`, which prints lines instead";
        let mut live = Live::start(options.quiet).or_fail(terminal, next)?;
        if options.engage {
            self.engage();
        }
        let started = Instant::now();
        self.numbers.begin();
        let mut last_round = started;
        loop {
            self.round()?;
            let moving = self.session.snapshot().map(|s| s.state.is_moving());
            self.numbers
                .pass(last_round.elapsed(), self.clutch, moving == Some(true));
            last_round = Instant::now();
            for key in live.keys().or_fail(terminal, next)? {
                self.obey(key);
            }
            live.show(|| self.view(options, started.elapsed(), live_keys()))
                .or_fail(terminal, next)?;
            // Nobody sees the lines any more: do not drive on unseen.
            if self.interrupt.asked() || out::closed() {
                return Ok(End::Asked);
            }
            if options
                .seconds
                .is_some_and(|time| started.elapsed() >= time)
            {
                return Ok(End::Time);
            }
            self.interrupt.sleep(ROUND);
        }
    }

    /// Holds the gripper, ends the session, finishes the log and sums up.
    ///
    /// # Errors
    /// What ended the bridge, or the log's fault.
    pub fn finish(mut self) -> Result<Finished> {
        let ended = self.session.stop();
        self.take_records();
        let lost = self.session.lost();
        let counters = self.session.snapshot().map(|s| s.counters);
        let log = self.log.take().map(SessionLog::finish).transpose();
        let stopped = ended?;
        let log = log?.map(|mut written| {
            written.lost += lost;
            written
        });
        Ok(Finished {
            summary: self.numbers.summary(counters, self.session.scheduling()),
            log,
            stopped,
        })
    }

    fn obey(&mut self, key: Key) {
        match key {
            Key::End => self.interrupt.ask(),
            Key::Clutch => {
                if self.clutch {
                    self.clutch = false;
                    self.order(Order::Release);
                } else {
                    self.engage();
                }
            }
            Key::Calibrate => self.order(Order::Calibrate(glove::timing::STILL_WAIT)),
        }
    }

    /// Closes the clutch: an act of a person.
    fn engage(&mut self) {
        let now = Instant::now();
        (self.clutch, self.engaged, self.heartbeat) = (true, Some(now), Some(now));
        self.order(Order::Engage);
    }

    /// Sees that the clutch opened by itself. Returns whether it just did.
    fn clutch_opened(&mut self) -> bool {
        let settled = self.engaged.is_some_and(|at| at.elapsed() > CLUTCH_SETTLES);
        let open = self
            .session
            .snapshot()
            .is_some_and(|seen| matches!(seen.clutch, Position::Open | Position::Expired));
        let opened = self.clutch && settled && open;
        if opened {
            self.clutch = false;
        }
        opened
    }

    /// What has to be done every few milliseconds.
    fn round(&mut self) -> Result<()> {
        if !self.session.running() {
            // Says what ended it.
            self.session.stop()?;
            anyhow::bail!("the bridge ended");
        }
        let now = Instant::now();
        let due = self
            .heartbeat
            .is_none_or(|last| now.duration_since(last) >= HEARTBEAT - ROUND / 2);
        if self.clutch && due {
            self.heartbeat = Some(now);
            self.order(Order::Heartbeat);
        }
        self.clutch_opened();
        self.take_records();
        Ok(())
    }

    fn take_records(&mut self) {
        for record in self.session.records() {
            self.numbers.count(&record);
            match &record {
                Record::Event {
                    sort: Sort::Fault,
                    text,
                    ..
                } => {
                    // The same thing again only renews what is shown.
                    self.recent_faults.retain(|(_, known)| known != text);
                    self.recent_faults.push_back((Instant::now(), text.clone()));
                    if self.recent_faults.len() > SHOWN_FAULTS {
                        self.recent_faults.pop_front();
                    }
                }
                _ => {}
            }
            if let Some(log) = &mut self.log {
                log.take(record);
            }
        }
    }

    fn view(&mut self, options: &Options, elapsed: Duration, keys: &'static str) -> View {
        let snapshot = self.session.snapshot();
        let now = self.clock.now();
        let mut view = View {
            title: options.title.to_owned(),
            elapsed,
            total: options.seconds,
            state: "starting".to_owned(),
            following: false,
            fingers: Vec::new(),
            axes: Vec::new(),
            frames_per_s: self.numbers.frames.now(now.as_ticks()),
            cycles_per_s: self.numbers.cycles.now(now.as_ticks()),
            latency_p50: self.numbers.latency.at(0.5),
            latency_p99: self.numbers.latency.at(0.99),
            dropped: self.numbers.dropped(),
            faults: self.faults_now(snapshot.as_ref()),
            fault_count: self.numbers.faults(),
            keys,
        };
        if let Some(snapshot) = &snapshot {
            view.state = snapshot.state.name().to_owned();
            view.following = snapshot.state.is_moving();
            view.fingers = fingers(snapshot);
            view.axes = axes(snapshot);
        }
        view
    }

    fn faults_now(&mut self, snapshot: Option<&Snapshot>) -> Vec<String> {
        let mut faults = Vec::new();
        for (port, device) in self.session.ports().iter().zip(["glove", "gripper"]) {
            if !port.plugged() {
                faults.push(format!(
                    "{device}: {} is unplugged, waiting for it to come back",
                    port.path().display()
                ));
            }
        }
        if let Some(snapshot) = snapshot {
            faults.extend(standing_faults(snapshot));
        }
        self.recent_faults
            .retain(|(at, _)| at.elapsed() < FAULT_SHOWN);
        faults.extend(self.recent_faults.iter().map(|(_, text)| text.clone()));
        faults
    }
}

fn live_keys() -> &'static str {
    "space: close or open the clutch   c: calibrate on a flat hand   q: hold and end"
}

/// What is wrong now and stays so.
fn standing_faults(snapshot: &Snapshot) -> Vec<String> {
    let mut faults = Vec::new();
    if let State::Holding(reason) | State::SafeAction(reason) = snapshot.state {
        faults.push(format!("held: {reason}"));
    }
    if let Some(frame) = &snapshot.frame {
        let health = frame.samples.map(|sample| sample.health);
        faults.extend(words::lost_sensors(&health));
    }
    if let Some(status) = &snapshot.status {
        if status.fault != gripper::Fault::None {
            faults.push(format!(
                "gripper fault {:02X}: {}; {}",
                status.fault.code(),
                status.fault.sentence(),
                status.fault.action()
            ));
        }
        if status.activation != Activation::Ready {
            faults.push(format!(
                "the gripper is {}",
                words::activation(status.activation)
            ));
        }
    }
    faults
}

fn fingers(snapshot: &Snapshot) -> Vec<Finger> {
    let good = match &snapshot.frame {
        Some(frame) => frame
            .samples
            .map(|sample| sample.health == glove::scan::Health::Good),
        None => [false; glove::hand::SEGMENT_COUNT],
    };
    let good = words::fingers_good(&good);
    words::FINGER_NAMES
        .iter()
        .enumerate()
        .map(|(finger, name)| Finger {
            name,
            angles: core::array::from_fn(|joint| snapshot.angles[5 * finger + joint]),
            limits: core::array::from_fn(|joint| LIMITS[5 * finger + joint]),
            good: good[finger],
        })
        .collect()
}

fn axes(snapshot: &Snapshot) -> Vec<Axis> {
    (0..AXES)
        .map(|axis| Axis {
            name: words::AXIS_WORDS[axis],
            asked: snapshot.command.map(|motion| motion.position[axis]),
            reached: snapshot.status.map(|status| status.position[axis]),
            word: snapshot
                .status
                .map_or("silent", |status| words::contact(status.contact[axis])),
        })
        .collect()
}
