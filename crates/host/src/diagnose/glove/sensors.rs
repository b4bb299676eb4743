//! The 16 sensors: which of them give orientations, and how often.

use std::path::Path;
use std::time::{Duration, Instant};

use bridge::Platform;
use glove::bus::Bus;
use glove::calibration::Step;
use glove::hand::{SEGMENT_COUNT, SEGMENT_NAMES};
use glove::imu;
use glove::scan::{BusScanner, Health, State};

use super::{own, worn};
use crate::calibration::virtual_person::VirtualPerson;
use crate::clock::Clock;
use crate::diagnose::Findings;
use crate::interrupt::Interrupt;
use crate::lines::Pc;
use crate::lines::glove::Reading;
use crate::lines::port::Watch;
use crate::scanning::Scanned;

/// All sensors are up 1.6 s after power-on.
const BRING_UP: Duration = Duration::from_secs(6);
/// By so much later all sensors that fail in a step again and again are through with it.
const STUBBORN: Duration = Duration::from_secs(12);
/// Time for a sensor to come after the first frame.
const STRAGGLERS: Duration = Duration::from_secs(2);
/// For the noise and the drift of the sensors' headings: to about 1 °/min.
const LYING: Duration = Duration::from_secs(3);
/// A virtual person hears late, and takes its time.
const SETTLES: Duration = Duration::from_secs(2);
/// The longest wait between two looks.
const LOOK: glove::Duration = glove::Duration::from_millis(1);

/// Which glove it is.
#[derive(Debug, Clone, Copy)]
pub struct Examined<'a> {
    /// Where it is, as it was named.
    pub place: &'a Path,
    /// Address of its multiplexer.
    pub mux: u8,
    /// How it is read.
    pub reading: Reading,
    /// The speed its serial bridge was found at; `None` on an I²C port.
    pub found: Option<u32>,
}

/// Brings the sensors up, and looks which of them give orientations, and how well.
pub fn sensors<B: Bus>(
    mut scanner: BusScanner<B>,
    glove: &Examined<'_>,
    watch: Watch,
    findings: &mut Findings,
    interrupt: &Interrupt,
) {
    let clock = Clock::start();
    let mut pc = Pc::new(clock, [watch], interrupt.clone());
    let layer = match glove.found {
        Some(_) => "bridge",
        None => "bus",
    };
    let mut end = Instant::now() + BRING_UP;
    let longest = end + STUBBORN;
    let (mut frames, mut since) = (0_u32, Instant::now());
    let mut seen = [Seen::default(); SEGMENT_COUNT];
    // Not before each was brought up, or has failed: what it failed with is the finding.
    let tried = |scanner: &BusScanner<B>| {
        scanner.state() != State::Starting && !scanner.health().contains(&Health::Starting)
    };
    while (Instant::now() < end || !tried(&scanner) && Instant::now() < longest)
        && !interrupt.asked()
    {
        let now = pc.now();
        let Some(frame) = scanner.poll(now) else {
            let due = scanner.next_due().unwrap_or(now + LOOK);
            pc.wait_until(due.clamp(now, now + LOOK));
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
        let baud = scanner.bus_mut().line_baud();
        let raised = match baud {
            Some(baud) if glove.found != Some(baud) => format!(", set to {baud} baud"),
            _ => String::new(),
        };
        findings.good(layer, format!("{rate:.1} scans/s{raised}"));
        let place = glove.place.display().to_string();
        if let Some(slow) = baud.and_then(|baud| glove.reading.slow(&place, baud)) {
            findings.note(layer, slow.what, slow.next);
        }
    }
    if matches!(scanner.state(), State::NoAnswer | State::Resync) {
        let what = match glove.found {
            Some(_) => "the serial bridge answers one question and then falls silent",
            None => "the I2C port does not come back from a transaction",
        };
        return findings.wrong(
            layer,
            what,
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
    if lasting.iter().all(|health| health.is_good()) {
        let ids = scanner.ids();
        let mut worn = worn::Worn::of(&ids, findings);
        let lying = watch_lying(&mut scanner, &mut pc, &mut worn, glove.place, interrupt);
        let mut bus = scanner.into_bus();
        let driven = (clock, interrupt);
        own::tell(&mut bus, glove.mux, &ids, &lying, findings, driven);
        worn.tell(glove.place, findings);
    }
}

/// How the sensors are while nobody is asked to move; the virtual person of a simulated glove lays the hand flat.
fn watch_lying<B: Bus>(
    scanner: &mut BusScanner<B>,
    pc: &mut Pc,
    worn: &mut worn::Worn,
    place: &Path,
    interrupt: &Interrupt,
) -> own::Lying {
    let mut lying = own::Lying::default();
    let person = VirtualPerson::at(place);
    if let Some(person) = &person {
        person.ask(Step::FirstFlat);
    }
    let settled = Instant::now()
        + if person.is_some() {
            SETTLES
        } else {
            Duration::ZERO
        };
    let end = settled + LYING;
    worn.begin(pc.now(), LYING + SETTLES);
    while Instant::now() < end && !interrupt.asked() {
        let now = pc.now();
        match scanner.poll(now) {
            Some(frame) => {
                if Instant::now() >= settled {
                    lying.take(&frame, now);
                }
                worn.take(&Scanned {
                    frame,
                    at: now,
                    starts: scanner.counters().starts,
                    ids: scanner.ids(),
                });
            }
            None => {
                let due = scanner.next_due().unwrap_or(now + LOOK);
                pc.wait_until(due.clamp(now, now + LOOK));
            }
        }
    }
    if let Some(person) = &person {
        person.let_go();
    }
    lying
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

/// Tells which sensors are not good, and why; those of one channel together.
pub fn judge(health: &[Health; SEGMENT_COUNT], findings: &mut Findings) {
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
                SEGMENT_NAMES[0],
                words(&health[0])
            ),
            cure(&health[0])
                .unwrap_or("the sensors' power, and the cable between multiplexer and sensors"),
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
                    words(&health[a]),
                    SEGMENT_NAMES[b],
                    words(&health[b])
                ),
                cure(&health[a])
                    .unwrap_or("that channel's cable, its pull-ups, and the power of its sensors"),
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
            "{} (channel {}, address {:#04X}): {}",
            SEGMENT_NAMES[k],
            imu::channel(k),
            imu::address(k),
            words(health)
        ),
        cure(health)
            .unwrap_or("its plug and power; its address pin (COM3: low is 0x28, high is 0x29)"),
    );
}

