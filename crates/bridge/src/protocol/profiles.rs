//! The glove's profile over the line.

use super::gate::idle;
use super::message::{Answer, Call, PROFILE_CHUNK, ProfilePart, Refusal};
use crate::store::profile::{Error, ProfileStore};
use crate::{App, Board};

/// The place where profiles are kept, if the clutch is open.
fn profiles<B: Board<X>, const X: usize>(
    app: &mut App<B, X>,
) -> Result<&mut ProfileStore<B::Flash>, Refusal> {
    let profiles = idle(app)?.profiles_mut();
    profiles.ok_or(Refusal::Profile(Error::NoStore))
}

pub(super) fn profile_chunk<B: Board<X>, const X: usize>(
    offset: u32,
    bytes: &[u8],
    app: &mut App<B, X>,
) -> Result<Answer, Refusal> {
    let there = profiles(app)?.chunk(offset as usize, bytes);
    there
        .map(|there| Answer::Received {
            bytes: there as u32,
        })
        .map_err(Refusal::Profile)
}

/// Begins to keep the profile that came, or to take the one away that is kept.
pub(super) fn change_profile<B: Board<X>, const X: usize>(
    call: &Call<'_>,
    app: &mut App<B, X>,
) -> Result<(), Refusal> {
    let profiles = profiles(app)?;
    match call {
        Call::ProfileCommit { length, crc } => profiles
            .commit(*length as usize, *crc)
            .map_err(Refusal::Profile),
        _ => {
            profiles.erase();
            Ok(())
        }
    }
}

pub(super) fn profile_part<B: Board<X>, const X: usize>(
    offset: u32,
    app: &mut App<B, X>,
) -> Result<Answer, Refusal> {
    let profiles = app.profiles_mut().ok_or(Refusal::Profile(Error::NoStore))?;
    let bytes = profiles.bytes().ok_or(Refusal::Profile(Error::NoProfile))?;
    let rest = bytes.get(offset as usize..).unwrap_or_default();
    let part = rest.get(..PROFILE_CHUNK).unwrap_or(rest);
    Ok(Answer::Profile(ProfilePart {
        length: bytes.len() as u16,
        offset: offset.min(u32::from(u16::MAX)) as u16,
        bytes: part.iter().copied().collect(),
    }))
}
