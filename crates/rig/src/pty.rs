//! A virtual device behind a pseudo-terminal, in real time.

use std::io;
use std::path::{Path, PathBuf};

use crate::Device;

/// Starts devices behind pseudo-terminals.
#[derive(Debug)]
pub struct PtyDevice;

/// A running device. Dropping it stops the thread and removes the link.
#[derive(Debug)]
pub struct Handle {
    path: PathBuf,
}

impl PtyDevice {
    /// Opens a pseudo-terminal, puts it in raw mode, links it at `link`, and serves it from a thread.
    ///
    /// # Errors
    /// No pseudo-terminal to be had, or `link` exists and is not a dead link of ours.
    pub fn spawn(_device: Box<dyn Device>, _link: Option<&Path>) -> io::Result<Handle> {
        Err(io::Error::from(io::ErrorKind::Unsupported))
    }
}

impl Handle {
    /// The path to open: the link where one was asked for, else the terminal itself.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}
