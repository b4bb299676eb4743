//! The 3-Finger Adaptive Gripper's controller: command block in, status block out, once every 5 ms
//! (hardware.md §1; Robotiq instruction manual, register tables).
//!
//! Where the documents are silent the choice made here is said beside it with "assumed".

use super::axis::{Axis, Detection, Order};

/// Position register of the scissor in basic mode.
const NEUTRAL_SCISSOR: f32 = 137.0;
/// Scissor positions of basic, pinch, wide and scissor mode (all but the first assumed).
const MODE_SCISSOR: [f32; 4] = [NEUTRAL_SCISSOR, 249.0, 6.0, NEUTRAL_SCISSOR];
/// Software limits of fingers A, B, C and the scissor: fully open reads 7, 6, 6.
const LIMITS: [(f32, f32); 4] = [(7.0, 249.0), (6.0, 249.0), (6.0, 249.0), (6.0, 249.0)];
/// Scissor limits under rICS, reduced so that B and C cannot meet (by how much is assumed).
const INDIVIDUAL_SCISSOR: (f32, f32) = (16.0, 239.0);
/// Fingertip 22 to 110 mm/s, 155 mm over 255 counts.
const SPEED: (f32, f32) = (36.2, 181.0);
/// Motor current while closing and while opening, 10 mA a count, from the manual's examples.
const CURRENT: [(u8, u8); 4] = [(15, 11), (16, 14), (15, 11), (12, 12)];
/// An axis barred by another for this many ticks is an interference (assumed).
const INTERFERENCE_TICKS: u32 = 40;
/// 20 s of it make a major fault.
const INTERFERENCE_FATAL_TICKS: u32 = 4_000;

mod fault {
    pub const ACTIVATE_FIRST: u8 = 0x05;
    pub const MODE_FIRST: u8 = 0x06;
    pub const NOT_ACTIVATED: u8 = 0x07;
    pub const INTERFERENCE: u8 = 0x0A;
    pub const RELEASING: u8 = 0x0B;
    pub const ACTIVATION: u8 = 0x0D;
    pub const INTERFERENCE_LONG: u8 = 0x0E;
    pub const RELEASED: u8 = 0x0F;
}

/// The region fingers cannot enter together: scissor at or above the first number while A plus B or
/// A plus C is at or above the second. A little inside what the paper's configuration space forbids.
const INTERFERENCE: (f32, f32) = (200.0, 310.0);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Reset,
    Closing,
    Opening,
    ChangingMode,
    Ready,
    Releasing,
    /// A major fault: nothing moves until rACT falls.
    Failed,
}

/// Controller and motors.
#[derive(Debug, Clone)]
pub(super) struct ThreeFinger {
    pub axes: [Axis; 4],
    state: State,
    mode: u8,
    individual_scissor: bool,
    going: bool,
    echo: [u8; 4],
    fault: u8,
    pub injected: Option<u8>,
    barred_ticks: u32,
}

/// The command block, decoded.
struct Command {
    activate: bool,
    mode: u8,
    go: bool,
    release: bool,
    individual_fingers: bool,
    individual_scissor: bool,
    /// Position, speed, force of A, B, C, scissor.
    axes: [[u8; 3]; 4],
}

impl Command {
    fn decode(block: &[u8; 16]) -> Self {
        let axis = |at: usize| [block[at], block[at + 1], block[at + 2]];
        Self {
            activate: block[0] & 0x01 != 0,
            mode: block[0] >> 1 & 3,
            go: block[0] & 0x08 != 0,
            release: block[0] & 0x10 != 0,
            individual_fingers: block[1] & 0x04 != 0,
            individual_scissor: block[1] & 0x08 != 0,
            axes: [axis(3), axis(6), axis(9), axis(12)],
        }
    }
}

fn speed(register: u8) -> f32 {
    SPEED.0 + (SPEED.1 - SPEED.0) * f32::from(register) / 255.0
}

fn interferes(p: [f32; 4]) -> bool {
    let [a, b, c, scissor] = p;
    scissor >= INTERFERENCE.0 && a + b.max(c) >= INTERFERENCE.1
}

impl ThreeFinger {
    pub fn new(start: [f32; 4]) -> Self {
        Self {
            axes: start.map(Axis::new),
            state: State::Reset,
            mode: 0,
            individual_scissor: false,
            going: false,
            echo: [0; 4],
            fault: 0,
            injected: None,
            barred_ticks: 0,
        }
    }

