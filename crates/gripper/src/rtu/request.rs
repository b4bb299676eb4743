//! Requests: what a master sends.

use super::{
    Error, Frame, MAX_READ, MAX_READ_WRITE, MAX_WRITE, Registers, Writer, code_of, emit_frame,
    exact, function, pair_of, quantity, u16_at,
};

/// One request. Register values are borrowed as the bytes that lie in the frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request<'a> {
    /// FC03: read `quantity` (1 to 125) holding registers from `address`.
    ReadHolding {
        /// First register.
        address: u16,
        /// Number of registers.
        quantity: u16,
    },
    /// FC04: read `quantity` (1 to 125) input registers from `address`.
    ReadInput {
        /// First register.
        address: u16,
        /// Number of registers.
        quantity: u16,
    },
    /// FC06: write one register.
    WriteSingle {
        /// The register.
        address: u16,
        /// Its value.
        value: u16,
    },
    /// FC16: write 1 to 123 registers from `address`.
    WriteMultiple {
        /// First register.
        address: u16,
        /// Values.
        values: Registers<'a>,
    },
    /// FC23: write 1 to 121 registers, then read 1 to 125, in one transaction.
    ReadWrite {
        /// First register read.
        read_address: u16,
        /// Number of registers read.
        read_quantity: u16,
        /// First register written.
        write_address: u16,
        /// Values written.
        values: Registers<'a>,
    },
}

impl<'a> Request<'a> {
    /// The function code.
    #[must_use]
    pub fn function(&self) -> u8 {
        match self {
            Self::ReadHolding { .. } => function::READ_HOLDING,
            Self::ReadInput { .. } => function::READ_INPUT,
            Self::WriteSingle { .. } => function::WRITE_SINGLE,
            Self::WriteMultiple { .. } => function::WRITE_MULTIPLE,
            Self::ReadWrite { .. } => function::READ_WRITE,
        }
    }

    /// Length of the whole frame, bytes.
    #[must_use]
    pub fn buffer_len(&self) -> usize {
        self.pdu_len() + 3
    }

    /// Length of the PDU, bytes (frame without address and CRC).
    #[must_use]
    pub fn pdu_len(&self) -> usize {
        match self {
            Self::ReadHolding { .. } | Self::ReadInput { .. } | Self::WriteSingle { .. } => 5,
            Self::WriteMultiple { values, .. } => 6 + values.bytes().len(),
            Self::ReadWrite { values, .. } => 10 + values.bytes().len(),
        }
    }

    /// Length of the whole frame that answers this request (not of an exception), bytes.
    #[must_use]
    pub fn reply_len(&self) -> usize {
        match *self {
            Self::ReadHolding { quantity, .. }
            | Self::ReadInput { quantity, .. }
            | Self::ReadWrite {
                read_quantity: quantity,
                ..
            } => 5 + 2 * quantity as usize,
            Self::WriteSingle { .. } | Self::WriteMultiple { .. } => 8,
        }
    }

    /// Writes the whole frame to the start of `out`; returns its length.
    ///
    /// # Errors
    /// [`Error::Buffer`] when `out` is shorter than [`Self::buffer_len`]; [`Error::Quantity`] when
    /// a register count is outside what the function allows.
    pub fn emit(&self, unit: u8, out: &mut [u8]) -> Result<usize, Error> {
        emit_frame(unit, self.buffer_len(), out, |pdu| self.emit_pdu(pdu))
    }

    /// Writes the PDU (what Modbus TCP carries after its header) to the start of `out`.
    ///
    /// # Errors
    /// As [`Self::emit`].
    pub fn emit_pdu(&self, out: &mut [u8]) -> Result<usize, Error> {
        self.check()?;
        let length = self.pdu_len();
        let mut writer = Writer::new(out, length, self.function())?;
        match *self {
            Self::ReadHolding {
                address,
                quantity: second,
            }
            | Self::ReadInput {
                address,
                quantity: second,
            }
            | Self::WriteSingle {
                address,
                value: second,
            } => writer.put_pair(address, second),
            Self::WriteMultiple { address, values } => {
                writer.put_pair(address, values.quantity());
                writer.put_counted(values);
            }
            Self::ReadWrite {
                read_address,
                read_quantity,
                write_address,
                values,
            } => {
                writer.put_pair(read_address, read_quantity);
                writer.put_pair(write_address, values.quantity());
                writer.put_counted(values);
            }
        }
        Ok(length)
    }

