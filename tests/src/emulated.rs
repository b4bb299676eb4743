//! The firmware in the emulator, in real time: the whole loop by its counters, and power cuts while weights are flashed.

use std::io::Write;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use bridge::State;
use bridge::calibration::Try;
use bridge::protocol::message::{Answer, Call, Counters, Restart, SlotContents};
use gauntlet::wearer::Wearer;
use gripper::Activation;
use host::chip::emulator::{Emulator, Setup};
use host::chip::link::{Address, Error, Heartbeat, HostLink};
use host::interrupt::Interrupt;
use host::realtime;
use rig::Device;
use rig::glove::VirtualGlove;
use rig::gripper::VirtualGripper;
use rig::person::{Attitude, Task};
use rig::pty::{Handle, PtyDevice};

use crate::debugger;
use crate::images::index_finger;
use crate::random;

/// Far more than anything here takes, also on a machine with much to do.
const PATIENCE: Duration = Duration::from_secs(60);
const BEAT: Duration = Duration::from_millis(80);

/// One emulator at a time: a machine that is kept waiting by another one tells nothing about the loop.
pub fn alone() -> MutexGuard<'static, ()> {
    static ONE: Mutex<()> = Mutex::new(());
    // A test that failed while it held the lock says so itself.
    ONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// An emulator without glove and gripper.
///
/// # Panics
/// QEMU or its folder cannot be had.
pub fn bare(firmware: &Path) -> Emulator {
    Emulator::new(Setup {
        firmware: firmware.to_owned(),
        glove: None,
        gripper: None,
        debugger: false,
    })
    .expect("an emulator")
}

/// [`bare`], into which a debugger may look.
///
/// # Panics
/// As [`bare`].
pub fn debugged(firmware: &Path) -> Emulator {
    Emulator::new(Setup {
        firmware: firmware.to_owned(),
        glove: None,
        gripper: None,
        debugger: true,
    })
    .expect("an emulator")
}

/// Waits until the machine has started again: its time is less than `before_us`. A new line to it.
///
/// # Panics
/// It does not within a minute.
pub fn restarted(emulator: &mut Emulator, before_us: u64) -> HostLink {
    let end = Instant::now() + PATIENCE;
    loop {
        assert!(emulator.is_on(), "the emulator ended");
        // While it hangs it does not answer.
        if let Ok(mut link) = emulator.link()
            && link.status().is_ok_and(|status| status.now_us < before_us)
        {
            return link;
        }
        assert!(Instant::now() < end, "it did not start again");
    }
}

/// Flashes `image`; the CRC that the bridge reads back.
///
/// # Errors
/// As [`HostLink::flash`].
pub fn flash(link: &mut HostLink, image: &[u8]) -> Result<u32, Error> {
    let never = Interrupt::never().expect("an interrupt");
    link.flash(image, &never, &mut |_| {})
        .map(|flashed| flashed.crc)
}

/// The active image's model id, if there is one.
///
/// # Panics
/// The bridge does not answer, or its active slot holds no whole image.
pub fn active(link: &mut HostLink) -> Option<u32> {
    let slots = link.slots().expect("an answer");
    match slots.contents[usize::from(slots.active?)] {
        SlotContents::Image { model_id, .. } => Some(model_id),
        other => panic!("the active slot is {other:?}"),
    }
}