    /// One refresh of the registers: takes the command block and moves on for `seconds`.
    pub fn tick(&mut self, block: &[u8; 16], seconds: f32) {
        let command = Command::decode(block);
        if !command.activate {
            self.reset(&command);
            return;
        }
        if self.state == State::Reset {
            self.state = State::Closing;
        }
        if self.injected.is_some_and(|code| code >= fault::ACTIVATION) {
            self.state = State::Failed;
            self.fault = self.injected.unwrap_or(0);
        } else if command.release && !matches!(self.state, State::Releasing | State::Failed) {
            self.state = State::Releasing;
            self.axes.iter_mut().for_each(Axis::release_contact);
        }
        match self.state {
            State::Reset | State::Failed => self.axes.iter_mut().for_each(Axis::halt),
            State::Closing | State::Opening => {
                self.fault = if command.go { fault::ACTIVATE_FIRST } else { 0 };
                self.activate(seconds);
            }
            State::ChangingMode => {
                self.fault = if command.go { fault::MODE_FIRST } else { 0 };
                self.change_mode(&command, seconds);
            }
            State::Ready => self.follow(&command, seconds),
            State::Releasing => self.release(seconds),
        }
    }

    /// Activated without the motion that belongs to it.
    pub fn preset_active(&mut self) {
        self.ready();
    }

    /// The status block.
    pub fn status(&self) -> [u8; 16] {
        let imc: u8 = match self.state {
            State::Reset | State::Releasing => 0,
            State::Failed if self.fault == fault::RELEASED => 0,
            State::Closing | State::Opening => 1,
            State::ChangingMode => 2,
            State::Ready | State::Failed => 3,
        };
        let activated = self.state != State::Reset;
        let mut block = [0; 16];
        block[0] = u8::from(activated) | self.mode << 1 | u8::from(self.going) << 3 | imc << 4;
        if self.going {
            block[0] |= self.stopped() << 6;
            let detections = self.axes.iter().enumerate();
            block[1] = detections.fold(0, |byte, (i, axis)| {
                byte | (axis.detection as u8) << (2 * i)
            });
        }
        block[2] = self.injected.unwrap_or(self.fault);
        for (i, axis) in self.axes.iter().enumerate() {
            let at = 3 + 3 * i;
            block[at] = self.echo[i];
            block[at + 1] = axis.counts();
            block[at + 2] = axis.current(CURRENT[i]);
        }
        block
    }

    /// Whether a tick with an unchanged command would change nothing.
    pub fn is_settled(&self) -> bool {
        let waiting = !matches!(self.state, State::Reset | State::Ready | State::Failed);
        let busy = self.axes.iter().enumerate();
        let busy = busy
            .clone()
            .any(|(i, a)| a.is_moving() || a.current(CURRENT[i]) > 0);
        !waiting && !busy && self.barred_ticks == 0
    }

    /// gSTA: 0 moving, 1 one or two fingers short of the target, 2 all three short, 3 all there.
    fn stopped(&self) -> u8 {
        let fingers = &self.axes[..3];
        if self
            .axes
            .iter()
            .any(|a| a.is_moving() || a.detection == Detection::Moving)
        {
            return 0;
        }
        match fingers
            .iter()
            .filter(|a| a.detection != Detection::AtPosition)
            .count()
        {
            0 => 3,
            3 => 2,
            _ => 1,
        }
    }

    fn reset(&mut self, command: &Command) {
        self.state = State::Reset;
        self.going = false;
        self.echo = [0; 4];
        self.barred_ticks = 0;
        self.individual_scissor = false;
        if self.injected.is_some_and(|code| code >= fault::ACTIVATION) {
            self.injected = None;
        }
        self.fault = if command.go { fault::NOT_ACTIVATED } else { 0 };
        for axis in &mut self.axes {
            axis.halt();
            axis.release_contact();
        }
    }

    /// Every activation, one after a reset, too, closes and opens the fingers and centres the scissor.
    fn activate(&mut self, seconds: f32) {
        let state = self.state;
        match state {
            State::Closing
                if self.sweep([249.0, 249.0, 249.0, NEUTRAL_SCISSOR], SPEED.1, seconds) =>
            {
                self.axes.iter_mut().for_each(Axis::release_contact);
                self.state = State::Opening;
            }
            State::Opening if self.sweep([0.0, 0.0, 0.0, NEUTRAL_SCISSOR], SPEED.1, seconds) => {
                self.mode = 0;
                self.ready();
            }
            _ => {}
        }
    }

    fn ready(&mut self) {
        self.state = State::Ready;
        self.fault = 0;
        for axis in &mut self.axes {
            axis.halt();
            axis.release_contact();
        }
    }

    fn release(&mut self, seconds: f32) {
        self.fault = fault::RELEASING;
        self.going = false;
        let scissor = self.axes[3].position;
        if self.sweep([0.0, 0.0, 0.0, scissor], SPEED.0, seconds) {
            self.state = State::Failed;
            self.fault = fault::RELEASED;
        }
    }

