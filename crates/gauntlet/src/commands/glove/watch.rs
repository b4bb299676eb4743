//! `gauntlet glove watch`: the hand, the rates and each sensor.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use anyhow::Result;
use clap::Args;
use host::calibration::virtual_person::VirtualPerson;
use host::glove::calibration::Step;
use host::glove::hand::{JOINT_COUNT, LIMITS, SEGMENT_NAMES};
use host::glove::imu;
use host::glove::scan::{Health, State};

use super::at::GloveAt;
use crate::live::glove::{GloveView, Sensor};
use crate::live::{Bindings, Finger, Key, Live, headings};
use crate::options::run_time;
use crate::results::{self, gloves, headings as known};
use crate::run::FLAT_WAIT;
use crate::say;
use crate::tell::Tell;
use crate::{note, out};
use host::clock::{Clock, ticks};
use host::failure::OrFail;
use host::interrupt::Interrupt;
use host::scanning::{self, Flat, Hand, Pose, Scanning, Snapshot};
use host::stats::{short, short_or_dash};
use host::trace::TraceLog;
use host::words;

/// Options of `glove watch`.
#[derive(Debug, Args)]
pub struct Watch {
    /// The glove.
    #[command(flatten)]
    pub at: GloveAt,
    /// End by itself after this many seconds (1 to 86400).
    #[arg(long, value_name = "N", value_parser = run_time, allow_negative_numbers = true)]
    pub seconds: Option<Duration>,
}

/// Pause between two rounds.
const ROUND: Duration = Duration::from_millis(20);
/// What is older is marked as old.
const OLD: Duration = Duration::from_millis(250);
/// A glove without a scan for so long gives nothing.
const SILENT: Duration = Duration::from_secs(1);
/// How long a finding stays on the view.
const SHOWN: Duration = Duration::from_secs(6);
/// Findings that the result names.
const KEPT: usize = 32;

/// Watches until its time is over or somebody ends it.
///
/// # Errors
/// A failure that names the port or the layer; that the glove gave nothing at the end.
pub(super) fn run(options: &Watch, interrupt: &Interrupt) -> Result<()> {
    let at = &options.at;
    let tell = Tell::new(at.json);
    let clock = Clock::start();
    let opened = at.open(&tell, clock, TraceLog::default(), interrupt)?;
    let mut watching = Watching {
        unknown: opened.hand.as_ref().err().cloned(),
        hand: opened.hand.unwrap_or_else(|_| Hand::ideal(at.side())),
        scanning: opened.scanning,
        clock,
        pose: None,
        person: VirtualPerson::at(&at.glove),
        asked: false,
        findings: VecDeque::new(),
        seen: 0,
        found: Vec::new(),
        newest: Instant::now(),
    };
    let started = Instant::now();
    watching.scanning.begin();
    let watched = watching.watch(options, started, interrupt);
    watching.let_go();
    let snapshot = watching.scanning.snapshot();
    let silent = watching.newest.elapsed() >= SILENT;
    let stopped = watching.scanning.stop();
    let judged = watched.and(stopped).and_then(|()| match silent {
        true => Err(at.silent().into()),
        false => Ok(()),
    });
    let (judgement, failure) = results::judged(judged);
    if let Some(seen) = &snapshot {
        let result = gloves::Watched {
            place: at.glove.display().to_string(),
            took_s: started.elapsed().as_secs_f64(),
            calibrated: watching.hand.is_calibrated(),
            scanned: gloves::Scanned::from(seen),
            joints: watching.hand.headings().as_ref().map(known::joints),
            sensors: gloves::sensors(seen),
            found: watching.found,
            failure,
        };
        if at.json {
            results::print("glove watch", result)?;
        } else {
            result.lines().iter().for_each(|line| say!("{line}"));
        }
    }
    judgement
}

struct Watching {
    /// Why nobody knows how the sensors sit, if nobody does.
    unknown: Option<String>,
    hand: Hand,
    scanning: Scanning,
    clock: Clock,
    pose: Option<Pose>,
    /// The virtual person in the glove, who lies flat when asked.
    person: Option<VirtualPerson>,
    /// It was asked, and not let go since.
    asked: bool,
    /// What was found lately, and when.
    findings: VecDeque<(Instant, String)>,
    seen: u64,
    found: Vec<String>,
    /// When a scan came last.
    newest: Instant,
}

