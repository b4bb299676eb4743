//! One motor of a gripper: a position in counts that moves at a finite speed until its target, its
//! limit or an obstacle.

/// How an axis stands to its target; the numbers are those of gDTx and gOBJ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Detection {
    Moving = 0,
    ContactOpening = 1,
    ContactClosing = 2,
    AtPosition = 3,
}

impl Detection {
    fn of_contact(closing: bool) -> Self {
        if closing {
            Self::ContactClosing
        } else {
            Self::ContactOpening
        }
    }
}

/// What an axis is asked to do in one tick.
#[derive(Debug, Clone, Copy)]
pub(super) struct Order {
    pub target: f32,
    /// Counts a second.
    pub speed: f32,
    pub force: u8,
    /// Software limits, counts.
    pub limits: (f32, f32),
}

/// A contact that holds the axis until something releases it.
#[derive(Debug, Clone, Copy)]
struct Contact {
    closing: bool,
    force: u8,
}

/// Ticks for which the motor current shows the squeeze after a contact.
const SQUEEZE_TICKS: u32 = 20;

#[derive(Debug, Clone)]
pub(super) struct Axis {
    pub position: f32,
    /// Closing meets something here, counts.
    pub object: Option<f32>,
    /// Opening meets something here, counts.
    pub inner_object: Option<f32>,
    /// Software limits in place of the model's, counts.
    pub limits: Option<(f32, f32)>,
    /// Its motor does not turn, whatever it is told.
    pub dead: bool,
    pub detection: Detection,
    contact: Option<Contact>,
    moving: bool,
    closing: bool,
    squeeze: u32,
    /// How often it has started to move.
    pub motions: u64,
}

impl Axis {
    pub fn new(position: f32) -> Self {
        Self {
            position,
            object: None,
            inner_object: None,
            limits: None,
            dead: false,
            detection: Detection::AtPosition,
            contact: None,
            moving: false,
            closing: false,
            squeeze: 0,
            motions: 0,
        }
    }

    /// Moves on for `seconds`. `blocked_at` tells whether the position it would take is barred by
    /// another axis; returns whether that happened.
    pub fn step(&mut self, order: &Order, seconds: f32, blocked_at: impl Fn(f32) -> bool) -> bool {
        self.squeeze = self.squeeze.saturating_sub(1);
        if self.dead {
            self.still();
            return false;
        }
        let (open, closed) = self.limits.unwrap_or(order.limits);
        let target = order.target.clamp(open, closed);
        if self.held_by_contact(order) {
            self.still();
            return false;
        }
        let left = target - self.position;
        if left.abs() < 1e-3 {
            self.still();
            self.detection = Detection::AtPosition;
            return false;
        }
        let closing = left > 0.0;
        let reach = (order.speed * seconds).min(left.abs());
        let mut next = self.position + if closing { reach } else { -reach };
        let obstacle = if closing {
            self.object
        } else {
            self.inner_object
        };
        let met = obstacle.filter(|at| if closing { next >= *at } else { next <= *at });
        if let Some(at) = met {
            // An object put where the finger already is does not push it back.
            next = if closing {
                at.max(self.position)
            } else {
                at.min(self.position)
            };
        }
        if blocked_at(next) {
            // Not a contact: it goes on by itself as soon as the other axis makes room.
            self.still();
            self.detection = Detection::of_contact(closing);
            return true;
        }
        self.go_to(next, closing);
        if met.is_some() {
            self.touch(closing, order.force);
        } else if (target - next).abs() < 1e-3 {
            self.still();
            self.detection = Detection::AtPosition;
        }
        false
    }

    /// Stands still without a target.
    pub fn halt(&mut self) {
        self.still();
        self.squeeze = 0;
        self.detection = Detection::Moving;
    }

    /// Lets go of a contact, as a toggle of rGTO does.
    pub fn release_contact(&mut self) {
        self.contact = None;
    }

    pub fn is_moving(&self) -> bool {
        self.moving
    }

    /// Motor current in counts of 10 mA: `running` (closing, opening) while it moves, more for a
    /// moment after a contact, 0 at rest (the gears hold).
    pub fn current(&self, running: (u8, u8)) -> u8 {
        match (self.moving, self.closing) {
            (true, true) => running.0,
            (true, false) => running.1,
            _ if self.squeeze > 0 => running.0 + self.contact.map_or(0, |c| c.force / 8),
            _ => 0,
        }
    }

    /// The position as its register shows it.
    pub fn counts(&self) -> u8 {
        // The cast saturates.
        self.position.round() as u8
    }

    /// Whether a contact still holds it: it moves again only on an opposite target or a higher force.
    fn held_by_contact(&mut self, order: &Order) -> bool {
        let Some(contact) = self.contact else {
            return false;
        };
        let opposite = if contact.closing {
            order.target < self.position - 0.5
        } else {
            order.target > self.position + 0.5
        };
        if opposite || order.force > contact.force {
            self.contact = None;
            return false;
        }
        true
    }

    fn go_to(&mut self, next: f32, closing: bool) {
        let changed = (next - self.position).abs() > 1e-6;
        if changed && !self.moving {
            self.motions += 1;
        }
        self.moving = changed;
        self.closing = closing;
        self.position = next;
        self.detection = Detection::Moving;
    }

    fn touch(&mut self, closing: bool, force: u8) {
        if self.contact.is_none() {
            self.squeeze = SQUEEZE_TICKS;
        }
        self.still();
        self.contact = Some(Contact { closing, force });
        self.detection = Detection::of_contact(closing);
    }

    fn still(&mut self) {
        self.moving = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order(target: f32, force: u8) -> Order {
        Order {
            target,
            speed: 100.0,
            force,
            limits: (6.0, 249.0),
        }
    }

    fn run(axis: &mut Axis, order: &Order, ticks: usize) {
        for _ in 0..ticks {
            axis.step(order, 0.005, |_| false);
        }
    }

    #[test]
    fn an_axis_moves_at_its_speed_and_stops_inside_its_limits() {
        let mut axis = Axis::new(6.0);
        run(&mut axis, &order(255.0, 0), 100);
        assert!((axis.position - 56.0).abs() < 0.01, "{}", axis.position);
        assert_eq!(axis.detection, Detection::Moving);
        run(&mut axis, &order(255.0, 0), 500);
        assert_eq!(axis.counts(), 249);
        assert_eq!(axis.detection, Detection::AtPosition);
        assert_eq!(axis.motions, 1);
    }

    #[test]
    fn after_a_contact_only_opposite_higher_or_toggled_moves_it() {
        let mut axis = Axis::new(6.0);
        axis.object = Some(100.0);
        run(&mut axis, &order(200.0, 50), 400);
        assert_eq!(
            (axis.counts(), axis.detection),
            (100, Detection::ContactClosing)
        );
        axis.object = None;
        run(&mut axis, &order(250.0, 50), 10);
        assert_eq!(
            axis.counts(),
            100,
            "further in the same direction does nothing"
        );
        let mut stronger = axis.clone();
        run(&mut stronger, &order(200.0, 51), 10);
        assert!(stronger.position > 100.0);
        let mut opened = axis.clone();
        run(&mut opened, &order(50.0, 50), 10);
        assert!(opened.position < 100.0);
        axis.release_contact();
        run(&mut axis, &order(200.0, 50), 10);
        assert!(axis.position > 100.0);
    }
}
