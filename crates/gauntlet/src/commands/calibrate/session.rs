//! The session: scans in, words and pictures out, keys heard.

use std::time::{Duration, Instant};

use anyhow::Result;
use host::glove::calibration::{Unfinished, Verdict};
use host::glove::hand::Side;

use super::source::Source;
use crate::live::guided::GuideView;
use crate::live::{Key, Live};
use crate::out;
use crate::results::calibrations::Repeated;
use crate::results::gloves;
use crate::tell::Tell;
use crate::wearer::Listener;
use crate::web::Page;
use host::calibration::guide::{News, PARTS, Remark, Stage, plan};
use host::calibration::{Guide, Judged};
use host::chip::link::{Error, HostLink};
use host::failure::OrFail;
use host::interrupt::Interrupt;

/// Pause between two looks.
const ROUND: Duration = Duration::from_millis(20);
/// The same remark is said again after so long.
const SAID_EVERY: Duration = Duration::from_secs(3);

/// How it ended.
pub(in crate::commands) enum Led {
    /// With a verdict; `agreed`: the person saw it and wants it kept.
    Judged { judged: Box<Judged>, agreed: bool },
    /// Without an outcome.
    Unfinished(Unfinished),
    /// By the person.
    Stopped,
}

/// What is left of it.
pub(in crate::commands) struct Done {
    pub judged: Option<Judged>,
    /// Steps that were asked for again, and why.
    pub again: Vec<Repeated>,
    pub took_s: f64,
    pub scanned: gloves::Scanned,
    /// The line to the chip, where the glove is a chip's.
    pub link: Option<Result<HostLink, Error>>,
}

/// How it is led.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::commands) struct Leading {
    /// Which hand the person says it is.
    pub declared: Option<Side>,
    /// What is bad may be kept.
    pub keep_anyway: bool,
    /// It begins and ends by itself: nobody but a virtual person takes part.
    pub by_itself: bool,
    /// A program reads the result.
    pub json: bool,
}

/// A session under way.
pub(in crate::commands) struct Session {
    source: Source,
    guide: Guide,
    person: Option<Listener>,
    keep_anyway: bool,
    by_itself: bool,
    json: bool,
    again: Vec<Repeated>,
    started: Instant,
    said: Option<(String, Instant)>,
    pub(super) page: Option<Page>,
}

impl Session {
    pub fn new(source: Source, leading: Leading, person: Option<Listener>) -> Self {
        Self {
            source,
            guide: Guide::new(leading.declared),
            person,
            keep_anyway: leading.keep_anyway,
            by_itself: leading.by_itself,
            json: leading.json,
            again: Vec::new(),
            started: Instant::now(),
            said: None,
            page: None,
        }
    }

    /// Shows all of it on `page`, too, whose buttons are keys.
    pub fn shows(&mut self, page: Option<Page>) {
        self.page = page;
    }

    /// Leads the person through it.
    ///
    /// # Errors
    /// The terminal, or the reading of the glove, failed.
    pub fn lead(&mut self, tell: &Tell, interrupt: &Interrupt) -> Result<Led> {
        if self.person.is_some() {
            tell.say(format_args!(
                "person   a virtual one, who does what is asked"
            ));
        }
        self.source.begin()?;
        let terminal = || "the terminal does not work".to_owned();
        let next = "the same with | cat behind it, which prints lines instead";
        // Without a terminal there are lines, but not those of a view.
        let drawn = !self.json && is_terminal();
        let mut live = Live::start(!drawn).or_fail(terminal, next)?;
        if !drawn {
            let lasts = Guide::lasts().as_ticks() / 1_000_000;
            tell.say(format_args!(
                "session  {PARTS} steps, {lasts} s; Ctrl-C ends it"
            ));
        }
        if !drawn || self.by_itself {
            self.guide.go_on(self.source.now());
        }
        loop {
            self.round(tell, drawn)?;
            if interrupt.asked() || (!self.json && out::reader_left()?) {
                return Ok(Led::Stopped);
            }
            let mut keys = live.keys().or_fail(terminal, next)?;
            keys.extend(self.look_at_page());
            for key in keys {
                match key {
                    Key::End => return Ok(Led::Stopped),
                    Key::Clutch | Key::Open if self.is_over() => {
                        if let Some(led) = self.agreed() {
                            return Ok(led);
                        }
                    }
                    Key::Clutch | Key::Open => self.guide.go_on(self.source.now()),
                    Key::Again => self.guide.again(self.source.now()),
                    Key::Calibrate | Key::Undo => {}
                }
            }
            if self.is_over() && (!drawn || self.by_itself) {
                return Ok(self.over(false));
            }
            if drawn {
                live.show(|| self.view()).or_fail(terminal, next)?;
            }
        }
    }

    pub(super) fn is_over(&self) -> bool {
        self.guide.ended().is_some()
    }

    fn over(&self, agreed: bool) -> Led {
        match self.guide.ended() {
            Some(Ok(judged)) => Led::Judged {
                judged: Box::new(judged.clone()),
                agreed,
            },
            Some(Err(unfinished)) => Led::Unfinished(*unfinished),
            None => Led::Stopped,
        }
    }

