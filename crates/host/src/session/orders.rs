//! What a bridge can be told, by as many as like to: one bounded queue, in which orders meet.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};

use bridge::timing::{HEARTBEAT_TIMEOUT, is_within};
use glove::calibration::Bound;
use gripper::{Duration, Instant};

use crate::clock::Clock;

/// Orders that may wait; a bridge in this process takes them every 10 ms.
const ORDERS: usize = 64;

/// What the bridge can be told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Close the clutch: an act of a person.
    Engage,
    /// Keep the clutch closed that was closed last: send one every 100 ms. It closes nothing.
    Heartbeat,
    /// Open the clutch: hold.
    Release,
    /// Activate the gripper: the fingers move.
    Activate,
    /// Take the headings of the profile's sensors from the flat hand, once it has been still for a second; within so long.
    FlatPose(Duration),
    /// Take the hand as flat, for virtual sensors that sit straight and share a heading, once it has been still for a second;
    /// within so long.
    CalibrateStraight(Duration),
    /// Take the newest flat pose or calibration back.
    UndoCalibration,
    /// Find flat poses while the hand works, or do not.
    FindFlat(bool),
    /// Hold, and end.
    Stop,
}

impl Order {
    /// Whether a person closes the clutch or activates the gripper by it.
    fn is_act(self) -> bool {
        matches!(self, Self::Engage | Self::Activate)
    }

    /// Whether it makes motion possible: then it counts only while it is young.
    fn moves(self) -> bool {
        matches!(self, Self::Engage | Self::Heartbeat | Self::Activate)
    }
}

/// An order, and when it was given. Between that and its being read a process can stand still.
#[derive(Debug, Clone, Copy)]
struct Given {
    order: Order,
    at: Instant,
}

/// A giver's end. Clones give into the same queue.
#[derive(Debug, Clone)]
pub struct Orders {
    queue: SyncSender<Given>,
    profile: Arc<Mutex<Option<Option<Bound>>>>,
    stop: Arc<AtomicBool>,
    too_late: Arc<AtomicU32>,
    clock: Clock,
}

impl Orders {
    /// Both ends of an empty queue.
    pub fn queue(clock: Clock) -> (Self, Queue) {
        let (queue, given) = sync_channel(ORDERS);
        let stop = Arc::new(AtomicBool::new(false));
        let too_late = Arc::new(AtomicU32::new(0));
        let profile = Arc::new(Mutex::new(None));
        let taken = Queue {
            given,
            profile: Arc::clone(&profile),
            stop: Arc::clone(&stop),
            too_late: Arc::clone(&too_late),
            clock,
        };
        let orders = Self {
            queue,
            profile,
            stop,
            too_late,
            clock,
        };
        (orders, taken)
    }

    /// Tells the bridge something; never waits. Returns whether it was taken: not when the queue is full or the bridge has
    /// ended. [`Order::Stop`] has a place of its own and is always taken.
    pub fn give(&self, order: Order) -> bool {
        if order == Order::Stop {
            self.stop.store(true, Ordering::Relaxed);
            return true;
        }
        let at = self.clock.now();
        self.queue.try_send(Given { order, at }).is_ok()
    }

    /// Gives the glove another profile, or none. It has a place of its own, in which the newest wins; events tell whether it was taken:
    /// not while the clutch is closed.
    pub fn set_profile(&self, profile: Option<Bound>) {
        let mut place = self.profile.lock().unwrap_or_else(PoisonError::into_inner);
        *place = Some(profile);
    }

    /// Orders to close the clutch or to activate that were passed over so far, since they were too old when they came, or that no
    /// bridge answered.
    pub fn too_late(&self) -> u32 {
        self.too_late.load(Ordering::Relaxed)
    }
}

/// The bridge's end.
#[derive(Debug)]
pub struct Queue {
    given: Receiver<Given>,
    profile: Arc<Mutex<Option<Option<Bound>>>>,
    stop: Arc<AtomicBool>,
    too_late: Arc<AtomicU32>,
    clock: Clock,
}

impl Queue {
    /// The newest profile that was given and not taken yet.
    pub fn profile(&self) -> Option<Option<Bound>> {
        let mut place = self.profile.lock().unwrap_or_else(PoisonError::into_inner);
        place.take()
    }

    /// The next order; never waits. What makes motion possible and is older than a heartbeat lasts is passed over, and all of
    /// it once the end was ordered.
    pub fn next(&self) -> Option<Order> {
        let ends = self.stop.load(Ordering::Relaxed);
        while let Ok(Given { order, at }) = self.given.try_recv() {
            let old = !is_within(self.clock.now(), at, HEARTBEAT_TIMEOUT);
            if !(order.moves() && (old || ends)) {
                return Some(order);
            }
            if old && order.is_act() {
                self.came_too_late();
            }
        }
        ends.then_some(Order::Stop)
    }

    /// An act did not reach the bridge while it was new.
    pub fn came_too_late(&self) {
        self.too_late.fetch_add(1, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_moves_is_passed_over_once_it_is_old_or_the_end_was_ordered() {
        let (orders, queue) = Orders::queue(Clock::start());
        assert!(orders.give(Order::Engage));
        std::thread::sleep(std::time::Duration::from_micros(
            HEARTBEAT_TIMEOUT.as_micros() + 1_000,
        ));
        assert!(orders.give(Order::Release));
        assert_eq!(queue.next(), Some(Order::Release), "the engagement is old");
        assert_eq!(orders.too_late(), 1, "and its giver can see so");
        assert_eq!(queue.next(), None);
        orders.give(Order::Activate);
        orders.clone().give(Order::Stop);
        assert_eq!(queue.next(), Some(Order::Stop));
    }

    #[test]
    fn a_full_queue_refuses_and_still_takes_the_end() {
        let (orders, queue) = Orders::queue(Clock::start());
        assert!((0..ORDERS).all(|_| orders.give(Order::Release)));
        assert!(!orders.give(Order::Heartbeat));
        assert!(orders.give(Order::Stop));
        assert!((0..ORDERS).all(|_| queue.next() == Some(Order::Release)));
        assert_eq!(queue.next(), Some(Order::Stop));
    }
}
