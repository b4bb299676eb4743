//! Keys from the terminal, read without ever waiting: what each means, and what is only text typed by mistake.
//!
//! The clutch closes on one space bar pressed by itself. A paste (marked by the terminal, or several characters at once)
//! and typed words close nothing; opening and ending are obeyed from text, too, where that is the safe side.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::key::{Bindings, Key};

/// After text, space and `c` are text for so long.
const TEXT: Duration = Duration::from_secs(1);
/// A paste whose end does not come is over after this.
const PASTE: Duration = Duration::from_secs(1);
/// Reads in one look; a terminal that never runs dry must not hold the loop.
const READS: usize = 8;
/// Start of a paste and its end, as terminals mark them.
const PASTE_BEGINS: &[u8] = b"\x1b[200~";
const PASTE_ENDS: &[u8] = b"\x1b[201~";
/// Keys without a meaning of their own that are kept until somebody asks for them.
const OTHERS: usize = 8;
const CTRL_C: u8 = 3;
const CTRL_D: u8 = 4;
const ESCAPE: u8 = 0x1b;

/// Whether `terminal` was closed at its other end. Of what is no terminal nothing is said.
pub(super) fn hung_up(terminal: &(impl IsTerminal + std::os::fd::AsFd)) -> bool {
    // A terminal that hung up is none any more: the caller asks for those that were one.
    ready(terminal).intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL)
}

fn ready(descriptor: &impl std::os::fd::AsFd) -> PollFlags {
    let mut polled = [PollFd::new(descriptor, PollFlags::IN)];
    let nothing = Timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    match poll(&mut polled, Some(&nothing)) {
        Ok(_) => polled[0].revents(),
        Err(_) => PollFlags::empty(),
    }
}

/// The keyboard of a terminal in raw mode.
#[derive(Debug, Default)]
pub(super) struct Keyboard {
    /// Which keys mean what.
    bindings: Bindings,
    /// A sequence whose end has not come.
    rest: Vec<u8>,
    /// Inside a paste, until then at most.
    paste: Option<Instant>,
    /// What comes is text, until then.
    text: Option<Instant>,
    /// Keys that have no meaning of their own, each pressed by itself: 0 stands for one that sends more than a byte.
    others: Vec<u8>,
    /// A pedal is one of the others, whatever its key means elsewhere.
    has_pedal: bool,
}

impl Keyboard {
    pub(super) fn new(bindings: Bindings) -> Self {
        Self {
            bindings,
            ..Self::default()
        }
    }

    /// From now on the pedal's key is one without a meaning of its own.
    pub(super) fn with_pedal(&mut self) {
        self.has_pedal = true;
    }