    /// The person wants to keep what it came to, of the hand that it shows; `None` where it cannot be kept.
    fn agreed(&self) -> Option<Led> {
        let Some(Ok(judged)) = self.guide.ended() else {
            return Some(self.over(true));
        };
        match judged.of_the_hand_shown() {
            Some(judged) => Some(Led::Judged {
                judged: Box::new(judged),
                agreed: true,
            }),
            None if judged.verdict() == Verdict::Bad && !self.keep_anyway => None,
            None => Some(self.over(true)),
        }
    }

    /// Takes what came, and says what happened.
    fn round(&mut self, tell: &Tell, drawn: bool) -> Result<()> {
        let mut scanned = self.source.next(ROUND)?;
        while let Some(scan) = scanned {
            self.guide.take(&scan.frame, &scan.starts);
            scanned = self.source.next(Duration::ZERO)?;
        }
        self.guide.pass(self.source.now());
        while let Some(news) = self.guide.next_news() {
            self.hear(news, tell, drawn);
        }
        if !drawn {
            self.say_remarks(tell);
        }
        Ok(())
    }

    fn hear(&mut self, news: News, tell: &Tell, drawn: bool) {
        match news {
            News::Asked(step) => {
                if let Some(person) = &self.person {
                    person.ask(step);
                }
                if !drawn {
                    let number = plan::place(step) + 1;
                    tell.say(format_args!(
                        "{number:>2} of {PARTS}   {}",
                        plan::words(step)
                    ));
                }
            }
            News::Again(step, why) => {
                self.again.push(Repeated {
                    step: plan::name(step),
                    why: why.to_string(),
                });
                if !drawn {
                    tell.say(format_args!("           again in 3 s: {why}"));
                }
            }
            News::Note(remark) => {
                if !drawn {
                    tell.say(format_args!("           {remark}"));
                }
            }
            News::Over => {
                if let Some(person) = &self.person {
                    person.let_go();
                }
            }
        }
    }

    fn say_remarks(&mut self, tell: &Tell) {
        let ask = self.guide.ask(self.source.now());
        // While a step waits to be done again its reason was said.
        if !matches!(ask.stage, Stage::Doing(_)) {
            return;
        }
        let seen = ask.remarks.iter().rfind(|remark| !remark.is_good());
        // What was wrong the time before was said then.
        let Some(remark) = seen.filter(|remark| !matches!(remark, Remark::Found(_))) else {
            return;
        };
        // Numbers change all the time.
        let text = remark.to_string();
        let kind: String = text.chars().filter(|c| !c.is_ascii_digit()).collect();
        let old = |(said, at): &(String, Instant)| *said == kind && at.elapsed() < SAID_EVERY;
        if !self.said.as_ref().is_some_and(old) {
            tell.say(format_args!("           {text}"));
            self.said = Some((kind, Instant::now()));
        }
    }

    pub(super) fn view(&self) -> GuideView {
        let (end, good, mut keys) = self.end();
        if let Some(page) = &self.page {
            keys = format!("{keys}   page: {}", page.address());
        }
        GuideView {
            elapsed: self.started.elapsed(),
            ask: self.guide.ask(self.source.now()),
            glove: self.source.line(),
            end,
            good,
            keep: self.keeping(),
            keys,
        }
    }

    /// What keeps it is called, once it can be kept.
    fn keeping(&self) -> Option<String> {
        let judged = self.guide.ended()?.as_ref().ok()?;
        let shown = judged.of_the_hand_shown();
        if judged.verdict() == Verdict::Bad && !self.keep_anyway && shown.is_none() {
            return None;
        }
        let hand = match (shown, judged.outcome.profile.side) {
            (None, _) => "",
            (Some(_), Side::Left) => " as a left hand's",
            (Some(_), Side::Right) => " as a right hand's",
        };
        let seats = match judged.is_swapped() {
            true => ", the sensors as they sit",
            false => "",
        };
        Some(format!("keep it{hand}{seats}"))
    }

    /// What it came to, whether that is good, and what keys do.
    fn end(&self) -> (Vec<String>, bool, String) {
        let Some(ended) = self.guide.ended() else {
            let keys = "space: begin, or do not wait   r: this step again   q: end";
            return (Vec::new(), false, keys.to_owned());
        };
        let judged = match ended {
            Ok(judged) => judged,
            Err(unfinished) => {
                let lines = vec![format!("it came to nothing: {unfinished}")];
                return (lines, false, "r: all of it again   q: end".to_owned());
            }
        };
        let mut keys: Vec<String> = Vec::new();
        keys.extend(self.keeping().map(|keeps| format!("space: {keeps}")));
        let again = judged
            .again()
            .map_or("the last flat pose", |again| again.words());
        keys.push(format!("r: {again} again"));
        keys.push("q: end without keeping it".to_owned());
        let good = judged.verdict() != Verdict::Bad;
        (super::verdict::lines(judged), good, keys.join("   "))
    }

    /// Ends the reading.
    pub fn finish(self) -> Done {
        Done {
            judged: self.guide.ended().and_then(|ended| ended.clone().ok()),
            again: self.again,
            took_s: self.started.elapsed().as_secs_f64(),
            scanned: self.source.scanned(),
            link: self.source.end(),
        }
    }
}

fn is_terminal() -> bool {
    use std::io::IsTerminal;
    std::io::stdin().is_terminal() && std::io::stdout().is_terminal()
}
