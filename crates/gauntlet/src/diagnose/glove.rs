//! A glove's layers: port, serial bridge (SC18IM), I²C multiplexer (TCA9548A), 16 sensors.

use std::path::Path;
use std::time::{Duration, Instant};

use glove::hand::{SEGMENT_COUNT, SEGMENT_NAMES};
use glove::imu;
use glove::scan::{Config, Health, Scanner, State};

use super::Findings;
use super::raw::ask;
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
                sensors(port, baud, &mut findings, interrupt);
                return findings;
            }
            Err(bytes) if !bytes.is_empty() => noise.push((baud, bytes)),
            Err(_) => {}
        }
    }
    nobody(&noise, &mut findings);
    findings
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
    if status == 0xF8 {
        findings.note(
            "bridge",
            "I2CStat is F8: the last transfer on the I2C bus timed out",
            "looking at SDA and SCL if sensors are missing below",
        );
    }
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
fn sensors(port: Port, baud: u32, findings: &mut Findings, interrupt: &Interrupt) {
    let config = Config {
        baud,
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
    while Instant::now() < end && !interrupt.sleep(Duration::from_millis(1)) {
        let Some(frame) = scanner.poll(clock.now()) else {
            continue;
        };
        if frames == 0 {
            since = Instant::now();
            end = end.min(since + STRAGGLERS);
        }
        frames += 1;
        if frame.good() == u16::MAX && frames >= 10 {
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
    judge(&scanner.health(), findings);
}

fn judge(health: &[Health; SEGMENT_COUNT], findings: &mut Findings) {
    let lost: Vec<usize> = (0..SEGMENT_COUNT)
        .filter(|k| !health[*k].is_good())
        .collect();
    if lost.is_empty() {
        findings.good("multiplexer", "selects all 8 channels");
        return findings.good("sensors", "all 16 give orientations");
    }
    let mux = |k: &&usize| matches!(health[**k], Health::Missing(imu::Error::Mux(_)));
    if lost.len() == SEGMENT_COUNT && lost.iter().all(|k| mux(&k)) {
        return findings.wrong(
            "multiplexer",
            format!(
                "the I2C multiplexer (TCA9548A at 0x70) is missing: {}",
                health[0]
            ),
            "its power, SDA and SCL, and its address pins A0 to A2 (all low for 0x70)",
        );
    }
    if lost.len() == SEGMENT_COUNT {
        return findings.wrong(
            "sensors",
            format!(
                "none of the 16 gives an orientation; the first: {}",
                health[0]
            ),
            "the sensors' power, and the cable between multiplexer and sensors",
        );
    }
    for k in lost {
        findings.wrong(
            "sensors",
            format!(
                "{} (channel {}, address {:#04X}): {}",
                SEGMENT_NAMES[k],
                imu::channel(k),
                imu::address(k),
                health[k]
            ),
            "its plug and cable; its address pin (COM3), if its neighbour on the channel is missing too",
        );
    }
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
    fn a_missing_multiplexer_is_one_finding_and_two_missing_sensors_are_two() {
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
        let findings = judged([Health::Good; SEGMENT_COUNT]);
        assert!(findings.0.iter().all(|f| f.verdict == Verdict::Good));
    }
}