    /// Keys pressed since the last call that have no meaning of their own; at most [`OTHERS`].
    pub(super) fn others(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.others)
    }

    /// Keys pressed since the last call; [`Key::End`] when the terminal is gone.
    pub(super) fn read(&mut self, now: Instant) -> Vec<Key> {
        let stdin = std::io::stdin();
        let mut keys = Vec::new();
        let mut bytes = Vec::new();
        for _ in 0..READS {
            let ready = ready(&stdin);
            let mut piece = [0; 256];
            let gone = ready.intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL);
            if ready.contains(PollFlags::IN) {
                // The terminal's settings make this return at once, also where another program took the bytes.
                let count = rustix::io::read(&stdin, &mut piece).unwrap_or(0);
                bytes.extend_from_slice(piece.get(..count).unwrap_or_default());
                if count == piece.len() {
                    continue;
                }
            }
            if gone {
                keys.push(Key::End);
            }
            break;
        }
        keys.extend(self.meaning(&bytes, now));
        keys
    }

    /// What `bytes`, which came together, ask for.
    fn meaning(&mut self, bytes: &[u8], now: Instant) -> Vec<Key> {
        // Always the safe side, wherever it stands.
        if bytes.contains(&CTRL_C) {
            return vec![Key::End];
        }
        let mut typed = Vec::new();
        let mut left = std::mem::take(&mut self.rest);
        left.extend_from_slice(bytes);
        let mut left = left.as_slice();
        while let Some((first, after)) = left.split_first() {
            if *first != ESCAPE {
                typed.extend((!self.pasting(now)).then_some(*first));
                left = after;
                continue;
            }
            let (sequence, after) = left.split_at(sequence_length(left));
            if sequence == PASTE_BEGINS {
                self.paste = Some(now + PASTE);
            } else if sequence == PASTE_ENDS {
                self.paste = None;
                self.text = Some(now + TEXT);
            } else if sequence.len() == 1 && after.is_empty() && !self.pasting(now) {
                typed.push(ESCAPE);
            } else if after.is_empty() && PASTE_ENDS.starts_with(sequence) && sequence.len() > 1 {
                self.rest = sequence.to_vec();
            } else if sequence.len() > 2 && after.is_empty() && !self.pasting(now) {
                self.other(0);
            }
            left = after;
        }
        self.typed(&typed, now)
    }

    fn pasting(&mut self, now: Instant) -> bool {
        self.paste = self.paste.filter(|until| now < *until);
        if let Some(until) = &mut self.paste {
            *until = now + PASTE;
        }
        self.paste.is_some()
    }

    fn other(&mut self, byte: u8) {
        if self.others.len() < OTHERS {
            self.others.push(byte);
        }
    }

    fn typed(&mut self, typed: &[u8], now: Instant) -> Vec<Key> {
        let Bindings {
            clutch,
            calibrate,
            undo,
            end,
            pedal,
        } = self.bindings;
        let ends = |byte: &u8| *byte == end || matches!(*byte, ESCAPE | CTRL_D);
        let text = self.text.is_some_and(|until| now < until);
        match typed {
            [] => Vec::new(),
            [byte] if self.has_pedal && Some(*byte) == pedal => {
                self.other(0);
                Vec::new()
            }
            [byte] if ends(byte) => vec![Key::End],
            [byte] if *byte == clutch && text => vec![Key::Open],
            [byte] if *byte == clutch => vec![Key::Clutch],
            [byte] if *byte == calibrate && !text => vec![Key::Calibrate],
            [byte] if *byte == undo && !text => vec![Key::Undo],
            [b'r'] if !text => {
                // Where it is no key it is text.
                self.text = Some(now + TEXT);
                vec![Key::Again]
            }
            // A key that was held down, or pressed while this program was not looking.
            keys if keys.iter().all(|byte| *byte == clutch) => vec![Key::Open],
            keys if keys
                .iter()
                .all(|byte| ends(byte) || [clutch, calibrate, undo].contains(byte))
                && keys.iter().any(ends) =>
            {
                vec![Key::End]
            }
            _ => {
                if let [byte] = typed {
                    self.other(*byte);
                }
                self.text = Some(now + TEXT);
                Vec::new()
            }
        }
    }
}

