//! A gripper's layers: port, line (bytes, frames, baud), unit, and what the gripper says of itself.

use std::path::Path;
use std::time::{Duration, Instant};

use embedded_io::{Read, ReadReady, Write};
use gripper::driver::{ThreeFinger, TwoFinger};
use gripper::registers::two_finger;
use gripper::{Activation, Fault, Gripper, Status};

use super::Findings;
use super::raw::{Heard, ask_status};
use crate::failure::Failure;
use crate::interrupt::Interrupt;
use crate::line::{Line, Settings};
use crate::platform::Clock;
use crate::port::{BAUD, Port};
use crate::{ports, tcp, words};

/// Unit as delivered.
const UNIT: u8 = 9;
/// Speeds a Robotiq gripper can be set to, the usual one left out.
const OTHER_BAUDS: [u32; 5] = [57_600, 38_400, 19_200, 9_600, 230_400];
/// Questions before silence is believed.
const TRIES: usize = 3;
/// For an answer: an adapter with a 16 ms latency timer, and a PC with other work.
const WAIT: Duration = Duration::from_millis(80);
/// For an answer of each of 247 units.
const UNIT_WAIT: Duration = Duration::from_millis(40);
/// Reads to see how well the line does.
const SAMPLE: Duration = Duration::from_secs(1);

/// Finds out which layer of the gripper at `path` (a serial port, or `tcp:HOST[:PORT]`) fails.
pub fn gripper(path: &Path, interrupt: &Interrupt) -> Findings {
    let mut findings = Findings::default();
    match tcp::Address::parse(path) {
        Err(failure) => findings.failure("address", &failure),
        Ok(Some(address)) => network(&address, &mut findings, interrupt),
        Ok(None) => serial(path, &mut findings, interrupt),
    }
    findings
}

fn network(address: &tcp::Address, findings: &mut Findings, interrupt: &Interrupt) {
    let port = match tcp::Port::connect(address, tcp::UNIT, interrupt) {
        Ok(port) => port,
        Err(error) => {
            let (text, _) = crate::failure::report(&error);
            let (what, next) = text.split_once("\n  try: ").unwrap_or((&text, ""));
            return findings.wrong("connection", what.trim_start_matches("error: "), next);
        }
    };
    findings.good("connection", format!("{address} accepts"));
    let config = port.driver_config();
    let mut driver = ThreeFinger::new(Line::Tcp(port), config);
    match sample(&mut driver, interrupt) {
        Some(status) => says(&status, "3-Finger gripper", findings),
        None => {
            let error = driver.serial_mut().error().unwrap_or(tcp::Error::Timeout);
            findings.wrong("gripper", error.to_string(), error.next_step());
        }
    }
}

fn serial(path: &Path, findings: &mut Findings, interrupt: &Interrupt) {
    let mut port = match Port::open(path, BAUD) {
        Ok(port) => port,
        Err(error) => return findings.failure("port", &Failure::from(error)),
    };
    findings.good("port", format!("{} opens", path.display()));
    if let Some(warning) = ports::latency_warning(path) {
        findings.note("port", warning, "the command above");
    }
    let first = persist(&mut port, UNIT, interrupt);
    if let Heard::Answer(_, echoes) = first {
        if echoes {
            let what = "the adapter gives back what it is given; the driver takes that off";
            findings.note("line", what, "nothing: it works");
        }
        let what = format!("unit {UNIT} answers at {BAUD} baud");
        findings.good("line", what);
        return talk(port, Settings::default(), findings, interrupt);
    }
    drop(port);
    if let Some(baud) = other_baud(path, interrupt) {
        findings.wrong(
            "line",
            format!("unit {UNIT} answers at {baud} baud, not at {BAUD}"),
            format!("`gauntlet gripper … --baud {baud}`, or set {BAUD} in the maker's tool"),
        );
        let settings = Settings {
            baud: Some(baud),
            unit: None,
        };
        return reopen(path, settings, findings, interrupt);
    }
    if let Some(unit) = other_unit(path, &first, interrupt) {
        findings.wrong(
            "unit",
            format!("unit {unit} answers at {BAUD} baud, not unit {UNIT}"),
            format!("`gauntlet gripper … --unit {unit}`, or set {UNIT} in the maker's tool"),
        );
        let settings = Settings {
            unit: Some(unit),
            baud: None,
        };
        return reopen(path, settings, findings, interrupt);
    }
    nobody(&first, findings);
}

/// Asks until there is an answer, a few times.
fn persist(port: &mut Port, unit: u8, interrupt: &Interrupt) -> Heard {
    let mut worst = Heard::Silence;
    for _ in 0..TRIES {
        // Three registers: every family has those.
        match ask_status(port, unit, 3, WAIT, interrupt) {
            answer @ Heard::Answer(..) => return answer,
            Heard::Silence => {}
            other => worst = other,
        }
    }
    worst
}

fn other_baud(path: &Path, interrupt: &Interrupt) -> Option<u32> {
    OTHER_BAUDS.into_iter().find(|baud| {
        Port::open(path, *baud)
            .is_ok_and(|mut port| matches!(persist(&mut port, UNIT, interrupt), Heard::Answer(..)))
    })
}

