//! Several questions to the serial bridge (SC18IM), and what they say of the line together.

use std::time::Duration;

use glove::timing;

use super::bridge_chip::{BAUDS, READ_STATUS, WAIT};
use crate::diagnose::Findings;
use crate::diagnose::raw::{self, Expect, Heard, hex, listen, text};
use crate::interrupt::Interrupt;
use crate::lines::port::Port;
use crate::next::{Command, advice};
use crate::stats;

/// For the first answer, however late.
const FIRST_WAIT: Duration = Duration::from_millis(500);
/// For bytes that nobody asked for.
const LISTEN: Duration = Duration::from_millis(60);
/// A command cut off by whoever used the port before is forgotten after this.
const IDLE: Duration = Duration::from_millis(700);
/// Good answers that are enough.
const ENOUGH: usize = 4;
/// Times a register must read otherwise.
const TRIES: usize = 3;
/// Questions at most; and without any good answer.
const MOST: usize = 7;
const HOPELESS: usize = 3;

/// What came after one question.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Met {
    Silence,
    /// I2CStat, and whether the question came back before it.
    Status(u8, bool),
    /// Only the question.
    Echo,
    Noise(Vec<u8>),
}

/// What came after several.
#[derive(Debug, Default)]
pub struct Survey {
    met: Vec<(Met, Duration)>,
    unasked: Vec<u8>,
}

/// Sends `bytes`; whatever comes until `enough` bytes are there and the line is quiet, for `wait` at most.
pub fn ask(
    port: &mut Port,
    bytes: &[u8],
    enough: usize,
    wait: Duration,
    interrupt: &Interrupt,
) -> Vec<u8> {
    let expect = |heard: &[u8]| match heard.len() {
        count if count >= enough => Expect::Nothing,
        _ => Expect::Answer,
    };
    raw::ask(port, bytes, wait, interrupt, expect).bytes
}

/// Listens, then asks for I2CStat several times.
pub fn survey(port: &mut Port, interrupt: &Interrupt) -> Survey {
    let mut survey = Survey {
        unasked: listen(port, LISTEN, interrupt),
        ..Survey::default()
    };
    for attempt in 0..MOST {
        let good = survey.good();
        if good >= ENOUGH || good == 0 && attempt == HOPELESS || interrupt.asked() {
            break;
        }
        if good == 0 && attempt == HOPELESS - 1 {
            interrupt.sleep(IDLE);
        }
        let wait = if attempt == 0 { FIRST_WAIT } else { WAIT };
        let heard = raw::ask(port, &READ_STATUS, wait, interrupt, |bytes| {
            match judge(bytes) {
                Met::Status(..) => Expect::Nothing,
                Met::Echo => Expect::AnswerAfterEcho,
                Met::Silence | Met::Noise(_) => Expect::Answer,
            }
        });
        let Heard { bytes, first, .. } = heard;
        survey.met.push((judge(&bytes), first));
    }
    survey
}

/// Writes the I²C clock and timeout as the driver does, and reads them back: the first register that reads otherwise every
/// time, in words. Nothing where no whole answer comes: that is told elsewhere.
pub fn unkept(port: &mut Port, interrupt: &Interrupt) -> Option<String> {
    const NAMES: [&str; 3] = ["I2CClkL (0x07)", "I2CClkH (0x08)", "I2CTO (0x09)"];
    let wrote = [
        timing::I2C_DIVIDER,
        timing::I2C_DIVIDER,
        timing::I2C_TIMEOUT,
    ];
    let [low, high, timeout] = wrote;
    let set = [0x57, 0x07, low, 0x08, high, 0x09, timeout, 0x50];
    let read = [0x52, 0x07, 0x50, 0x52, 0x08, 0x50, 0x52, 0x09, 0x50];
    let question = [&set[..], &read[..]].concat();
    let mut told = None;
    for _ in 0..TRIES {
        let heard = ask(port, &question, NAMES.len(), WAIT, interrupt);
        let whole = heard.len() == NAMES.len();
        let other = (0..NAMES.len()).find(|at| whole && heard[*at] != wrote[*at])?;
        told = Some(format!(
            "the serial bridge's register {} reads back otherwise: wrote {:#04X}, read {:#04X}",
            NAMES[other], wrote[other], heard[other]
        ));
    }
    told
}

/// What to try then.
pub const UNKEPT_NEXT: &str = "unplugging the glove and plugging it in again; if it stays, the chip is no SC18IM700 or 704, or another \
     program writes to it";

fn judge(heard: &[u8]) -> Met {
    match heard {
        [] => Met::Silence,
        [status @ 0xF0..=0xF8] => Met::Status(*status, false),
        [0x52, 0x0A, 0x50, status @ 0xF0..=0xF8] => Met::Status(*status, true),
        _ if READ_STATUS.starts_with(heard) => Met::Echo,
        other => Met::Noise(other.to_vec()),
    }
}

impl Survey {
    fn good(&self) -> usize {
        let is_good = |met: &&(Met, Duration)| matches!(met.0, Met::Status(..));
        self.met.iter().filter(is_good).count()
    }

    /// The newest I2CStat, where half of the questions or more were answered.
    pub fn status(&self) -> Option<u8> {
        let newest = self.met.iter().rev().find_map(|(met, _)| match met {
            Met::Status(status, _) => Some(*status),
            _ => None,
        });
        newest.filter(|_| 2 * self.good() >= self.met.len())
    }

