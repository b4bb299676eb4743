//! The virtual person of `gauntlet simulate` hears what a person is asked for: on a socket beside the virtual glove's link.
//!
//! A glove at `/tmp/glove` has its person at `/tmp/glove.person`; a real port has none. One datagram is one request in words: `flat`,
//! `turn`, `bend` and a finger's number (0 thumb to 4 little), `fists`, `thumb`, `free`; `show` and a gripper's counts asks for the hand
//! pose that this person would show for them; `move` lets the hand do as it likes.

use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};

use glove::calibration::{Finger, Step};

/// Where the virtual person of a glove at `port` hears.
pub fn place(port: &Path) -> PathBuf {
    let mut name = port.as_os_str().as_bytes().to_vec();
    name.extend_from_slice(b".person");
    PathBuf::from(std::ffi::OsStr::from_bytes(&name))
}

/// A request as it is sent.
pub fn request(step: Step) -> String {
    match step {
        Step::FirstFlat | Step::SecondFlat | Step::LastFlat => "flat".to_owned(),
        Step::Turn => "turn".to_owned(),
        Step::Alone(finger) => format!("bend {}", finger.number()),
        Step::Fists => "fists".to_owned(),
        Step::Thumb => "thumb".to_owned(),
        Step::Free => "free".to_owned(),
    }
}

/// The finger of a request to bend one.
pub fn finger(number: &str) -> Option<Finger> {
    let number: usize = number.parse().ok()?;
    Finger::ALL.get(number).copied()
}

/// The longest request, bytes.
pub const LONGEST: usize = 64;

/// A request to show the hand pose that belongs to a gripper's counts, as it is sent.
pub fn request_to_show(counts: &[f32]) -> String {
    let counts: Vec<String> = counts.iter().map(|count| format!("{count:.1}")).collect();
    format!("show {}", counts.join(" "))
}

/// The counts of such a request; `None` for any other.
pub fn counts_to_show(request: &str) -> Option<Vec<f32>> {
    let counts = request.strip_prefix("show ")?.split(' ');
    counts.map(|count| count.parse().ok()).collect()
}

/// The way to one.
#[derive(Debug)]
pub struct VirtualPerson(UnixDatagram);

impl VirtualPerson {
    /// The one of the glove at `port`, where there is one.
    pub fn at(port: &Path) -> Option<Self> {
        let socket = UnixDatagram::unbound().ok()?;
        socket.connect(place(port)).ok()?;
        socket.set_nonblocking(true).ok()?;
        Some(Self(socket))
    }

    /// Asks for a step. One that has gone does not hear it.
    pub fn ask(&self, step: Step) {
        let _ = self.0.send(request(step).as_bytes());
    }

    /// Asks for the hand pose that belongs to a gripper's counts.
    pub fn show(&self, counts: &[f32]) {
        let _ = self.0.send(request_to_show(counts).as_bytes());
    }

    /// Lets the hand do as it likes.
    pub fn let_go(&self) {
        let _ = self.0.send(b"move");
    }
}
