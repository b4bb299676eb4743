//! A bridge on a chip as a person watches it: heartbeat, telemetry, live view, and the counters' difference at the end.

mod stop;
mod summary;
mod table;
mod view;

use stop::stop;
pub use summary::Summary;
pub use table::{write_head, write_row};
pub use view::standing_faults;

use std::time::{Duration, Instant};

use anyhow::Result;
use bridge::clutch::HeartbeatRefusal;
use bridge::protocol::message::{Counters, Sample, Status};
use bridge::{Epoch, HoldReason};

use crate::live::{Key, Live};
use crate::out;
use crate::run::{End, Ending, Lasting, MOVED_COUNTS, Obeyed, first_failure};
use host::chip::link::{Error, Heartbeat, HostLink};
use host::failure::{Failure, OrFail};
use host::interrupt::Interrupt;
use host::session::stopped::Stopped;
use host::stats::{Percentiles, Rate};

/// Pause between two heartbeats, spent listening.
const HEARTBEAT: Duration = Duration::from_millis(100);
/// Pause between two questions for the status without heartbeats; a session ends after 2 s.
const STATUS_EVERY: Duration = Duration::from_millis(500);
/// Pause between two looks at the counters.
const COUNT_EVERY: Duration = Duration::from_secs(1);
/// Pause between two telemetry samples, ms.
pub const SAMPLE_MS: u16 = 50;
/// Heartbeats without an answer, in a row, after which nobody is there: 2 s.
const MISSED_BEATS: u32 = 20;

/// Frames of a watch that say something of the glove.
const LEAST_FRAMES: u32 = 10;

/// How a watch goes.
#[derive(Debug)]
pub struct Options {
    /// Heading of the view.
    pub title: &'static str,
    /// When it ends by itself.
    pub seconds: Option<Duration>,
    /// Whether the clutch is kept closed.
    pub engage: bool,
    /// No view at all.
    pub quiet: bool,
}

/// What is left when a watch is over.
#[derive(Debug)]
pub struct Watched {
    /// Its numbers.
    pub summary: Summary,
    /// How the gripper was left, where the clutch was closed.
    pub stopped: Option<Stopped>,
    /// Why it ended.
    end: Result<End>,
    /// How everything was then; `None` where the bridge never said.
    ending: Option<Ending>,
}

impl Watched {
    /// How the gripper was left, in words, where it is safe.
    pub fn left(&self) -> Option<&'static str> {
        self.stopped.and_then(|stopped| stopped.judge().ok())
    }

    /// The judgement. Whether the gripper may still move comes first, then what ended the watch, then what was broken at
    /// its end.
    ///
    /// # Errors
    /// The first of the failures; the others are noted before it.
    pub fn judge(self) -> Result<End> {
        let stopped = self
            .stopped
            .map_or(Ok(()), |stopped| stopped.judge().map(drop));
        let ending = self.ending.map_or(Ok(()), Ending::judge);
        first_failure(stopped, self.end, [ending])
    }
}

/// A bridge that somebody watches.
#[derive(Debug)]
pub struct Watch<'a> {
    link: &'a mut HostLink,
    interrupt: &'a Interrupt,
    /// Of the closing that is kept.
    epoch: Option<Epoch>,
    /// The clutch was closed by this watch.
    engaged: bool,
    /// It opened by itself, and was not closed again.
    expired: bool,
    /// Somebody can press keys.
    attended: bool,
    missed: u32,
    status: Option<Status>,
    sample: Option<Sample>,
    frames: Rate,
    last_frame: Option<u32>,
    latency: Percentiles,
    samples: u64,
    started: Instant,
    start_positions: Option<Vec<u8>>,
    first_motion: Option<Duration>,
    /// Whether the gripper went where it was told.
    obeyed: Obeyed,
    /// What holds it.
    held: Lasting<HoldReason>,
    counted: Option<(Instant, Counters)>,
    cycles_per_s: f64,
}

impl<'a> Watch<'a> {
    /// Watches the bridge behind `link`.
    pub fn new(link: &'a mut HostLink, interrupt: &'a Interrupt) -> Self {
        Self {
            link,
            interrupt,
            epoch: None,
            engaged: false,
            expired: false,
            attended: false,
            missed: 0,
            status: None,
            sample: None,
            frames: Rate::default(),
            last_frame: None,
            latency: Percentiles::default(),
            samples: 0,
            started: Instant::now(),
            start_positions: None,
            first_motion: None,
            obeyed: Obeyed::default(),
            held: Lasting::default(),
            counted: None,
            cycles_per_s: 0.0,
        }
    }