    /// Reads one whole frame: address and request.
    ///
    /// # Errors
    /// Everything in [`Error`] but `Buffer`: CRC first, then function, length, counts.
    pub fn parse(bytes: &'a [u8]) -> Result<(u8, Self), Error> {
        let frame = Frame::new_checked(bytes)?;
        Ok((frame.unit(), Self::parse_pdu(frame.pdu())?))
    }

    /// Reads a PDU.
    ///
    /// # Errors
    /// [`Error::Function`], `Short`, `Long`, `Quantity` or `ByteCount`.
    pub fn parse_pdu(pdu: &'a [u8]) -> Result<Self, Error> {
        let code = code_of(pdu)?;
        let request = match code {
            function::READ_HOLDING | function::READ_INPUT | function::WRITE_SINGLE => {
                let (address, second) = pair_of(pdu)?;
                match code {
                    function::READ_HOLDING => Self::ReadHolding {
                        address,
                        quantity: second,
                    },
                    function::READ_INPUT => Self::ReadInput {
                        address,
                        quantity: second,
                    },
                    _ => Self::WriteSingle {
                        address,
                        value: second,
                    },
                }
            }
            function::WRITE_MULTIPLE => Self::WriteMultiple {
                address: u16_at(pdu, 1)?,
                values: values_at(pdu, 3)?,
            },
            function::READ_WRITE => Self::ReadWrite {
                read_address: u16_at(pdu, 1)?,
                read_quantity: u16_at(pdu, 3)?,
                write_address: u16_at(pdu, 5)?,
                values: values_at(pdu, 7)?,
            },
            other => return Err(Error::Function(other)),
        };
        request.check()?;
        Ok(request)
    }

    /// The length of the request frame that starts with `prefix`, for a slave that collects bytes:
    /// `Ok(None)` while too few bytes are there to tell.
    ///
    /// # Errors
    /// [`Error::Function`] for a function code this codec does not speak.
    pub fn frame_len(prefix: &[u8]) -> Result<Option<usize>, Error> {
        let Some(&code) = prefix.get(1) else {
            return Ok(None);
        };
        let counted = |at: usize| prefix.get(at).map(|&count| at + 1 + usize::from(count) + 2);
        match code {
            function::READ_HOLDING | function::READ_INPUT | function::WRITE_SINGLE => Ok(Some(8)),
            function::WRITE_MULTIPLE => Ok(counted(6)),
            function::READ_WRITE => Ok(counted(10)),
            other => Err(Error::Function(other)),
        }
    }

    /// The register counts against what the function allows.
    fn check(&self) -> Result<(), Error> {
        match *self {
            Self::ReadHolding { quantity: n, .. } | Self::ReadInput { quantity: n, .. } => {
                quantity(n, MAX_READ).map(drop)
            }
            Self::WriteSingle { .. } => Ok(()),
            Self::WriteMultiple { values, .. } => quantity(values.quantity(), MAX_WRITE).map(drop),
            Self::ReadWrite {
                read_quantity,
                values,
                ..
            } => {
                quantity(read_quantity, MAX_READ)?;
                quantity(values.quantity(), MAX_READ_WRITE).map(drop)
            }
        }
    }
}

/// Quantity, byte count and values at `at`, to the end of the PDU.
fn values_at(pdu: &[u8], at: usize) -> Result<Registers<'_>, Error> {
    let count = u16_at(pdu, at)?;
    let &bytes = pdu.get(at + 2).ok_or(Error::Short {
        needed: at + 3,
        found: pdu.len(),
    })?;
    if u16::from(bytes) != count.wrapping_mul(2) || count > MAX_WRITE {
        return Err(if count > MAX_WRITE {
            Error::Quantity(count)
        } else {
            Error::ByteCount(bytes)
        });
    }
    exact(pdu, at + 3 + usize::from(bytes))?;
    pdu.get(at + 3..)
        .and_then(Registers::from_bytes)
        .ok_or(Error::ByteCount(bytes))
}
