//! A move of a scripted gripper on virtual time, seed by seed.

use super::super::args::Target;
use super::super::bench::Waiter;
use super::*;
use crate::tell::Tell;
use host::clock::Clock;
use host::gripper::driver::{Control, Outcome, Task};
use host::gripper::registers::three_finger;
use host::gripper::travel::Speed;
use host::gripper::{Contact, Event, Gripper};
use host::interrupt::Interrupt;
use host::lines::Model;
use host::lines::tcp;
use std::path::Path;

/// One exchange, µs.
const CYCLE: u64 = 8_000;

/// A 2F-85 whose position register says what a script says.
struct Scripted<F> {
    truth: f32,
    told: u8,
    motion: Option<Motion<1>>,
    next: u64,
    writes: u32,
    /// The farthest a command was from the truth.
    farthest: f32,
    shown: F,
}

impl<F: FnMut(u64, u8) -> u8> Scripted<F> {
    fn new(truth: f32, shown: F) -> Self {
        Self {
            truth,
            told: truth as u8,
            motion: None,
            next: CYCLE,
            writes: 0,
            farthest: 0.0,
            shown,
        }
    }
}

impl<F: FnMut(u64, u8) -> u8> Gripper<1> for Scripted<F> {
    type Error = host::gripper::Error;
    fn poll(&mut self, now: Instant) -> Option<Event<1, host::gripper::Error>> {
        let at = now.as_ticks();
        if at < self.next {
            return None;
        }
        self.next = at + CYCLE;
        if let Some(motion) = self.motion {
            self.told = motion.position[0];
            self.writes += 1;
            self.farthest = self.farthest.max((f32::from(self.told) - self.truth).abs());
        }
        // Some 150 counts a second.
        let way = f32::from(self.told) - self.truth;
        self.truth += way.clamp(-1.2, 1.2);
        Some(Event::Status(Status {
            stamp: Instant::from_ticks(at - 6_000),
            activation: Activation::Ready,
            going_to: true,
            contact: [if way.abs() < 1.0 {
                Contact::AtPosition
            } else {
                Contact::Moving
            }],
            echo: [self.told],
            position: [(self.shown)(at, self.truth as u8)],
            current: [0],
            fault: Fault::None,
        }))
    }
    fn set_motion(&mut self, motion: Option<Motion<1>>, _: Instant) {
        self.motion = motion;
    }
    fn activate(&mut self) {}
    fn next_due(&self) -> Instant {
        Instant::from_ticks(self.next)
    }
    fn counters(&self) -> host::gripper::link::Counters {
        host::gripper::link::Counters {
            writes: self.writes,
            ..Default::default()
        }
    }
}

impl<F: FnMut(u64, u8) -> u8> Bench<1> for Scripted<F> {
    fn raw(&self) -> Option<Vec<u8>> {
        None
    }
    fn accepted(&self) -> bool {
        true
    }
    fn outcome(&self) -> (Option<Task>, Option<(Task, Outcome)>) {
        (None, None)
    }
    fn reset(&mut self) {}
    fn release(&mut self, _: bool) -> bool {
        false
    }
    fn set_mode(&mut self, _: three_finger::Mode) -> bool {
        false
    }
    fn set_control(&mut self, _: Control) {}
    fn is_in_scissor_mode(&self) -> bool {
        false
    }
    fn names(&self) -> (&'static str, [&'static str; 1]) {
        ("2F-85", ["fingers"])
    }
    fn facts(&self) -> Vec<(&'static str, String)> {
        Vec::new()
    }
    fn speed(&self) -> Speed {
        Speed::TWO_FINGER_85
    }
    fn lateness(&self) -> Option<host::gripper::Duration> {
        None
    }
    fn line_error(&mut self) -> Option<tcp::Error> {
        None
    }
    fn identify(&mut self) {}
    fn is_identified(&self) -> bool {
        true
    }
}

/// Moves from 30 to `to`, stopped dead for `pauses` (when, how long, ms); how it ended and the gripper then.
fn moved<F: FnMut(u64, u8) -> u8>(
    to: u8,
    shown: F,
    pauses: &[(u64, u64)],
) -> (Option<End<1>>, Scripted<F>) {
    let options = Move {
        target: Target::delivered(Path::new("/dev/gripper"), Model::TwoFinger85),
        to: vec![to],
        speed: 64,
        force: 64,
        ends_with: None,
    };
    let mut driver = Scripted::new(30.0, shown);
    let first = driver.poll(Instant::from_ticks(CYCLE));
    let first = first.and_then(Event::ended).unwrap().unwrap();
    let doing = Doing {
        verb: "gripper move",
        driver: Scripted::new(30.0, |_, truth| truth),
        target: &options.target,
        waiter: Waiter {
            clock: Clock::from_source(|| Duration::ZERO),
            interrupt: Interrupt::never().unwrap(),
        },
        tell: Tell::new(true),
    };
    let mut leader = Leader::new(&doing, &options, Axes::Each, [to], first);
    let end = 16_000_000 + 1_000 * pauses.iter().map(|pause| pause.1).sum::<u64>();
    let mut pauses = pauses.iter();
    let mut pause = pauses.next();
    let mut us = CYCLE;
    while us < end {
        us += 1_000;
        if let Some((at, long)) = pause
            && us >= at * 1_000
        {
            us += long * 1_000;
            pause = pauses.next();
        }
        let now = Instant::from_ticks(us);
        let heard = driver.poll(now).and_then(Event::ended);
        if let Some(end) = leader.step(&mut driver, now, heard) {
            return (Some(end), driver);
        }
    }
    (None, driver)
}

