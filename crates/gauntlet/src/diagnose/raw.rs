//! One question on a port, and whatever comes back, byte by byte: the drivers would hide what is wrong.

use std::time::{Duration, Instant};

use embedded_io::{Read, ReadReady, Write};
use gripper::rtu::{Frame, Request};

use crate::interrupt::Interrupt;
use crate::port::Port;

/// Silence that ends an answer: longer than an adapter's 16 ms latency timer.
const QUIET: Duration = Duration::from_millis(20);
/// Pause between two looks.
const LOOK: Duration = Duration::from_millis(1);
/// More bytes than this are no answer to anything asked here.
const MOST: usize = 512;

/// Sends `bytes` and collects what comes: until `enough` bytes are there and the line is quiet, for `wait` at most.
pub fn ask(
    port: &mut Port,
    bytes: &[u8],
    enough: usize,
    wait: Duration,
    interrupt: &Interrupt,
) -> Vec<u8> {
    discard(port);
    let mut heard = Vec::new();
    if port.write(bytes) != Ok(bytes.len()) {
        return heard;
    }
    let (start, mut last) = (Instant::now(), Instant::now());
    while start.elapsed() < wait && heard.len() < MOST {
        let mut chunk = [0; 64];
        if port.read_ready() == Ok(true)
            && let Ok(count) = port.read(&mut chunk)
        {
            heard.extend_from_slice(&chunk[..count]);
            last = Instant::now();
        } else if (heard.len() >= enough && last.elapsed() >= QUIET) || interrupt.sleep(LOOK) {
            break;
        }
    }
    heard
}

fn discard(port: &mut Port) {
    for _ in 0..64 {
        if port.read_ready() != Ok(true) || port.read(&mut [0; 64]).is_err() {
            return;
        }
    }
}

/// What came after a Modbus RTU request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Heard {
    /// Nothing.
    Silence,
    /// The answer: register bytes; and whether the adapter echoes what it is given.
    Answer(Vec<u8>, bool),
    /// The device says no.
    Exception(u8),
    /// A valid frame of another unit.
    Other(u8),
    /// Only a copy of the request.
    Echo,
    /// Bytes that make no frame.
    Noise(usize),
}

/// Judges what came after `request`.
pub fn judge(unit: u8, request: &Request<'_>, sent: &[u8], heard: &[u8]) -> Heard {
    let echoed = heard.starts_with(sent);
    let rest = if echoed { &heard[sent.len()..] } else { heard };
    let frame = |length: usize| {
        let frame = Frame::new_checked(rest.get(..length)?).ok()?;
        Some((frame.unit(), frame.function(), frame.pdu()))
    };
    if rest.is_empty() {
        return if echoed { Heard::Echo } else { Heard::Silence };
    }
    match frame(request.reply_len()) {
        Some((from, function, pdu)) if from == unit && function == request.function() => {
            return Heard::Answer(pdu.get(2..).unwrap_or(&[]).to_vec(), echoed);
        }
        Some((from, ..)) => return Heard::Other(from),
        None => {}
    }
    match frame(gripper::rtu::EXCEPTION_FRAME) {
        Some((from, _, pdu)) if from == unit => Heard::Exception(pdu.get(1).copied().unwrap_or(0)),
        Some((from, ..)) => Heard::Other(from),
        None => Heard::Noise(rest.len()),
    }
}

/// Asks `unit` for `quantity` status registers with FC03.
pub fn ask_status(
    port: &mut Port,
    unit: u8,
    quantity: u16,
    wait: Duration,
    interrupt: &Interrupt,
) -> Heard {
    let request = Request::ReadHolding {
        address: gripper::registers::STATUS,
        quantity,
    };
    let mut frame = [0; 16];
    let Ok(length) = request.emit(unit, &mut frame) else {
        return Heard::Silence;
    };
    let sent = &frame[..length];
    let heard = ask(port, sent, request.reply_len(), wait, interrupt);
    judge(unit, &request, sent, &heard)
}

#[cfg(test)]
mod tests {
    use super::*;

    const REQUEST: Request<'static> = Request::ReadHolding {
        address: 0x07D0,
        quantity: 1,
    };
    const SENT: [u8; 8] = [0x09, 0x03, 0x07, 0xD0, 0x00, 0x01, 0x85, 0xCF];
    const REPLY: [u8; 7] = [0x09, 0x03, 0x02, 0x31, 0x00, 0x4C, 0x15];

    #[test]
    fn answers_echoes_and_noise_are_told_apart() {
        let judge = |heard: &[u8]| judge(9, &REQUEST, &SENT, heard);
        assert_eq!(judge(&[]), Heard::Silence);
        assert_eq!(judge(&SENT), Heard::Echo);
        assert_eq!(judge(&REPLY), Heard::Answer(vec![0x31, 0x00], false));
        let both = [&SENT[..], &REPLY[..]].concat();
        assert_eq!(judge(&both), Heard::Answer(vec![0x31, 0x00], true));
        assert_eq!(judge(&REPLY[1..]), Heard::Noise(6));
        let mut exception = vec![9, 0x83, 2];
        exception.extend(gripper::rtu::crc16(&exception).to_le_bytes());
        assert_eq!(judge(&exception), Heard::Exception(2));
        let other = super::judge(8, &REQUEST, &SENT, &REPLY);
        assert_eq!(other, Heard::Other(9));
    }
}
