//! The glove of a bridge on a chip: flat poses that are tried as often as it takes, and its profile.

use std::time::{Duration, Instant};

use bridge::calibration::{Refusal, Try};
use bridge::event::{Kind, Request};
use bridge::protocol;
use glove::calibration::Bound;

use super::calibrating::told;
use super::chip_worker::{Trying, Worker};
use super::hub::Happened;
use super::record::Sort;
use crate::chip::link::{Error, HostLink};

impl Worker {
    pub(super) fn begin_try(
        &mut self,
        wait: gripper::Duration,
        is_straight: bool,
    ) -> Result<(), Error> {
        let ended = self.link.health()?.calibration.ended;
        calibrate(&mut self.link, is_straight)?;
        self.trying = Some(Trying {
            until: Instant::now() + Duration::from_micros(wait.as_micros()),
            is_straight,
            ended,
        });
        self.calibration.newest = Try::Waiting;
        Ok(())
    }

    /// Takes the newest calibration back, and tells how that ended.
    pub(super) fn undo(&mut self) -> Result<(), Error> {
        self.trying = None;
        self.link.undo_calibration()?;
        let now = self.link.health()?.calibration;
        self.calibration.is_calibrated = now.is_calibrated;
        self.calibrated(now.newest);
        Ok(())
    }

    /// Another profile, kept by the bridge; refused while the clutch is closed.
    pub(super) fn set_profile(&mut self, profile: Option<&Bound>) -> Result<(), Error> {
        match self.link.set_profile(profile) {
            Err(Error::Refused(protocol::message::Refusal::Engaged)) => {
                let kind = Kind::Refused(Request::Profile);
                self.hub.lock().happened(Happened {
                    sort: Sort::Fault,
                    text: kind.to_string(),
                    kind,
                });
                Ok(())
            }
            done => done,
        }
    }

    pub(super) fn look_at_calibration(&mut self, end: Instant) -> Result<(), Error> {
        let now = match self.link.health_by(end) {
            // That of an older bridge, which only watches and is flashed, is not known.
            Err(Error::Older { .. }) => return Ok(()),
            health => match health? {
                Some(health) => health.calibration,
                None => return Ok(()),
            },
        };
        self.calibration_known = true;
        let Some(trying) = &mut self.trying else {
            self.calibration.is_calibrated = now.is_calibrated;
            return Ok(());
        };
        match now.newest {
            _ if now.ended == trying.ended => {}
            Try::Refused(why) if Instant::now() < trying.until && may_come(why) => {
                trying.ended = now.ended;
                calibrate(&mut self.link, trying.is_straight)?;
            }
            newest => {
                self.trying = None;
                self.calibration.is_calibrated = now.is_calibrated;
                self.calibrated(newest);
            }
        }
        Ok(())
    }

    /// A try ended, for this session's watchers.
    pub(super) fn calibrated(&mut self, newest: Try) {
        self.calibration.newest = newest;
        self.calibration.ended = self.calibration.ended.wrapping_add(1);
        let kind = Kind::Calibration(newest);
        self.hub.lock().happened(Happened {
            // A hand that was not taken is no fault of a device.
            sort: Sort::Note,
            text: told(&kind, &self.calibration),
            kind,
        });
    }
}

fn calibrate(link: &mut HostLink, is_straight: bool) -> Result<(), Error> {
    match is_straight {
        true => link.calibrate_straight(),
        false => link.calibrate_flat_hand(),
    }
}

/// Whether what was refused so may be taken when it is tried again.
fn may_come(why: Refusal) -> bool {
    !matches!(
        why,
        Refusal::Engaged | Refusal::NoProfile | Refusal::OtherGlove | Refusal::HasProfile
    )
}
