//! A glove's layers: port, serial bridge (SC18IM), I²C multiplexer (TCA9548A), 16 sensors.

use std::path::Path;
use std::time::{Duration, Instant};

use glove::hand::{SEGMENT_COUNT, SEGMENT_NAMES};
use glove::scan::{Config, Health, Scanner, State};
use glove::{imu, mux};

use super::Findings;
use super::raw::{Heard, ask};
use super::search::{UNIT, persist};
use crate::failure::Failure;
use crate::interrupt::Interrupt;
use crate::platform::Clock;
use crate::port::{BAUD, Port};
use crate::ports;

/// The SC18IM's speed after power-on.
const RESET_BAUD: u32 = 9_600;
/// Speeds it may have been left at, likeliest first.
const BAUDS: [u32; 4] = [BAUD, RESET_BAUD, 460_800, 230_400];
/// Read the register I2CStat: `R 0A P`.
const READ_STATUS: [u8; 3] = [0x52, 0x0A, 0x50];
/// Write the register I2CTO (09), 3 × 4.44 ms, on: else a bus that hangs keeps the bridge silent for ever.
const SET_TIMEOUT: [u8; 4] = [0x57, 0x09, 0x07, 0x50];
/// Addresses a TCA9548A can have; the first is the one every program here expects.
const MULTIPLEXERS: std::ops::RangeInclusive<u8> = mux::ADDRESS..=mux::ADDRESS + 7;
/// I2CStat: done, nobody acknowledged the address, the bus hung.
const DONE: u8 = 0xF0;
const NO_ACKNOWLEDGE: u8 = 0xF1;
const BUS_HUNG: u8 = 0xF8;
/// For its one byte: 4.2 ms at 9600 baud, an adapter's latency timer twice, a PC with other work.
const WAIT: Duration = Duration::from_millis(80);
/// A command cut off by whoever used the port before is forgotten after this.
const IDLE: Duration = Duration::from_millis(700);
/// All sensors are up 1.6 s after power-on, slower at 9600 baud.
const BRING_UP: Duration = Duration::from_secs(6);
/// The same at 9600 baud.
const BRING_UP_SLOW: Duration = Duration::from_secs(20);
/// Time for a sensor to come after the first frame.
const STRAGGLERS: Duration = Duration::from_secs(2);

/// Finds out which layer of the glove at `path` fails.
pub fn glove(path: &Path, interrupt: &Interrupt) -> Findings {
    let mut findings = Findings::default();
    match Port::open(path, BAUD) {
        Ok(_) => findings.good("port", format!("{} opens", path.display())),
        Err(error) => {
            findings.failure("port", &Failure::from(error));
            return findings;
        }
    }
    if let Some(warning) = ports::latency_warning(path) {
        findings.wrong("port", warning, "the command above");
    }
    let mut noise = Vec::new();
    for baud in BAUDS {
        let Ok(mut port) = Port::open(path, baud) else {
            continue;
        };
        match answers(&mut port, interrupt) {
            Ok(status) => {
                bridge(baud, status, &mut findings);
                if let Some(address) = multiplexer(&mut port, &mut findings, interrupt) {
                    sensors(port, baud, address, &mut findings, interrupt);
                }
                return findings;
            }
            Err(bytes) if !bytes.is_empty() => noise.push((baud, bytes)),
            Err(_) => {}
        }
    }
    if gripper_answers(path, interrupt) {
        findings.wrong(
            "bridge",
            "this is the gripper's port: a Modbus status comes, no glove",
            "the other port for --glove (`gauntlet ports`)",
        );
    } else {
        nobody(&noise, &mut findings);
    }
    findings
}

/// Whether a glove's serial bridge answers at `path`, at the speed it is set to or that of its power-on.
pub(super) fn glove_answers(path: &Path, interrupt: &Interrupt) -> bool {
    [BAUD, RESET_BAUD].into_iter().any(|baud| {
        Port::open(path, baud).is_ok_and(|mut port| {
            // Noise may look like it once.
            (0..3).all(|_| {
                let heard = ask(&mut port, &READ_STATUS, 1, WAIT, interrupt);
                matches!(heard[..], [0xF0..=0xF8])
            })
        })
    })
}

