//! A run of the bridge as a person sees it: heartbeat, keys, live view, log and numbers, until its time is over.

mod bringup;
mod clutch;
mod finished;
mod on_page;
mod paged;
mod shown;
mod view;
mod worn;

use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::Result;
use host::bridge::event::Kind;
use host::glove::hand::Side;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::live::{Key, Live};
use crate::wearer::Listener;
use crate::{note, out};
use clutch::Clutch;
use host::clock::Clock;
use host::failure::{Failure, OrFail};
use host::interrupt::Interrupt;
use host::recording::{Drawn, QUEUE, SessionLog};
use host::session::record::{self, Feed, Records, Sort};
use host::session::{Devices, Driver, Ending, Order, Session, Snapshot};
use host::settings::Settings;
use on_page::OnPage;
use shown::Shown;

pub use bringup::{ASK as ASK_FLAT, WAIT as FLAT_WAIT};
pub use finished::Finished;
pub use on_page::drawn;

/// Pause between two rounds: heartbeats, keys and records are looked after this often.
const ROUND: Duration = Duration::from_millis(20);
/// For a person to answer a question: what waits for the log's file is bounded.
const ANSWER: Duration = Duration::from_secs(60);
/// Pause between two heartbeats of the clutch.
const HEARTBEAT: Duration = Duration::from_micros(host::bridge::timing::HEARTBEAT.as_micros());
/// By then whoever wrote beyond a file's limit was told.
const FILE_LIMIT_TOLD: Duration = Duration::from_millis(300);
/// For the hold before Ctrl-Z stops the program.
const SUSPEND_HOLD: Duration = Duration::from_millis(500);

/// How a run goes.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// Heading of the view.
    pub title: &'static str,
    /// When it ends by itself, counted from the start of [`Run::drive`].
    pub seconds: Option<Duration>,
    /// Whether the clutch is closed from the start.
    pub engage: bool,
    /// Whether a person may close the clutch and calibrate; else the bridge is only watched.
    pub drives: bool,
    /// No view at all (for `--json`).
    pub quiet: bool,
}

/// Why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// Its time was over, or nothing could come of it any more.
    Time,
    /// A person asked for it.
    Asked,
}

/// A log that is made when driving begins: a bring-up that fails leaves no file. What comes before waits in its queue.
#[derive(Debug)]
pub struct LogTo {
    path: PathBuf,
    drawn: Drawn,
    records: Records,
}

impl LogTo {
    /// At `path`, with such a hand and gripper drawn; and where its session hands the records.
    pub fn new(path: PathBuf, drawn: Drawn) -> (Self, Feed) {
        let (feed, records) = record::queue(QUEUE);
        let log = Self {
            path,
            drawn,
            records,
        };
        (log, feed)
    }
}

/// A session that somebody watches.
#[derive(Debug)]
pub struct Run {
    session: Box<dyn Session>,
    log_to: Option<LogTo>,
    log: Option<SessionLog>,
    /// Its end was noted.
    log_end_noted: bool,
    clock: Clock,
    interrupt: Interrupt,
    devices: Devices,
    clutch: Clutch,
    /// Somebody can press keys.
    attended: bool,
    shown: Shown,
    /// Events that were shown.
    happened: u64,
    /// The view was not taken for so long that nobody sees it.
    unseen: bool,
    /// When a file grew to its limit.
    file_limit: Option<Instant>,
    ending: Option<Ending>,
    /// The gripper was told to activate.
    activated: bool,
    /// The glove's sensors sit straight and share a heading; else a profile says how they sit.
    straight: bool,
    /// Flat poses are found while the hand works.
    finds_flat: bool,
    /// The virtual person in the glove, who lies flat when asked.
    person: Option<Listener>,
    /// It was asked to by a key: calibrations that had ended by then.
    asked_flat: Option<u16>,
    /// Which hand wears the glove.
    side: Side,
    /// The page in a browser.
    page: Option<OnPage>,
    /// How it is driven, and since when, once it is.
    course: Option<(Options, Instant)>,
}

impl Run {
    /// Watches `session` with `devices`, and makes its log when driving begins.
    pub fn new(
        session: impl Session + 'static,
        log_to: Option<LogTo>,
        clock: Clock,
        interrupt: Interrupt,
        devices: Devices,
    ) -> Self {
        Self {
            session: Box::new(session),
            log_to,
            log: None,
            log_end_noted: false,
            clock,
            interrupt,
            devices,
            clutch: Clutch::default(),
            attended: false,
            shown: Shown::default(),
            happened: 0,
            unseen: false,
            file_limit: None,
            ending: None,
            activated: false,
            straight: false,
            finds_flat: true,
            person: None,
            asked_flat: None,
            side: Side::Right,
            page: None,
            course: None,
        }
    }

    /// The state now.
    pub fn snapshot(&self) -> Option<Snapshot> {
        self.session.snapshot()
    }

