//! The same for a glove with a profile.

use super::flash_kind;
use crate::calibration::ProfileState;
use crate::store::profile;
use embedded_storage::nor_flash::NorFlashErrorKind;
use glove::calibration::{Invalid, Unreadable};
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
#[serde(remote = "ProfileState")]
pub(in crate::protocol) struct WireProfileState {
    is_there: bool,
    fits: bool,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "profile::Error")]
pub(in crate::protocol) enum WireProfileError {
    NoStore,
    NoProfile,
    Offset {
        found: usize,
        expected: usize,
    },
    Length {
        found: usize,
        expected: usize,
    },
    Crc {
        found: u32,
        computed: u32,
    },
    Unreadable(#[serde(with = "WireUnreadable")] Unreadable),
    Geometry {
        slot: usize,
    },
    Flash {
        slot: usize,
        offset: usize,
        #[serde(with = "flash_kind")]
        kind: NorFlashErrorKind,
    },
    ReadBack {
        slot: usize,
        offset: usize,
    },
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Unreadable")]
enum WireUnreadable {
    Length(usize),
    Magic,
    Version(u8),
    Crc,
    Side(u8),
    Profile(#[serde(with = "WireInvalid")] Invalid),
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Invalid")]
enum WireInvalid {
    Sensors,
    Segment(u8),
    ThumbBase,
}

/// A report that may be missing.
pub(in crate::protocol) mod pose {
    use glove::hand::SEGMENT_COUNT;
    use glove::headings::PoseReport;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Serialize, Deserialize)]
    struct Wire {
        found: bool,
        off: [f32; SEGMENT_COUNT],
        tilt: [f32; SEGMENT_COUNT],
        slipped: u16,
    }

    pub fn serialize<S: Serializer>(report: &Option<PoseReport>, to: S) -> Result<S::Ok, S::Error> {
        let wire = report.as_ref().map(|report| Wire {
            found: report.found,
            off: report.off,
            tilt: report.tilt,
            slipped: report.slipped,
        });
        wire.serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Option<PoseReport>, D::Error> {
        let wire = Option::<Wire>::deserialize(from)?;
        Ok(wire.map(|wire| PoseReport {
            found: wire.found,
            off: wire.off,
            tilt: wire.tilt,
            slipped: wire.slipped,
        }))
    }
}