fn gripper_answers(path: &Path, interrupt: &Interrupt) -> bool {
    Port::open(path, BAUD).is_ok_and(|mut port| {
        let heard = persist(&mut port, UNIT, interrupt);
        matches!(heard, Heard::Answer(..))
    })
}

/// I2CStat, or what came instead of it.
fn answers(port: &mut Port, interrupt: &Interrupt) -> Result<u8, Vec<u8>> {
    let mut worst = Vec::new();
    for attempt in 0..3 {
        if attempt == 2 {
            interrupt.sleep(IDLE);
        }
        let heard = ask(port, &READ_STATUS, 1, WAIT, interrupt);
        match heard[..] {
            [status @ 0xF0..=0xF8] => return Ok(status),
            [] => {}
            _ => worst = heard,
        }
    }
    Err(worst)
}

fn bridge(baud: u32, status: u8, findings: &mut Findings) {
    let what = format!("the serial bridge (SC18IM) answers at {baud} baud");
    match baud {
        BAUD => findings.good("bridge", what),
        RESET_BAUD => findings.note(
            "bridge",
            format!("{what}, as after power-on"),
            "nothing: `gauntlet teleop` switches it to 115200",
        ),
        _ => findings.wrong(
            "bridge",
            format!("{what}: another program left it there"),
            "unplug the glove and plug it in again: it then speaks 9600 baud, which `teleop` expects",
        ),
    }
    // The status is that of the last transfer, which may have been somebody else's.
    if status == BUS_HUNG {
        findings.note(
            "bridge",
            "I2CStat is F8: the last transfer on the I2C bus timed out",
            "looking at SDA and SCL if sensors are missing below",
        );
    }
}

/// The address the multiplexer answers at; asked by deselecting its channels, which changes nothing that lasts.
fn multiplexer(port: &mut Port, findings: &mut Findings, interrupt: &Interrupt) -> Option<u8> {
    // No answer belongs to this; the next question shows whether it was understood.
    ask(port, &SET_TIMEOUT, 0, Duration::ZERO, interrupt);
    let mut status = |address: u8| {
        let question = [0x53, address << 1, 0x01, 0x00, 0x50, 0x52, 0x0A, 0x50];
        (0..3).find_map(|_| match ask(port, &question, 1, WAIT, interrupt)[..] {
            [status @ 0xF0..=0xF8] => Some(status),
            _ => None,
        })
    };
    let expected = mux::ADDRESS;
    match status(expected) {
        Some(DONE) => {
            findings.good(
                "multiplexer",
                format!("the I2C multiplexer (TCA9548A) answers at {expected:#04X}"),
            );
            return Some(expected);
        }
        Some(NO_ACKNOWLEDGE) => {}
        Some(BUS_HUNG) => {
            findings.wrong(
                "bus",
                "the I2C bus hangs: SDA or SCL is held low (I2CStat F8)",
                "a short on SDA or SCL, or a chip that holds them: switch the glove off and on; then unplug the multiplexer and look again",
            );
            return None;
        }
        Some(other) => {
            findings.wrong(
                "multiplexer",
                format!("the I2C multiplexer (TCA9548A at {expected:#04X}) does not take its control byte (I2CStat {other:02X})"),
                "SDA and SCL between serial bridge and multiplexer, their pull-ups and length",
            );
            return None;
        }
        None if interrupt.asked() => {
            findings.note("multiplexer", "interrupted", "again");
            return None;
        }
        None => {
            findings.wrong(
                "bridge",
                "the serial bridge answers one question, then falls silent over a message on the I2C bus",
                "SDA and SCL (a short keeps the bus busy), the glove's power; then unplug it and plug it in again",
            );
            return None;
        }
    }
    let elsewhere = MULTIPLEXERS
        .skip(1)
        .find(|address| status(*address) == Some(DONE));
    match elsewhere {
        Some(address) => findings.wrong(
            "multiplexer",
            format!("the I2C multiplexer (TCA9548A) answers at {address:#04X}, not at {expected:#04X}"),
            "its address pins A0, A1 and A2 low",
        ),
        None => findings.wrong(
            "multiplexer",
            format!("the I2C multiplexer (TCA9548A) is missing: nobody acknowledges {expected:#04X} to 0x77 (I2CStat F1)"),
            "its power, its RESET pin high, SDA and SCL between it and the serial bridge",
        ),
    }
    elsewhere
}