    /// Watches until the time is over or somebody asks for the end, then opens the clutch and sees how the gripper was left.
    /// `each` is given every sample.
    ///
    /// # Errors
    /// The line's fault before the watch began; what goes wrong later is part of what is left.
    pub fn run(
        mut self,
        options: &Options,
        each: &mut dyn FnMut(&Sample) -> std::io::Result<()>,
    ) -> Result<Watched> {
        let before = self.link.counters().map_err(Failure::from)?;
        self.link.telemetry(SAMPLE_MS).map_err(Failure::from)?;
        self.started = Instant::now();
        let end = self.watch(options, each);
        let ending = self.ending(&before);
        let seconds = self.started.elapsed().as_secs_f64();
        let stopped = self.engaged.then(|| stop(self.link));
        let known = self.counted.map_or(before, |(_, counters)| counters);
        let after = self.link.counters().unwrap_or(known);
        // Nobody listens any more, whether the bridge hears it or not.
        let _ = self.link.telemetry(0);
        Ok(Watched {
            summary: self.summary(seconds, &before, &after),
            stopped,
            end,
            ending,
        })
    }

    fn ending(&mut self, before: &Counters) -> Option<Ending> {
        let status = self.status.clone()?;
        // Who only watches is not to blame for what another host's run came to.
        let ours = self.engaged;
        Some(Ending {
            state: status.state,
            attended: self.attended,
            expired: self.expired,
            held: self.held.lasted(Instant::now()).filter(|_| ours),
            glove_answers: status.glove_answers,
            useless: self.useless(before, &status),
            gripper_answers: status.gripper.is_some(),
            disobeyed: self.obeyed.fault().filter(|_| ours),
        })
    }

    /// Why no frame of the whole watch could be used. What else makes frames useless (no weights, no calibration) is told as
    /// what it is.
    fn useless(&mut self, before: &Counters, status: &Status) -> Option<String> {
        let (_, counted) = self.counted?;
        let grown = counted.since(before);
        let all = grown.frames >= LEAST_FRAMES && grown.unusable_frames >= grown.frames;
        let ready = all && status.active_slot.is_some();
        let calibrated = ready && self.link.health().ok()?.calibration.is_calibrated;
        calibrated.then(|| "sensors are lost, frozen or give what is no orientation".to_owned())
    }

    fn watch(
        &mut self,
        options: &Options,
        each: &mut dyn FnMut(&Sample) -> std::io::Result<()>,
    ) -> Result<End> {
        let terminal = || "the terminal does not work".to_owned();
        let next = "`gauntlet … | cat`, which prints lines instead";
        let mut live = Live::start(options.quiet).or_fail(terminal, next)?;
        let suspend = self.interrupt.catch_suspend().or_fail(
            || "Ctrl-Z cannot be caught".to_owned(),
            "ending other programs: the system lacks descriptors",
        )?;
        self.attended = live.interactive();
        if options.engage {
            self.engage()?;
        }
        let mut asked_status: Option<Instant> = None;
        loop {
            let beat = Instant::now();
            if let Some(epoch) = self.epoch {
                // Nobody sees the view: as if nobody were there.
                if !live.unseen() {
                    self.heartbeat(epoch)?;
                }
            } else if asked_status.is_none_or(|at| at.elapsed() >= STATUS_EVERY) {
                asked_status = Some(beat);
                self.status = Some(self.link.status().map_err(Failure::from)?);
            }
            let reason = self.status.as_ref().and_then(|s| s.state.hold_reason());
            self.held.look(reason, beat);
            self.count(beat + HEARTBEAT)?;
            let rest = HEARTBEAT.saturating_sub(beat.elapsed());
            for sample in self.link.listen(rest).map_err(Failure::from)? {
                each(&sample).or_fail(
                    || "the log cannot be written".to_owned(),
                    "room on the disk",
                )?;
                self.take(sample);
            }
            for key in live.keys().or_fail(terminal, next)? {
                self.obey(key, options)?;
            }
            live.show(|| self.view(options)).or_fail(terminal, next)?;
            if suspend.asked() {
                self.release()?;
                live.aside(|| suspend.stop()).or_fail(terminal, next)?;
            }
            if self.interrupt.asked() || out::closed() {
                return Ok(End::Asked);
            }
            if options
                .seconds
                .is_some_and(|time| self.started.elapsed() >= time)
            {
                return Ok(End::Time);
            }
        }
    }

