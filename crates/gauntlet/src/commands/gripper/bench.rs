//! Both families of drivers as a person at a bench uses them: asked, watched, within deadlines.

use std::ops::ControlFlow;
use std::time::Duration;

use host::gripper::driver::{Control, Outcome, Task, ThreeFinger, TwoFinger};
use host::gripper::registers::{three_finger, two_finger};
use host::gripper::travel::Speed;
use host::gripper::{Event, Gripper, Status, link};

use host::clock::Clock;
use host::clock::ticks;
use host::interrupt::Interrupt;
use host::lines::Line;
use host::lines::tcp;

/// Time a gripper gets to answer a first status read.
pub const ANSWER_WAIT: Duration = Duration::from_secs(3);
/// Pause between two looks at the line.
const LOOK: Duration = Duration::from_millis(1);
/// A longer one the process did not choose.
const STALL: host::gripper::Duration = host::gripper::Duration::from_millis(250);

/// What the verbs need of a driver beyond [`Gripper`].
pub trait Bench<const X: usize>: Gripper<X, Error = host::gripper::Error> {
    /// Registers' bytes of the newest status.
    fn raw(&self) -> Option<Vec<u8>>;
    /// Whether the gripper repeats the newest motion.
    fn accepted(&self) -> bool;
    /// The task under way, or how the last one ended.
    fn outcome(&self) -> (Option<Task>, Option<(Task, Outcome)>);
    /// Clears rACT.
    fn reset(&mut self);
    /// Automatic release; `false` where the family cannot close in it.
    fn release(&mut self, closing: bool) -> bool;
    /// Another grasping mode; `false` where the family has none.
    fn set_mode(&mut self, mode: three_finger::Mode) -> bool;
    /// Which axes follow their own positions; nothing for a family of one axis.
    fn set_control(&mut self, control: Control);
    /// Whether one position is the scissor's.
    fn is_in_scissor_mode(&self) -> bool;
    /// Whether it is in the mode in which finger A closes between the others.
    fn is_in_pinch_mode(&self) -> bool {
        false
    }
    /// The gripper's name and those of its axes.
    fn names(&self) -> (&'static str, [&'static str; X]);
    /// What only this family tells: name and value.
    fn facts(&self) -> Vec<(&'static str, String)>;
    /// The greatest speed its axes can have.
    fn speed(&self) -> Speed;
    /// How late the latest of its late answers came; none where none was.
    fn lateness(&self) -> Option<host::gripper::Duration>;
    /// What is wrong with the line, where it can tell better than the driver.
    fn line_error(&mut self) -> Option<tcp::Error>;
    /// Finds out whether the gripper is of this family before anything else.
    fn identify(&mut self);
    /// Whether it is, as far as that can be told.
    fn is_identified(&self) -> bool;
}

impl Bench<4> for ThreeFinger<Line> {
    fn raw(&self) -> Option<Vec<u8>> {
        self.raw_status().map(|block| block.to_vec())
    }
    fn accepted(&self) -> bool {
        ThreeFinger::accepted(self)
    }
    fn outcome(&self) -> (Option<Task>, Option<(Task, Outcome)>) {
        (self.task(), ThreeFinger::outcome(self))
    }
    fn reset(&mut self) {
        ThreeFinger::reset(self);
    }
    fn release(&mut self, closing: bool) -> bool {
        if !closing {
            self.automatic_release();
        }
        !closing
    }
    fn set_mode(&mut self, mode: three_finger::Mode) -> bool {
        ThreeFinger::set_mode(self, mode);
        true
    }
    fn set_control(&mut self, control: Control) {
        ThreeFinger::set_control(self, control);
    }
    fn is_in_scissor_mode(&self) -> bool {
        self.mode() == Some(three_finger::Mode::Scissor)
    }
    fn is_in_pinch_mode(&self) -> bool {
        self.mode() == Some(three_finger::Mode::Pinch)
    }
    fn names(&self) -> (&'static str, [&'static str; 4]) {
        ("3-Finger gripper", host::words::AXIS_WORDS)
    }
    fn facts(&self) -> Vec<(&'static str, String)> {
        let Some(block) = self.raw_status() else {
            return Vec::new();
        };
        let status = three_finger::Status::decode_any(&block);
        let mut facts = vec![("mode", status.mode.name().to_owned())];
        if status.going_to {
            use three_finger::Progress;
            let motion = match status.progress {
                Progress::Moving => "the fingers move",
                Progress::SomeShort => "stopped, one or two fingers short of their target",
                Progress::AllShort => "stopped, all fingers short of their target",
                Progress::AllThere => "stopped, all fingers at their target",
            };
            facts.push(("motion", motion.to_owned()));
        }
        facts
    }
    fn speed(&self) -> Speed {
        Speed::THREE_FINGER
    }
    fn lateness(&self) -> Option<host::gripper::Duration> {
        self.link().lateness()
    }
    fn line_error(&mut self) -> Option<tcp::Error> {
        self.serial_mut().error()
    }
    fn identify(&mut self) {
        ThreeFinger::identify(self);
    }
    fn is_identified(&self) -> bool {
        ThreeFinger::is_identified(self)
    }
}

