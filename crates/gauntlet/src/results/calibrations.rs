//! Results of `calibrate`.

use std::path::Path;

use host::calibration::Judged;
use host::calibration::guide::{Finding, Joint};
use host::calibration::profile_file::{Quality, id_text};
use host::calibration::profile_store::Entry;
use host::failure::Told;
use host::glove::calibration::Identity;
use host::glove::hand::{SEGMENT_NAMES, Side};
use host::next::NextStep;
use serde::Serialize;

use super::gloves::Scanned;

/// `calibrate`.
#[derive(Debug, Serialize)]
pub struct Calibrated {
    /// The glove's port.
    pub place: String,
    /// The file that was written; `null` where nothing was kept.
    pub profile: Option<String>,
    /// `right` or `left`; `null` where it does not show, or it came to nothing.
    pub hand: Option<&'static str>,
    /// Which hand it was said to be; `null` where nothing was said.
    pub declared: Option<&'static str>,
    /// Which sensor sits where: `as_wired`, `moved`, `unclear`, `not_seen`; `null` where it came to nothing.
    pub sensors: Option<&'static str>,
    /// Sensors that sit elsewhere than they are wired.
    pub moved: Vec<Seat>,
    /// How good it came out; `null` where it came to nothing.
    pub quality: Option<Quality>,
    /// What speaks against it, the worst first.
    pub findings: Vec<Finding>,
    /// Every joint with each check and its threshold.
    pub joints: Vec<Joint>,
    /// Steps that were asked for again.
    pub again: Vec<Repeated>,
    /// How long the session took, s.
    pub took_s: f64,
    /// How often the glove was read.
    #[serde(flatten)]
    pub scanned: Scanned,
    /// What one does with a calibrated glove; where it failed it is the failure that says what is next.
    #[serde(flatten)]
    pub next: NextStep,
    /// Why it failed; `null` where it did not.
    pub failure: Option<Told>,
}

/// A sensor that sits elsewhere than it is wired.
#[derive(Debug, Serialize)]
pub struct Seat {
    /// Where it sits.
    pub segment: &'static str,
    /// Its number as it is wired.
    pub sensor: u8,
}

/// A step that was asked for again.
#[derive(Debug, Clone, Serialize)]
pub struct Repeated {
    /// Its name.
    pub step: &'static str,
    /// Why, in words.
    pub why: String,
}

/// A hand by its name.
pub fn hand(side: Side) -> &'static str {
    match side {
        Side::Right => "right",
        Side::Left => "left",
    }
}

impl Calibrated {
    /// Of a session.
    #[expect(clippy::too_many_arguments, reason = "each is one field of the result")]
    pub fn of(
        place: String,
        judged: Option<&Judged>,
        profile: Option<&Path>,
        again: Vec<Repeated>,
        took_s: f64,
        scanned: Scanned,
        next: NextStep,
        failure: Option<Told>,
    ) -> Self {
        let identity = judged.map(|judged| judged.outcome.checks.identity);
        let moved = match identity {
            Some(Identity::Moved(seats)) => (0..)
                .zip(seats)
                .filter(|(segment, sensor)| *segment != usize::from(*sensor))
                .map(|(segment, sensor)| Seat {
                    segment: SEGMENT_NAMES[segment],
                    sensor,
                })
                .collect(),
            _ => Vec::new(),
        };
        Self {
            place,
            profile: profile.map(|path| path.display().to_string()),
            hand: judged.map(|judged| hand(judged.outcome.profile.side)),
            declared: judged.and_then(|judged| judged.declared).map(hand),
            sensors: identity.map(|identity| match identity {
                Identity::AsWired => "as_wired",
                Identity::Moved(_) => "moved",
                Identity::Unclear(_) => "unclear",
                Identity::NotSeen => "not_seen",
            }),
            moved,
            quality: judged.map(Judged::quality),
            findings: judged.map(Judged::findings).unwrap_or_default(),
            joints: judged.map(Judged::joints).unwrap_or_default(),
            again,
            took_s,
            scanned,
            next: (failure.as_ref()).map_or(next, |failure| failure.next.clone()),
            failure,
        }
    }
}

/// `calibrate --flat`.
#[derive(Debug, Serialize)]
pub struct FlatPose {
    /// The glove's port.
    pub place: String,
    /// The profile's file.
    pub profile: String,
    /// When it was made, RFC 3339; `null` where a bridge on a chip keeps it, which does not know.
    pub calibrated: Option<String>,
    /// Sensors that lie otherwise than they were calibrated.
    pub findings: Vec<Finding>,
    /// Why it failed; `null` where it did not.
    pub failure: Option<Told>,
}

/// `calibrate --list`.
#[derive(Debug, Serialize)]
pub struct List {
    /// Where profiles lie.
    pub folder: String,
    /// Each of them.
    pub profiles: Vec<Listed>,
}

/// A profile that is there.
#[derive(Debug, Serialize)]
pub struct Listed {
    /// Its file.
    pub profile: String,
    /// When it was made, RFC 3339; `null` where it cannot be read, as all below.
    pub calibrated: Option<String>,
    /// `right` or `left`.
    pub hand: Option<&'static str>,
    /// How good it came out.
    pub quality: Option<Quality>,
    /// The sensors' unique ids, hexadecimal, as they are wired.
    pub ids: Option<Vec<String>>,
    /// Why it is not used; `null` where it can be.
    pub refused: Option<String>,
}

impl Listed {
    /// Of an entry of the store.
    pub fn of((path, kept): &Entry) -> Self {
        let good = kept.as_ref().ok();
        Self {
            profile: path.display().to_string(),
            calibrated: good.map(|kept| kept.calibrated.clone()),
            hand: good.map(|kept| hand(kept.bound.profile.side)),
            quality: good.map(|kept| kept.quality.clone()),
            ids: good.map(|kept| kept.bound.ids.iter().map(id_text).collect()),
            refused: kept.as_ref().err().map(ToString::to_string),
        }
    }
}
