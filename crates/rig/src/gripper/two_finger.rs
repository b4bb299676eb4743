//! The 2F-85, 2F-140 and Hand-E controller: 6 command bytes in, 6 status bytes out (hardware.md §2).

use super::axis::{Axis, Order};

/// Software limits: open reads 0D in the manuals' examples; the closed end is assumed.
const LIMITS: (f32, f32) = (13.0, 230.0);
/// Motor current while closing and opening, 10 mA a count.
const CURRENT: (u8, u8) = (10, 10);
/// Without a request for this many ticks of 5 ms the communication counts as lost.
const SILENCE_TICKS: u32 = 200;
/// A re-activation without a power cut moves nothing (assumed); its ticks.
const REACTIVATION_TICKS: u32 = 100;

mod fault {
    pub const ACTIVATE_FIRST: u8 = 0x05;
    pub const NOT_ACTIVATED: u8 = 0x07;
    pub const SILENCE: u8 = 0x09;
    pub const UNDER_VOLTAGE: u8 = 0x0A;
    pub const RELEASING: u8 = 0x0B;
    pub const RELEASED: u8 = 0x0F;
}

/// What tells the three of them apart here.
#[derive(Debug, Clone, Copy)]
pub(super) struct Traits {
    /// Slowest and fastest, counts a second.
    pub speed: (f32, f32),
    /// Whether rARD = 1 means that the automatic release opens (sources differ).
    pub ard_opens: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Reset,
    Closing,
    Opening,
    Reactivating { ticks: u32 },
    Ready,
    Releasing,
    Failed,
}

/// Controller and motor.
#[derive(Debug, Clone)]
pub(super) struct TwoFinger {
    pub axis: Axis,
    traits: Traits,
    state: State,
    going: bool,
    was_activated: bool,
    echo: u8,
    fault: u8,
    pub injected: Option<u8>,
    silent_ticks: u32,
}

impl TwoFinger {
    pub fn new(start: f32, traits: Traits) -> Self {
        Self {
            axis: Axis::new(start.clamp(LIMITS.0, LIMITS.1)),
            traits,
            state: State::Reset,
            going: false,
            was_activated: false,
            echo: 0,
            fault: 0,
            injected: None,
            silent_ticks: 0,
        }
    }

    /// Tells it that a request has come.
    pub fn heard(&mut self) {
        self.silent_ticks = 0;
    }

    /// One refresh of the registers.
    pub fn tick(&mut self, block: &[u8; 16], seconds: f32) {
        self.silent_ticks = self.silent_ticks.saturating_add(1);
        let [action, _, _, position, rate, force, ..] = *block;
        let (activate, go, release) = (action & 1 != 0, action & 8 != 0, action & 0x10 != 0);
        if !activate {
            self.reset(go);
            return;
        }
        if self.state == State::Reset {
            self.state = if self.was_activated {
                State::Reactivating {
                    ticks: REACTIVATION_TICKS,
                }
            } else {
                State::Closing
            };
        }
        if self
            .injected
            .is_some_and(|code| code >= fault::UNDER_VOLTAGE && code != fault::RELEASING)
        {
            self.state = State::Failed;
            self.fault = self.injected.unwrap_or(0);
        } else if release && !matches!(self.state, State::Releasing | State::Failed) {
            self.state = State::Releasing;
            self.axis.release_contact();
        }
        match self.state {
            State::Reset | State::Failed => self.axis.halt(),
            State::Closing | State::Opening | State::Reactivating { .. } => {
                self.fault = if go { fault::ACTIVATE_FIRST } else { 0 };
                self.activate(seconds);
            }
            State::Ready => self.follow(go, position, rate, force, seconds),
            State::Releasing => self.release(action & 0x20 != 0, seconds),
        }
    }

    /// Activated without the motion that belongs to it.
    pub fn preset_active(&mut self) {
        self.was_activated = true;
        self.ready();
    }

    /// The status block: 6 bytes, the rest 0.
    pub fn status(&self) -> [u8; 16] {
        let sta: u8 = match self.state {
            // The manual: reset, or automatic release.
            State::Reset | State::Releasing => 0,
            State::Failed if self.fault == fault::RELEASED => 0,
            State::Closing | State::Opening | State::Reactivating { .. } => 1,
            State::Ready | State::Failed => 3,
        };
        let object = if self.going {
            self.axis.detection as u8
        } else {
            0
        };
        let activated = u8::from(self.state != State::Reset);
        let lost = self.silent_ticks > SILENCE_TICKS && self.fault == 0;
        let fault = if lost { fault::SILENCE } else { self.fault };
        let mut block = [0; 16];
        block[0] = activated | u8::from(self.going) << 3 | sta << 4 | object << 6;
        block[2] = self.injected.unwrap_or(fault);
        block[3] = self.echo;
        block[4] = self.axis.counts();
        block[5] = self.axis.current(CURRENT);
        block
    }

    /// Whether a tick with an unchanged command would change nothing.
    pub fn is_settled(&self) -> bool {
        let waiting = !matches!(self.state, State::Reset | State::Ready | State::Failed);
        !waiting && self.axis.current(CURRENT) == 0 && self.silent_ticks > SILENCE_TICKS
    }

    fn reset(&mut self, go: bool) {
        self.state = State::Reset;
        self.going = false;
        self.echo = 0;
        if self
            .injected
            .is_some_and(|code| code >= fault::UNDER_VOLTAGE)
        {
            self.injected = None;
        }
        self.fault = if go { fault::NOT_ACTIVATED } else { 0 };
        self.axis.halt();
        self.axis.release_contact();
    }

    fn activate(&mut self, seconds: f32) {
        let state = self.state;
        match state {
            State::Reactivating { ticks: 0 } => self.ready(),
            State::Reactivating { ticks } => self.state = State::Reactivating { ticks: ticks - 1 },
            State::Closing if self.sweep(LIMITS.1, self.traits.speed.1, seconds) => {
                self.axis.release_contact();
                self.state = State::Opening;
            }
            State::Opening if self.sweep(LIMITS.0, self.traits.speed.1, seconds) => {
                self.was_activated = true;
                self.ready();
            }
            _ => {}
        }
    }

    fn ready(&mut self) {
        self.state = State::Ready;
        self.fault = 0;
        self.axis.halt();
        self.axis.release_contact();
    }

    fn release(&mut self, direction_bit: bool, seconds: f32) {
        self.fault = fault::RELEASING;
        self.going = false;
        let opens = direction_bit == self.traits.ard_opens;
        let target = if opens { LIMITS.0 } else { LIMITS.1 };
        if self.sweep(target, self.traits.speed.0, seconds) {
            self.state = State::Failed;
            self.fault = fault::RELEASED;
        }
    }

    fn sweep(&mut self, target: f32, speed: f32, seconds: f32) -> bool {
        self.axis.step(
            &Order {
                target,
                speed,
                force: 0,
                limits: LIMITS,
            },
            seconds,
            |_| false,
        );
        !self.axis.is_moving()
    }

    fn follow(&mut self, go: bool, position: u8, rate: u8, force: u8, seconds: f32) {
        self.echo = position;
        if go && !self.going {
            self.axis.release_contact();
        }
        self.going = go;
        self.fault = 0;
        if !go {
            self.axis.halt();
            return;
        }
        let (slow, fast) = self.traits.speed;
        let order = Order {
            target: f32::from(position),
            speed: slow + (fast - slow) * f32::from(rate) / 255.0,
            force,
            limits: LIMITS,
        };
        self.axis.step(&order, seconds, |_| false);
    }
}
