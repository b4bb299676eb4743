//! A run on the page: what is shown in the browser, and what is asked for there.

use std::time::{Duration, Instant};

use host::bridge::clutch::Position;
use host::bridge::{HoldReason, State};
use host::glove::hand::Side;
use host::gripper::kinematics::Model;
use host::gripper::registers::two_finger;

use super::on_page::OnPage;
use super::shown;
use super::{Options, ROUND, Run};
use crate::live::{Bindings, View};
use crate::web::picture::{Action, Axis, Clutch, Gripper, Hand, Headline, Rates, Tone};
use crate::web::{self, Known, Page, Picture, Said, Wish};
use host::session::Snapshot;
use host::session::snapshot::Sensors;

/// Words and rates are made anew this often: looking through latencies takes longer than all the rest.
const SLOWLY: Duration = Duration::from_millis(200);
/// Pause between two rounds while somebody watches: 60 pictures a second.
const PICTURE: Duration = Duration::from_millis(15);
/// The action that takes the flat hand.
const FLAT: &str = "flat";

impl Run {
    /// Shows all of it on `page`, too, and does what is asked for there. `model`: which gripper is drawn, if that is known.
    pub fn shows(&mut self, page: Option<Page>, model: Option<Model>) {
        self.page = page.map(|page| OnPage::new(page, model));
    }

    /// The page's address.
    pub(super) fn page_address(&self) -> Option<&str> {
        self.page.as_ref().map(|shown| shown.page.address())
    }

    /// Whether somebody looks at a page, and can close the clutch there.
    pub(super) fn has_pages(&self) -> bool {
        self.page
            .as_ref()
            .is_some_and(|shown| shown.page.watching() > 0)
    }

    /// Pause between two rounds.
    pub(super) fn pause(&self) -> Duration {
        match self.has_pages() {
            true => PICTURE,
            false => ROUND,
        }
    }

    /// Does what was asked for, and shows what is so. Never waits.
    pub(super) fn look_at_page(&mut self) {
        let Some(mut on_page) = self.page.take() else {
            return;
        };
        let drives = self.course.is_some_and(|(options, _)| options.drives);
        for said in on_page.page.said() {
            on_page.look(&said);
            self.obey_page(&said, drives);
        }
        if on_page.page.is_due() {
            let picture = self.picture(&mut on_page, drives);
            on_page.page.show(|| picture);
        }
        self.page = Some(on_page);
    }

    fn obey_page(&mut self, said: &Said, drives: bool) {
        match &said.wish {
            // Opening is obeyed from anybody, always.
            Wish::Open => self.clutch.release(self.session.orders()),
            Wish::Gone => self.clutch.gone(self.session.orders(), said.page),
            _ if !drives || !said.is_young() => {}
            Wish::Close => self.clutch.hold(&*self.session, said.page),
            Wish::Beat => self.clutch.beat(&*self.session, said.page),
            Wish::Do(what) if what == FLAT => self.ask_flat(),
            Wish::Do(_) => {}
        }
    }

    fn picture(&mut self, on_page: &mut OnPage, drives: bool) -> Picture {
        let now = Instant::now();
        let snapshot = self.session.snapshot();
        let course = self.course;
        let fresh = |(made, _): &(Instant, View)| now.duration_since(*made) < SLOWLY;
        let (_, slow) = match on_page.slow.take().filter(fresh) {
            Some(slow) => on_page.slow.insert(slow),
            None => {
                let options = course.map_or(Options::WATCH, |(options, _)| options);
                let elapsed = course.map_or(Duration::ZERO, |(_, started)| started.elapsed());
                on_page
                    .slow
                    .insert((now, self.view(&options, elapsed, drives)))
            }
        };
        let mut picture = Picture {
            title: slow.title.clone(),
            elapsed_s: course.map_or(0.0, |(_, started)| started.elapsed().as_secs_f64()),
            total_s: slow.total.map(|total| total.as_secs_f64()),
            state: Headline {
                words: "starting".to_owned(),
                tone: Tone::Wait,
            },
            rates: Some(Rates {
                frames_per_s: slow.frames_per_s,
                cycles_per_s: Some(slow.cycles_per_s),
                latency_p50_us: slow.latency_p50,
                latency_p99_us: slow.latency_p99,
                dropped: slow.dropped,
            }),
            faults: slow.faults.clone(),
            ..Picture::default()
        };
        picture.faults.extend(on_page.behind_words(now));
        if let Some(snapshot) = &snapshot {
            picture.state = headline(snapshot);
            picture.clutch = Some(Clutch {
                position: position(snapshot.clutch),
                page: self.clutch.page(),
                terminal: self.clutch.is_kept_here(),
                may_close: drives,
            });
            picture.hand = Some(hand(snapshot, self.side));
            picture.gripper = Some(self.gripper(snapshot, on_page.model, now));
        }
        if drives {
            picture.actions.push(Action {
                name: FLAT,
                key: "c",
                words: format!("flat hand ({})", Bindings::name(b'c')),
            });
        }
        picture
    }