impl Watching {
    fn watch(&mut self, options: &Watch, started: Instant, interrupt: &Interrupt) -> Result<()> {
        let terminal = || "the terminal does not work".to_owned();
        let next = "the same with | cat behind it, which prints lines instead";
        let mut live = Live::start(options.at.json).or_fail(terminal, next)?;
        if self.unknown.is_none() {
            self.lay_flat();
        }
        loop {
            let scans: Vec<_> = self.scanning.waiting().collect();
            for scanned in scans {
                self.pose = Some(self.hand.take(&scanned));
                self.newest = Instant::now();
            }
            self.hand.pass(self.clock.now());
            if !matches!(self.hand.flat(), Flat::Waiting(_)) {
                self.let_go();
            }
            self.look_for_findings(options.at.json);
            for key in live.keys().or_fail(terminal, next)? {
                match key {
                    Key::End => interrupt.ask(),
                    Key::Calibrate if self.unknown.is_none() => self.lay_flat(),
                    _ => {}
                }
            }
            let keys = live.interactive();
            live.show(|| self.view(options, started.elapsed(), keys))
                .or_fail(terminal, next)?;
            let over = options
                .seconds
                .is_some_and(|time| started.elapsed() >= time);
            if over || interrupt.asked() || out::reader_left()? {
                return Ok(());
            }
            if !self.scanning.running() {
                return Err(self.scanning.ended());
            }
            interrupt.sleep(ROUND);
        }
    }

    fn lay_flat(&mut self) {
        self.hand.begin_flat(self.clock.now(), ticks(FLAT_WAIT));
        if let Some(person) = &self.person {
            person.ask(Step::FirstFlat);
            self.asked = true;
        }
    }

    fn let_go(&mut self) {
        if std::mem::take(&mut self.asked)
            && let Some(person) = &self.person
        {
            person.let_go();
        }
    }

    fn look_for_findings(&mut self, quiet: bool) {
        for finding in self.scanning.findings(&mut self.seen) {
            let text = finding.to_string();
            if quiet {
                note!("{text}");
            }
            if self.found.len() < KEPT {
                self.found.push(text.clone());
            }
            self.findings.push_back((Instant::now(), text));
        }
        while self
            .findings
            .front()
            .is_some_and(|(at, _)| at.elapsed() > SHOWN)
        {
            self.findings.pop_front();
        }
    }

    fn view(&self, options: &Watch, elapsed: Duration, keys: bool) -> GloveView {
        let bindings = Bindings::load();
        let [calibrate, end] = [bindings.calibrate, bindings.end].map(Bindings::name);
        let snapshot = self.scanning.snapshot();
        let seen = snapshot.as_ref();
        let calibrated = self.hand.is_calibrated();
        let all_good = seen.is_some_and(|seen| seen.good() == SEGMENT_NAMES.len());
        let age = self.newest.elapsed();
        GloveView {
            title: "gauntlet glove watch",
            elapsed,
            total: options.seconds,
            state: self.state(seen, calibrated),
            good: all_good && calibrated,
            // Zeros are no angles: with a profile there are none before the hand has lain flat.
            fingers: (self.pose.as_ref())
                .filter(|pose| calibrated || pose.angles.iter().any(|angle| *angle != 0.0))
                .map(fingers)
                .unwrap_or_default(),
            hand_age: (age >= OLD).then_some(age.as_secs_f32()),
            calibrated,
            headings: headings::of(self.hand.headings()),
            sensors: seen.map(shown).unwrap_or_default(),
            scans_per_s: seen.map_or(0.0, |seen| seen.rate),
            jitter_us: seen.and_then(|seen| seen.jitter_us),
            baud: seen.and_then(|seen| seen.baud),
            faults: self.faults(seen, keys),
            keys: match (keys, &self.unknown) {
                (true, None) => format!("{calibrate}: the hand lies flat   {end}: end"),
                (true, Some(_)) => format!("{end}: end"),
                (false, _) => "Ctrl-C: end".to_owned(),
            },
        }
    }