fn nobody(noise: &[(u32, Vec<u8>)], findings: &mut Findings) {
    let speeds = BAUDS.map(|baud| baud.to_string()).join(", ");
    let Some((baud, bytes)) = noise.first() else {
        return findings.wrong(
            "bridge",
            format!("no byte comes: no OK, no I2CStat; asked at {speeds} baud"),
            "the glove's power, TX against RX, and whether this is the gripper's port (`gauntlet ports`)",
        );
    };
    let count = bytes.len();
    findings.wrong(
        "bridge",
        format!("{count} bytes come at {baud} baud, but no I2CStat (one byte F0 to F8); asked at {speeds} baud"),
        "unplug the glove and plug it in again (it then speaks 9600 baud); whether this is the glove's port",
    );
}

/// Brings the sensors up and looks which of them give orientations.
fn sensors(port: Port, baud: u32, mux: u8, findings: &mut Findings, interrupt: &Interrupt) {
    let config = Config {
        baud,
        mux,
        ..Config::default()
    };
    let mut scanner = Scanner::new(port, config);
    let clock = Clock::start();
    let time = if baud == RESET_BAUD {
        BRING_UP_SLOW
    } else {
        BRING_UP
    };
    let mut end = Instant::now() + time;
    let (mut frames, mut since) = (0_u32, Instant::now());
    let mut seen = [Seen::default(); SEGMENT_COUNT];
    while Instant::now() < end && !interrupt.sleep(Duration::from_millis(1)) {
        let Some(frame) = scanner.poll(clock.now()) else {
            continue;
        };
        if frames == 0 {
            since = Instant::now();
            end = end.min(since + STRAGGLERS);
        }
        frames += 1;
        for (seen, sample) in seen.iter_mut().zip(&frame.samples) {
            seen.take(sample.health);
        }
        if seen.iter().all(|seen| seen.good > 0) && frames >= 10 {
            break;
        }
    }
    if interrupt.asked() {
        return findings.note("sensors", "interrupted", "again");
    }
    if frames > 1 {
        let rate = f64::from(frames - 1) / since.elapsed().as_secs_f64();
        findings.good("bridge", format!("{rate:.0} scans a second"));
    }
    if matches!(scanner.state(), State::NoAnswer | State::Resync) {
        return findings.wrong(
            "bridge",
            "the serial bridge answers one question and then falls silent",
            "cable and power of the glove; then unplug it and plug it in again",
        );
    }
    let health = scanner.health();
    // One that gave orientations and missed the last scan is not missing.
    let lasting = core::array::from_fn(|k| match seen[k].good {
        0 => health[k],
        _ => Health::Good,
    });
    judge(&lasting, findings);
    for (k, seen) in seen.iter().enumerate() {
        unsteady(k, seen, findings);
    }
}

/// How a sensor did from its first good sample on.
#[derive(Debug, Clone, Copy, Default)]
struct Seen {
    good: u32,
    bad: u32,
    worst: Option<Health>,
}

impl Seen {
    fn take(&mut self, health: Health) {
        if health.is_good() {
            self.good += 1;
        } else if self.good > 0 {
            self.bad += 1;
            self.worst = Some(health);
        }
    }
}