    fn gripper(&self, snapshot: &Snapshot, model: Option<Model>, now: Instant) -> Gripper {
        let axes = self.shown.axes(snapshot, now);
        let model = model.unwrap_or(match axes.len() {
            1 => Model::TwoFinger(two_finger::Model::TwoFinger85),
            _ => Model::ThreeFinger,
        });
        let reached = snapshot.status.as_ref().map(|status| &*status.position);
        let asked = snapshot.command.as_deref();
        let links = |counts: Option<&[u8]>| counts.map(|counts| web::gripper(model, counts));
        Gripper {
            reached: links(reached).unwrap_or_default(),
            asked: links(asked).unwrap_or_default(),
            axes: axes
                .into_iter()
                .map(|axis| Axis {
                    name: axis.name,
                    asked: axis.asked,
                    reached: axis.reached,
                    word: axis.word,
                })
                .collect(),
            age_s: shown::gripper_age(snapshot),
            is_imagined: false,
        }
    }
}

impl Options {
    /// Before anything is driven.
    const WATCH: Self = Self {
        title: "gauntlet",
        seconds: None,
        engage: false,
        drives: false,
        quiet: true,
    };
}

fn position(clutch: Position) -> &'static str {
    match clutch {
        Position::Open => "open",
        Position::Closed => "closed",
        Position::Lost => "lost",
        Position::Expired => "expired",
    }
}

fn headline(snapshot: &Snapshot) -> Headline {
    let (words, tone) = match snapshot.state {
        State::Idle | State::Holding(HoldReason::NotCalibrated) if snapshot.lacks_calibration() => {
            ("not calibrated".to_owned(), Tone::Wait)
        }
        State::Following | State::Blending => (snapshot.state.name().to_owned(), Tone::Good),
        State::Idle => (snapshot.state.name().to_owned(), Tone::Calm),
        State::Holding(reason) | State::SafeAction(reason) => {
            (format!("held: {reason}"), Tone::Wait)
        }
        State::Faulted(_) => (snapshot.state.to_string(), Tone::Bad),
    };
    Headline { words, tone }
}

/// The hand and its sensors.
fn hand(snapshot: &Snapshot, side: Side) -> Hand {
    let headings = snapshot.headings.as_ref();
    let known = |segment: usize| {
        let has = |mask: u16| mask >> segment & 1 == 1;
        let unused = match headings {
            _ if has(snapshot.distrusted) => Some("not used until a flat pose"),
            _ if has(snapshot.impossible) => Some("turned farther than a hand can be"),
            Some(headings) if has(headings.unknown) => Some("no heading yet: lay the hand flat"),
            Some(headings) if has(headings.degraded) => Some("heading not sure: its joint is held"),
            _ => None,
        };
        let health = |sensors: Sensors| sensors.health.get(segment).copied();
        Known {
            health: snapshot.sensors.and_then(health),
            unused,
            sigma: headings.and_then(|headings| headings.sigma.get(segment).copied()),
        }
    };
    Hand {
        age_s: shown::glove_age(snapshot),
        ..web::drawn_hand(&snapshot.angles, side, !snapshot.lacks_calibration(), known)
    }
}