    /// Whether somebody asked for the end.
    pub fn asked(&self) -> bool {
        self.interrupt.asked()
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

    /// Asks a person, while the session is looked after. `false` where there is no terminal to ask on, or no answer in a minute.
    ///
    /// # Errors
    /// What ended the bridge.
    pub fn ask_yes(&mut self, question: &str) -> Result<bool> {
        let stdin = std::io::stdin();
        if !stdin.is_terminal() || !std::io::stderr().is_terminal() {
            return Ok(false);
        }
        out::ask(format_args!("{question}"));
        let end = Instant::now() + ANSWER;
        while Instant::now() < end && !self.interrupt.sleep(ROUND) {
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
    ///
    /// # Errors
    /// It was not taken: so many orders wait that the bridge's thread stands still.
    pub fn order(&self, order: Order) -> Result<()> {
        match self.session.order(order) {
            true => Ok(()),
            false => Err(Failure::new(
                "the bridge takes no orders: those that were given wait",
                "the same again, on a computer that neither sleeps nor has so much to do",
            )
            .into()),
        }
    }

    /// Runs with heartbeat, keys and view until the time is over or somebody asks for the end.
    ///
    /// # Errors
    /// What ended the bridge, or the terminal's fault.
    pub fn drive(&mut self, options: &Options) -> Result<End> {
        self.start_log()?;
        let driven = self.watch(options);
        self.ending = self.session.hub().ending(Driver {
            attended: self.attended,
            engages: options.engage,
            closed: self.clutch.ours(),
            expired: self.clutch.expired,
            too_late: self.clutch.too_late,
        });
        driven
    }

    fn watch(&mut self, options: &Options) -> Result<End> {
        // A key that was bound to something safe must not close the clutch since the file could not be read.
        Settings::load()?;
        let terminal = || "the terminal does not work".to_owned();
        let next = "the same with | cat behind it, which prints lines instead";
        let mut live = Live::start(options.quiet).or_fail(terminal, next)?;
        let suspend = self.interrupt.catch_suspend().or_fail(
            || "Ctrl-Z cannot be caught".to_owned(),
            "ending other programs: the system lacks descriptors",
        )?;
        if options.engage {
            self.clutch.engage(&*self.session);
        }
        let started = Instant::now();
        self.session.hub().begin();
        self.course = Some((*options, started));
        loop {
            // Nobody sees the view: as if nobody were there.
            self.unseen = live.unseen();
            self.round()?;
            for key in live.keys().or_fail(terminal, next)? {
                self.obey(key, options);
            }
            let keys = live.interactive();
            let attended = keys || self.has_person();
            self.attended = attended;
            live.show(|| self.view(options, started.elapsed(), keys))
                .or_fail(terminal, next)?;
            self.note_log_end(options.quiet);
            if suspend.asked() {
                self.hold_for_a_while()?;
                live.aside(|| suspend.stop()).or_fail(terminal, next)?;
            }
            // Nobody sees the lines any more: do not drive on unseen.
            if self.interrupt.asked() || out::reader_left()? {
                return Ok(End::Asked);
            }
            let over = options
                .seconds
                .is_some_and(|time| started.elapsed() >= time);
            // Nobody is there to close the clutch again.
            let useless = options.engage && self.clutch.too_late && !attended;
            if over || useless {
                return Ok(End::Time);
            }
            self.interrupt.sleep(self.pause());
        }
    }

    /// Opens the clutch, and waits until the hold has left.
    fn hold_for_a_while(&mut self) -> Result<()> {
        let released = self.clock.now();
        self.clutch.release(self.session.orders());
        let end = Instant::now() + SUSPEND_HOLD;
        let mut held = false;
        while !held && Instant::now() < end && !self.interrupt.sleep(ROUND) {
            self.round()?;
            held = self.session.hub().is_idle_since(released);
        }
        Ok(())
    }

    /// Makes the log's file, with what came so far in it.
    fn start_log(&mut self) -> Result<()> {
        let Some(to) = self.log_to.take() else {
            return Ok(());
        };
        self.log = Some(SessionLog::create(
            &to.path, to.drawn, self.clock, to.records,
        )?);
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
        let seen = self.session.snapshot();
        let stopped = self.session.stop();
        let log = self.log.take().map(SessionLog::finish);
        Finished {
            summary: self.session.hub().summary(),
            log,
            stopped,
            seen,
            ending: self.ending,
            activated: self.activated,
            devices: self.devices,
        }
    }

    fn obey(&mut self, key: Key, options: &Options) {
        match key {
            Key::End => self.interrupt.ask(),
            Key::Again => {}
            _ if !options.drives => {}
            Key::Clutch => {
                if self.clutch.closed {
                    self.clutch.release(self.session.orders());
                } else {
                    self.clutch.engage(&*self.session);
                }
            }
            Key::Open => self.clutch.release(self.session.orders()),
            // One that is not taken says no word of having begun; who pressed it presses it again.
            Key::Calibrate => {
                self.ask_flat();
            }
            Key::Undo => {
                self.session.order(Order::UndoCalibration);
            }
        }
    }

    /// What has to be done every few milliseconds.
    fn round(&mut self) -> Result<()> {
        if !self.session.running() {
            return Err(self.session.ended());
        }
        let now = Instant::now();
        let due = self
            .clutch
            .heartbeat
            .is_none_or(|last| now.duration_since(last) >= HEARTBEAT - ROUND / 2);
        if self.clutch.is_kept_here() && due && !self.unseen {
            self.clutch.heartbeat = Some(now);
            // What is not taken is given again with the next.
            self.session.order(Order::Heartbeat);
        }
        self.clutch.give_release(self.session.orders());
        self.clutch.look(&*self.session);
        self.look_at_file_limit();
        self.look_at_events();
        self.look_at_flat();
        self.look_at_page();
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

    fn look_at_events(&mut self) {
        for event in self.session.hub().happened(&mut self.happened) {
            if event.sort == Sort::Fault || matches!(event.kind, Kind::Calibration(_)) {
                self.shown.happened(&event.text, event.kind);
            }
        }
        if let Some(status) = self.session.snapshot().and_then(|seen| seen.status) {
            self.shown.status(&status, Instant::now());
        }
    }
}