/// Length of the sequence that begins with the escape at the start of `bytes`: 1 for a lone one.
fn sequence_length(bytes: &[u8]) -> usize {
    match bytes.get(1) {
        None | Some(&ESCAPE) => 1,
        // CSI: parameters, then one final byte. SS3: one byte.
        Some(b'[') => {
            let parameters = bytes.iter().skip(2);
            let length = parameters.take_while(|byte| (0x20..0x40).contains(*byte));
            (3 + length.count()).min(bytes.len())
        }
        Some(b'O') => 3.min(bytes.len()),
        Some(_) => 2,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keyboard() -> (Keyboard, Instant) {
        (Keyboard::default(), Instant::now())
    }

    #[test]
    fn keys_mean_what_the_foot_line_says() {
        for (bytes, key) in [
            (&b" "[..], Key::Clutch),
            (b"c", Key::Calibrate),
            (b"u", Key::Undo),
            (b"r", Key::Again),
            (b"q", Key::End),
            (b"\x1b", Key::End),
            (b"\x03", Key::End),
            (b"\x04", Key::End),
        ] {
            let (mut keys, now) = keyboard();
            assert_eq!(keys.meaning(bytes, now), [key], "{bytes:?}");
        }
    }

    #[test]
    fn keys_that_a_person_prefers_mean_the_same_and_the_usual_ones_are_text() {
        let bindings = Bindings {
            clutch: b'x',
            calibrate: b'f',
            undo: b'z',
            end: b'.',
            pedal: None,
        };
        for (bytes, key) in [
            (&b"x"[..], &[Key::Clutch][..]),
            (b"f", &[Key::Calibrate]),
            (b"z", &[Key::Undo]),
            (b".", &[Key::End]),
            (b"\x1b", &[Key::End]),
            (b"xx", &[Key::Open]),
            (b" ", &[]),
            (b"c", &[]),
            (b"u", &[]),
            (b"q", &[]),
        ] {
            let mut keys = Keyboard::new(bindings);
            assert_eq!(keys.meaning(bytes, Instant::now()), key, "{bytes:?}");
        }
    }

    #[test]
    fn a_pedal_takes_poses_whatever_its_key_means_and_elsewhere_it_means_that() {
        for pedal in [b'r', b's', b'+'] {
            let bindings = Bindings {
                pedal: Some(pedal),
                ..Bindings::default()
            };
            let (mut keys, now) = (Keyboard::new(bindings), Instant::now());
            keys.with_pedal();
            for step in 0..3 {
                let at = now + Duration::from_millis(step * 400);
                assert_eq!(keys.meaning(&[pedal], at), [], "{pedal}");
                assert_eq!(keys.others(), [0], "{pedal}");
            }
            // It is no text: the clutch's key after it is the clutch's.
            assert_eq!(keys.meaning(b" ", now), [Key::Clutch]);
        }
        let bindings = Bindings {
            pedal: Some(b'r'),
            ..Bindings::default()
        };
        let mut keys = Keyboard::new(bindings);
        assert_eq!(keys.meaning(b"r", Instant::now()), [Key::Again]);
    }

    #[test]
    fn arrows_and_other_sequences_are_no_keys() {
        for bytes in [
            &b"\x1b[A"[..],
            b"\x1bOP",
            b"\x1b[1;5C",
            b"\x1bq",
            b"\x1b[<0;3;4M",
            b"x",
            "é".as_bytes(),
        ] {
            let (mut keys, now) = keyboard();
            assert_eq!(keys.meaning(bytes, now), [], "{bytes:?}");
        }
    }

    #[test]
    fn a_paste_touches_nothing_marked_or_not_whole_or_in_pieces() {
        for pieces in [
            &[&b"rm -r my folder"[..]][..],
            &[b"\x1b[200~a b c q \x1b[201~"],
            &[b"\x1b[200~a b", b" ", b"q", b"c\x1b[201~"],
            &[b"\x1b[200~a\x1b[20", b"1~"],
            &[b"one two ", b"c"],
        ] {
            let (mut keys, now) = keyboard();
            for piece in pieces {
                assert_eq!(keys.meaning(piece, now), [], "{pieces:?}");
            }
        }
    }

    #[test]
    fn a_space_inside_typed_words_closes_nothing_and_one_after_them_does() {
        let (mut keys, now) = keyboard();
        let after = |ms| now + Duration::from_millis(ms);
        assert_eq!(keys.meaning(b"l", now), []);
        assert_eq!(keys.meaning(b"s", after(150)), []);
        assert_eq!(keys.meaning(b" ", after(300)), [Key::Open]);
        assert_eq!(keys.meaning(b" ", after(1_400)), [Key::Clutch]);
    }

    #[test]
    fn keys_that_came_together_after_a_stall_do_only_what_is_safe() {
        for (bytes, key) in [
            (&b"   "[..], Key::Open),
            (b"qqq", Key::End),
            (b" q", Key::End),
            (b"make it\x03", Key::End),
        ] {
            let (mut keys, now) = keyboard();
            assert_eq!(keys.meaning(bytes, now), [key], "{bytes:?}");
        }
    }

    #[test]
    fn a_paste_whose_end_never_comes_is_over_after_a_second() {
        let (mut keys, now) = keyboard();
        assert_eq!(keys.meaning(b"\x1b[200~a", now), []);
        let later = now + PASTE + Duration::from_millis(1);
        assert_eq!(keys.meaning(b"q", later), [Key::End]);
    }
}
