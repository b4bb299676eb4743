//! Virtual devices behind pseudo-terminals in the test's own process: their true state can be looked at, and faults put
//! on them.

use std::collections::VecDeque;
use std::os::fd::OwnedFd;

use host::realtime;
use rig::glove::VirtualGlove;
use rig::gripper::{Config, VirtualGripper};
use rig::pty::{Handle, PtyDevice};
use rig::{Device, Instant};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

/// A device behind a pseudo-terminal, and the path to it. It answers in time whatever else the computer does, where that is
/// allowed, as a real one would.
pub fn behind_pty(device: impl Device + 'static) -> (Handle, String) {
    let spawn = || PtyDevice::spawn(Box::new(device), None).unwrap();
    let (handle, _) = realtime::starting(spawn).unwrap();
    let path = handle.path().to_str().unwrap().to_owned();
    (handle, path)
}

/// A terminal with nobody behind it.
pub fn silent_port() -> (OwnedFd, String) {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&master).unwrap();
    unlockpt(&master).unwrap();
    let name = ptsname(&master, Vec::new()).unwrap();
    (master, name.into_string().unwrap())
}

/// A virtual gripper behind a pseudo-terminal, and a handle on its true state.
pub fn gripper(config: Config) -> (VirtualGripper, Handle, String) {
    let gripper = VirtualGripper::new(config);
    let (handle, path) = behind_pty(gripper.clone());
    (gripper, handle, path)
}

/// A virtual glove, its hand still, at `baud`.
pub fn glove(baud: u32) -> (VirtualGlove, Handle, String) {
    let config = rig::glove::Config::at_baud(baud);
    let glove = VirtualGlove::new(Box::new(|_: f64| [0.1; 25]), config);
    let (handle, path) = behind_pty(glove.clone());
    (glove, handle, path)
}

/// A device that answers each burst of bytes as a script says.
pub struct Scripted<F> {
    answer: F,
    heard: Vec<u8>,
    last: Instant,
    out: VecDeque<u8>,
}

/// Silence that ends a burst.
const GAP: rig::Duration = rig::Duration::from_micros(1_750);

impl<F: FnMut(&[u8]) -> Vec<u8> + Send> Scripted<F> {
    pub fn new(answer: F) -> Self {
        Self {
            answer,
            heard: Vec::new(),
            last: Instant::from_ticks(0),
            out: VecDeque::new(),
        }
    }
}

impl<F: FnMut(&[u8]) -> Vec<u8> + Send> Device for Scripted<F> {
    fn receive(&mut self, bytes: &[u8], now: Instant) {
        self.heard.extend_from_slice(bytes);
        self.last = now;
    }

    fn transmit(&mut self, now: Instant, out: &mut [u8]) -> usize {
        if !self.heard.is_empty() && now >= self.last + GAP {
            let heard = std::mem::take(&mut self.heard);
            self.out.extend((self.answer)(&heard));
        }
        let count = out.len().min(self.out.len());
        for (slot, byte) in out.iter_mut().zip(self.out.drain(..count)) {
            *slot = byte;
        }
        count
    }

    fn next_due(&self) -> Option<Instant> {
        (!self.heard.is_empty()).then(|| self.last + GAP)
    }

    fn baud(&self) -> u32 {
        115_200
    }
}

/// An RS-485 adapter that gives back what it is given, with a device behind it.
pub struct Echoing<D>(pub D, pub VecDeque<u8>);

impl<D: Device> Device for Echoing<D> {
    fn receive(&mut self, bytes: &[u8], now: Instant) {
        self.1.extend(bytes);
        self.0.receive(bytes, now);
    }

    fn transmit(&mut self, now: Instant, out: &mut [u8]) -> usize {
        let count = out.len().min(self.1.len());
        for (slot, byte) in out.iter_mut().zip(self.1.drain(..count)) {
            *slot = byte;
        }
        count + self.0.transmit(now, &mut out[count..])
    }

    fn next_due(&self) -> Option<Instant> {
        self.0.next_due()
    }

    fn baud(&self) -> u32 {
        self.0.baud()
    }
}
