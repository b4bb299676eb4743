//! A gripper's layers: port, line (bytes, frames, baud), unit, and what the gripper says of itself.

use std::path::Path;
use std::time::{Duration, Instant};

use embedded_io::{Read, ReadReady, Write};
use gripper::driver::{ThreeFinger, TwoFinger};
use gripper::registers::two_finger;
use gripper::{Activation, Fault, Gripper, Status};

use super::Findings;
use super::glove::glove_answers;
use super::raw::{Heard, ask_status};
use super::search::{Found, OTHER_BAUDS, Outcome, TRIES, UNIT, persist, search};
use crate::failure::Failure;
use crate::interrupt::Interrupt;
use crate::line::{Line, Settings};
use crate::platform::Clock;
use crate::port::{BAUD, Port};
use crate::{ports, tcp, words};

/// For an answer to a longer read.
const WAIT: Duration = Duration::from_millis(80);
/// Units that gateways and other programs use instead of the gripper's own.
const OTHER_TCP_UNITS: [u8; 4] = [9, 1, 255, 0];
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
    let error = match network_status(port, interrupt) {
        Ok(status) => return says(&status, "3-Finger gripper", findings),
        Err(error) => error,
    };
    let silent = matches!(error, tcp::Error::Timeout | tcp::Error::Exception(_));
    for unit in OTHER_TCP_UNITS.into_iter().filter(|_| silent) {
        let Ok(port) = tcp::Port::connect(address, unit, interrupt) else {
            continue;
        };
        if let Ok(status) = network_status(port, interrupt) {
            findings.wrong(
                "unit",
                format!("unit {unit} answers, not unit {}", tcp::UNIT),
                format!("`gauntlet gripper … --unit {unit}`"),
            );
            return says(&status, "3-Finger gripper", findings);
        }
    }
    if interrupt.asked() {
        return interrupted(findings);
    }
    let tried = OTHER_TCP_UNITS.map(|unit| unit.to_string()).join(", ");
    let what = if silent {
        format!("{error}; asked unit {}, then {tried}", tcp::UNIT)
    } else {
        error.to_string()
    };
    findings.wrong("gripper", what, error.next_step());
}

/// Reads for a second; the newest status, or what is wrong with the line.
fn network_status(port: tcp::Port, interrupt: &Interrupt) -> Result<Status<4>, tcp::Error> {
    let config = port.driver_config();
    let mut driver = ThreeFinger::new(Line::Tcp(port), config);
    sample(&mut driver, interrupt)
        .ok_or_else(|| driver.serial_mut().error().unwrap_or(tcp::Error::Timeout))
}

fn interrupted(findings: &mut Findings) {
    findings.note("search", "interrupted before it was done", "again");
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
    if let Heard::Exception(code) = first {
        return findings.wrong(
            "unit",
            format!("unit {UNIT} refuses a status read with exception {code:02X}"),
            "whether this device is a Robotiq gripper",
        );
    }
    if glove_answers(path, interrupt) {
        return findings.wrong(
            "line",
            "this is the glove's port: its serial bridge (SC18IM) answers, no gripper",
            "the other port for --gripper (`gauntlet ports`)",
        );
    }
    match search(path, &first, interrupt) {
        Outcome::Found(found) => elsewhere(path, found, findings, interrupt),
        Outcome::Nobody(searched) => nobody(&first, &searched, findings),
        Outcome::Interrupted => interrupted(findings),
    }
}

/// Somebody answers, but not where a gripper does as delivered.
fn elsewhere(path: &Path, found: Found, findings: &mut Findings, interrupt: &Interrupt) {
    let Found { baud, unit } = found;
    let (other_baud, other_unit) = (baud != BAUD, unit != UNIT);
    let mut options = String::new();
    if other_baud {
        options.push_str(&format!(" --baud {baud}"));
    }
    if other_unit {
        options.push_str(&format!(" --unit {unit}"));
    }
    let next = format!(
        "`gauntlet gripper …{options}`, or set unit {UNIT} and {BAUD} baud in the maker's tool"
    );
    if other_baud {
        let what = format!("it answers at {baud} baud, not at {BAUD}");
        findings.wrong("line", what, &next);
    }
    if other_unit {
        let what = format!("unit {unit} answers at {baud} baud, not unit {UNIT}");
        findings.wrong("unit", what, &next);
    }
    let settings = Settings {
        baud: other_baud.then_some(baud),
        unit: other_unit.then_some(unit),
        ..Settings::default()
    };
    reopen(path, settings, findings, interrupt);
}

fn nobody(first: &Heard, searched: &[u32], findings: &mut Findings) {
    let mut tried = format!(
        "asked unit {UNIT} at {BAUD} and {} other speeds",
        OTHER_BAUDS.len()
    );
    if !searched.is_empty() {
        let speeds: Vec<String> = searched.iter().map(u32::to_string).collect();
        tried.push_str(&format!(
            ", then units 1 to 247 at {} baud",
            speeds.join(", ")
        ));
    }
    match first {
        Heard::Noise(count) => findings.wrong(
            "line",
            format!("bytes come but no Modbus frame: {count} bytes at {BAUD} baud; {tried}"),
            "whether this is the gripper's port and not the glove's; RS-485 A against B, ground and termination",
        ),
        Heard::Echo => findings.wrong(
            "line",
            format!("only the adapter's own echo comes back; {tried}"),
            "the gripper's 24 V supply, and RS-485 A against B",
        ),
        _ => findings.wrong(
            "line",
            format!("no byte comes; {tried}"),
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
