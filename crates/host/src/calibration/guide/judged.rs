//! What a session came to: what speaks against it and what to do about each thing, a verdict for every joint with each check's
//! threshold, and whether it may be used.

use glove::calibration::{Bound, Checks, Doubt, Identity, Outcome, Step, Verdict, checks};
use glove::hand::{SEGMENT_COUNT, SEGMENT_NAMES, Side};
use glove::imu::UniqueId;
use serde::Serialize;

use super::super::profile_file::{Kept, MadeBy, Quality};
use super::super::report::word;

/// The outcome of a session, judged.
#[derive(Debug, Clone, PartialEq)]
pub struct Judged {
    /// What the session gave.
    pub outcome: Outcome,
    /// Which hand the person said it is.
    pub declared: Option<Side>,
}

/// Something that was found, and what to do about it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// `doubtful` or `bad`.
    pub verdict: &'static str,
    /// The segment it is about; `None`: the whole glove.
    pub segment: Option<&'static str>,
    /// What it is, with its value.
    pub what: String,
    /// What to do, in words.
    pub todo: String,
}

/// One check of one joint.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// `fit_deg`, `ratio`, `moved`, `lean_deg`, `tilt_deg`, `heading_deg` or `straight_deg`.
    pub check: &'static str,
    /// What was measured.
    pub value: f64,
    /// How far it may go; `moved` must reach it.
    pub limit: f64,
    /// Whether it holds.
    pub holds: bool,
}

/// A joint between a segment and its parent.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Joint {
    /// The segment that it leads to.
    pub segment: &'static str,
    /// The sensor on that, as it is wired.
    pub sensor: u8,
    /// `good`, `doubtful` or `bad`.
    pub verdict: &'static str,
    /// Every check that is about this segment.
    pub checks: Vec<Check>,
}

/// From which step on it should be done again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Again {
    /// All of it.
    All,
    /// From the turn on.
    Turn,
    /// The fingers one by one.
    Alone,
    /// The fists.
    Fists,
    /// The thumb.
    Thumb,
    /// The last flat pose.
    LastFlat,
}

impl Again {
    /// In words, as the object of "repeats".
    pub fn words(self) -> &'static str {
        match self {
            Self::All => "the whole session",
            Self::Turn => "it from the turn on",
            Self::Alone => "the fingers one by one",
            Self::Fists => "the fists",
            Self::Thumb => "the thumb's step",
            Self::LastFlat => "the last flat pose",
        }
    }
}

/// What is to be done about a doubt, in words, and what can be done again.
pub fn todo(doubt: &Doubt) -> (String, Option<Again>) {
    let thumb = |segment: u8| (1..4).contains(&segment);
    let (words, again) = match *doubt {
        Doubt::Restarted { spoils: true, .. } => (
            "its plug and cable looked at, then the whole session again",
            Some(Again::All),
        ),
        Doubt::Restarted { .. } => (
            "its plug and cable looked at; a flat pose before each use makes its heading sure",
            None,
        ),
        Doubt::Unclear { .. } => (
            "the fingers again, one by one, each bent from base to tip with the others still",
            Some(Again::Alone),
        ),
        Doubt::Elsewhere { .. } => (
            "the profile taken with the sensors as they sit, or put back where they are wired and the whole session again",
            None,
        ),
        Doubt::NotTurned { .. } => (
            "the turn again, farther: thumb up, palm up, fingers up, fingers down",
            Some(Again::Turn),
        ),
        Doubt::NotStill { .. } => (
            "the turn again, slower, all fingers kept as they lay on the table",
            Some(Again::Turn),
        ),
        Doubt::Side { .. } => (
            "the turn again: the thumb must point up in it, the little finger never",
            Some(Again::Turn),
        ),
        Doubt::NotBent { segment } if thumb(segment) => (
            "the thumb's step again, with its tip bent, too",
            Some(Again::Thumb),
        ),
        Doubt::NotBent { .. } => (
            "the fists again, closed to the fingertips",
            Some(Again::Fists),
        ),
        Doubt::Leans { .. } => (
            "a look at whether its sensor is on the right finger and sits firmly; the fingers again, one by one",
            Some(Again::Alone),
        ),
        Doubt::Tilted { .. } | Doubt::NotFlat { .. } => (
            "the last flat pose again, every finger straight on the table; if it stays: the sensor sewn or pressed on firmly, then the whole session again",
            Some(Again::LastFlat),
        ),
        Doubt::Turned { .. } => (
            "the last flat pose again, the fingers together; if it stays: the sensor sewn or pressed on firmly, then the whole session again",
            Some(Again::LastFlat),
        ),
    };
    (words.to_owned(), again)
}