impl Bench<1> for TwoFinger<Line> {
    fn raw(&self) -> Option<Vec<u8>> {
        self.raw_status()
            .map(|block| block[..two_finger::BLOCK].to_vec())
    }
    fn accepted(&self) -> bool {
        TwoFinger::accepted(self)
    }
    fn outcome(&self) -> (Option<Task>, Option<(Task, Outcome)>) {
        (self.task(), TwoFinger::outcome(self))
    }
    fn reset(&mut self) {
        TwoFinger::reset(self);
    }
    fn release(&mut self, closing: bool) -> bool {
        self.release_towards(if closing {
            two_finger::Release::Closing
        } else {
            two_finger::Release::Opening
        });
        true
    }
    fn set_mode(&mut self, _: three_finger::Mode) -> bool {
        false
    }
    fn set_control(&mut self, _: Control) {}
    fn is_in_scissor_mode(&self) -> bool {
        false
    }
    fn names(&self) -> (&'static str, [&'static str; 1]) {
        (self.model().name(), ["fingers"])
    }
    fn facts(&self) -> Vec<(&'static str, String)> {
        // The controller's own fault has no public list.
        self.raw_status()
            .map(|block| block[2] >> 4)
            .filter(|fault| *fault != 0)
            .map(|fault| ("controller", format!("fault {fault:X}: see its manual")))
            .into_iter()
            .collect()
    }
    fn speed(&self) -> Speed {
        Speed::of_model(self.model())
    }
    fn lateness(&self) -> Option<host::gripper::Duration> {
        self.link().lateness()
    }
    fn line_error(&mut self) -> Option<tcp::Error> {
        self.serial_mut().error()
    }
    fn identify(&mut self) {
        TwoFinger::identify(self);
    }
    fn is_identified(&self) -> bool {
        TwoFinger::is_identified(self)
    }
}

/// Whoever waits: the clock, and Ctrl-C.
#[derive(Debug, Clone)]
pub struct Waiter {
    /// The driver's time.
    pub clock: Clock,
    /// Ends every wait early.
    pub interrupt: Interrupt,
}

impl Waiter {
    /// A waiter whose clock starts now.
    pub fn new(interrupt: &Interrupt) -> Self {
        Self {
            clock: Clock::start(),
            interrupt: interrupt.clone(),
        }
    }

    /// Polls the driver until `step` breaks; `None` when the time is over or the end was asked for. A time in which the
    /// process stood still counts as [`STALL`], however long it was: nobody looked.
    pub fn pump<B: Bench<X>, T, const X: usize>(
        &self,
        driver: &mut B,
        time: Duration,
        mut step: impl FnMut(
            &mut B,
            host::gripper::Instant,
            Option<Result<Status<X>, host::gripper::Error>>,
        ) -> ControlFlow<T>,
    ) -> Option<T> {
        let mut left = ticks(time).as_ticks();
        let mut looked = self.clock.now();
        while left > 0 {
            let now = self.clock.now();
            let passed = now.as_ticks().saturating_sub(looked.as_ticks());
            looked = now;
            left = left.saturating_sub(passed.min(STALL.as_ticks()));
            let heard = driver.poll(now).and_then(Event::ended);
            if let ControlFlow::Break(value) = step(driver, now, heard) {
                return Some(value);
            }
            if self.interrupt.sleep(LOOK) {
                return None;
            }
        }
        None
    }

    /// The first status for which `done` says so, or the newest when `time` is over; `first` where none comes.
    pub fn newest<B: Bench<X>, const X: usize>(
        &self,
        driver: &mut B,
        time: Duration,
        first: Status<X>,
        done: impl Fn(&Status<X>) -> bool,
    ) -> Status<X> {
        let mut newest = first;
        self.pump(driver, time, |_, _, heard| {
            if let Some(Ok(status)) = heard {
                newest = status;
                if done(&newest) {
                    return ControlFlow::Break(());
                }
            }
            ControlFlow::Continue(())
        });
        newest
    }

    /// The first status of a gripper that is of the driver's family.
    ///
    /// # Errors
    /// What came instead of one, as the driver says it.
    pub fn status<B: Bench<X>, const X: usize>(
        &self,
        driver: &mut B,
        patience: Duration,
    ) -> Result<Status<X>, Option<host::gripper::Error>> {
        let mut last = None;
        self.pump(
            driver,
            ANSWER_WAIT + 10 * patience,
            |driver, _, heard| match heard {
                Some(Ok(status)) if driver.is_identified() => ControlFlow::Break(Some(status)),
                Some(Err(error)) => {
                    // What tells most is kept.
                    if !matches!(
                        last,
                        Some(host::gripper::Error::Link(link::Error::Shifted(_)))
                    ) {
                        last = Some(error);
                    }
                    match error {
                        // It will not become another one.
                        host::gripper::Error::OtherGripper(_) => ControlFlow::Break(None),
                        _ => ControlFlow::Continue(()),
                    }
                }
                _ => ControlFlow::Continue(()),
            },
        )
        .flatten()
        .ok_or(last)
    }
}
