//! Weights into the bridge: begin, chunks, commit, and the CRC that the bridge computes from its flash afterwards.

use std::time::{Duration, Instant};

use bridge::protocol::message::{Answer, CHUNK, Call, Refusal, SlotContents, Slots};
use crc::{CRC_32_ISO_HDLC, Crc};
use serde::Serialize;

use super::{Error, HostLink, confused};
use crate::interrupt::Interrupt;

const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
/// A broken line is opened again for so long after the last byte that got through.
const GIVE_UP: Duration = Duration::from_secs(10);
/// A line that breaks more often in one transfer will not carry it.
pub(super) const MOST_BROKEN: u32 = 100;
/// Pause between two attempts to open it.
const PAUSE: Duration = Duration::from_millis(250);

/// An image that arrived.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Flashed {
    /// The slot it is in, now the active one.
    pub slot: u8,
    /// Bytes.
    pub bytes: u32,
    /// CRC-32 of the image sent, and of what the bridge reads from its flash.
    pub crc: u32,
    /// Byte the transfer first went on from; 0 when it was a new one.
    pub resumed_at: u32,
    /// Times the line broke and was opened again.
    pub broken_lines: u32,
    /// Requests sent again for want of a reply.
    pub repeats: u32,
    /// What both slots hold now.
    pub slots: Slots,
}

/// One transfer, over as many lines as it takes.
struct Transfer<'a> {
    image: &'a [u8],
    crc: u32,
    resumed_at: Option<u32>,
    /// Bytes the bridge has.
    there: u32,
    /// When a chunk last got through.
    grew: Instant,
    /// The commit was asked for at least once.
    committing: bool,
}

impl HostLink {
    /// Writes `image` into the slot that is not active, makes it the active one, and compares the CRC of what the
    /// bridge then reads from its flash. `progress` hears how many bytes are there.
    ///
    /// # Errors
    /// A line that stays broken for 10 s or breaks more than 100 times, a refusal, a CRC that differs, or the person's wish to stop.
    pub fn flash(
        &mut self,
        image: &[u8],
        interrupt: &Interrupt,
        progress: &mut dyn FnMut(u32),
    ) -> Result<Flashed, Error> {
        self.flash_with(image, interrupt, progress, PAUSE)
    }

    /// [`HostLink::flash`] with `pause` between two attempts to open a broken line.
    pub(super) fn flash_with(
        &mut self,
        image: &[u8],
        interrupt: &Interrupt,
        progress: &mut dyn FnMut(u32),
        pause: Duration,
    ) -> Result<Flashed, Error> {
        let mut transfer = Transfer {
            image,
            crc: CRC32.checksum(image),
            resumed_at: None,
            there: 0,
            grew: Instant::now(),
            committing: false,
        };
        let mut broken_lines = 0;
        let mut outcome = transfer.run(self, interrupt, progress);
        let slots = loop {
            match outcome {
                Ok(slots) => break slots,
                Err(error) if error.is_of_the_line() && broken_lines == MOST_BROKEN => {
                    return Err(Error::Breaking {
                        times: broken_lines + 1,
                        done: transfer.there,
                        total: transfer.total(),
                        cause: Box::new(error),
                    });
                }
                Err(error) if error.is_of_the_line() && transfer.grew.elapsed() < GIVE_UP => {
                    broken_lines += 1;
                    if interrupt.sleep(pause) {
                        return Err(transfer.stopped());
                    }
                    outcome = self
                        .reconnect()
                        .and_then(|()| transfer.run(self, interrupt, progress));
                }
                Err(error) => return Err(error),
            }
        };
        let (slot, found) = active(&slots).unwrap_or_default();
        if found != transfer.crc {
            return Err(Error::ReadBack {
                found,
                expected: transfer.crc,
            });
        }
        Ok(Flashed {
            slot,
            bytes: transfer.total(),
            crc: transfer.crc,
            resumed_at: transfer.resumed_at.unwrap_or(0),
            broken_lines,
            repeats: self.repeats(),
            slots,
        })
    }
}

impl Transfer<'_> {
    fn total(&self) -> u32 {
        self.image.len().try_into().unwrap_or(u32::MAX)
    }

    fn stopped(&self) -> Error {
        Error::Stopped {
            done: self.there,
            total: self.total(),
        }
    }

    /// Everything from begin to the slots read back, over one line.
    fn run(
        &mut self,
        link: &mut HostLink,
        interrupt: &Interrupt,
        progress: &mut dyn FnMut(u32),
    ) -> Result<Slots, Error> {
        if self.committing {
            // The reply to the commit may have been lost, not the commit.
            let slots = link.slots()?;
            if active(&slots).is_some_and(|(_, crc)| crc == self.crc) {
                return Ok(slots);
            }
        }
        let begin = Call::WeightsBegin {
            length: self.total(),
            crc: self.crc,
        };
        let begun = received(link.call(&begin)?)?;
        self.resumed_at.get_or_insert(begun);
        // Told, not got through: a bridge that restarts at every chunk must not be begun with for ever.
        self.there = begun.min(self.total());
        progress(self.there);
        while self.there < self.total() {
            if interrupt.asked() {
                return Err(self.stopped());
            }
            self.send_chunk(link, progress)?;
        }
        self.committing = true;
        match link.call(&Call::WeightsCommit) {
            // A repetition that reached a bridge which had done it: the slots tell.
            Ok(Answer::Slots(_))
            | Err(Error::Refused(Refusal::Store(bridge::store::Error::NotBegun))) => {}
            Ok(other) => return Err(confused(&other)),
            Err(error) => return Err(error),
        }
        link.slots()
    }

    fn send_chunk(
        &mut self,
        link: &mut HostLink,
        progress: &mut dyn FnMut(u32),
    ) -> Result<(), Error> {
        let most = link
            .hello()
            .map_or(CHUNK, |hello| usize::from(hello.chunk).clamp(1, CHUNK));
        let rest = self.image.get(self.there as usize..).unwrap_or_default();
        let chunk = Call::WeightsChunk {
            offset: self.there,
            bytes: rest.get(..most.min(rest.len())).unwrap_or_default(),
        };
        let there = received(link.call(&chunk)?)?;
        if there <= self.there || there > self.total() {
            return Err(Error::Confused(format!(
                "byte {there} to a chunk from byte {}",
                self.there
            )));
        }
        self.there = there;
        self.grew = Instant::now();
        progress(self.there);
        Ok(())
    }
}

fn received(answer: Answer) -> Result<u32, Error> {
    match answer {
        Answer::Received { bytes } => Ok(bytes),
        other => Err(confused(&other)),
    }
}

/// The active slot and its image's CRC.
fn active(slots: &Slots) -> Option<(u8, u32)> {
    let slot = slots.active?;
    match slots.contents.get(usize::from(slot))? {
        SlotContents::Image { crc, .. } => Some((slot, *crc)),
        SlotContents::Empty | SlotContents::Damaged => None,
    }
}