    fn change_mode(&mut self, command: &Command, seconds: f32) {
        self.mode = command.mode;
        let [a, b, c, _] = self.positions();
        // Fingers stay where they are (assumed), but for scissor mode, which opens them.
        let fingers = if self.mode == 3 { [0.0; 3] } else { [a, b, c] };
        let [a, b, c] = fingers;
        let scissor = MODE_SCISSOR[usize::from(self.mode & 3)];
        let here = self.axes[3].position;
        let barred = scissor > here && interferes([a, b, c, here + 1.0]);
        self.count_interference(barred);
        if barred {
            // It waits for the fingers to open, or for another mode.
            self.axes.iter_mut().for_each(Axis::halt);
        } else if self.sweep([a, b, c, scissor], SPEED.1, seconds) {
            self.ready();
        }
    }

    /// Moves all axes towards `targets`; true when all stand.
    fn sweep(&mut self, targets: [f32; 4], speed: f32, seconds: f32) -> bool {
        for (i, axis) in self.axes.iter_mut().enumerate() {
            let order = Order {
                target: targets[i],
                speed,
                force: 0,
                limits: LIMITS[i],
            };
            axis.step(&order, seconds, |_| false);
        }
        !self.axes.iter().any(Axis::is_moving)
    }

    fn positions(&self) -> [f32; 4] {
        core::array::from_fn(|i| self.axes[i].position)
    }

    fn follow(&mut self, command: &Command, seconds: f32) {
        let scissor_let_go = self.individual_scissor && !command.individual_scissor;
        let other_mode = !command.individual_scissor && command.mode != self.mode;
        self.individual_scissor = command.individual_scissor;
        if scissor_let_go || other_mode {
            self.state = State::ChangingMode;
            self.going = false;
            self.axes.iter_mut().for_each(Axis::release_contact);
            self.fault = if command.go { fault::MODE_FIRST } else { 0 };
            self.change_mode(command, seconds);
            return;
        }
        self.echo = command.axes.map(|[position, ..]| position);
        if command.go && !self.going {
            self.axes.iter_mut().for_each(Axis::release_contact);
        }
        self.going = command.go;
        self.fault = 0;
        if !command.go {
            self.barred_ticks = 0;
            self.axes.iter_mut().for_each(Axis::halt);
            return;
        }
        let orders = self.orders(command);
        self.move_axes(&orders, command, seconds);
    }

    /// What each axis is to do: rICS before rICF before simplified control.
    fn orders(&self, command: &Command) -> [Order; 4] {
        let [all, ..] = command.axes;
        let stay = |i: usize| Order {
            target: self.axes[i].position,
            speed: 0.0,
            force: 0,
            limits: (0.0, 255.0),
        };
        core::array::from_fn(|i| {
            let individual = if i == 3 {
                command.individual_scissor
            } else {
                command.individual_fingers
            };
            let scissor_mode =
                self.mode == 3 && !command.individual_scissor && !command.individual_fingers;
            let [position, rate, force] = match (individual, i == 3) {
                (true, _) => command.axes[i],
                (false, true) if scissor_mode => all,
                (false, true) => return stay(i),
                (false, false) if scissor_mode => return stay(i),
                (false, false) => all,
            };
            let limits = match (i, command.individual_scissor) {
                (3, true) => INDIVIDUAL_SCISSOR,
                _ => LIMITS[i],
            };
            Order {
                target: f32::from(position),
                speed: speed(rate),
                force,
                limits,
            }
        })
    }

    fn move_axes(&mut self, orders: &[Order; 4], command: &Command, seconds: f32) {
        let mut barred = false;
        for (i, order) in orders.iter().enumerate() {
            let others = self.positions();
            let deeper = |next: f32| {
                let mut p = others;
                p[i] = next;
                interferes(p) && next > others[i]
            };
            barred |= self.axes[i].step(order, seconds, deeper);
            barred |=
                deeper(self.axes[i].position + 1.0) && order.target > self.axes[i].position + 1.0;
        }
        // The fault is the scissor's: fingers that meet while the mode has it touch each other, as an object.
        self.count_interference(barred && command.individual_scissor);
    }

    /// Fingers and scissor have barred each other's way in this tick, or not: a fault where it lasts.
    fn count_interference(&mut self, barred: bool) {
        self.barred_ticks = if barred { self.barred_ticks + 1 } else { 0 };
        if self.barred_ticks >= INTERFERENCE_FATAL_TICKS {
            self.state = State::Failed;
            self.fault = fault::INTERFERENCE_LONG;
        } else if self.barred_ticks >= INTERFERENCE_TICKS {
            self.fault = fault::INTERFERENCE;
        }
    }
}
