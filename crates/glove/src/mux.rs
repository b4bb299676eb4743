//! The TCA9548A multiplexer: one control byte, bit n connects channel n.
//!
//! A selection that fails unnoticed lets the next read reach the wrong finger's sensor without an error. So the channel
//! is forgotten before every write, is known again only when the control byte was read back, and is forgotten on
//! any bus error. The new channel connects at the STOP, hence two transactions. Never two channels at a time:
//! every channel holds the same two addresses.

use crate::bus::{Batch, Error, Transaction};

/// Address with A2, A1, A0 low; 0x70 to 0x77 exist.
pub const ADDRESS: u8 = 0x70;

/// Number of channels.
pub const CHANNELS: u8 = 8;

/// What is known of the multiplexer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mux {
    address: u8,
    selected: Option<u8>,
}

impl Mux {
    /// A multiplexer of which nothing is known yet.
    pub fn new(address: u8) -> Self {
        Self {
            address,
            selected: None,
        }
    }

    /// The channel that is known to be connected.
    pub fn selected(&self) -> Option<u8> {
        self.selected
    }

    /// Appends what selects `channel` and reads the selection back, and forgets what was selected.
    ///
    /// The reply to the batch then carries one byte for [`Mux::confirm`].
    ///
    /// # Errors
    /// [`Error::Unsupported`] for a channel above 7, [`Error::TooLong`] when the batch is full.
    pub fn select(&mut self, channel: u8, batch: &mut Batch) -> Result<(), Error> {
        self.forget();
        if channel >= CHANNELS {
            return Err(Error::Unsupported);
        }
        let too_long = Error::TooLong {
            length: batch.len() + 2,
            limit: batch.capacity(),
        };
        let write = Transaction::write(self.address, &[1 << channel])?;
        batch.push(write).map_err(|_| too_long)?;
        let read = Transaction::read(self.address, 1)?;
        batch.push(read).map_err(|_| too_long)
    }

    /// Takes the byte that was read back: remembers `channel` if it is the one connected.
    ///
    /// # Errors
    /// [`Error::Status`] with the byte if another set of channels is connected.
    pub fn confirm(&mut self, channel: u8, read_back: u8) -> Result<(), Error> {
        if channel < CHANNELS && read_back == 1 << channel {
            self.selected = Some(channel);
            return Ok(());
        }
        self.forget();
        Err(Error::Status(read_back))
    }

    /// Forgets the channel: after any bus error.
    pub fn forget(&mut self) {
        self.selected = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_is_known_only_after_its_read_back() {
        let mut mux = Mux::new(ADDRESS);
        assert_eq!(mux.selected(), None);
        let mut batch = Batch::new();
        mux.select(3, &mut batch).unwrap();
        assert_eq!(batch[0], Transaction::write(0x70, &[0x08]).unwrap());
        assert_eq!(batch[1], Transaction::read(0x70, 1).unwrap());
        assert_eq!(mux.selected(), None);
        mux.confirm(3, 0x08).unwrap();
        assert_eq!(mux.selected(), Some(3));
        mux.select(4, &mut Batch::new()).unwrap();
        assert_eq!(mux.selected(), None, "forgotten before the write");
    }

    #[test]
    fn another_channels_read_back_is_refused() {
        let mut mux = Mux::new(ADDRESS);
        for byte in 0..=255 {
            assert_eq!(mux.confirm(5, byte).is_ok(), byte == 0x20);
            assert_eq!(mux.selected().is_some(), byte == 0x20);
        }
        assert_eq!(mux.confirm(8, 0), Err(Error::Status(0)));
    }

    #[test]
    fn a_channel_that_does_not_exist_is_refused() {
        assert_eq!(
            Mux::new(ADDRESS).select(8, &mut Batch::new()),
            Err(Error::Unsupported)
        );
    }
}
