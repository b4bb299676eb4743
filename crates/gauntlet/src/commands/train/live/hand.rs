//! The hand in the glove: opened, laid flat, moved freely.

use std::path::Path;
use std::sync::mpsc::{SyncSender, TrySendError};
use std::time::{Duration, Instant};

use anyhow::Result;
use host::glove::calibration::Step;
use host::glove::hand::{JOINT_COUNT, Side};

use super::paged::OnPage;
use crate::commands::calibrate::source::{Place, Source};
use crate::commands::teleop::Hand as WhichHand;
use crate::commands::train::args::Train;
use crate::line_log::LineLog;
use crate::live::teach::{Doing, TeachView};
use crate::live::{Key, Live};
use crate::out;
use crate::run::{ASK_FLAT, FLAT_WAIT};
use crate::tell::Tell;
use crate::web::picture::Rates;
use crate::web::{self, Known, Picture};
use host::calibration::virtual_person::VirtualPerson;
use host::calibration::{may_be_ideal, profile_of};
use host::clock::{QuietTime, ticks};
use host::failure::{Failure, OrFail};
use host::interrupt::Interrupt;
use host::next::{Command, NextStep};
use host::recording::poses::Row;
use host::scanning::{Flat, Hand, Pose};
use host::teaching::Free;
use host::training::recorded::names;

/// Pause between two looks.
pub(super) const ROUND: Duration = Duration::from_millis(20);
/// A glove that is silent for so long ends the session.
const SILENT: Duration = Duration::from_secs(10);
/// What stands in the way of a flat hand is said at most so often.
const SAID_EVERY: Duration = Duration::from_secs(3);

/// A glove that is worn.
pub(super) struct Worn<'a> {
    place: &'a Place<'a>,
    source: Source,
    hand: Hand,
    side: Side,
    on_page: OnPage,
    pub person: Option<VirtualPerson>,
    /// The newest whole pose.
    pub angles: [f32; JOINT_COUNT],
    quiet_time: QuietTime,
    pub started: Instant,
}

impl<'a> Worn<'a> {
    /// Opens the glove and has the hand laid flat.
    pub fn open(
        place: &'a Place<'a>,
        options: &Train,
        on_page: OnPage,
        (tell, interrupt): (&Tell, &Interrupt),
    ) -> Result<Self> {
        let (mut source, missing) = place.open(tell, &mut LineLog::default(), interrupt)?;
        if missing > 0 {
            let what = format!(
                "the glove on {} lacks sensors, and a pose needs every joint",
                place.name()
            );
            return Err(Failure::new(what, place.doctor()).into());
        }
        let (hand, side) = known(place, &mut source, options)?;
        let mut worn = Self {
            place,
            source,
            hand,
            side,
            on_page,
            person: place.person(),
            angles: [0.0; JOINT_COUNT],
            quiet_time: QuietTime::begin(),
            started: Instant::now(),
        };
        worn.lies_flat(tell, interrupt)?;
        Ok(worn)
    }

    /// The time on the clock of the scans.
    pub fn now(&self) -> host::glove::Instant {
        self.source.now()
    }

    /// How the glove is read, in a line.
    pub fn line(&self) -> String {
        self.source.line()
    }

    /// The hand, its sensors and how it is read, for the page.
    pub fn picture(&self) -> Picture {
        let health = self.source.health();
        let sigma = self.hand.headings().map(|known| known.sigma);
        let calibrated = self.hand.is_calibrated();
        let known = |segment: usize| Known {
            health: health[segment],
            unused: None,
            sigma: sigma.map(|sigma| sigma[segment]),
        };
        let (frames_per_s, dropped) = self.source.rates();
        Picture {
            elapsed_s: self.started.elapsed().as_secs_f64(),
            hand: Some(web::drawn_hand(&self.angles, self.side, calibrated, known)),
            rates: Some(Rates {
                frames_per_s,
                dropped,
                ..Rates::default()
            }),
            ..Picture::default()
        }
    }

    /// The whole poses that came, waited for a moment.
    pub fn poses(&mut self) -> Result<Vec<Pose>> {
        let mut poses = Vec::new();
        let mut scanned = self.source.next(ROUND)?;
        while let Some(scan) = scanned {
            self.quiet_time.end();
            let pose = self.hand.take(&scan);
            if pose.is_whole() {
                self.angles = pose.angles;
                poses.push(pose);
            }
            scanned = self.source.next(Duration::ZERO)?;
        }
        if self.quiet_time.look() >= SILENT {
            let what = format!("the glove on {} no longer sends scans", self.place.name());
            return Err(Failure::new(what, self.place.doctor()).into());
        }
        if !self.hand.is_calibrated() {
            let what = format!(
                "the glove on {} is no longer calibrated: the sensor of the hand, or two others, started anew",
                self.place.name()
            );
            return Err(Failure::new(what, self.place.doctor()).into());
        }
        Ok(poses)
    }

