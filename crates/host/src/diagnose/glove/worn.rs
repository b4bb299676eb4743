//! The glove's profile, and how sure the headings of its joints are where a hand lies flat in it.

use std::path::Path;
use std::time::Duration;

use glove::hand::{SEGMENT_COUNT, SEGMENT_NAMES};
use glove::imu::UniqueId;

use crate::calibration::profile_of;
use crate::clock::ticks;
use crate::diagnose::Findings;
use crate::next::{Command, advice};
use crate::scanning::{Flat, Hand, Scanned};
use crate::session::snapshot::Headings;

/// The hand in a glove whose profile there is.
#[derive(Debug)]
pub(super) struct Worn(Option<Hand>);

impl Worn {
    /// By the sensors' ids; tells which profile it is.
    pub fn of(ids: &[Option<UniqueId>; SEGMENT_COUNT], findings: &mut Findings) -> Self {
        match profile_of(None, ids) {
            Ok(Ok((path, kept))) => {
                let what = format!(
                    "calibrated {}, {}: {}",
                    kept.calibrated,
                    kept.quality.verdict,
                    path.display()
                );
                findings.good("profile", what);
                Self(Some(Hand::with_profile(&kept.bound)))
            }
            // Told at the end: the command needs the place.
            Ok(Err(_)) => Self(None),
            Err(failure) => {
                let next = failure.next();
                findings.wrong("profile", failure.to_string(), next);
                Self(None)
            }
        }
    }

    /// From `now` on the hand may lie flat.
    pub fn begin(&mut self, now: glove::Instant, wait: Duration) {
        if let Some(hand) = &mut self.0 {
            hand.begin_flat(now, ticks(wait));
        }
    }

    /// Takes a scan.
    pub fn take(&mut self, scanned: &Scanned) {
        if let Some(hand) = &mut self.0 {
            hand.take(scanned);
        }
    }

    /// How sure each joint's heading is.
    pub fn tell(&self, place: &Path, findings: &mut Findings) {
        let Some(hand) = &self.0 else {
            return findings.note(
                "profile",
                "there is no profile of this glove: nothing follows it",
                Command::gauntlet("calibrate").path("--glove", place),
            );
        };
        match (hand.flat(), hand.headings()) {
            (Flat::Taken, Some(headings)) => joints(&headings, findings),
            _ => findings.note(
                "joints",
                "no hand lay flat in it: how sure the joints' headings are is not told",
                advice("the same again, the hand in it flat and still").then(""),
            ),
        }
    }
}

fn joints(headings: &Headings, findings: &mut Findings) {
    let of = |k: usize| {
        format!(
            "{} {:.1}°",
            SEGMENT_NAMES[k],
            headings.sigma[k].to_degrees()
        )
    };
    let unsure = headings.degraded | headings.unknown;
    let sure: Vec<String> = (1..SEGMENT_COUNT)
        .filter(|k| unsure >> k & 1 == 0)
        .map(of)
        .collect();
    if !sure.is_empty() {
        let what = format!(
            "sigma of the heading between each segment and its parent: {}",
            sure.join(", ")
        );
        findings.good("joints", what);
    }
    let held: Vec<&str> = (1..SEGMENT_COUNT)
        .filter(|k| unsure >> k & 1 == 1)
        .map(|k| SEGMENT_NAMES[k])
        .collect();
    if !held.is_empty() {
        findings.note(
            "joints",
            format!(
                "not sure enough, and held: the joints below {}",
                held.join(", ")
            ),
            "the same again, the hand flat and still",
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::Verdict;

    #[test]
    fn each_joint_s_sigma_is_told_and_those_that_are_not_sure_are_named() {
        let headings = Headings {
            sigma: [0.02; SEGMENT_COUNT],
            drift: [0.0; SEGMENT_COUNT],
            degraded: 1 << 5,
            unknown: 1 << 9,
            poses: 1,
            pose: None,
        };
        let mut findings = Findings::default();
        joints(&headings, &mut findings);
        let [sure, held] = &findings.0[..] else {
            panic!("{findings:?}");
        };
        assert_eq!((sure.verdict, held.verdict), (Verdict::Good, Verdict::Note));
        assert!(sure.what.contains("index_proximal 1.1°"), "{}", sure.what);
        assert!(!sure.what.contains("index_middle"), "{}", sure.what);
        assert!(
            held.what.contains("index_middle, middle_distal"),
            "{}",
            held.what
        );
    }
}