    fn state(&self, seen: Option<&Snapshot>, calibrated: bool) -> String {
        let state = match seen.map(|seen| seen.state) {
            _ if seen.is_some_and(|seen| !seen.is_plugged) => "unplugged",
            Some(State::Scanning) if calibrated => "scanning",
            Some(State::Scanning) => "not calibrated",
            Some(State::NoAnswer) => "no answer",
            Some(State::Resync) => "resynchronising",
            Some(State::Starting) | None => "starting",
        };
        state.to_owned()
    }

    fn faults(&self, seen: Option<&Snapshot>, keys: bool) -> Vec<String> {
        let mut faults = Vec::new();
        if seen.is_some_and(|seen| !seen.is_plugged) {
            let port = self.scanning.port().path().display();
            faults.push(format!("{port} is unplugged, waiting for it to come back"));
        }
        faults.extend(
            self.unknown
                .as_ref()
                .map(|why| format!("not calibrated: {why}")),
        );
        match self.hand.flat() {
            Flat::Waiting(why) => {
                let why = why.as_deref().unwrap_or("fingers together, for a second");
                faults.push(format!("lay the hand flat and hold it still: {why}"));
            }
            Flat::Refused(why) if !self.hand.is_calibrated() => {
                let again = if keys { "; c tries again" } else { "" };
                faults.push(format!("not calibrated: {why}{again}"));
            }
            _ => {}
        }
        if let Some(seen) = seen {
            faults.extend(words::lost_sensors(&seen.health()));
        }
        let newest = self.findings.iter().rev().map(|(_, text)| text.clone());
        faults.extend(newest.take(3));
        faults
    }
}

/// The fingers of a pose.
fn fingers(pose: &Pose) -> Vec<Finger> {
    let of = |finger: usize| Finger {
        name: words::FINGER_NAMES[finger],
        angles: std::array::from_fn(|joint| pose.angles[5 * finger + joint]),
        limits: std::array::from_fn(|joint| LIMITS[5 * finger + joint]),
        good: pose.held >> (5 * finger) & 0b1_1111 == 0,
    };
    (0..JOINT_COUNT / 5).map(of).collect()
}

fn shown(seen: &Snapshot) -> Vec<Sensor> {
    let of = |(name, sensor): (&'static str, scanning::Sensor)| Sensor {
        name,
        good: sensor.health.is_good(),
        word: word(sensor.health),
        age_us: sensor.age.map(|age| age.as_micros() as u64),
        lost: sensor.lost,
        starts: sensor.starts,
        id: sensor
            .id
            .map_or_else(|| "–".to_owned(), |id| gloves::hex(&id[id.len() - 3..])),
    };
    SEGMENT_NAMES
        .into_iter()
        .zip(seen.sensors)
        .map(of)
        .collect()
}

/// How a sensor is, in a word.
fn word(health: Health) -> &'static str {
    match health {
        Health::Good => "good",
        Health::Starting => "starting",
        Health::Missing(_) => "missing",
        Health::Rejected(imu::Fault::Frozen | imu::Fault::AllFrozen) => "frozen",
        Health::Rejected(imu::Fault::Twin) => "twin",
        Health::Rejected(_) => "refused",
    }
}

impl gloves::Watched {
    /// For a person to read.
    fn lines(&self) -> Vec<String> {
        let scanned = &self.scanned;
        let [median, most, longest] = [
            scanned.interval_p50_us,
            scanned.interval_p99_us,
            scanned.interval_max_us,
        ];
        let mut lines = vec![format!(
            "scans      {} in {:.1} s, {:.1}/s, interval p50 {}, p99 {}, longest {}, jitter {}",
            scanned.scans,
            self.took_s,
            scanned.scans_per_s,
            short_or_dash(median),
            short_or_dash(most),
            short_or_dash(longest),
            short_or_dash(scanned.jitter_us)
        )];
        for sensor in &self.sensors {
            lines.push(format!(
                "  {:<17} channel {} {}  good {:>6}  lost {:>4}  age {:>8}  started {}  id {}  {}",
                sensor.segment,
                sensor.channel,
                sensor.address,
                sensor.good,
                sensor.lost,
                sensor.age_us.map_or_else(|| "–".to_owned(), short),
                sensor.starts,
                sensor.id.as_deref().unwrap_or("–"),
                sensor.state
            ));
        }
        lines.extend(self.found.iter().map(|text| format!("found      {text}")));
        lines
    }
}
