//! A profile bound to the sensors it was made with, and its bytes.
//!
//! | bytes | content |
//! |---|---|
//! | 0..4 | magic `GPRO` |
//! | 4 | version, 1 |
//! | 5 | hand: 0 right, 1 left |
//! | 6..8 | 0 |
//! | 8..24 | the sensor on each segment |
//! | 24..280 | mountings by segment: w, x, y, z each |
//! | 280..472 | axes by segment: x, y, z each |
//! | 472..488 | the thumb's base: w, x, y, z |
//! | 488..744 | the sensors' unique ids, in the order as they are wired |
//! | 744..748 | CRC-32/ISO-HDLC of bytes 0..744 |
//!
//! All numbers are little-endian, f32 where they are not whole.

use super::profile::{Invalid, Profile};
use crate::hand::{Quaternion, SEGMENT_COUNT, SEGMENT_NAMES, Side};
use crate::imu::UniqueId;
use crc::{CRC_32_ISO_HDLC, Crc};

static CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

const MAGIC: [u8; 4] = *b"GPRO";
const VERSION: u8 = 1;
/// How many sensors' ids may be unknown in a glove that a profile is taken for: one, as the hand goes on without one sensor and
/// without two it is held anyway. Fifteen ids that fit leave no doubt whose glove it is, and one sensor or several exchanged are seen.
const UNREAD_MOST: u32 = 1;

const CRC_AT: usize = Bound::BYTES - 4;

/// A profile, and the unique ids of the sensors it was made with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// The numbers.
    pub profile: Profile,
    /// Unique ids: `ids[k]` is of what answers as sensor `k`.
    pub ids: [UniqueId; SEGMENT_COUNT],
}

/// Why bytes are no profile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unreadable {
    /// There are so many; a profile has [`Bound::BYTES`].
    Length(usize),
    /// They do not begin as a profile does.
    Magic,
    /// They are of this version, which is not known here.
    Version(u8),
    /// Bits changed: the CRC-32 does not fit.
    Crc,
    /// The hand is neither right nor left.
    Side(u8),
    /// The numbers are no profile.
    Profile(Invalid),
}

impl core::fmt::Display for Unreadable {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Unreadable::Length(there) => {
                write!(f, "a profile has {} bytes, these are {there}", Bound::BYTES)
            }
            Unreadable::Magic => f.write_str("the bytes do not begin as a profile does"),
            Unreadable::Version(version) => write!(
                f,
                "the profile is of version {version}, known is {VERSION}: calibrate anew"
            ),
            Unreadable::Crc => f.write_str("the profile's CRC-32 does not fit its bytes"),
            Unreadable::Side(side) => write!(f, "the profile's hand is {side}: 0 right, 1 left"),
            Unreadable::Profile(invalid) => write!(f, "the profile cannot be used: {invalid}"),
        }
    }
}

impl core::error::Error for Unreadable {}

/// Why a profile is none of this glove.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Misfit {
    /// No sensor's id has been read yet.
    NoIds,
    /// The ids that were read fit, but too few were: those of two sensors or more (bit k: as they are wired) are not known.
    Unread(u16),
    /// Two sensors or more give the same id (bit k: sensor k as it is wired): nothing can be told from the ids of such a glove.
    Alike(u16),
    /// These sensors (bit k: as they are wired) are others than the profile was made with.
    Differ(u16),
}

impl core::fmt::Display for Misfit {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let sensors = match *self {
            Misfit::NoIds => {
                return f.write_str("no sensor's id has been read: is the glove connected?");
            }
            Misfit::Unread(sensors) => {
                f.write_str("too few sensors have told their ids; those of these are not known:")?;
                sensors
            }
            Misfit::Alike(sensors) => {
                f.write_str("these sensors give the same id, so no profile can be told to fit:")?;
                sensors
            }
            Misfit::Differ(sensors) => {
                f.write_str("the profile is of another glove; other sensors than then are:")?;
                sensors
            }
        };
        SEGMENT_NAMES
            .iter()
            .enumerate()
            .filter(|(k, _)| sensors >> k & 1 == 1)
            .try_for_each(|(_, name)| write!(f, " {name}"))
    }
}

impl core::error::Error for Misfit {}

impl Bound {
    /// Bytes of a stored profile.
    pub const BYTES: usize = 748;