fn random(seed: &mut u64) -> u8 {
    *seed ^= *seed << 13;
    *seed ^= *seed >> 7;
    *seed ^= *seed << 17;
    (*seed >> 32) as u8
}

#[test]
fn random_positions_are_not_followed_in_two_hundred_runs() {
    // From the first status on; from some moment of the motion on; two of three only.
    for (name, from, share) in [("first", 0, 255), ("later", 700_000, 255), ("some", 0, 170)] {
        let (mut wrote, mut far, mut worst) = (0, 0, 0.0f32);
        for seed in 1..=200u64 {
            let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15);
            let shown = |at: u64, truth: u8| {
                let lies = at >= from && random(&mut state) <= share;
                let lie = random(&mut state);
                if lies { lie } else { truth }
            };
            let (end, gripper) = moved(200, shown, &[]);
            assert!(matches!(end, Some(End::Doubted(_))), "{name}, seed {seed}");
            wrote += u32::from(gripper.writes > 0);
            far += u32::from(gripper.farthest > 41.0);
            worst = worst.max(gripper.farthest);
        }
        println!(
            "{name}: {wrote} of 200 runs wrote, {far} more than 40 counts away, {worst:.0} at worst"
        );
        // Two lies in a row that a finger could have followed are believed: one time in a hundred.
        assert!(far <= 2 && worst <= 53.0, "{name}: {far}, {worst}");
        assert!(from > 0 || wrote == 0, "{name}: {wrote}");
    }
}

#[test]
fn a_move_whose_process_stood_still_ends_and_one_that_was_late_goes_on() {
    let honest = |_, truth| truth;
    for (stood, ends) in [(150, false), (900, false), (1_000, true), (40_000, true)] {
        let (end, gripper) = moved(200, honest, &[(900, stood)]);
        match end {
            Some(End::Stood(time)) if ends => assert!(time.as_ticks() >= stood * 1_000),
            Some(End::Stands([Some(Rest::Target)])) if !ends => {}
            _ => panic!("{stood}"),
        }
        assert!(gripper.farthest <= 40.0, "{}", gripper.farthest);
    }
    // Nothing was written yet.
    let (end, _) = moved(200, honest, &[(100, 40_000)]);
    assert!(matches!(end, Some(End::Stands([Some(Rest::Target)]))));
}

#[test]
fn a_limit_in_mid_stroke_is_proved_by_a_step_back() {
    // It stands at 120, lives, and goes no further.
    let (end, gripper) = moved(200, |_, truth| truth.min(120), &[]);
    assert!(matches!(end, Some(End::Stands([Some(Rest::Limit)]))));
    assert_eq!(gripper.told, 160);
    // It stays at 120 once it was there; it says half of what is so.
    let mut frozen = false;
    let freezes = |_: u64, truth: u8| {
        frozen |= truth >= 120;
        if frozen { 120 } else { truth }
    };
    let frozen = moved(200, freezes, &[]);
    let (halved, _) = moved(200, |_, truth| truth / 2 + 15, &[]);
    for end in [frozen.0, halved] {
        let Some(End::Doubted(failure)) = end else {
            panic!("not told");
        };
        assert!(
            failure.to_string().contains("no software limit"),
            "{failure}"
        );
    }
    assert!(frozen.1.farthest <= 40.0, "{}", frozen.1.farthest);
}

#[test]
fn a_next_step_is_the_whole_command() {
    let options = Move {
        target: Target::delivered(Path::new("/dev/gripper"), Model::TwoFinger85),
        to: vec![9],
        speed: 1,
        force: 2,
        ends_with: None,
    };
    let whole = "gauntlet gripper move --to 9 --speed 1 --force 2 --gripper /dev/gripper --gripper-model 2f85";
    assert_eq!(options.again().to_string(), whole);
    let patient = options.patient().to_string();
    assert!(patient.starts_with(&format!("{whole} --patience")));
}