/// Asks until `done` says so.
fn wait_for(link: &mut HostLink, what: &str, done: impl Fn(&mut HostLink) -> bool) {
    let end = Instant::now() + PATIENCE;
    while !done(link) {
        assert!(Instant::now() < end, "{what}: {:?}", link.status());
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// Closes the clutch and keeps it closed for `time`; the states seen.
///
/// # Panics
/// The line breaks, the bridge refuses, or the clutch opens by itself.
pub fn hold_clutch(link: &mut HostLink, time: Duration) -> Vec<State> {
    let end = Instant::now() + time;
    let (epoch, _) = link.engage().expect("taken");
    let mut states = Vec::new();
    while Instant::now() < end {
        match link.heartbeat(epoch).expect("taken") {
            Heartbeat::Kept(status) => states.push(status.state),
            Heartbeat::Unanswered => {}
            Heartbeat::Refused(why) => panic!("{why}: {:?}", link.status()),
        }
        std::thread::sleep(BEAT);
    }
    states
}

/// Lays the hand flat and takes the pose, as often as it takes: sensors may just be coming up. Then the hand moves.
fn take_flat(link: &mut HostLink, glove: &VirtualGlove) {
    glove.ask(Task::Flat);
    link.calibrate_flat_hand().expect("taken");
    wait_for(link, "the flat pose", |link| {
        let calibration = link.health().expect("an answer").calibration;
        if matches!(calibration.newest, Try::Refused(_)) {
            link.calibrate_flat_hand().expect("taken");
        }
        calibration.is_calibrated
    });
    glove.ask(Task::Use(Attitude::PalmDown));
}

/// The index finger opens and closes.
fn index_bends(time_s: f64) -> [f32; 25] {
    let mut pose = [0.0; 25];
    pose[5] = 0.6 * (1.0 - (1.5 * time_s).cos()) as f32;
    pose
}

/// The firmware between the virtual devices, its gripper active, its weights in place.
pub struct Loop {
    /// The host's line.
    pub link: HostLink,
    /// The gripper on UART 2.
    pub gripper: VirtualGripper,
    emulator: Emulator,
    ports: [Handle; 2],
    /// On a virtual person, of sensors as they really are.
    glove: VirtualGlove,
}

/// What a stretch of time did to the counters.
#[derive(Debug, Clone, Copy)]
pub struct Stretch {
    /// How long it took here, seconds.
    pub seconds: f64,
    /// How long by the bridge's own clock, seconds.
    pub bridge_seconds: f64,
    /// [`Counters::since`] the start of the stretch.
    pub grown: Counters,
    /// Every state seen was `Following`.
    pub followed_throughout: bool,
    /// Whether the gripper moved.
    pub moved: bool,
}

impl Loop {
    /// Starts everything; a virtual person, calibrated on another day, opens and closes the index finger.
    ///
    /// # Panics
    /// Anything does not come up within a minute.
    pub fn start(firmware: &Path) -> Self {
        let never = Interrupt::never().expect("an interrupt");
        let wearer = Wearer::new(1);
        let calibrated = wearer.calibrated(&never).expect("calibrated");
        let glove = wearer.playing(Box::new(index_bends));
        let gripper = VirtualGripper::new(rig::gripper::Config::default());
        let ports = [
            spawn(Box::new(glove.clone())),
            spawn(Box::new(gripper.clone())),
        ];
        // Fresh from power-on it speaks 9,600 baud: the bridge finds it there.
        let mut emulator = Emulator::new(Setup {
            firmware: firmware.to_owned(),
            glove: Some(ports[0].path().to_owned()),
            gripper: Some(ports[1].path().to_owned()),
            debugger: false,
        })
        .expect("an emulator");
        let mut link = emulator.link().expect("a bridge");
        assert_eq!(active(&mut link), None);
        flash(&mut link, &index_finger(11)).expect("weights");
        assert_eq!(active(&mut link), Some(11));
        wait_for(&mut link, "the glove", |link| {
            link.status().expect("an answer").glove_answers
        });
        wait_for(&mut link, "the gripper", |link| {
            link.status().expect("an answer").gripper.is_some()
        });
        assert_eq!(link.status().expect("an answer").state, State::Idle);
        link.set_profile(Some(calibrated.bound())).expect("kept");
        take_flat(&mut link, &glove);
        link.activate().expect("taken");
        wait_for(&mut link, "the activation", |link| {
            let gripper = link.status().expect("an answer").gripper;
            gripper.is_some_and(|gripper| gripper.activation == Activation::Ready)
        });
        Self {
            link,
            gripper,
            emulator,
            ports,
            glove,
        }
    }

    /// What a person does when the session is over: a new one and, where the chip has started anew, too, a hand that lies flat.
    /// Whether it has.
    ///
    /// # Panics
    /// The bridge does not come back.
    pub fn bring_back(&mut self) -> bool {
        self.link.reconnect().expect("a session");
        wait_for(&mut self.link, "the glove", |link| {
            link.status().expect("an answer").glove_answers
        });
        wait_for(&mut self.link, "the gripper", |link| {
            link.status().expect("an answer").gripper.is_some()
        });
        let health = self.link.health().expect("an answer");
        if health.calibration.is_calibrated {
            return false;
        }
        // The profile outlived it.
        take_flat(&mut self.link, &self.glove);
        true
    }

    /// Cuts the glove's power for a moment, and waits until the bridge has found it again at the speed of its power-on. Its headings
    /// are new: one flat pose more.
    ///
    /// # Panics
    /// It does not come back.
    pub fn cut_glove_power(&mut self) {
        let now = || self.ports[0].clock().now();
        self.glove.power(false, now());
        wait_for(&mut self.link, "a glove that is gone", |link| {
            !link.status().expect("an answer").glove_answers
        });
        self.glove.power(true, now());
        wait_for(&mut self.link, "the glove, back", |link| {
            link.status().expect("an answer").glove_answers
        });
        let health = self.link.health().expect("an answer");
        assert!(!health.calibration.is_calibrated, "its headings are others");
        take_flat(&mut self.link, &self.glove);
    }

    /// Whether the bridge still knows the session.
    pub fn knows_session(&mut self) -> bool {
        self.link.status().is_ok()
    }

    /// The emulator's process.
    ///
    /// # Panics
    /// It has ended.
    pub fn process(&self) -> u32 {
        self.emulator.process_id().expect("an emulator that runs")
    }

    /// The virtual gripper's clock.
    pub fn clock(&self) -> &rig::Clock {
        self.ports[1].clock()
    }

    /// Holds the clutch for `time`, after 2 s for settling and blending.
    ///
    /// # Panics
    /// The bridge does not answer.
    pub fn follow(&mut self, time: Duration) -> Stretch {
        hold_clutch(&mut self.link, Duration::from_secs(2));
        let positions = self.gripper.positions();
        let clock = |link: &mut HostLink| link.status().expect("an answer").now_us as f64 * 1e-6;
        let (started, bridge_started) = (Instant::now(), clock(&mut self.link));
        let before = self.link.counters().expect("an answer");
        // Looked at more than once: twice it may stand at the same end of its way.
        let (mut states, mut moved) = (Vec::new(), false);
        for _ in 0..4 {
            states.extend(hold_clutch(&mut self.link, time / 4));
            moved |= self.gripper.positions() != positions;
        }
        let after = self.link.counters().expect("an answer");
        let following = |state: &State| *state == State::Following;
        Stretch {
            seconds: started.elapsed().as_secs_f64(),
            bridge_seconds: clock(&mut self.link) - bridge_started,
            grown: after.since(&before),
            followed_throughout: states.iter().all(following) && before.holds == after.holds,
            moved,
        }
    }
}

/// A device on a terminal of its own, with the priority that the tool gives its own.
fn spawn(device: Box<dyn Device>) -> Handle {
    let (handle, _) = realtime::starting(|| PtyDevice::spawn(device, None)).expect("a thread");
    handle.expect("a terminal")
}

/// Sends `bytes` bytes to a bridge whose loop stands still for a moment: its receive queue fills. The bytes lost by the
/// host's, the glove's and the gripper's port, once the loop goes on; `None` where it stood so long that the watchdog restarted it.
///
/// # Panics
/// The bridge does not answer then.
pub fn flood(firmware: &Path, bytes: usize) -> Option<[u32; 3]> {
    let mut emulator = debugged(firmware);
    drop(emulator.link().expect("a bridge"));
    let Address::Unix(path) = emulator.address() else {
        panic!("an emulator's address is a socket")
    };
    let mut line = UnixStream::connect(path).expect("the emulator's socket");
    let hung = debugger::hang(&emulator.debugger());
    // No zero among them: together they are the start of one frame that is too long.
    line.write_all(&vec![0x55; bytes])
        .expect("room in the socket");
    // A byte takes the emulator some 80 µs; the watchdog waits for a second.
    std::thread::sleep(Duration::from_millis(400));
    debugger::resume(&emulator.debugger(), &hung);
    drop(line);
    let mut link = emulator.link().expect("the bridge answers the next host");
    let restart = link.health().expect("an answer").restart;
    (restart == Restart::Power).then(|| link.counters().expect("an answer").bytes_lost)
}

/// What cutting the power many times came to.
#[derive(Debug, Clone, Copy, Default)]
pub struct Cuts {
    /// Cuts.
    pub cuts: u64,
    /// Cuts that came before the host had its last answer.
    pub inside: u64,
    /// Cuts after which the new image was active.
    pub new: u64,
}

/// Kills the emulator at `cuts` moments while an image is flashed. After each restart the bridge must answer with the
/// old image or the new one, whole and byte for byte what was sent; after the last one more flash must read back.
///
/// # Panics
/// Anything else.
pub fn cut_power(firmware: &Path, cuts: u64, seed: u64, progress: &mut dyn FnMut(u64)) -> Cuts {
    let mut emulator = bare(firmware);
    let images = [index_finger(1), index_finger(2)];
    let mut link = emulator.link().expect("a bridge");
    let started = Instant::now();
    let mut crcs = [flash(&mut link, &images[0]).expect("weights"), 0];
    let whole_us = started.elapsed().as_micros() as u64;
    crcs[1] = crc32(&images[1]);
    assert_eq!(crcs[0], crc32(&images[0]));
    let (mut old, mut seen) = (1, Cuts::default());
    for cut in 0..cuts {
        let new = 3 - old;
        let bytes = &images[new as usize - 1];
        // A little beyond the end, so that some cuts come in the commit and after it.
        let at = Duration::from_micros(random(seed ^ cut) % (whole_us * 21 / 20));
        let stop = Interrupt::never().expect("an interrupt");
        let done = std::thread::scope(|scope| {
            let writer = scope.spawn(|| link.flash(bytes, &stop, &mut |_| {}).is_ok());
            std::thread::sleep(at);
            emulator.power_off();
            // Otherwise it would wait for the machine to come back.
            stop.ask();
            writer.join().expect("no panic")
        });
        link = emulator
            .link()
            .expect("the bridge answers after the restart");
        let found = active(&mut link);
        assert!(
            found == Some(old) || found == Some(new),
            "cut {cut} at {at:?}: {found:?} is active, {old} was, {new} was being written"
        );
        assert!(
            !done || found == Some(new),
            "cut {cut}: a finished flash was lost"
        );
        let found = found.unwrap_or(old);
        assert_eq!(
            active_crc(&mut link),
            Some(crcs[found as usize - 1]),
            "cut {cut}: bytes differ"
        );
        seen.cuts += 1;
        seen.inside += u64::from(!done);
        seen.new += u64::from(found == new);
        old = found;
        progress(seen.cuts);
    }
    let last = 3 - old;
    flash(&mut link, &images[last as usize - 1]).expect("one clean flash");
    emulator.power_off();
    let mut link = emulator.link().expect("a bridge");
    assert_eq!(active(&mut link), Some(last));
    assert_eq!(active_crc(&mut link), Some(crcs[last as usize - 1]));
    seen
}

/// The CRC that the bridge computes over its active image.
fn active_crc(link: &mut HostLink) -> Option<u32> {
    let Ok(Answer::Slots(slots)) = link.call(&Call::Slots) else {
        return None;
    };
    match slots.contents[usize::from(slots.active?)] {
        SlotContents::Image { crc, .. } => Some(crc),
        _ => None,
    }
}

/// CRC-32/ISO-HDLC bit by bit.
pub fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| {
            (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg())
        })
    })
}
