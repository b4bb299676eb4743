//! A run of the bridge as a person sees it: heartbeat, keys, live view, log and numbers, until its time is over.

pub mod calibrating;
mod clutch;
mod ending;
mod lasting;
mod numbers;
mod obeyed;
mod replies;
mod shown;
mod summary;
mod view;

use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::Result;
use bridge::event::Kind;
use bridge::telemetry::Sent;
use bridge::{HoldReason, State};
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::live::{Key, Live};
use crate::{note, out};
use host::clock::Clock;
use host::failure::OrFail;
use host::interrupt::Interrupt;
use host::recording::SessionLog;
use host::session::record::{AXES, Record, Sort};
use host::session::{Order, Session, Snapshot};
use shown::Shown;

pub use ending::{Ending, Finished, first_failure};
pub use lasting::Lasting;
pub use numbers::Numbers;
pub use obeyed::{MOVED_COUNTS, Obeyed};
pub use replies::Failed;
pub use summary::Summary;

/// Pause between two rounds: heartbeats, keys and records are looked after this often.
const ROUND: Duration = Duration::from_millis(20);
/// Pause between two heartbeats of the clutch.
const HEARTBEAT: Duration = Duration::from_micros(bridge::timing::HEARTBEAT.as_micros());
/// Records of the bring-up that wait for the log, which is made after it: some 30 s.
const EARLY: usize = 8192;
/// By then whoever wrote beyond a file's limit was told.
const FILE_LIMIT_TOLD: Duration = Duration::from_millis(300);
/// For the hold before Ctrl-Z stops the program.
const SUSPEND_HOLD: Duration = Duration::from_millis(500);

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

/// A session that somebody watches.
#[derive(Debug)]
pub struct Run {
    session: Session,
    /// Where the log will be.
    log_path: Option<PathBuf>,
    log: Option<SessionLog>,
    /// What came before the log was made.
    early: Vec<Record>,
    early_lost: u64,
    /// Its end was noted.
    log_end_noted: bool,
    clock: Clock,
    interrupt: Interrupt,
    numbers: Numbers,
    clutch: bool,
    /// When a person closed it last.
    engaged: Option<Instant>,
    /// It opened by itself, and nobody touched it since.
    expired: bool,
    /// Somebody can press keys.
    attended: bool,
    heartbeat: Option<Instant>,
    shown: Shown,
    /// What holds the gripper.
    held: Lasting<HoldReason>,
    /// No frame of the glove can be used.
    useless: Lasting<()>,
    /// The view was not taken for so long that nobody sees it.
    unseen: bool,
    /// When a file grew to its limit.
    file_limit: Option<Instant>,
    ending: Option<Ending>,
}