/// Tells of a sensor that comes and goes. One lost sample in five is more than a healthy line loses.
fn unsteady(k: usize, seen: &Seen, findings: &mut Findings) {
    let Seen {
        good,
        bad,
        worst: Some(health),
    } = *seen
    else {
        return;
    };
    if 4 * bad > good {
        findings.note(
            "sensors",
            format!(
                "{} gives {good} samples of {}: {health}",
                SEGMENT_NAMES[k],
                good + bad
            ),
            "its plug and cable; a PC with less other work",
        );
    }
}

fn judge(health: &[Health; SEGMENT_COUNT], findings: &mut Findings) {
    let lost: Vec<usize> = (0..SEGMENT_COUNT)
        .filter(|k| !health[*k].is_good())
        .collect();
    if lost.is_empty() {
        return findings.good("sensors", "all 16 give orientations");
    }
    let mux = |k: &&usize| matches!(health[**k], Health::Missing(imu::Error::Mux(_)));
    if lost.len() == SEGMENT_COUNT && lost.iter().all(|k| mux(&k)) {
        return findings.wrong(
            "multiplexer",
            format!(
                "the I2C multiplexer answers, but selects no channel: {}",
                health[0]
            ),
            "SDA and SCL between serial bridge and multiplexer, and their pull-ups",
        );
    }
    if lost.len() == SEGMENT_COUNT {
        return findings.wrong(
            "sensors",
            format!(
                "none of the 16 gives an orientation; the first, {}: {}",
                SEGMENT_NAMES[0], health[0]
            ),
            "the sensors' power, and the cable between multiplexer and sensors",
        );
    }
    for pair in lost.chunk_by(|a, b| imu::channel(*a) == imu::channel(*b)) {
        match *pair {
            [a, b] => findings.wrong(
                "sensors",
                format!(
                    "both sensors of channel {}: {}: {}; {}: {}",
                    imu::channel(a),
                    SEGMENT_NAMES[a],
                    health[a],
                    SEGMENT_NAMES[b],
                    health[b]
                ),
                "that channel's cable, its pull-ups, and the power of its sensors",
            ),
            _ => pair
                .iter()
                .for_each(|k| one_missing(*k, &health[*k], findings)),
        }
    }
}

fn one_missing(k: usize, health: &Health, findings: &mut Findings) {
    findings.wrong(
        "sensors",
        format!(
            "{} (channel {}, address {:#04X}): {health}",
            SEGMENT_NAMES[k],
            imu::channel(k),
            imu::address(k),
        ),
        "its plug and power; its address pin (COM3: low is 0x28, high is 0x29)",
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::Verdict;
    use glove::bus;

    fn judged(health: [Health; SEGMENT_COUNT]) -> Findings {
        let mut findings = Findings::default();
        judge(&health, &mut findings);
        findings
    }

    #[test]
    fn a_dead_multiplexer_a_dead_channel_and_a_lone_sensor_are_one_finding_each() {
        let mux = Health::Missing(imu::Error::Mux(bus::Error::NackAddress));
        let findings = judged([mux; SEGMENT_COUNT]);
        assert_eq!(findings.faults(), 1);
        assert_eq!(findings.0[0].layer, "multiplexer");
        let mut health = [Health::Good; SEGMENT_COUNT];
        health[3] = Health::Missing(imu::Error::ChipId(0));
        health[6] = Health::Starting;
        let findings = judged(health);
        assert_eq!(findings.faults(), 2);
        assert!(findings.0[0].what.contains(SEGMENT_NAMES[3]));
        assert!(findings.0[0].what.contains("channel 1, address 0x29"));
        health[7] = Health::Missing(imu::Error::ChipId(0));
        let findings = judged(health);
        assert_eq!(findings.faults(), 2);
        assert!(findings.0[1].what.contains("both sensors of channel 3"));
        let findings = judged([Health::Good; SEGMENT_COUNT]);
        assert!(findings.0.iter().all(|f| f.verdict == Verdict::Good));
    }
}