    /// The bytes to store.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        let mut put = Put {
            bytes: &mut bytes,
            at: 0,
        };
        let profile = &self.profile;
        put.bytes(&MAGIC);
        put.bytes(&[VERSION, u8::from(profile.side == Side::Left), 0, 0]);
        put.bytes(&profile.sensors);
        profile.mounting.iter().for_each(|q| put.rotation(q));
        profile.axes.iter().for_each(|axis| put.numbers(axis));
        put.rotation(&profile.thumb_base);
        self.ids.iter().for_each(|id| put.bytes(id));
        let (numbers, _) = bytes.split_at(CRC_AT);
        let crc = CRC32.checksum(numbers);
        if let Some(place) = bytes.get_mut(CRC_AT..) {
            place.copy_from_slice(&crc.to_le_bytes());
        }
        bytes
    }

    /// A profile from its bytes.
    ///
    /// # Errors
    /// [`Unreadable`] says what is wrong; a profile that comes back passed [`Profile::check`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Unreadable> {
        let whole: &[u8; Self::BYTES] = bytes
            .try_into()
            .map_err(|_| Unreadable::Length(bytes.len()))?;
        let (numbers, crc) = whole.split_at(CRC_AT);
        let mut get = Get { bytes: numbers };
        if get.bytes::<4>() != MAGIC {
            return Err(Unreadable::Magic);
        }
        let [version, side, _, _] = get.bytes();
        if version != VERSION {
            return Err(Unreadable::Version(version));
        }
        if crc != CRC32.checksum(numbers).to_le_bytes() {
            return Err(Unreadable::Crc);
        }
        let side = match side {
            0 => Side::Right,
            1 => Side::Left,
            other => return Err(Unreadable::Side(other)),
        };
        let profile = Profile {
            side,
            sensors: get.bytes(),
            mounting: core::array::from_fn(|_| get.rotation()),
            axes: core::array::from_fn(|_| get.numbers()),
            thumb_base: get.rotation(),
        };
        profile.check().map_err(Unreadable::Profile)?;
        Ok(Self {
            profile,
            ids: core::array::from_fn(|_| get.bytes()),
        })
    }

    /// Whether the glove with these sensors is the one the profile was made with: every id that was read is the profile's, and of at most
    /// one sensor it was not (`None`): it is missing, and without two the hand is held anyway.
    ///
    /// # Errors
    /// [`Misfit`] names the sensors.
    pub fn fits(&self, ids: &[Option<UniqueId>; SEGMENT_COUNT]) -> Result<(), Misfit> {
        let mut alike = 0;
        let mut differ = 0;
        let unread = unread(ids);
        for (k, id) in ids.iter().enumerate() {
            let Some(id) = id else { continue };
            for (other, _) in ids
                .iter()
                .enumerate()
                .skip(k + 1)
                .filter(|(_, o)| **o == Some(*id))
            {
                alike |= 1u16 << k | 1u16 << other;
            }
            differ |= u16::from(self.ids.get(k) != Some(id)) << k;
        }
        if unread == u16::MAX {
            Err(Misfit::NoIds)
        } else if alike != 0 {
            Err(Misfit::Alike(alike))
        } else if differ != 0 {
            Err(Misfit::Differ(differ))
        } else if unread.count_ones() > UNREAD_MOST {
            Err(Misfit::Unread(unread))
        } else {
            Ok(())
        }
    }

    /// The same where the sensors may still be on their way: too few ids say nothing against it. Whoever uses the profile asks
    /// [`Bound::fits`] again.
    ///
    /// # Errors
    /// [`Misfit`] names the sensors; never [`Misfit::Unread`].
    pub fn may_fit(&self, ids: &[Option<UniqueId>; SEGMENT_COUNT]) -> Result<(), Misfit> {
        match self.fits(ids) {
            Err(Misfit::Unread(_)) => Ok(()),
            fits => fits,
        }
    }
}

/// Sensors whose id was not read (bit k: as they are wired).
pub fn unread(ids: &[Option<UniqueId>; SEGMENT_COUNT]) -> u16 {
    let is_unread = |(k, id): (usize, &Option<UniqueId>)| u16::from(id.is_none()) << k;
    ids.iter().enumerate().map(is_unread).sum()
}

/// Bytes put one after the other; what has no room is left out, which the lengths above rule out.
struct Put<'a> {
    bytes: &'a mut [u8; Bound::BYTES],
    at: usize,
}

impl Put<'_> {
    fn bytes(&mut self, bytes: &[u8]) {
        let end = self.at.saturating_add(bytes.len());
        if let Some(place) = self.bytes.get_mut(self.at..end) {
            place.copy_from_slice(bytes);
        }
        self.at = end;
    }

    fn numbers(&mut self, numbers: &[f32]) {
        numbers.iter().for_each(|n| self.bytes(&n.to_le_bytes()));
    }

    fn rotation(&mut self, q: &Quaternion) {
        self.numbers(&[q.w, q.i, q.j, q.k]);
    }
}

