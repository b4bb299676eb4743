//! `i2c:/dev/i2c-N`: a glove on an I²C port of this computer.

use std::path::{Path, PathBuf};

use crate::failure::Failure;

/// The device file of an I²C port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Address(PathBuf);

impl Address {
    /// The address in `text`; `None` where it does not begin with `i2c:` and so is a serial port's path.
    ///
    /// # Errors
    /// A failure of usage: no device file behind it.
    pub fn parse(text: &Path) -> Result<Option<Self>, Failure> {
        let Some(path) = text.to_str().and_then(|text| text.strip_prefix("i2c:")) else {
            return Ok(None);
        };
        if path.is_empty() {
            return Err(Failure::usage(
                "i2c: names no port",
                "i2c:/dev/i2c-1, or what ls /dev/i2c-* shows",
            ));
        }
        Ok(Some(Self(PathBuf::from(path))))
    }

    /// The device file.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl std::fmt::Display for Address {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "i2c:{}", self.0.display())
    }
}