    fn lies_flat(&mut self, tell: &Tell, interrupt: &Interrupt) -> Result<()> {
        tell.say(format_args!("{ASK_FLAT}"));
        self.source.begin()?;
        self.hand.begin_flat(self.source.now(), ticks(FLAT_WAIT));
        if let Some(person) = &self.person {
            person.ask(Step::FirstFlat);
        }
        let mut said = Instant::now();
        loop {
            match self.source.next(ROUND)? {
                Some(scanned) => drop(self.hand.take(&scanned)),
                None => self.hand.pass(self.source.now()),
            }
            let why = match self.hand.flat() {
                Flat::Waiting(why) => why.as_deref(),
                _ => None,
            };
            self.on_page.show_flat(|| self.picture(), ASK_FLAT, why);
            match self.hand.flat() {
                Flat::Taken => break,
                Flat::Refused(why) => {
                    let what = format!("the flat hand was not taken: {why}");
                    return Err(
                        Failure::new(what, "the same again, the hand flat and still").into(),
                    );
                }
                Flat::Waiting(Some(why)) if said.elapsed() >= SAID_EVERY => {
                    said = Instant::now();
                    tell.say(format_args!("flat     not yet: {why}"));
                }
                Flat::Waiting(_) | Flat::None => {}
            }
            if interrupt.asked() {
                return Err(Failure::interrupted("before anything was shown").into());
            }
        }
        tell.say(format_args!("flat     taken"));
        if let Some(person) = &self.person {
            person.let_go();
        }
        self.quiet_time.end();
        Ok(())
    }

    /// A minute of free motion, after `rows` of it that are there already; each row goes to `kept`. Whether it went to its end.
    pub fn moves_freely(
        &mut self,
        rows: Vec<Row>,
        kept: SyncSender<Row>,
        (json, tell): (bool, &Tell),
        interrupt: &Interrupt,
    ) -> Result<bool> {
        let terminal = || "the terminal does not work".to_owned();
        let next = "the same with | cat behind it, which prints lines instead";
        let drawn = !json && out::is_drawn();
        let mut live = Live::start(!drawn).or_fail(terminal, next)?;
        let mut free = Free::going_on(rows, self.now());
        let mut asked = None;
        while !free.is_over() {
            for pose in self.poses()? {
                if let Some(row) = free.take(&pose.angles, pose.at) {
                    // A disk that takes no more asks for the end, and its writer says why.
                    if let Err(TrySendError::Full(_)) = kept.try_send(row) {
                        let what = "the disk does not keep up with the free motion";
                        return Err(Failure::new(what, "--out in another folder").into());
                    }
                }
            }
            free.pass(self.now());
            if interrupt.asked() || (!json && out::reader_left()?) {
                return Ok(false);
            }
            for key in live.keys().or_fail(terminal, next)? {
                match key {
                    Key::End => return Ok(false),
                    Key::Clutch | Key::Open => free.go_on(self.now()),
                    Key::Calibrate | Key::Undo | Key::Again => {}
                }
            }
            let Some(ask) = free.ask(self.now()) else {
                break;
            };
            if self.on_page.free(|| self.picture(), &ask, &seen(&free)) {
                free.go_on(self.now());
            }
            if !drawn && asked.replace(ask.number) != Some(ask.number) {
                tell.say(format_args!(
                    "{:>2} of {}   {}",
                    ask.number, ask.of, ask.ask
                ));
            }
            let view = || TeachView {
                elapsed: self.started.elapsed(),
                doing: Doing::Free(ask),
                words: String::new(),
                gripper: None,
                axes: Vec::new(),
                hand: self.angles,
                said: Some((seen(&free), free.missing().is_empty())),
                glove: self.source.line(),
                keys: "space: the next movement   q: end",
            };
            if drawn {
                live.show(view).or_fail(terminal, next)?;
            }
        }
        Ok(true)
    }
}

fn seen(free: &Free) -> String {
    match free.missing() {
        missing if missing.is_empty() => "every movement seen".to_owned(),
        missing => format!("not yet: {}", names(&missing)),
    }
}

/// How the sensors sit, and on which hand.
fn known(place: &Place<'_>, source: &mut Source, options: &Train) -> Result<(Hand, Side)> {
    let ids = source.ids();
    if options.worn.ideal {
        may_be_ideal(Path::new(&place.name()), &ids)?;
        return Ok((Hand::ideal(side(options)), side(options)));
    }
    let none = |why: String| {
        let what = format!("the glove on {} is not calibrated: {why}", place.name());
        let calibrate = place.command("calibrate").then(", and then the same again");
        // Never for a real glove: its angles would be wrong by tens of degrees.
        let next = match place.person() {
            Some(_) if matches!(place, Place::Port(_)) => calibrate
                .then("; if its sensors sit straight: ")
                .then(NextStep::same(Command::more().word("--ideal"))),
            _ => calibrate,
        };
        Failure::new(what, next)
    };
    if let Source::Chip { scans, address } = source {
        let kept = scans.profile().map_err(|error| error.at(address))?;
        let bound = kept.ok_or_else(|| none("the bridge keeps no profile of it".to_owned()))?;
        bound
            .fits(&ids)
            .map_err(|misfit| none(misfit.to_string()))?;
        return Ok((Hand::with_profile(&bound), bound.profile.side));
    }
    let (_, kept) = profile_of(options.worn.profile.as_deref(), &ids)?.map_err(none)?;
    Ok((Hand::with_profile(&kept.bound), kept.bound.profile.side))
}

/// Which hand wears the glove, where no profile says.
fn side(options: &Train) -> Side {
    match options.worn.hand {
        WhichHand::Right => Side::Right,
        WhichHand::Left => Side::Left,
    }
}