impl Run {
    /// Watches `session`. What it sees goes into a log at `log_path`, which is made when driving begins: a bring-up that fails
    /// leaves no file.
    pub fn new(
        session: Session,
        log_path: Option<PathBuf>,
        clock: Clock,
        interrupt: Interrupt,
    ) -> Self {
        Self {
            session,
            log_path,
            log: None,
            early: Vec::new(),
            early_lost: 0,
            log_end_noted: false,
            clock,
            interrupt,
            numbers: Numbers::default(),
            clutch: false,
            engaged: None,
            expired: false,
            attended: false,
            heartbeat: None,
            shown: Shown::default(),
            held: Lasting::default(),
            useless: Lasting::default(),
            unseen: false,
            file_limit: None,
            ending: None,
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
        self.start_log()?;
        let driven = self.watch(options);
        self.ending = self.session.snapshot().map(|seen| self.ending(&seen));
        driven
    }

    fn ending(&self, seen: &Snapshot) -> Ending {
        let now = Instant::now();
        let useless = self.useless.lasted(now);
        Ending {
            state: seen.state,
            attended: self.attended,
            expired: self.expired,
            held: self.held.lasted(now),
            glove_answers: seen.glove_answers,
            useless: useless.map(|()| shown::why_useless(seen)),
            gripper_answers: seen.gripper_answers,
            disobeyed: self.numbers.obeyed.fault(),
        }
    }

    fn watch(&mut self, options: &Options) -> Result<End> {
        let terminal = || "the terminal does not work".to_owned();
        let next = "`gauntlet … | cat`, which prints lines instead";
        let mut live = Live::start(options.quiet).or_fail(terminal, next)?;
        let suspend = self.interrupt.catch_suspend().or_fail(
            || "Ctrl-Z cannot be caught".to_owned(),
            "ending other programs: the system lacks descriptors",
        )?;
        if options.engage {
            self.engage();
        }
        let started = Instant::now();
        self.numbers.begin(self.clock.now());
        let mut last_round = started;
        loop {
            // Nobody sees the view: as if nobody were there.
            self.unseen = live.unseen();
            self.round()?;
            let moving = self.session.snapshot().map(|s| s.state.is_moving());
            self.numbers
                .pass(last_round.elapsed(), self.clutch, moving == Some(true));
            last_round = Instant::now();
            for key in live.keys().or_fail(terminal, next)? {
                self.obey(key);
            }
            let keys = live.interactive();
            self.attended = keys;
            live.show(|| self.view(options, started.elapsed(), keys))
                .or_fail(terminal, next)?;
            self.note_log_end(options.quiet);
            if suspend.asked() {
                self.hold_for_a_while()?;
                live.aside(|| suspend.stop()).or_fail(terminal, next)?;
            }
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

    /// Opens the clutch, and waits until the hold has left.
    fn hold_for_a_while(&mut self) -> Result<()> {
        let released = self.clock.now();
        self.release();
        let end = Instant::now() + SUSPEND_HOLD;
        let mut held = false;
        while !held && Instant::now() < end && !self.interrupt.sleep(ROUND) {
            self.round()?;
            held = self.session.snapshot().is_some_and(|seen| {
                let holds = |sent: Sent<AXES>| !sent.follows && sent.decided > released;
                seen.state == State::Idle && seen.sent.is_none_or(holds)
            });
        }
        Ok(())
    }

    /// Makes the log's file, with what came so far in it.
    fn start_log(&mut self) -> Result<()> {
        let Some(path) = &self.log_path else {
            return Ok(());
        };
        let early = std::mem::take(&mut self.early);
        self.log = Some(SessionLog::create(path, self.clock, early)?);
        self.interrupt.look_after_file_limit();
        Ok(())
    }

    /// Says once that the log ended before the run, where no view shows it.
    fn note_log_end(&mut self, quiet: bool) {
        if let Some(text) = self.log_end().filter(|_| quiet && !self.log_end_noted) {
            self.log_end_noted = true;
            note!("{text}");
        }
    }

    fn log_end(&self) -> Option<String> {
        let log = self.log.as_ref()?;
        let fault = log.fault()?;
        Some(format!(
            "the log {} ended: {fault}; the run goes on without it",
            log.path().display()
        ))
    }

    /// Holds the gripper, ends the session, finishes the log and sums up. Always: what failed is part of what is left.
    pub fn finish(mut self) -> Finished {
        let stopped = self.session.stop();
        self.take_records();
        let lost = self.session.lost() + self.early_lost;
        let counters = self.session.snapshot().map(|s| s.counters);
        let summary = self.numbers.summary(counters, self.session.scheduling());
        let log = self.log.take().map(|log| {
            let mut written = log.finish();
            written.lost += lost;
            written
        });
        Finished {
            summary,
            log,
            stopped,
            ending: self.ending,
        }
    }

    fn obey(&mut self, key: Key) {
        match key {
            Key::End => self.interrupt.ask(),
            Key::Clutch => {
                if self.clutch {
                    self.release();
                } else {
                    self.engage();
                }
            }
            Key::Open => self.release(),
            Key::Calibrate => self.order(Order::Calibrate(glove::timing::STILL_WAIT)),
        }
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
        if self.clutch && due && !self.unseen {
            self.heartbeat = Some(now);
            self.order(Order::Heartbeat);
        }
        self.look_at_clutch();
        self.look_at_file_limit();
        if let Some(seen) = self.session.snapshot() {
            let unusable = seen.frame_sequence > 0 && !seen.angles_valid;
            self.useless.look(unusable.then_some(()), now);
            self.held.look(seen.state.hold_reason(), now);
        }
        self.take_records();
        Ok(())
    }

    /// SIGXFSZ: of the log, which tells it itself, or of somebody who wants the end.
    fn look_at_file_limit(&mut self) {
        if self.interrupt.file_limit() {
            self.file_limit = Some(Instant::now());
        }
        if self
            .file_limit
            .is_some_and(|at| at.elapsed() >= FILE_LIMIT_TOLD)
        {
            self.file_limit = None;
            if self.log_end().is_none() {
                self.interrupt.ask();
            }
        }
    }

    fn take_records(&mut self) {
        for record in self.session.records() {
            self.numbers.count(&record);
            match &record {
                Record::Event {
                    sort, text, kind, ..
                } if *sort == Sort::Fault || matches!(kind, Kind::Calibration(_)) => {
                    self.shown.happened(text, *kind);
                }
                Record::Status(status) => self.shown.status(status, Instant::now()),
                _ => {}
            }
            if let Some(log) = &mut self.log {
                log.take(record);
            } else if self.log_path.is_some() && self.early.len() < EARLY {
                self.early.push(record);
            } else if self.log_path.is_some() {
                self.early_lost += 1;
            }
        }
    }
}
