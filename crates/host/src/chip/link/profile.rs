//! The glove's profile in a bridge, its sensors' ids and headings, and scans of it.

use std::time::{Duration, Instant};

use bridge::protocol::message::{Answer, CHUNK, Call, Refusal, Scan};
use bridge::store::profile;
use crc::{CRC_32_ISO_HDLC, Crc};
use glove::calibration::Bound;
use glove::hand::SEGMENT_COUNT;
use glove::imu::UniqueId;

use super::{Error, HostLink, confused};

const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

impl HostLink {
    /// Gives the bridge another profile, which it keeps over restarts, or takes it away. The glove is then not calibrated before a
    /// flat pose.
    ///
    /// # Errors
    /// As [`HostLink::call`]; refused while the clutch is closed.
    pub fn set_profile(&mut self, profile: Option<&Bound>) -> Result<(), Error> {
        let Some(profile) = profile else {
            return self.done(&Call::ProfileErase);
        };
        let bytes = profile.to_bytes();
        for (index, chunk) in bytes.chunks(CHUNK).enumerate() {
            let offset = (index * CHUNK) as u32;
            match self.call(&Call::ProfileChunk {
                offset,
                bytes: chunk,
            })? {
                Answer::Received { .. } => {}
                other => return Err(confused(&other)),
            }
        }
        self.done(&Call::ProfileCommit {
            length: bytes.len() as u32,
            crc: CRC32.checksum(&bytes),
        })
    }

    /// The profile that the bridge keeps; `None` where it keeps none.
    ///
    /// # Errors
    /// As [`HostLink::call`]; bytes that are no profile.
    pub fn profile(&mut self) -> Result<Option<Bound>, Error> {
        let mut bytes = Vec::new();
        loop {
            let offset = bytes.len() as u32;
            let part = match self.call(&Call::ProfileGet { offset }) {
                Ok(Answer::Profile(part)) => part,
                Ok(other) => return Err(confused(&other)),
                Err(Error::Refused(Refusal::Profile(profile::Error::NoProfile))) => {
                    return Ok(None);
                }
                Err(error) => return Err(error),
            };
            bytes.extend_from_slice(&part.bytes);
            if part.bytes.is_empty() || bytes.len() >= usize::from(part.length) {
                break;
            }
        }
        let unreadable = |why| Error::Refused(Refusal::Profile(profile::Error::Unreadable(why)));
        Bound::from_bytes(&bytes).map(Some).map_err(unreadable)
    }

    /// Who the sensors are, as they are wired; `None` where that is not known.
    ///
    /// # Errors
    /// As [`HostLink::call`].
    pub fn sensor_ids(&mut self) -> Result<[Option<UniqueId>; SEGMENT_COUNT], Error> {
        match self.call(&Call::SensorIds)? {
            Answer::SensorIds(ids) => Ok(ids.0),
            other => Err(confused(&other)),
        }
    }

    /// Scans come from now on, or no longer. They end with the session, too.
    ///
    /// # Errors
    /// As [`HostLink::call`].
    pub fn scans(&mut self, on: bool) -> Result<(), Error> {
        self.done(&Call::Scans { on })
    }

    /// Scans that have come, after listening for `time`.
    ///
    /// # Errors
    /// The line's fault.
    pub fn listen_for_scans(&mut self, time: Duration) -> Result<Vec<Scan>, Error> {
        let deadline = Instant::now() + time;
        // Replies that come now answer requests given up before.
        while self.receive(deadline)?.is_some() {}
        Ok(self.scans.drain(..).collect())
    }

    /// The next scan, waited for until `deadline`, which no stream of bytes puts off.
    ///
    /// # Errors
    /// The line's fault.
    pub fn next_scan(&mut self, deadline: Instant) -> Result<Option<Scan>, Error> {
        // Replies that come now answer requests given up before.
        let is_there = |link: &Self| !link.scans.is_empty();
        while self.receive_until(deadline, is_there)?.is_some() {}
        Ok(self.scans.pop_front())
    }

    /// Whether flat poses are found while the hand works.
    ///
    /// # Errors
    /// As [`HostLink::call`].
    pub fn find_flat(&mut self, on: bool) -> Result<(), Error> {
        self.done(&Call::FindFlat { on })
    }
}