    /// Tells what is odd about the answers.
    pub fn tell(&self, findings: &mut Findings) {
        let (good, asked) = (self.good(), self.met.len());
        if good < asked {
            let what = format!("{good} of {asked} questions were answered with one byte, I2CStat");
            let next = "TX, RX and ground between adapter and glove; a PC with less other work";
            findings.note("bridge", what, next);
        }
        if self
            .met
            .iter()
            .any(|(met, _)| matches!(met, Met::Status(_, true)))
        {
            findings.wrong(
                "bridge",
                "the adapter gives back what it is given: its TX and RX touch, or it is an RS-485 adapter",
                "an adapter for UART levels (TX and RX apart); TX and RX without a bridge between them",
            );
        }
        let slack = Duration::from_micros(timing::REPLY_SLACK.as_micros());
        let mut late: Vec<Duration> = self.met.iter().map(|(_, after)| *after).collect();
        late.sort_unstable();
        if let Some(middle) = late.get(late.len() / 2).filter(|middle| **middle > slack) {
            let what = format!(
                "answers come late: {} ms after the question, where {} ms are waited for",
                middle.as_millis(),
                slack.as_millis()
            );
            let next = advice("an adapter with a latency timer of 1 ms (")
                .then(Command::gauntlet("ports"))
                .then("), on this machine and not behind a tunnel");
            findings.wrong("bridge", what, next);
        }
    }

    fn noise(&self) -> Option<&[u8]> {
        if !self.unasked.is_empty() {
            return Some(&self.unasked);
        }
        self.met.iter().find_map(|(met, _)| match met {
            Met::Noise(bytes) => Some(&bytes[..]),
            _ => None,
        })
    }
}

/// No serial bridge answered at any of these speeds.
pub fn nobody(seen: &[(u32, Survey)], findings: &mut Findings) {
    let speeds: Vec<String> = seen.iter().map(|(baud, _)| baud.to_string()).collect();
    let speeds = speeds.join(", ");
    let all_echo =
        |(_, survey): &(u32, Survey)| survey.met.iter().any(|(met, _)| *met == Met::Echo);
    if seen.iter().any(all_echo) {
        return findings.wrong(
            "bridge",
            format!("only the adapter's own echo comes back, no I2CStat; asked at {speeds} baud"),
            "TX and RX that touch, an RS-485 adapter instead of one for UART levels; then the glove's power",
        );
    }
    let unasked = seen.iter().find(|(_, survey)| !survey.unasked.is_empty());
    if let Some((baud, survey)) = unasked {
        return findings.wrong(
            "bridge",
            format!(
                "bytes come without being asked for: {} at {baud} baud ({}); asked at {speeds} baud",
                survey.unasked.len(),
                shown(&survey.unasked)
            ),
            advice("whether this is the glove's port (")
                .then(Command::gauntlet("ports"))
                .then("): something that talks by itself is on it"),
        );
    }
    let noisy = seen
        .iter()
        .find_map(|(baud, survey)| Some((*baud, survey.noise()?)));
    let Some((baud, bytes)) = noisy else {
        let tried: Vec<String> = BAUDS.iter().map(u32::to_string).collect();
        let speeds = if seen.is_empty() {
            tried.join(", ")
        } else {
            speeds
        };
        return findings.wrong(
            "bridge",
            format!("no byte comes: no OK, no I2CStat; asked at {speeds} baud"),
            advice("the glove's power, TX against RX, and whether this is the gripper's port (")
                .then(Command::gauntlet("ports"))
                .then(")"),
        );
    };
    findings.wrong(
        "bridge",
        format!(
            "{} come{} at {baud} baud, but no I2CStat (one byte F0 to F8): {}; asked at {speeds} baud",
            stats::bytes(bytes.len()),
            if bytes.len() == 1 { "s" } else { "" },
            shown(bytes)
        ),
        "unplug the glove and plug it in again (it then speaks 9600 baud); whether this is the glove's port",
    );
}

fn shown(bytes: &[u8]) -> String {
    match text(bytes) {
        Some(text) => format!("“{text}”"),
        None => hex(bytes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_status_an_echo_and_noise_are_told_apart() {
        assert_eq!(judge(&[]), Met::Silence);
        assert_eq!(judge(&[0xF1]), Met::Status(0xF1, false));
        assert_eq!(judge(&[0x52, 0x0A, 0x50, 0xF0]), Met::Status(0xF0, true));
        assert_eq!(judge(&READ_STATUS), Met::Echo);
        assert_eq!(judge(&[0xF0, 0]), Met::Noise(vec![0xF0, 0]));
    }

    #[test]
    fn one_byte_that_looks_like_a_status_among_others_is_no_glove() {
        let met = |list: Vec<Met>| Survey {
            met: list.into_iter().map(|met| (met, Duration::ZERO)).collect(),
            ..Survey::default()
        };
        let noise = Met::Noise(vec![1, 2]);
        let lucky = met(vec![noise.clone(), Met::Status(0xF3, false), noise.clone()]);
        assert_eq!(lucky.status(), None);
        let steady = met(vec![
            Met::Status(0xF0, false),
            Met::Status(0xF0, false),
            noise,
        ]);
        assert_eq!(steady.status(), Some(0xF0));
    }
}
