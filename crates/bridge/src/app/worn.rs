//! What the bridge knows and tells of a glove with a profile: whose it is, its headings, flat poses.

use super::{App, Heard};
use crate::Instant;
use crate::board::Board;
use crate::calibration::ProfileState;
use crate::event::Kind;
use crate::store::profile::ProfileStore;
use glove::calibration::Misfit;
use glove::hand::SEGMENT_COUNT;
use glove::headings::PoseReport;

impl<B: Board<X>, const X: usize> App<B, X> {
    /// Keeps the profile in these slots from now on, and takes the one that is there.
    pub fn keep_profile(&mut self, slots: [B::Flash; 2]) {
        self.profiles = Some(ProfileStore::new(slots));
        self.use_kept_profile();
    }

    /// Where the profile is kept, if it is.
    pub fn profiles_mut(&mut self) -> Option<&mut ProfileStore<B::Flash>> {
        self.profiles.as_mut()
    }

    /// Takes the profile that is kept, or none where none is. Nothing changes while the clutch is closed.
    #[inline(never)]
    pub(crate) fn use_kept_profile(&mut self) {
        let kept = self.profiles.as_ref().and_then(ProfileStore::profile);
        // Refused only while the clutch is closed, which callers have looked at.
        let _ = self.set_profile(kept.as_ref());
    }

    /// The sensor on each segment, as it is wired.
    pub fn seats(&self) -> [u8; SEGMENT_COUNT] {
        self.posture.seats()
    }

    /// Sensors that have started since the last frame, or told another id: whose they are, and that their headings are others.
    pub(super) fn watch_starts(&mut self, now: Instant) {
        let starts = self.scanner.counters().starts;
        let ids = self.scanner.ids_known();
        let before = self.heard.replace(Heard { starts, ids });
        let fit = self.posture.fit();
        if before != self.heard {
            self.posture.meet(&self.scanner.ids());
        }
        let before = before.map(|heard| heard.starts);
        if self.posture.fit() != fit {
            match self.posture.fit() {
                Some(Err(misfit @ (Misfit::Alike(_) | Misfit::Differ(_)))) => {
                    self.tell(now, Kind::ProfileMisfit(misfit));
                }
                Some(Ok(())) => self.tell(now, Kind::ProfileFits),
                _ => {}
            }
        }
        let relative = self.config().settings().heading_is_relative;
        let restarted = self.posture.hear(&starts, relative, now);
        for (segment, seat) in self.posture.seats().into_iter().enumerate() {
            let starts_of = |starts: &[u16; SEGMENT_COUNT]| starts.get(usize::from(seat)).copied();
            let of_before = before.as_ref().and_then(starts_of).unwrap_or(0);
            // A first start is none.
            let is_new = of_before > 0 && starts_of(&starts) != Some(of_before);
            if relative && is_new && restarted >> segment & 1 == 1 {
                self.sensors.searching |= 1 << segment;
                self.tell(now, Kind::HeadingLost { segment });
            }
        }
    }

    /// Sensors that give samples and no id, by segment: the profile does not use them.
    pub(super) fn watch_unread(&mut self, now: Instant, missing: u16) {
        let nameless = self.posture.unread() & !missing;
        let new = nameless & !self.sensors.nameless;
        self.sensors.nameless = nameless;
        for segment in (0..SEGMENT_COUNT).filter(|k| new >> k & 1 == 1) {
            self.tell(now, Kind::Nameless { segment });
        }
    }

    /// What the headings say, after a frame was read.
    pub(super) fn watch_headings(&mut self, now: Instant, found: Option<PoseReport>) {
        let Some(headings) = self.posture.headings() else {
            return;
        };
        let (degraded, unknown) = (headings.degraded(), headings.unknown());
        let telemetry = &mut self.telemetry;
        telemetry.sigma = headings.sigma();
        telemetry.drift = headings.drift();
        telemetry.unknown = unknown;
        // Without a heading it is not only unsure.
        let degraded = degraded & !unknown;
        let changed = telemetry.degraded ^ degraded;
        telemetry.degraded = degraded;
        for segment in (1..SEGMENT_COUNT).filter(|k| changed >> k & 1 == 1) {
            if degraded >> segment & 1 == 1 {
                self.tell(now, Kind::Unsure { segment });
            } else if unknown >> segment & 1 == 0 {
                self.tell(now, Kind::Sure { segment });
            }
        }
        let still = self.posture.astray();
        let back = self.sensors.searching & !still;
        self.sensors.searching &= still;
        for segment in (0..SEGMENT_COUNT).filter(|k| back >> k & 1 == 1) {
            self.tell(now, Kind::HeadingFound { segment });
        }
        if let Some(report) = found {
            self.take_report(now, &report);
        }
    }

    /// A flat pose was taken. Of one that a person asked for, who lies flat as in the calibration, it is told what slipped; in one that was only
    /// found nobody looked at the glove: what slipped is not used until somebody has.
    pub(super) fn take_report(&mut self, now: Instant, report: &PoseReport) {
        self.telemetry.take_pose(report);
        let most = report.off.iter().fold(0.0, |most: f32, off| {
            let off = libm::fabsf(*off);
            if off > most { off } else { most }
        });
        if report.found {
            self.tell(now, Kind::FlatPoseFound { off: most });
        }
        for segment in (0..SEGMENT_COUNT).filter(|k| report.slipped >> k & 1 == 1) {
            if report.found {
                self.posture.distrust(segment, now);
            }
            self.tell(
                now,
                Kind::SensorSlipped {
                    segment,
                    held: report.found,
                },
            );
        }
    }

    /// Whether there is a profile, and whether it is this glove's.
    pub(super) fn profile_state(&self) -> ProfileState {
        let fit = self.posture.fit();
        ProfileState {
            is_there: fit.is_some(),
            fits: fit == Some(Ok(())),
        }
    }
}