    /// Closes the clutch: an act of a person.
    fn engage(&mut self) -> Result<()> {
        // Also where the answer is lost: the bridge may have closed it.
        (self.engaged, self.epoch) = (true, None);
        let (epoch, status) = self.link.engage().map_err(Failure::from)?;
        self.epoch = Some(epoch);
        self.status = Some(status);
        (self.expired, self.missed) = (false, 0);
        Ok(())
    }

    /// Opens the clutch, for a person.
    fn release(&mut self) -> Result<()> {
        (self.epoch, self.expired) = (None, false);
        self.status = Some(self.link.release().map_err(Failure::from)?);
        Ok(())
    }

    fn heartbeat(&mut self, epoch: Epoch) -> Result<()> {
        match self.link.heartbeat(epoch).map_err(Failure::from)? {
            Heartbeat::Kept(status) => {
                self.missed = 0;
                self.status = Some(status);
            }
            // Somebody else's release, or their closing, is an act: nothing went wrong.
            Heartbeat::Refused(why) => {
                (self.epoch, self.expired) = (None, why == HeartbeatRefusal::Expired);
            }
            Heartbeat::Unanswered => self.missed += 1,
        }
        if self.missed >= MISSED_BEATS {
            return Err(Failure::from(Error::Silent {
                address: self.link.address().clone(),
                attempts: self.missed,
                heard: self.link.heard(),
            })
            .into());
        }
        Ok(())
    }

    /// Once a second, where the answer comes by `end`: the gripper's rate, from the bridge's own count.
    fn count(&mut self, end: Instant) -> Result<()> {
        let now = Instant::now();
        match self.counted {
            Some((at, _)) if now.duration_since(at) < COUNT_EVERY => return Ok(()),
            _ => {}
        }
        let Some(counters) = self.link.counters_by(end).map_err(Failure::from)? else {
            return Ok(());
        };
        if let Some((at, before)) = self.counted.replace((now, counters)) {
            let cycles = counters.statuses.wrapping_sub(before.statuses);
            self.cycles_per_s = f64::from(cycles) / now.duration_since(at).as_secs_f64();
        }
        Ok(())
    }

    fn obey(&mut self, key: Key, options: &Options) -> Result<()> {
        match key {
            Key::End => self.interrupt.ask(),
            Key::Clutch if options.engage && self.epoch.is_none() => self.engage()?,
            Key::Clutch | Key::Open if options.engage => self.release()?,
            Key::Clutch | Key::Open | Key::Calibrate => {}
        }
        Ok(())
    }

    fn take(&mut self, sample: Sample) {
        let now_us = sample.now_us;
        let last = self.last_frame.replace(sample.frame_sequence);
        let fresh = last.map_or(0, |last| sample.frame_sequence.wrapping_sub(last));
        for _ in 0..fresh.min(16) {
            self.frames.add(now_us);
        }
        self.samples += 1;
        if sample.state.is_moving() {
            // What is in an axis' way is not told on this wire.
            self.obeyed
                .look(now_us, &sample.command, &sample.position, |_| false);
            if let Some(us) = sample.latency_us {
                self.latency.add(us.into());
            }
            self.look_for_motion(&sample);
        }
        self.sample = Some(sample);
    }

    fn look_for_motion(&mut self, sample: &Sample) {
        if self.first_motion.is_some() || sample.position.is_empty() {
            return;
        }
        let start = self
            .start_positions
            .get_or_insert_with(|| sample.position.to_vec());
        let moved = start
            .iter()
            .zip(&sample.position)
            .any(|(start, now)| start.abs_diff(*now) >= MOVED_COUNTS);
        if moved {
            self.first_motion = Some(self.started.elapsed());
        }
    }

    fn summary(&self, seconds: f64, before: &Counters, after: &Counters) -> Summary {
        let grown = after.since(before);
        Summary {
            seconds,
            glove_frames: grown.frames,
            frames_following: grown.following_frames,
            frames_answered: grown.answered_frames,
            commands: grown.commands,
            gripper_cycles: grown.statuses,
            gripper_errors: grown.gripper_errors,
            holds: grown.holds,
            faults: grown.faults,
            bytes_lost: grown.bytes_lost,
            samples: self.samples,
            latency_p50_us: self.latency.at(0.5),
            latency_p99_us: self.latency.at(0.99),
            first_motion_s: self.first_motion.map(|after| after.as_secs_f64()),
        }
    }
}
