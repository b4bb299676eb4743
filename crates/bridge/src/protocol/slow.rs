//! Requests that look at whole images, or write the profile: done in pieces, one a poll, so that the loop's step stays short.

use super::frame::CRC32;
use super::message::{Answer, Refusal, SlotContents, Slots};
use crate::board::Slot;
use crate::store::{Contents, WeightsStore, profile};
use crate::{App, Board};
use crc::{Digest, Table};

/// Bytes of flash that one piece takes through the CRC.
const PIECE: usize = 1024;

/// What is under way, and then is answered.
#[derive(Debug)]
pub(super) enum Slow {
    /// Check an image and make it active, then read both slots.
    Commit,
    /// Read both slots.
    Read(Reading),
    /// Write the profile, or take it away; then the bridge uses what is kept.
    Profile,
}

impl Slow {
    /// The next piece: `Some` at the end.
    pub(super) fn step<B: Board<X>, const X: usize>(
        &mut self,
        app: &mut App<B, X>,
    ) -> Option<Result<Answer, Refusal>> {
        match self {
            Self::Commit => match app.store_mut().commit_step() {
                Ok(false) => None,
                Ok(true) => {
                    *self = Self::Read(Reading::new());
                    None
                }
                Err(error) => Some(Err(Refusal::Store(error))),
            },
            Self::Read(reading) => reading
                .step(app.store())
                .map(|slots| Ok(Answer::Slots(slots))),
            Self::Profile => profile_step(app),
        }
    }
}

/// The next piece of a profile's way into the flash, or out of it.
fn profile_step<B: Board<X>, const X: usize>(
    app: &mut App<B, X>,
) -> Option<Result<Answer, Refusal>> {
    let is_engaged = app.is_engaged();
    let Some(profiles) = app.profiles_mut() else {
        return Some(Err(Refusal::Profile(profile::Error::NoStore)));
    };
    if is_engaged {
        // Closed since it was begun: what is kept is as it was.
        profiles.abort();
        return Some(Err(Refusal::Engaged));
    }
    match profiles.step() {
        Ok(false) => None,
        Ok(true) => {
            app.use_kept_profile();
            Some(Ok(Answer::Done))
        }
        Err(error) => Some(Err(Refusal::Profile(error))),
    }
}

/// Both slots' contents, their CRCs computed from the flash.
pub(super) struct Reading {
    contents: [SlotContents; 2],
    slot: usize,
    offset: usize,
    digest: Digest<'static, u32, Table<1>>,
}

impl core::fmt::Debug for Reading {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Reading")
            .field("contents", &self.contents)
            .field("slot", &self.slot)
            .field("offset", &self.offset)
            .finish_non_exhaustive()
    }
}

impl Reading {
    pub(super) fn new() -> Self {
        Self {
            contents: [SlotContents::Empty; 2],
            slot: 0,
            offset: 0,
            digest: CRC32.digest(),
        }
    }

    fn step<F: Slot>(&mut self, store: &WeightsStore<F>) -> Option<Slots> {
        let known = store
            .contents()
            .get(self.slot)
            .zip(store.slots().get(self.slot));
        let Some((held, flash)) = known else {
            return Some(Slots {
                active: store.active().map(|(slot, _)| slot as u8),
                contents: self.contents,
            });
        };
        let found = match held {
            Contents::Empty => SlotContents::Empty,
            Contents::Damaged(_) => SlotContents::Damaged,
            Contents::Whole(image) => {
                let header = image.checked.header();
                let end = self.offset.saturating_add(PIECE).min(header.length);
                let piece = flash.mapped().get(self.offset..end).unwrap_or_default();
                self.digest.update(piece);
                self.offset = end;
                if end < header.length {
                    return None;
                }
                SlotContents::Image {
                    model_id: header.meta.model_id,
                    version: header.meta.version,
                    length: header.length as u32,
                    crc: self.digest.clone().finalize(),
                    weights: header.element.into(),
                }
            }
        };
        if let Some(place) = self.contents.get_mut(self.slot) {
            *place = found;
        }
        self.slot += 1;
        self.offset = 0;
        self.digest = CRC32.digest();
        None
    }
}
