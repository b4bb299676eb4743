//! Replies: what a slave sends.

use super::{
    Error, Frame, MAX_READ, MAX_WRITE, Registers, Writer, code_of, emit_frame, exact, function,
    pair_of, quantity,
};

/// A Modbus exception code: the slave understood the frame and says no.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Exception(pub u8);

impl Exception {
    /// 01: the slave does not know this function code.
    pub const ILLEGAL_FUNCTION: Self = Self(0x01);
    /// 02: no such register.
    pub const ILLEGAL_ADDRESS: Self = Self(0x02);
    /// 03: a value the register does not take.
    pub const ILLEGAL_VALUE: Self = Self(0x03);
    /// 04: the device failed.
    pub const DEVICE_FAILURE: Self = Self(0x04);
    /// 05: accepted, will take long.
    pub const ACKNOWLEDGE: Self = Self(0x05);
    /// 06: busy, ask again later.
    pub const BUSY: Self = Self(0x06);
    /// 08: memory parity error.
    pub const PARITY: Self = Self(0x08);
    /// 0A: a gateway has no path to the slave.
    pub const GATEWAY_PATH: Self = Self(0x0A);
    /// 0B: the slave behind a gateway does not answer.
    pub const GATEWAY_TARGET: Self = Self(0x0B);

    /// The code in words.
    #[must_use]
    pub fn meaning(self) -> &'static str {
        match self {
            Self::ILLEGAL_FUNCTION => "illegal function code",
            Self::ILLEGAL_ADDRESS => "illegal register address",
            Self::ILLEGAL_VALUE => "illegal value",
            Self::DEVICE_FAILURE => "device failure",
            Self::ACKNOWLEDGE => "acknowledged, still working on it",
            Self::BUSY => "device busy",
            Self::PARITY => "memory parity error",
            Self::GATEWAY_PATH => "gateway has no path to the device",
            Self::GATEWAY_TARGET => "device behind the gateway does not answer",
            _ => "a code the standard does not name",
        }
    }
}

/// One reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Response<'a> {
    /// FC03: the registers read.
    ReadHolding(Registers<'a>),
    /// FC04: the registers read.
    ReadInput(Registers<'a>),
    /// FC06: echo of the request.
    WriteSingle {
        /// The register.
        address: u16,
        /// Its value.
        value: u16,
    },
    /// FC16: echo of where and how many.
    WriteMultiple {
        /// First register.
        address: u16,
        /// Number of registers.
        quantity: u16,
    },
    /// FC23: the registers read.
    ReadWrite(Registers<'a>),
    /// The slave refused.
    Exception {
        /// Function code of the request, without bit 7.
        function: u8,
        /// Why.
        code: Exception,
    },
}

impl<'a> Response<'a> {
    /// The function code as it stands in the frame (bit 7 set for an exception).
    #[must_use]
    pub fn function(&self) -> u8 {
        match *self {
            Self::ReadHolding(_) => function::READ_HOLDING,
            Self::ReadInput(_) => function::READ_INPUT,
            Self::WriteSingle { .. } => function::WRITE_SINGLE,
            Self::WriteMultiple { .. } => function::WRITE_MULTIPLE,
            Self::ReadWrite(_) => function::READ_WRITE,
            Self::Exception { function: code, .. } => code | function::EXCEPTION,
        }
    }

    /// Length of the whole frame, bytes.
    #[must_use]
    pub fn buffer_len(&self) -> usize {
        self.pdu_len() + 3
    }

    /// Length of the PDU, bytes.
    #[must_use]
    pub fn pdu_len(&self) -> usize {
        match self {
            Self::ReadHolding(values) | Self::ReadInput(values) | Self::ReadWrite(values) => {
                2 + values.bytes().len()
            }
            Self::WriteSingle { .. } | Self::WriteMultiple { .. } => 5,
            Self::Exception { .. } => 2,
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

    /// Writes the PDU to the start of `out`.
    ///
    /// # Errors
    /// As [`Self::emit`].
    pub fn emit_pdu(&self, out: &mut [u8]) -> Result<usize, Error> {
        self.check()?;
        let length = self.pdu_len();
        let mut writer = Writer::new(out, length, self.function())?;
        match *self {
            Self::ReadHolding(values) | Self::ReadInput(values) | Self::ReadWrite(values) => {
                writer.put_counted(values);
            }
            Self::WriteSingle {
                address,
                value: second,
            }
            | Self::WriteMultiple {
                address,
                quantity: second,
            } => writer.put_pair(address, second),
            Self::Exception { code, .. } => writer.put(&[code.0]),
        }
        Ok(length)
    }

    /// Reads one whole frame: address and reply.
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
        let response = match code {
            function::READ_HOLDING => Self::ReadHolding(read_values(pdu)?),
            function::READ_INPUT => Self::ReadInput(read_values(pdu)?),
            function::READ_WRITE => Self::ReadWrite(read_values(pdu)?),
            function::WRITE_SINGLE | function::WRITE_MULTIPLE => {
                let (address, second) = pair_of(pdu)?;
                if code == function::WRITE_SINGLE {
                    Self::WriteSingle {
                        address,
                        value: second,
                    }
                } else {
                    Self::WriteMultiple {
                        address,
                        quantity: second,
                    }
                }
            }
            refused if refused & function::EXCEPTION != 0 => {
                exact(pdu, 2)?;
                let code = Exception(pdu.get(1).copied().unwrap_or(0));
                Self::Exception {
                    function: refused & !function::EXCEPTION,
                    code,
                }
            }
            other => return Err(Error::Function(other)),
        };
        response.check()?;
        Ok(response)
    }

    /// The register counts against what the function allows.
    fn check(&self) -> Result<(), Error> {
        match *self {
            Self::ReadHolding(values) | Self::ReadInput(values) | Self::ReadWrite(values) => {
                quantity(values.quantity(), MAX_READ).map(drop)
            }
            Self::WriteMultiple { quantity: n, .. } => quantity(n, MAX_WRITE).map(drop),
            Self::WriteSingle { .. } | Self::Exception { .. } => Ok(()),
        }
    }
}

fn read_values(pdu: &[u8]) -> Result<Registers<'_>, Error> {
    let &bytes = pdu.get(1).ok_or(Error::Short {
        needed: 2,
        found: pdu.len(),
    })?;
    exact(pdu, 2 + usize::from(bytes))?;
    pdu.get(2..)
        .and_then(Registers::from_bytes)
        .ok_or(Error::ByteCount(bytes))
}
