//! What came after a Modbus RTU request, judged by all its bytes: where the driver sees a wrong CRC, this sees a whole
//! frame one byte late, a frame without its first byte, or the answer to an earlier question.

use gripper::registers::STATUS;
use gripper::rtu::{EXCEPTION_FRAME, Frame, Request, crc16, function};

/// More foreign bytes before a frame than this are no glitch of the line.
const MOST_BEFORE: usize = 8;

/// What came after a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Came {
    /// Nothing.
    Silence,
    /// The answer, and what was around it.
    Answer(Answer),
    /// The device says no.
    Exception(u8),
    /// The answer of another unit.
    OtherUnit(u8),
    /// An answer of the unit asked, to another question than this.
    OtherQuestion,
    /// Only a copy of the request.
    Echo,
    /// The answer without its first byte.
    Headless,
    /// The answer's beginning.
    Cut {
        /// Bytes that came.
        got: usize,
        /// Bytes of the whole answer.
        of: usize,
    },
    /// The answer's length and beginning, with a wrong CRC.
    Damaged,
    /// Bytes that make no frame.
    Noise(Vec<u8>),
}

/// A good answer, and what was around it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Answer {
    /// Register bytes.
    pub data: Vec<u8>,
    /// The adapter gave back the question first.
    pub echoed: bool,
    /// Bytes before the frame.
    pub before: Vec<u8>,
    /// Bytes after the frame that make no frame.
    pub after: Vec<u8>,
    /// The unit of a second answer.
    pub second: Option<u8>,
    /// The answer to an earlier question came with it.
    pub earlier: bool,
}

/// A read of `quantity` status registers.
pub fn status_read(quantity: u16) -> Request<'static> {
    Request::ReadHolding {
        address: STATUS,
        quantity,
    }
}

/// The frame of such a read. Empty where the request cannot be put into bytes, which it always can.
pub fn emit(unit: u8, quantity: u16) -> Vec<u8> {
    let mut frame = vec![0; 16];
    let length = status_read(quantity).emit(unit, &mut frame).unwrap_or(0);
    frame.truncate(length);
    frame
}

/// Judges what came after a read of `quantity` registers of `unit`.
pub fn judge(unit: u8, quantity: u16, sent: &[u8], heard: &[u8]) -> Came {
    let echoed = heard.starts_with(sent);
    let rest = if echoed { &heard[sent.len()..] } else { heard };
    if rest.is_empty() {
        return if echoed { Came::Echo } else { Came::Silence };
    }
    let length = status_read(quantity).reply_len();
    let wanted = |frame: &Found| frame.unit == unit && frame.bytes == length;
    let frames = found(rest);
    if let Some(at) = frames
        .iter()
        .position(|f| wanted(f) && f.gap <= MOST_BEFORE)
    {
        let frame = &frames[at];
        let end = frame.start + frame.bytes;
        let others = || {
            frames
                .iter()
                .enumerate()
                .filter(|(k, _)| *k != at)
                .map(|(_, f)| f)
        };
        let second = others().find(|other| wanted(other) || other.unit != unit);
        let after = match frames.get(at + 1) {
            Some(_) => &[],
            None => rest.get(end..).unwrap_or(&[]),
        };
        return Came::Answer(Answer {
            data: rest.get(frame.start + 3..end - 2).unwrap_or(&[]).to_vec(),
            echoed,
            before: rest[frame.start - frame.gap..frame.start].to_vec(),
            after: after.to_vec(),
            second: second.map(|frame| frame.unit),
            earlier: second.is_none() && frames.len() > 1,
        });
    }
    if let Some(frame) = frames.first() {
        return match frame.exception {
            Some(code) if frame.unit == unit => Came::Exception(code),
            _ if frame.unit == unit => Came::OtherQuestion,
            _ => Came::OtherUnit(frame.unit),
        };
    }
    spoiled(unit, quantity, length, rest)
}

/// An answer of which something is missing or wrong.
fn spoiled(unit: u8, quantity: u16, length: usize, rest: &[u8]) -> Came {
    let count = u8::try_from(2 * quantity).unwrap_or(u8::MAX);
    let head = [unit, function::READ_HOLDING, count];
    let whole = [&head[..1], rest].concat();
    if rest.len() + 1 == length && Frame::new_checked(&whole).is_ok() {
        return Came::Headless;
    }
    if !rest.starts_with(&head) {
        return Came::Noise(rest.to_vec());
    }
    match rest.len() {
        got if got < length => Came::Cut { got, of: length },
        _ => Came::Damaged,
    }
}

/// Whether there is a whole answer among these bytes.
pub fn holds_answer(bytes: &[u8]) -> bool {
    !found(bytes).is_empty()
}

/// A frame among bytes.
struct Found {
    start: usize,
    /// Bytes between the frame before it and this one.
    gap: usize,
    bytes: usize,
    unit: u8,
    exception: Option<u8>,
}

