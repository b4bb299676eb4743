//! What is found out about the sensors, for a person.

use crate::hand::SEGMENT_NAMES;
use crate::{Duration, imu, mux};

/// Something the scanner found out about the sensors, told once when it begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Finding {
    /// This sensor repeats its bytes although it must have turned: it is not used until they change.
    Frozen {
        /// Its segment.
        segment: u8,
    },
    /// No bit of any sensor changes any more, although they flickered: none is used until its bytes change.
    AllFrozen,
    /// This sensor jumped as no hand does, and stayed there: it is used again, as a new beginning. Its heading, and with it
    /// the calibration, is doubtful.
    Jumped {
        /// Its segment.
        segment: u8,
        /// How far, radians.
        by: f32,
    },
    /// These sensors gave no samples for 200 ms or more, or started anew, and came back far from where they were. Several reads
    /// agree, and they are used again: a hand can have turned so far meanwhile, and so can a sensor's heading.
    Returned {
        /// Their segments (bit k: segment k).
        segments: u16,
        /// How far the farthest is off, radians.
        by: f32,
    },
    /// These sensors are far from where they were before a gap between scans, which is the computer's or the line's doing: a hand
    /// can have turned so far meanwhile. Several reads agree, and they are used again; the calibration stays.
    AfterGap {
        /// Their segments (bit k: segment k).
        segments: u16,
        /// How far the farthest is off, radians.
        by: f32,
        /// The longest gap.
        gap: Duration,
    },
    /// By this sensor a joint is turned far beyond what a hand can ([`crate::hand::beyond`]): it is not used while it is. Found by
    /// whoever has the calibration.
    Impossible {
        /// Its segment.
        segment: u8,
    },
    /// These channels of the multiplexer give the same bits (bit n: channel n): their sensors are not used while they do.
    Twins {
        /// The channels, two at least.
        channels: u8,
    },
    /// By its unique id another sensor answers than the one of this segment: it is not used.
    WrongSensor {
        /// The segment.
        segment: u8,
        /// [`imu::Error::SameSensor`] or [`imu::Error::OtherSensor`].
        error: imu::Error,
    },
}

impl Finding {
    /// The same by where sensors sit: `place` gives the segment of the sensor that is wired as the one it is asked for.
    #[must_use]
    pub fn placed(self, place: impl Fn(u8) -> u8) -> Self {
        let places = |sensors: u16| {
            (0..SEGMENT_NAMES.len() as u8)
                .filter(|k| sensors >> k & 1 == 1)
                .fold(0, |mask, k| {
                    mask | 1u16.checked_shl(u32::from(place(k))).unwrap_or(0)
                })
        };
        match self {
            Finding::Frozen { segment } => Finding::Frozen {
                segment: place(segment),
            },
            Finding::Jumped { segment, by } => Finding::Jumped {
                segment: place(segment),
                by,
            },
            Finding::Returned { segments, by } => Finding::Returned {
                segments: places(segments),
                by,
            },
            Finding::AfterGap { segments, by, gap } => Finding::AfterGap {
                segments: places(segments),
                by,
                gap,
            },
            Finding::Impossible { segment } => Finding::Impossible {
                segment: place(segment),
            },
            Finding::WrongSensor { segment, error } => Finding::WrongSensor {
                segment: place(segment),
                error: match error {
                    imu::Error::SameSensor { segment } => imu::Error::SameSensor {
                        segment: place(segment),
                    },
                    other => other,
                },
            },
            Finding::AllFrozen | Finding::Twins { .. } => self,
        }
    }
}

impl core::fmt::Display for Finding {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let name = |segment: u8| SEGMENT_NAMES.get(usize::from(segment)).unwrap_or(&"?");
        match *self {
            Finding::Frozen { segment } => {
                write!(f, "the sensor on {} is frozen", name(segment))
            }
            Finding::AllFrozen => f.write_str("all sensors are frozen: no bit changes any more"),
            Finding::Jumped { segment, by } => write!(
                f,
                "the sensor on {} jumped by {:.0}°, as no hand does, and stayed there",
                name(segment),
                by * (180.0 / core::f32::consts::PI)
            ),
            Finding::Returned { segments, by } => {
                write!(
                    f,
                    "back after a time without samples, and turned by up to {:.0}° since:",
                    by.to_degrees()
                )?;
                names(f, segments)?;
                f.write_str("; if that is not the hand's doing, calibrate again")
            }
            Finding::AfterGap { segments, by, gap } => {
                write!(
                    f,
                    "scans came {} ms apart, too far to follow: this computer or the line is too busy; turned by up to {:.0}° meanwhile, \
                     and followed again:",
                    gap.as_millis(),
                    by.to_degrees()
                )?;
                names(f, segments)
            }
            Finding::Impossible { segment } => write!(
                f,
                "the sensor on {} shows a joint turned farther than a hand's can be: it is not used; check its seat, calibrate again",
                name(segment)
            ),
            Finding::Twins { channels } => {
                f.write_str("the multiplexer's channels")?;
                for channel in (0..mux::CHANNELS).filter(|channel| channels >> channel & 1 == 1) {
                    write!(f, " {channel}")?;
                }
                f.write_str(" give the same bits: it does not select")
            }
            Finding::WrongSensor { segment, error } => write!(f, "{}: {error}", name(segment)),
        }
    }
}

/// The segments of a mask, by name.
fn names(f: &mut core::fmt::Formatter<'_>, segments: u16) -> core::fmt::Result {
    for (_, name) in (0..)
        .zip(SEGMENT_NAMES)
        .filter(|(k, _)| segments >> k & 1 == 1)
    {
        write!(f, " {name}")?;
    }
    Ok(())
}