/// Bytes taken one after the other; zeros after the last.
struct Get<'a> {
    bytes: &'a [u8],
}

impl Get<'_> {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        match self.bytes.split_first_chunk() {
            Some((first, rest)) => {
                self.bytes = rest;
                *first
            }
            None => [0; N],
        }
    }

    /// Out of line: some 400 numbers are taken.
    #[inline(never)]
    fn number(&mut self) -> f32 {
        f32::from_le_bytes(self.bytes())
    }

    fn numbers<const N: usize>(&mut self) -> [f32; N] {
        core::array::from_fn(|_| self.number())
    }

    fn rotation(&mut self) -> Quaternion {
        let [w, x, y, z] = self.numbers();
        super::algebra::quaternion(w, x, y, z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::algebra;
    extern crate std;
    use std::string::ToString;

    fn bound() -> Bound {
        let mut profile = Profile::straight(Side::Left);
        profile.sensors.swap(8, 11);
        for (k, mounting) in profile.mounting.iter_mut().enumerate() {
            let [c, s] = algebra::half(0.3 * k as f32);
            *mounting = algebra::quaternion(c, 0.0, s, 0.0);
        }
        profile.axes[5] = [0.6, 0.0, 0.8];
        profile.thumb_base = algebra::quaternion(0.6, 0.0, -0.8, 0.0);
        let id = |k: usize| core::array::from_fn(|i| (16 * k + i) as u8);
        Bound {
            profile,
            ids: core::array::from_fn(id),
        }
    }

    #[test]
    fn a_profile_comes_back_from_its_bytes_bit_for_bit() {
        let bound = bound();
        let bytes = bound.to_bytes();
        assert_eq!(bytes[..8], *b"GPRO\x01\x01\0\0");
        assert_eq!(Bound::from_bytes(&bytes), Ok(bound));
        assert_eq!(
            bytes[24 + 16 * 15..][..4],
            bound.profile.mounting[15].w.to_le_bytes()
        );
        assert_eq!(bytes[488 + 16 * 15..744], bound.ids[15]);
    }

    #[test]
    fn no_bit_of_a_stored_profile_may_be_wrong() {
        let bytes = bound().to_bytes();
        for bit in 0..8 * Bound::BYTES {
            let mut wrong = bytes;
            wrong[bit / 8] ^= 1 << (bit % 8);
            assert!(Bound::from_bytes(&wrong).is_err(), "bit {bit}");
        }
        assert_eq!(Bound::from_bytes(&bytes[1..]), Err(Unreadable::Length(747)));
        assert_eq!(Bound::from_bytes(&[0xFF; 748]), Err(Unreadable::Magic));
    }

    #[test]
    fn numbers_that_are_no_profile_are_refused_although_their_crc_fits() {
        let mut bound = bound();
        bound.profile.sensors[0] = 1;
        let refused = Bound::from_bytes(&bound.to_bytes());
        assert_eq!(refused, Err(Unreadable::Profile(Invalid::Sensors)));
    }

    #[test]
    fn a_profile_of_another_glove_is_refused_with_the_sensors_that_differ() {
        let bound = bound();
        let own = bound.ids.map(Some);
        assert_eq!(bound.fits(&own), Ok(()));
        let mut some = [None; SEGMENT_COUNT];
        assert_eq!(bound.fits(&some), Err(Misfit::NoIds));
        some[7] = own[7];
        assert_eq!(bound.fits(&some), Err(Misfit::Unread(!(1 << 7))));
        assert_eq!(bound.may_fit(&some), Ok(()), "the others may still come");
        let mut missing = own;
        missing[7] = None;
        assert_eq!(bound.fits(&missing), Ok(()), "one may be missing");
        missing[0] = None;
        assert_eq!(bound.fits(&missing), Err(Misfit::Unread(1 << 7 | 1)));
        missing[3] = Some([0xAA; 16]);
        assert_eq!(bound.fits(&missing), Err(Misfit::Differ(1 << 3)));
        assert_eq!(bound.may_fit(&missing), Err(Misfit::Differ(1 << 3)));
        let mut swapped = own;
        swapped.swap(8, 11);
        let misfit = bound.fits(&swapped).unwrap_err();
        assert_eq!(misfit, Misfit::Differ(1 << 8 | 1 << 11));
        assert!(misfit.to_string().ends_with(" middle_middle ring_middle"));
        let alike = [Some([0; 16]); SEGMENT_COUNT];
        assert_eq!(bound.fits(&alike), Err(Misfit::Alike(0xFFFF)));
    }
}