/// The frames that answer a read of registers, one after another.
fn found(bytes: &[u8]) -> Vec<Found> {
    let mut frames: Vec<Found> = Vec::new();
    let (mut start, mut last_end) = (0, 0);
    while start + EXCEPTION_FRAME <= bytes.len() {
        match frame_at(bytes, start) {
            Some(frame) => {
                let gap = start - last_end;
                start += frame.bytes;
                last_end = start;
                frames.push(Found { gap, ..frame });
            }
            None => start += 1,
        }
    }
    frames
}

fn frame_at(bytes: &[u8], start: usize) -> Option<Found> {
    let [unit, code, third, ..] = *bytes.get(start..)? else {
        return None;
    };
    let (length, exception) = match code {
        function::READ_HOLDING | function::READ_INPUT if third > 0 => {
            (5 + usize::from(third), None)
        }
        0x83 | 0x84 => (EXCEPTION_FRAME, Some(third)),
        _ => return None,
    };
    let (body, crc) = bytes.get(start..start + length)?.split_at(length - 2);
    (crc16(body).to_le_bytes() == *crc).then_some(Found {
        start,
        gap: 0,
        bytes: length,
        unit,
        exception,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SENT: [u8; 8] = [0x09, 0x03, 0x07, 0xD0, 0x00, 0x01, 0x85, 0xCF];
    const REPLY: [u8; 7] = [0x09, 0x03, 0x02, 0x31, 0x00, 0x4C, 0x15];

    fn frame(body: &[u8]) -> Vec<u8> {
        [body, &crc16(body).to_le_bytes()].concat()
    }

    fn heard(bytes: &[u8]) -> Came {
        judge(9, 1, &SENT, bytes)
    }

    fn answer(bytes: &[u8]) -> Answer {
        match heard(bytes) {
            Came::Answer(answer) => answer,
            other => panic!("no answer but {other:?}"),
        }
    }

    #[test]
    fn the_question_is_the_published_one() {
        assert_eq!(emit(9, 1), SENT);
    }

    #[test]
    fn an_answer_is_found_whatever_is_around_it() {
        let data = vec![0x31, 0x00];
        let plain = answer(&REPLY);
        assert_eq!(
            plain,
            Answer {
                data: data.clone(),
                ..Answer::default()
            }
        );
        let echoed = answer(&[&SENT[..], &REPLY].concat());
        assert_eq!(
            echoed,
            Answer {
                echoed: true,
                ..plain.clone()
            }
        );
        let shifted = answer(&[&[0][..], &REPLY].concat());
        assert_eq!(
            shifted,
            Answer {
                before: vec![0],
                ..plain.clone()
            }
        );
        let trailed = answer(&[&REPLY[..], &[0, 0, 0]].concat());
        assert_eq!(
            trailed,
            Answer {
                after: vec![0; 3],
                ..plain.clone()
            }
        );
        let twice = answer(&[&REPLY[..], &REPLY].concat());
        assert_eq!(
            twice,
            Answer {
                second: Some(9),
                ..plain.clone()
            }
        );
        let other = frame(&[7, 3, 2, 0, 0]);
        let second = answer(&[&REPLY[..], &other].concat());
        assert_eq!(
            second,
            Answer {
                second: Some(7),
                ..plain.clone()
            }
        );
        let late = frame(&[9, 3, 4, 1, 2, 3, 4]);
        let after_a_late_one = answer(&[&late[..], &REPLY].concat());
        assert_eq!(
            after_a_late_one,
            Answer {
                earlier: true,
                ..plain.clone()
            }
        );
        let first = answer(&[&other[..], &REPLY].concat());
        assert_eq!(first.second, Some(7));
    }

    #[test]
    fn answers_that_are_not_to_this_question_are_told_apart() {
        assert_eq!(heard(&frame(&[9, 0x83, 2])), Came::Exception(2));
        assert_eq!(heard(&frame(&[7, 3, 2, 0, 0])), Came::OtherUnit(7));
        assert_eq!(heard(&frame(&[9, 3, 4, 1, 2, 3, 4])), Came::OtherQuestion);
    }

    #[test]
    fn what_is_missing_or_wrong_in_an_answer_is_named() {
        assert_eq!(heard(&[]), Came::Silence);
        assert_eq!(heard(&SENT), Came::Echo);
        assert_eq!(heard(&REPLY[1..]), Came::Headless);
        assert_eq!(heard(&REPLY[..5]), Came::Cut { got: 5, of: 7 });
        let mut damaged = REPLY;
        damaged[4] ^= 4;
        assert_eq!(heard(&damaged), Came::Damaged);
        assert_eq!(heard(&[0x5A; 11]), Came::Noise(vec![0x5A; 11]));
    }

    #[test]
    fn no_bytes_make_it_fail() {
        let mut state = 1_u32;
        for length in 0..200 {
            let mut bytes = Vec::new();
            for _ in 0..length {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                bytes.push((state >> 24) as u8 & 0x0F);
            }
            heard(&bytes);
            heard(&[&REPLY[..], &bytes].concat());
        }
    }
}