impl Judged {
    fn checks(&self) -> &Checks {
        &self.outcome.checks
    }

    /// Whether the person named another hand than the session shows. Not where it shows none.
    pub fn is_other_hand(&self) -> bool {
        let shown = self.checks().x_up.abs() >= checks::UP;
        shown
            && self
                .declared
                .is_some_and(|said| said != self.outcome.profile.side)
    }

    /// The same of the hand that the session shows, where nothing else is bad of it but that another one was said.
    pub fn of_the_hand_shown(&self) -> Option<Self> {
        let shown = Self {
            declared: None,
            ..self.clone()
        };
        (self.is_other_hand() && shown.verdict() != Verdict::Bad).then_some(shown)
    }

    /// Everything that speaks against it, worst first.
    pub fn findings(&self) -> Vec<Finding> {
        let mut found: Vec<(Verdict, Finding)> = Vec::new();
        if self.is_other_hand() {
            let (is, said) = match self.outcome.profile.side {
                Side::Left => ("left", "right"),
                Side::Right => ("right", "left"),
            };
            found.push((
                Verdict::Bad,
                Finding {
                    verdict: word(Verdict::Bad),
                    segment: None,
                    what: format!("the glove is on a {is} hand, and {said} was said"),
                    todo: format!("--hand {is}, or hand = \"{is}\" below [glove] in the settings"),
                },
            ));
        }
        let slipped = self.checks().slipped();
        for doubt in self.checks().doubts() {
            let segment = doubt.segment();
            // Of a sensor that slipped its neighbours' joints show it, too: it is told once, at the one that did.
            let slips = matches!(
                doubt,
                Doubt::Tilted { .. } | Doubt::Turned { .. } | Doubt::NotFlat { .. }
            );
            if slips && slipped.is_some() && slipped != segment {
                continue;
            }
            found.push((
                doubt.verdict(),
                Finding {
                    verdict: word(doubt.verdict()),
                    segment: segment.and_then(|k| SEGMENT_NAMES.get(k).copied()),
                    what: doubt.to_string(),
                    todo: todo(&doubt).0,
                },
            ));
        }
        found.sort_by_key(|(verdict, _)| std::cmp::Reverse(*verdict));
        found.into_iter().map(|(_, finding)| finding).collect()
    }

    /// The verdict on all of it.
    pub fn verdict(&self) -> Verdict {
        let other = if self.is_other_hand() {
            Verdict::Bad
        } else {
            Verdict::Good
        };
        self.checks().overall().max(other)
    }

    /// Whether sensors sit elsewhere than they are wired, which a person should agree to.
    pub fn is_swapped(&self) -> bool {
        matches!(self.checks().identity, Identity::Moved(_))
    }

    /// What should be done again, if something should: the earliest step that what is bad asks for, else what is doubtful.
    pub fn again(&self) -> Option<Again> {
        let of = |verdict: Verdict| {
            let doubts = self
                .checks()
                .doubts()
                .filter(|doubt| doubt.verdict() == verdict);
            doubts.filter_map(|doubt| todo(&doubt).1).min()
        };
        let again = of(Verdict::Bad).or_else(|| of(Verdict::Doubtful));
        match again {
            // A sensor that started anew is left out of the bending, until a turn shows its heading.
            Some(Again::Alone | Again::Fists | Again::Thumb) if self.checks().restarted != 0 => {
                Some(Again::Turn)
            }
            again => again,
        }
    }

