//! A bridge on a chip that is watched: how that is judged at its end, and what its page shows. Skipped, with a word, where QEMU or the firmware is missing.

use crate::debugger;
use crate::support;

use std::path::PathBuf;
use std::process::{Output, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use host::chip::emulator::{Emulator, Setup, find_firmware, qemu_is_there};
use rig::glove::VirtualGlove;
use rig::gripper::{Config, VirtualGripper};
use support::bench::{Running, ends_soon, hand, jam, jumps};
use support::page::{OpenPage, address};
use support::{command, devices, model, refusal, run, text, until_line, wait};

/// What a test can break.
struct World {
    glove: VirtualGlove,
    gripper: VirtualGripper,
    /// The chip's debugger port.
    debugger: PathBuf,
}

impl World {
    /// Waits until the gripper was told something: what the tool says of it comes later or sooner.
    fn until_commanded(&self) {
        let end = Instant::now() + Duration::from_secs(60);
        while self.gripper.writes() == 0 {
            assert!(Instant::now() < end, "never commanded");
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

/// A bridge in QEMU between a glove whose hand moves once that is set, and an active gripper.
pub(super) struct Chip {
    pub(super) emulator: Emulator,
    glove: VirtualGlove,
    gripper: VirtualGripper,
    pub(super) moves: Arc<AtomicBool>,
    _ports: [rig::pty::Handle; 2],
}

pub(super) fn chip() -> Option<Chip> {
    let firmware = find_firmware(None).ok().filter(|_| qemu_is_there());
    let Some(firmware) = firmware else {
        rig::skip::skipped(
            rig::skip::Need::Chip,
            "no QEMU, or no firmware (`cargo xtask firmware`)",
        );
        return None;
    };
    let moves = Arc::new(AtomicBool::new(false));
    let config = rig::glove::Config::at_baud(115_200);
    let glove = VirtualGlove::new(Box::new(hand(Arc::clone(&moves))), config);
    let (glove_port, _) = devices::behind_pty(glove.clone());
    let (gripper, gripper_port, _) = devices::gripper(Config::default());
    gripper.preset_active();
    let mut emulator = Emulator::new(Setup {
        firmware,
        glove: Some(glove_port.path().to_owned()),
        gripper: Some(gripper_port.path().to_owned()),
        debugger: true,
    })
    .unwrap();
    drop(emulator.link().unwrap());
    Some(Chip {
        emulator,
        glove,
        gripper,
        moves,
        _ports: [glove_port, gripper_port],
    })
}

#[test]
fn the_page_of_a_watched_chip_shows_what_it_does_and_closes_nothing() {
    let Some(chip) = chip() else {
        return;
    };
    let bridge = chip.emulator.address().to_string();
    let words = ["bridge", "monitor", "--bridge", &bridge, "--view", "--json"];
    let mut running = Running::start(
        command(&[&words[..], &["--seconds", "60"]].concat())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped()),
    );
    let mut page = OpenPage::open(&address(running.0.stderr.take().unwrap()));
    let truth = chip.gripper.positions();
    let reached =
        |page: &OpenPage, axis: usize| page.picture["gripper"]["axes"][axis]["reached"].as_f64();
    page.until("the gripper", |page| {
        (0..4).all(|axis| reached(page, axis) == Some(f64::from(truth[axis].round())))
    });
    page.until("the sensors", |page| {
        let sensors = page.picture["hand"]["sensors"].as_array();
        sensors.is_some_and(|all| all.len() == 16 && all.iter().all(|s| s["health"] == "good"))
    });
    let title = page.picture["title"].as_str().unwrap();
    assert!(title.contains("bridge monitor"), "{title}");
    assert_eq!(page.picture["clutch"]["may_close"], false);
    page.say("close");
    let number = page.number;
    page.until("some pictures later", |page| page.number > number + 20);
    assert_eq!(page.clutch(), "open");
    assert_eq!(chip.gripper.writes(), 0, "something was commanded");
    support::interrupt(&running.0);
    let why = page.until_closed();
    assert_eq!(why.as_deref(), Some("the program has ended"));
    ends_soon(&mut running.0);
}

/// `bridge engage` for some `seconds` on a bridge in QEMU; `breaks` is done once it says that the gripper follows the hand.
fn engaged(jammed: bool, seconds: &str, breaks: impl FnOnce(&World)) -> Option<Output> {
    let Chip {
        emulator,
        glove,
        gripper,
        moves,
        _ports,
    } = chip()?;
    if jammed {
        jam(&gripper);
    }
    let bridge = emulator.address().to_string();
    let flashed = run(&["flash", model().to_str().unwrap(), "--bridge", &bridge]);
    assert_eq!(flashed.status.code(), Some(0), "{}", text(&flashed.stderr));
    let words = [
        "engage",
        "--bridge",
        &bridge,
        "--calibrate-flat",
        "--ideal",
        "--seconds",
    ];
    let mut child = command(&[&["bridge"][..], &words, &[seconds]].concat())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let said = until_line(child.stdout.take().unwrap(), "following");
    moves.store(true, Ordering::Relaxed);
    breaks(&World {
        glove,
        gripper,
        debugger: emulator.debugger(),
    });
    let status = wait(&mut child);
    let mut stderr = Vec::new();
    std::io::Read::read_to_end(child.stderr.as_mut().unwrap(), &mut stderr).unwrap();
    Some(Output {
        status,
        stdout: said.join().unwrap().into_bytes(),
        stderr,
    })
}

#[test]
fn a_watch_whose_glove_is_lost_until_its_end_has_failed_and_one_whose_glove_works_has_not() {
    let Some(output) = engaged(false, "10", |_| {}) else {
        return;
    };
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let lost = |world: &World| world.glove.unplug(0, true);
    let output = engaged(false, "10", lost).unwrap();
    let error = refusal(&output, 1);
    assert!(error.contains("sensor hand (missing"), "{error}");
    let jumped = |world: &World| jumps(&world.glove, 0);
    let output = engaged(false, "10", jumped).unwrap();
    let error = refusal(&output, 1);
    assert!(error.contains("not calibrated"), "{error}");
}

#[test]
fn a_watch_whose_gripper_was_told_to_move_and_never_moved_has_failed() {
    let Some(output) = engaged(true, "10", |_| {}) else {
        return;
    };
    let error = refusal(&output, 1);
    assert!(error.contains("never moved"), "{error}");
}

#[test]
fn a_chip_that_starts_anew_in_motion_is_told_as_that_and_the_watch_has_failed() {
    let bites = |world: &World| {
        world.until_commanded();
        // The loop hangs, and the watchdog resets the chip a second later: that ends the run.
        debugger::patch_tick(&world.debugger, debugger::JUMP_TO_ITSELF);
    };
    let Some(output) = engaged(false, "60", bites) else {
        return;
    };
    println!("{}", text(&output.stdout));
    let error = refusal(&output, 1);
    assert!(error.contains("restarted"), "{error}");
    let said = text(&output.stdout) + &text(&output.stderr);
    assert!(!said.contains("is held"), "{said}");
}

#[test]
fn a_hold_that_the_chips_gripper_did_not_confirm_is_not_told_as_one() {
    let cut = |world: &World| {
        world.until_commanded();
        world.gripper.mute(u32::MAX);
    };
    let Some(output) = engaged(false, "10", cut) else {
        return;
    };
    let error = refusal(&output, 1);
    assert!(error.contains("hold was not confirmed"), "{error}");
    let said = text(&output.stdout) + &text(&output.stderr);
    assert!(!said.contains("is held"), "{said}");
}