/// What a sensor's health says, its register by the data sheet's name.
fn words(health: &Health) -> String {
    match health {
        Health::Missing(imu::Error::ReadBack {
            register,
            wrote,
            read,
        }) => format!(
            "its register {} ({register:#04X}) reads back otherwise: wrote {wrote:#04X}, read {read:#04X}",
            name_of(*register)
        ),
        other => other.to_string(),
    }
}

/// What helps, where it is neither cable nor power.
fn cure(health: &Health) -> Option<&'static str> {
    match health {
        Health::Missing(imu::Error::ReadBack { .. }) => Some(
            "switching the glove off and on; if it stays, another chip than a BNO055 answers there, or another program \
             writes to it",
        ),
        Health::Missing(imu::Error::ChipId(_)) => {
            Some("another chip than a BNO055 answers there: its address pin, or the part")
        }
        _ => None,
    }
}

/// Names of the BNO055's registers that are written.
fn name_of(register: u8) -> &'static str {
    match register {
        0x07 => "PAGE_ID",
        0x3B => "UNIT_SEL",
        0x3D => "OPR_MODE",
        0x3E => "PWR_MODE",
        0x3F => "SYS_TRIGGER",
        0x41 => "AXIS_MAP_CONFIG",
        0x42 => "AXIS_MAP_SIGN",
        0x55..=0x6A => "calibration",
        _ => "of the BNO055",
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
        let kept = imu::Error::ReadBack {
            register: 0x3B,
            wrote: 0,
            read: 0x80,
        };
        let findings = judged([Health::Missing(kept); SEGMENT_COUNT]);
        assert_eq!(findings.faults(), 1);
        let what = &findings.0[0].what;
        assert!(
            what.contains("UNIT_SEL (0x3B) reads back otherwise: wrote 0x00, read 0x80"),
            "{what}"
        );
        let findings = judged([Health::Good; SEGMENT_COUNT]);
        assert!(findings.0.iter().all(|f| f.verdict == Verdict::Good));
    }
}
