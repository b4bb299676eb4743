//! `/dev/i2c-N` of Linux as an `embedded-hal` bus, through `i2cdev`.
//!
//! Every transaction is one `I2C_RDWR` with the address in its messages, on one descriptor. Not tried on hardware.

use std::io;
use std::os::fd::AsRawFd;
use std::path::Path;

use embedded_hal::i2c::{ErrorKind, ErrorType, I2c, NoAcknowledgeSource, Operation};
use i2cdev::core::{I2CMessage as _, I2CTransfer as _};
use i2cdev::linux::{LinuxI2CBus, LinuxI2CMessage};

use super::{Address, Port, TIMEOUT};
use crate::failure::Failure;
use crate::lines::port::{OpenError, group_of};
use crate::next::{Command, advice};

/// The adapter behind a device file.
struct Adapter {
    bus: LinuxI2CBus,
    /// It was unplugged.
    gone: bool,
}

impl Adapter {
    fn open(path: &Path) -> io::Result<Self> {
        let bus = LinuxI2CBus::new(path)?;
        shorten_timeout(&bus)?;
        Ok(Self { bus, gone: false })
    }
}

/// Tells the adapter to give a hung bus up after [`TIMEOUT`]. What is no I²C port does not know the call.
#[allow(unsafe_code)]
fn shorten_timeout(bus: &LinuxI2CBus) -> io::Result<()> {
    /// `I2C_TIMEOUT` of linux/i2c-dev.h; its argument counts in 10 ms.
    const I2C_TIMEOUT: libc::Ioctl = 0x0702;
    let tens = libc::c_ulong::try_from(TIMEOUT.as_millis() / 10).unwrap_or(2);
    // SAFETY: `bus` owns the descriptor and outlives the call; the argument is a number, no pointer.
    let result = unsafe { libc::ioctl(bus.as_raw_fd(), I2C_TIMEOUT, tens) };
    match result {
        0.. => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

impl ErrorType for Adapter {
    type Error = ErrorKind;
}

impl I2c for Adapter {
    fn transaction(
        &mut self,
        address: u8,
        operations: &mut [Operation<'_>],
    ) -> Result<(), ErrorKind> {
        let address = u16::from(address);
        let mut messages: Vec<LinuxI2CMessage<'_>> = operations
            .iter_mut()
            .map(|operation| match operation {
                Operation::Write(bytes) => LinuxI2CMessage::write(bytes).with_address(address),
                Operation::Read(buffer) => LinuxI2CMessage::read(buffer).with_address(address),
            })
            .collect();
        self.bus.transfer(&mut messages).map(drop).map_err(|error| {
            let error = io::Error::from(error);
            self.gone |= is_gone(&error);
            kind(&error)
        })
    }
}

/// Whether the adapter itself is no longer there: what one on USB says once it is unplugged.
fn is_gone(error: &io::Error) -> bool {
    matches!(
        error.raw_os_error(),
        Some(libc::ENODEV | libc::ESHUTDOWN | libc::EBADF)
    )
}

/// What an adapter's error number means (Documentation/i2c/fault-codes.rst). Most adapters tell a missing acknowledgement by EREMOTEIO or
/// ENXIO, and none whether it was the address's.
fn kind(error: &io::Error) -> ErrorKind {
    match error.raw_os_error() {
        Some(libc::ENXIO | libc::EREMOTEIO) => {
            ErrorKind::NoAcknowledge(NoAcknowledgeSource::Unknown)
        }
        Some(libc::ETIMEDOUT | libc::EBUSY | libc::EIO) => ErrorKind::Bus,
        Some(libc::EAGAIN) => ErrorKind::ArbitrationLoss,
        _ => ErrorKind::Other,
    }
}

impl Port {
    /// Opens the I²C port at `address`. Nothing is asked of the glove.
    ///
    /// # Errors
    /// A failure that says why it does not open, and what to try.
    pub fn open(address: &Address) -> Result<Self, Failure> {
        let path = address.path();
        let adapter = Adapter::open(path).map_err(|error| refused(address, &error))?;
        let again = path.to_owned();
        let name = address.to_string().into();
        let open = move || Adapter::open(&again).ok();
        Self::reopened(name, adapter, |adapter| adapter.gone, open).map_err(|error| {
            Failure::new(
                format!("{address} cannot be used: {error}"),
                "ending other programs",
            )
        })
    }
}

fn refused(address: &Address, error: &io::Error) -> Failure {
    let path = address.path();
    match (error.kind(), error.raw_os_error()) {
        (io::ErrorKind::NotFound, _) => Failure::new(
            format!("there is no I2C port {}", path.display()),
            advice("the port switched on (on a Raspberry Pi ")
                .then(Command::program("sudo").word("raspi-config"))
                .then(", Interface Options), and ")
                .then(Command::program("ls").word("/dev"))
                .then(" for the i2c-N there are"),
        ),
        (_, Some(libc::ENOTTY | libc::EINVAL)) | (io::ErrorKind::IsADirectory, _) => Failure::new(
            format!("{} is not an I2C port", path.display()),
            Command::program("ls")
                .word("/dev")
                .then(" for the i2c-N there are"),
        ),
        // The same words as for a serial port: its group may.
        (io::ErrorKind::PermissionDenied, _) => OpenError::Permission {
            path: path.to_owned(),
            group: group_of(path),
        }
        .into(),
        _ => Failure::new(
            format!("the I2C port {} did not open: {error}", path.display()),
            Command::program("dmesg").then(" for what the system says"),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_i2c_port_is_told_with_what_to_try() {
        let file = tempfile::NamedTempFile::new().expect("a file");
        let told = |path: &Path| {
            let address = Path::new("i2c:").as_os_str().to_owned();
            let mut text = address;
            text.push(path);
            let address = Address::parse(Path::new(&text))
                .expect("good")
                .expect("i2c");
            Port::open(&address).expect_err("refused").to_string()
        };
        assert!(told(file.path()).contains("is not an I2C port"));
        assert!(told(Path::new("/dev/null")).contains("is not an I2C port"));
        assert!(told(Path::new("/dev/i2c-none")).contains("there is no I2C port"));
    }

    #[test]
    fn a_missing_acknowledgement_and_a_hung_bus_are_told_apart() {
        let of = |code| kind(&io::Error::from_raw_os_error(code));
        assert_eq!(of(libc::ETIMEDOUT), ErrorKind::Bus);
        for code in [libc::ENXIO, libc::EREMOTEIO] {
            assert!(matches!(of(code), ErrorKind::NoAcknowledge(_)));
            assert!(!is_gone(&io::Error::from_raw_os_error(code)));
        }
        assert!(is_gone(&io::Error::from_raw_os_error(libc::ENODEV)));
        assert_eq!(of(libc::ENODEV), ErrorKind::Other);
    }
}