/// Another unit at the usual speed. Where noise came there is no point in asking 247 of them.
fn other_unit(path: &Path, first: &Heard, interrupt: &Interrupt) -> Option<u8> {
    match first {
        Heard::Other(unit) => return Some(*unit),
        Heard::Silence | Heard::Echo => {}
        Heard::Noise(_) | Heard::Exception(_) | Heard::Answer(..) => return None,
    }
    let mut port = Port::open(path, BAUD).ok()?;
    (1..=247).filter(|unit| *unit != UNIT).find(|unit| {
        let heard = ask_status(&mut port, *unit, 3, UNIT_WAIT, interrupt);
        !interrupt.asked() && matches!(heard, Heard::Answer(..))
    })
}

fn nobody(first: &Heard, findings: &mut Findings) {
    let tried = format!(
        "asked unit {UNIT} at {BAUD} and {} other speeds",
        OTHER_BAUDS.len()
    );
    match first {
        Heard::Noise(count) => findings.wrong(
            "line",
            format!("bytes come but no Modbus frame: {count} bytes at {BAUD} baud; {tried}"),
            "whether this is the gripper's port and not the glove's; RS-485 A against B, ground and termination",
        ),
        Heard::Exception(code) => findings.wrong(
            "unit",
            format!("unit {UNIT} refuses a status read with exception {code:02X}"),
            "whether this device is a Robotiq gripper",
        ),
        Heard::Echo => findings.wrong(
            "line",
            format!("only the adapter's own echo comes back; {tried}, and units 1 to 247"),
            "the gripper's 24 V supply, and RS-485 A against B",
        ),
        _ => findings.wrong(
            "line",
            format!("no byte comes; {tried}, and units 1 to 247 at {BAUD}"),
            "the gripper's 24 V supply, RS-485 A against B, and whether this is the gripper's port (`gauntlet ports`)",
        ),
    }
}

fn reopen(path: &Path, settings: Settings, findings: &mut Findings, interrupt: &Interrupt) {
    match Port::open(path, settings.baud.unwrap_or(BAUD)) {
        Ok(port) => talk(port, settings, findings, interrupt),
        Err(error) => findings.failure("port", &Failure::from(error)),
    }
}

/// Somebody answers: which gripper is it, and what does it say?
fn talk(mut port: Port, settings: Settings, findings: &mut Findings, interrupt: &Interrupt) {
    let unit = settings.unit.unwrap_or(UNIT);
    // Only the 3-Finger has eight status registers.
    let three = (0..TRIES).any(|_| {
        let heard = ask_status(&mut port, unit, 8, WAIT, interrupt);
        matches!(heard, Heard::Answer(..))
    });
    let config = Line::serial_config(settings);
    let counters = if three {
        let mut driver = ThreeFinger::new(port, config);
        heard(sample(&mut driver, interrupt), "3-Finger gripper", findings);
        driver.counters()
    } else {
        // The members of the family answer alike.
        let mut driver = TwoFinger::new(port, two_finger::Model::default(), config);
        let name = "2-Finger gripper or Hand-E";
        heard(sample(&mut driver, interrupt), name, findings);
        driver.counters()
    };
    let (asked, answered) = (counters.requests, counters.replies);
    let lost = asked.saturating_sub(answered.saturating_add(1));
    if lost > 0 {
        let what = format!(
            "{lost} of {asked} requests had no good answer in {} s: {} with a wrong CRC, {} late, {} silent",
            SAMPLE.as_secs(),
            counters.crc,
            counters.stale,
            counters.timeouts
        );
        findings.note(
            "line",
            what,
            "cable, ground and termination; a PC with less other work",
        );
    }
}

fn heard<const X: usize>(status: Option<Status<X>>, name: &str, findings: &mut Findings) {
    match status {
        Some(status) => says(&status, name, findings),
        None => findings.wrong(
            "gripper",
            "it answers single questions but gives no valid status",
            "whether this device is a Robotiq gripper",
        ),
    }
}

/// Reads for a second; the newest status.
fn sample<S, F, const X: usize>(
    driver: &mut gripper::driver::Driver<S, F, X>,
    interrupt: &Interrupt,
) -> Option<Status<X>>
where
    S: Read + ReadReady + Write,
    F: gripper::driver::Family<X>,
{
    let clock = Clock::start();
    let start = Instant::now();
    let mut newest = None;
    while start.elapsed() < SAMPLE && !interrupt.sleep(Duration::from_millis(1)) {
        if let Some(Ok(status)) = driver.poll(clock.now()) {
            newest = Some(status);
        }
    }
    newest
}

fn says<const X: usize>(status: &Status<X>, name: &str, findings: &mut Findings) {
    match status.fault {
        Fault::None => findings.good("gripper", format!("{name}, no fault")),
        fault => findings.wrong(
            "gripper",
            format!("{name}, fault {:02X}: {}", fault.code(), fault.sentence()),
            fault.action(),
        ),
    }
    let what = format!("it is {}", words::activation(status.activation));
    match status.activation {
        Activation::Ready => findings.good("gripper", what),
        Activation::Reset => findings.note(
            "gripper",
            what,
            "`gauntlet gripper activate`: the fingers move",
        ),
        Activation::Activating | Activation::ChangingMode => {
            findings.note("gripper", what, "waiting until it is done");
        }
    }
}