    /// Every joint with its checks.
    pub fn joints(&self) -> Vec<Joint> {
        (1..SEGMENT_COUNT).map(|k| self.joint(k)).collect()
    }

    fn joint(&self, k: usize) -> Joint {
        let checks = self.checks();
        let mut all = Vec::new();
        let mut below = |check, value: f32, limit: f32| {
            all.push(Check {
                check,
                value: rounded(value),
                limit: rounded(limit),
                holds: value.abs() <= limit,
            });
        };
        let degrees = |value: f32| value.to_degrees();
        below("fit_deg", degrees(checks.fit[k]), degrees(checks::FIT));
        below("ratio", checks.ratio[k], checks::RATIO_DOUBTFUL);
        below(
            "tilt_deg",
            degrees(checks.tilt[k]),
            degrees(checks::tilt_limit(k)),
        );
        below(
            "heading_deg",
            degrees(checks.innovation[k]),
            degrees(checks::innovation_limit(k)),
        );
        if k > 3 {
            below("lean_deg", degrees(checks.lean[k]), degrees(checks::LEAN));
            below(
                "straight_deg",
                degrees(checks.flat_angle[k]),
                degrees(checks::FLAT_ANGLE),
            );
        }
        if k % 3 != 1 {
            let value = checks.motion[k];
            all.push(Check {
                check: "moved",
                value: rounded(value),
                limit: f64::from(MOVED),
                holds: value >= MOVED,
            });
        }
        Joint {
            segment: SEGMENT_NAMES[k],
            sensor: self.outcome.profile.sensors[k],
            verdict: word(checks.verdict(k)),
            checks: all,
        }
    }

    /// What of it is worth keeping beside the numbers.
    pub fn quality(&self) -> Quality {
        let most = |values: &[f32; SEGMENT_COUNT]| {
            let most = values
                .iter()
                .fold(0f32, |most, value| most.max(value.abs()));
            rounded(most.to_degrees())
        };
        let checks = self.checks();
        Quality {
            verdict: word(self.verdict()).to_owned(),
            fit_deg: most(&checks.fit),
            ratio: rounded(checks.ratio.iter().copied().fold(0.0, f32::max)),
            tilt_deg: most(&checks.tilt),
            heading_deg: most(&checks.innovation),
            findings: self
                .findings()
                .into_iter()
                .map(|finding| finding.what)
                .collect(),
        }
    }

    /// The profile to keep, of a glove with these ids.
    pub fn kept(&self, ids: [UniqueId; SEGMENT_COUNT], calibrated: String) -> Kept {
        Kept {
            bound: Bound {
                profile: self.outcome.profile,
                ids,
            },
            calibrated,
            quality: self.quality(),
            made_by: MadeBy::Calibrate,
        }
    }
}

/// A hinge that moved less was not seen moving: mean squared sine of half its angle.
const MOVED: f32 = 0.01;

/// To a thousandth.
fn rounded(value: f32) -> f64 {
    (f64::from(value) * 1e3).round() / 1e3
}

/// The places in the plan that are done again.
pub(super) fn places(again: Again) -> std::ops::Range<usize> {
    use super::plan::{ALONE, PARTS, place};
    let one = |step: Step| place(step)..place(step) + 1;
    match again {
        Again::All => 0..PARTS,
        Again::Turn => place(Step::Turn)..PARTS,
        Again::Alone => ALONE,
        Again::Fists => one(Step::Fists),
        Again::Thumb => one(Step::Thumb),
        Again::LastFlat => one(Step::LastFlat),
    }
}
