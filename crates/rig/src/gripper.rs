//! The virtual gripper: Robotiq registers behind Modbus (hardware.md §1, §2, §5).
//!
//! One value stands for the gripper; clones share it. As a [`Device`] it speaks Modbus RTU on a serial
//! line; [`tcp`] gives the same gripper a Modbus TCP face. Registers are refreshed at 200 Hz: what is
//! written counts from the next refresh on, and what is read is as old as the last.

mod axis;
mod config;
mod server;
pub mod tcp;
mod three_finger;
mod two_finger;

use std::sync::{Arc, Mutex, MutexGuard};

use crate::clock::lock;
use crate::{Device, Duration, Instant};
use server::{Model, Server};

pub use config::{Config, Family, Liar, REFRESH};

/// The gripper. Clones share one: keep one to look at its true state and to put faults on it.
///
/// A one-axis gripper's axis is number 0; the other three read 0. Positions are those of the last
/// refresh.
#[derive(Clone)]
pub struct VirtualGripper {
    server: Arc<Mutex<Server>>,
}

impl VirtualGripper {
    /// A gripper that was just powered on: not activated.
    #[must_use]
    pub fn new(config: Config) -> Self {
        Self {
            server: Arc::new(Mutex::new(Server::new(config))),
        }
    }

    fn server(&self) -> MutexGuard<'_, Server> {
        lock(&self.server)
    }

    fn axes<T: Default + Copy>(&self, value: impl Fn(&axis::Axis) -> T) -> [T; 4] {
        match &self.server().model {
            Model::Three(three) => core::array::from_fn(|i| value(&three.axes[i])),
            Model::Two(two) => [value(&two.axis), T::default(), T::default(), T::default()],
        }
    }

    fn with_axis(&self, index: usize, act: impl FnOnce(&mut axis::Axis)) {
        match &mut self.server().model {
            Model::Three(three) => three.axes.get_mut(index).map(act),
            Model::Two(two) => (index == 0).then(|| act(&mut two.axis)),
        };
    }

    /// Lets the gripper move on to `now` without a request.
    pub fn run_until(&self, now: Instant) {
        self.server().run_until(now);
    }

    /// True positions of fingers A, B, C and the scissor, in counts with their fraction.
    #[must_use]
    pub fn positions(&self) -> [f32; 4] {
        self.axes(|a| a.position)
    }

    /// How often an axis has started to move, all axes together.
    #[must_use]
    pub fn motions(&self) -> u64 {
        self.axes(|a| a.motions).iter().sum()
    }

    /// Whether any axis moves.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        self.axes(axis::Axis::is_moving).contains(&true)
    }

    /// The command block as last written.
    #[must_use]
    pub fn command_block(&self) -> [u8; 16] {
        self.server().command
    }

    /// The status block as a read would give it now.
    #[must_use]
    pub fn status_block(&self) -> [u8; 16] {
        self.server().status()
    }

    /// How often the command block was written, by any function.
    #[must_use]
    pub fn writes(&self) -> u64 {
        self.server().writes
    }

    /// Requests answered, and frames that got silence although they were for this unit or broken.
    #[must_use]
    pub fn requests(&self) -> (u64, u64) {
        let server = self.server();
        (server.requests, server.refused)
    }

    /// Puts an axis somewhere by hand.
    pub fn set_position(&self, index: usize, counts: f32) {
        self.with_axis(index, |a| a.position = counts);
    }

    /// Makes it what a program finds that starts anew beside a running gripper: activated, rACT set in
    /// the command block, nothing moving.
    pub fn preset_active(&self) {
        let mut server = self.server();
        server.command = [0; 16];
        server.command[0] = 0x01;
        match &mut server.model {
            Model::Three(three) => three.preset_active(),
            Model::Two(two) => two.preset_active(),
        }
        server.show_status();
    }

    /// Puts an object where axis `index` meets it when it closes, or takes it away.
    pub fn set_object(&self, index: usize, at: Option<f32>) {
        self.with_axis(index, |a| a.object = at);
    }

    /// Puts an object where axis `index` meets it when it opens, or takes it away.
    pub fn set_inner_object(&self, index: usize, at: Option<f32>) {
        self.with_axis(index, |a| a.inner_object = at);
    }

    /// Puts the software limits of axis `index` at these counts, or back where the model has them.
    pub fn set_limits(&self, index: usize, limits: Option<(f32, f32)>) {
        self.with_axis(index, |a| a.limits = limits);
    }

    /// Shows fault `code` (0 to F) from the next refresh on; a major one stops everything until rACT
    /// falls, the others stay until `None`.
    pub fn set_fault(&self, code: Option<u8>) {
        let code = code.map(|c| c & 0x0F);
        match &mut self.server().model {
            Model::Three(three) => three.injected = code,
            Model::Two(two) => two.injected = code,
        }
    }

    /// Lets the status say that axis `index` is `counts` from where it truly is.
    pub fn set_shown_offset(&self, index: usize, counts: i16) {
        let mut server = self.server();
        if let Some(offset) = server.lies.position.get_mut(index) {
            *offset = counts.clamp(-255, 255);
        }
        server.show_status();
    }

    /// Lets every echo read this, whatever was written; or be true again.
    pub fn set_shown_echo(&self, echo: Option<u8>) {
        let mut server = self.server();
        server.lies.echo = echo;
        server.show_status();
    }

    /// Lets the position of axis `index` read this wherever it is, or what it is again.
    pub fn set_shown_position(&self, index: usize, counts: Option<u8>) {
        let mut server = self.server();
        if let Some(shown) = server.lies.shown.get_mut(index) {
            *shown = counts;
        }
        server.show_status();
    }

    /// Lets every position read anything at all, another number at each refresh, by `seed`; or be true again.
    pub fn scatter_shown_positions(&self, seed: Option<u64>) {
        let mut server = self.server();
        server.lies.scattered = seed;
        server.show_status();
    }

    /// Lets the contact of every axis (0 to 3, as gDTx and gOBJ have it) read this; or be true again.
    pub fn set_shown_contact(&self, contact: Option<u8>) {
        let mut server = self.server();
        server.lies.contact = contact.map(|bits| bits & 3);
        server.show_status();
    }

    /// Lets `liar` change the status block each time it is read, before it gets its (right) check sum; or be true again.
    pub fn set_liar(&self, liar: Option<Liar>) {
        self.server().liar = liar;
    }

    /// Writes `bytes` into the command block from `first` on, as another master on the line does.
    pub fn overwrite_command(&self, first: usize, bytes: &[u8]) {
        let mut server = self.server();
        let place = server.command.iter_mut().skip(first);
        place.zip(bytes).for_each(|(place, byte)| *place = *byte);
    }

    /// Switches its power off, in whatever it is doing, or on again: it stands where it stood, and has to be activated.
    pub fn power(&self, on: bool) {
        self.server().power(on);
    }

    /// Stops the motor of axis `index` for good, or lets it turn again; its contact stays as it was.
    pub fn set_dead(&self, index: usize, dead: bool) {
        self.with_axis(index, |a| a.dead = dead);
    }

    /// Swallows the answers to the next `count` requests (they are carried out); `u32::MAX` for ever.
    pub fn mute(&self, count: u32) {
        self.server().mute = count;
    }

    /// Sends every answer this much later.
    pub fn set_reply_delay(&self, delay: Duration) {
        self.server().reply_delay = delay;
    }
}

impl Device for VirtualGripper {
    fn receive(&mut self, bytes: &[u8], now: Instant) {
        let mut server = self.server();
        for byte in bytes {
            server.receive(*byte, now);
        }
    }

    fn transmit(&mut self, now: Instant, out: &mut [u8]) -> usize {
        self.server().transmit(now, out)
    }

    fn next_due(&self) -> Option<Instant> {
        self.server().next_due()
    }

    fn baud(&self) -> u32 {
        self.server().config.baud
    }
}
