//! What the host protocol may do with the loop.

use super::App;
use crate::clutch::{Epoch, HeartbeatRefusal, Position};
use crate::config::Config;
use crate::platform::{Platform, Slot};
use crate::store::WeightsStore;
use crate::telemetry::Telemetry;
use embedded_io::{Read, ReadReady, Write};
use gripper::Gripper;

/// [`App`] as a host sees it: without its ports and its machine. `X` is the gripper's number of axes.
pub trait Controls<const X: usize> {
    /// A slot of the weights store.
    type Flash: Slot;

    /// See [`App::is_engaged`].
    fn is_engaged(&self) -> bool;
    /// See [`App::clutch`].
    fn clutch(&self) -> Position;
    /// See [`App::engage`].
    fn engage(&mut self) -> Epoch;
    /// See [`App::heartbeat`].
    ///
    /// # Errors
    /// As there.
    fn heartbeat(&mut self, epoch: Epoch) -> Result<(), HeartbeatRefusal>;
    /// See [`App::release`].
    fn release(&mut self);
    /// See [`App::activate`].
    fn activate(&mut self);
    /// See [`App::calibrate_flat_hand`].
    fn calibrate_flat_hand(&mut self);
    /// See [`App::undo_calibration`].
    fn undo_calibration(&mut self);
    /// See [`App::config`].
    fn config(&self) -> &Config<X>;
    /// See [`App::set_config`].
    ///
    /// # Errors
    /// As there.
    fn set_config(&mut self, config: Config<X>) -> Result<(), Config<X>>;
    /// See [`App::telemetry`].
    fn telemetry(&self) -> &Telemetry<X>;
    /// See [`App::store`].
    fn store(&self) -> &WeightsStore<Self::Flash>;
    /// See [`App::store_mut`].
    fn store_mut(&mut self) -> &mut WeightsStore<Self::Flash>;
}

impl<P, G, R, F, const X: usize> Controls<X> for App<P, G, R, F, X>
where
    P: Platform,
    G: Read + ReadReady + Write,
    R: Gripper<X>,
    F: Slot,
{
    type Flash = F;

    fn is_engaged(&self) -> bool {
        self.is_engaged()
    }

    fn clutch(&self) -> Position {
        self.clutch()
    }

    fn engage(&mut self) -> Epoch {
        self.engage()
    }

    fn heartbeat(&mut self, epoch: Epoch) -> Result<(), HeartbeatRefusal> {
        self.heartbeat(epoch)
    }

    fn release(&mut self) {
        self.release();
    }

    fn activate(&mut self) {
        self.activate();
    }

    fn calibrate_flat_hand(&mut self) {
        self.calibrate_flat_hand();
    }

    fn undo_calibration(&mut self) {
        self.undo_calibration();
    }

    fn config(&self) -> &Config<X> {
        self.config()
    }

    fn set_config(&mut self, config: Config<X>) -> Result<(), Config<X>> {
        self.set_config(config)
    }

    fn telemetry(&self) -> &Telemetry<X> {
        self.telemetry()
    }

    fn store(&self) -> &WeightsStore<F> {
        self.store()
    }

    fn store_mut(&mut self) -> &mut WeightsStore<F> {
        self.store_mut()
    }
}
