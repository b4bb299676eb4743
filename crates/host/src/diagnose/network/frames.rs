//! Modbus TCP's bytes: a header of seven, then function and data.

use gripper::registers::STATUS;
use gripper::registers::three_finger::BLOCK;

/// Bytes before the function code.
const HEADER: usize = 7;
/// Most bytes that a header may promise: unit, function and 252 of data.
const MOST: usize = 254;
/// Function codes.
pub const READ_HOLDING: u8 = 3;
pub const READ_INPUT: u8 = 4;

/// What came after a question.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Came {
    /// Nothing.
    Silence,
    /// The status block, whatever its header says of number and unit.
    Answer,
    /// The device says no.
    Exception(u8),
    /// The other side ended the connection instead.
    Closed,
    /// A header, or a part of one, and less than it promises.
    Cut(String),
    /// What came is no Modbus TCP frame.
    Malformed(String),
    /// The answer to an earlier question.
    Late,
    /// A valid frame that answers something else.
    Other(String),
}

impl Came {
    pub fn is_answer(&self) -> bool {
        *self == Self::Answer
    }

    /// In words.
    pub fn words(&self) -> String {
        match self {
            Self::Silence => "no answer came".to_owned(),
            Self::Answer => "an answer came".to_owned(),
            Self::Exception(code) => format!(
                "the device refuses with exception {code:02X}, {}",
                gripper::rtu::Exception(*code).meaning()
            ),
            Self::Closed => "the other side closed the connection".to_owned(),
            Self::Cut(what) => format!("only a part of an answer came: {what}"),
            Self::Malformed(what) => format!("what came is no valid Modbus TCP frame: {what}"),
            Self::Late => {
                "answers come late: more than a second after the question, when the next one is asked".to_owned()
            }
            Self::Other(what) => format!("a valid frame does not answer the question: {what}"),
        }
    }
}

/// A frame's header, what it is, and what follows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Judged {
    pub came: Came,
    pub number: u16,
    pub unit: u8,
    pub rest: Vec<u8>,
}

impl Judged {
    fn of(came: Came) -> Self {
        Self {
            came,
            number: 0,
            unit: 0,
            rest: Vec::new(),
        }
    }
}

/// A read of the status block.
pub fn question(number: u16, unit: u8, function: u8) -> [u8; 12] {
    let [n1, n0] = number.to_be_bytes();
    let [s1, s0] = STATUS.to_be_bytes();
    let registers = u8::try_from(BLOCK / 2).unwrap_or(u8::MAX);
    [n1, n0, 0, 0, 0, 6, unit, function, s1, s0, 0, registers]
}

/// Judges what came after a read of the status block by `function`; `ended`: the other side closed the connection.
pub fn judge(function: u8, heard: &[u8], ended: bool) -> Judged {
    let [n1, n0, p1, p0, l1, l0, unit, ..] = *heard else {
        return Judged::of(match (heard, ended) {
            ([], true) => Came::Closed,
            ([], false) => Came::Silence,
            _ => Came::Cut(format!("{} bytes of a header of {HEADER}", heard.len())),
        });
    };
    let (number, length) = (
        u16::from_be_bytes([n1, n0]),
        usize::from(u16::from_be_bytes([l1, l0])),
    );
    if (p1, p0) != (0, 0) {
        let what = format!(
            "its protocol number is {}, not 0",
            u16::from_be_bytes([p1, p0])
        );
        return Judged::of(Came::Malformed(what));
    }
    if length < 2 {
        return Judged::of(Came::Malformed(format!(
            "a header without a body (length {length})"
        )));
    }
    if length > MOST {
        let what = format!("its header promises {length} bytes, more than any frame has");
        return Judged::of(Came::Malformed(what));
    }
    let (body, rest) = match heard.get(HEADER..HEADER + length - 1) {
        Some(body) => (body, heard.get(HEADER + length - 1..).unwrap_or(&[])),
        None => {
            let got = heard.len() + 1 - HEADER;
            return Judged::of(Came::Cut(format!(
                "{got} of the {length} bytes that its header promises"
            )));
        }
    };
    Judged {
        came: body_of(function, body),
        number,
        unit,
        rest: rest.to_vec(),
    }
}

fn body_of(function: u8, body: &[u8]) -> Came {
    match *body {
        [code, count, ref data @ ..] if code == function => {
            if usize::from(count) != data.len() {
                Came::Malformed(format!("it counts {count} bytes and has {}", data.len()))
            } else if data.len() != BLOCK {
                Came::Other(format!(
                    "{} registers instead of {}",
                    data.len() / 2,
                    BLOCK / 2
                ))
            } else {
                Came::Answer
            }
        }
        [code, exception, ..] if code == function | 0x80 => Came::Exception(exception),
        [code, ..] => Came::Other(format!("function {code:02X} instead of {function:02X}")),
        [] => Came::Malformed("a header without a body".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(number: u16, unit: u8) -> Vec<u8> {
        let mut frame = number.to_be_bytes().to_vec();
        frame.extend([0, 0, 0, 19, unit, READ_INPUT, 16]);
        frame.extend([7; 16]);
        frame
    }

    fn came(heard: &[u8]) -> Came {
        judge(READ_INPUT, heard, false).came
    }

    #[test]
    fn the_question_is_the_published_form() {
        assert_eq!(
            question(0x0102, 2, READ_INPUT),
            [1, 2, 0, 0, 0, 6, 2, 4, 7, 0xD0, 0, 8]
        );
    }

    #[test]
    fn an_answer_tells_its_number_its_unit_and_what_follows_it() {
        let mut heard = answer(77, 9);
        heard.extend([1, 2]);
        let judged = judge(READ_INPUT, &heard, false);
        assert_eq!((judged.number, judged.unit), (77, 9));
        assert_eq!((judged.came, judged.rest), (Came::Answer, vec![1, 2]));
    }

    #[test]
    fn whatever_is_no_answer_is_named() {
        let whole = answer(1, 2);
        assert_eq!(came(&[]), Came::Silence);
        assert_eq!(judge(READ_INPUT, &[], true).came, Came::Closed);
        for cut in 1..whole.len() {
            assert!(matches!(came(&whole[..cut]), Came::Cut(_)), "{cut}");
        }
        assert!(
            came(&[0, 1, 0, 0, 0, 1, 2])
                .words()
                .contains("without a body")
        );
        assert!(
            came(&[0, 1, 0, 0, 0xFF, 0xFF, 2, 4])
                .words()
                .contains("65535")
        );
        assert!(came(&[0, 1, 3, 0, 0, 2, 2, 4]).words().contains("768"));
        assert_eq!(
            came(&[0, 1, 0, 0, 0, 3, 2, 0x84, 0x0B]),
            Came::Exception(0x0B)
        );
        assert!(
            came(&[0, 1, 0, 0, 0, 5, 2, 4, 2, 0, 0])
                .words()
                .contains("1 registers")
        );
        assert!(
            came(&[0, 1, 0, 0, 0, 5, 2, 4, 4, 0, 0])
                .words()
                .contains("counts 4")
        );
        assert!(
            came(&[0, 1, 0, 0, 0, 3, 2, 3, 0])
                .words()
                .contains("function 03")
        );
    }
}
