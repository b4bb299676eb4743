//! The virtual hand of `simulate` lies flat on request: a line on standard input.

use std::os::fd::AsFd;

use rig::glove::VirtualGlove;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::say;

/// Most of a line that is looked at.
const LINE: usize = 64;

/// The hand, and who may tell it to lie flat.
pub(crate) struct Hand {
    glove: VirtualGlove,
    flat: bool,
    lines: Lines,
}

/// Lines that come on a descriptor, read as they come: what a buffer held back no poll would tell of.
#[derive(Debug, Default)]
struct Lines {
    line: Vec<u8>,
    ended: bool,
}

impl Lines {
    /// The lines that have come whole; never waits. Reads some bytes at most.
    fn read(&mut self, from: &impl AsFd) -> Vec<Vec<u8>> {
        let mut bytes = [0; LINE];
        let mut lines = Vec::new();
        let count = match rustix::io::read(from, &mut bytes) {
            Err(rustix::io::Errno::INTR | rustix::io::Errno::AGAIN) => return lines,
            Ok(0) | Err(_) => {
                self.ended = true;
                return lines;
            }
            Ok(count) => count,
        };
        for byte in bytes.iter().take(count) {
            if *byte == b'\n' {
                lines.push(std::mem::take(&mut self.line));
            } else if self.line.len() < LINE {
                self.line.push(*byte);
            }
        }
        lines
    }
}

/// What a line asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wanted {
    Flat,
    Moving,
    /// The other of the two.
    Other,
}

fn wanted(line: &[u8]) -> Option<Wanted> {
    match line.trim_ascii() {
        b"" => Some(Wanted::Other),
        b"flat" => Some(Wanted::Flat),
        b"move" => Some(Wanted::Moving),
        _ => None,
    }
}

impl Hand {
    /// The hand in this glove.
    pub(crate) fn of(glove: &VirtualGlove) -> Self {
        Self {
            glove: glove.clone(),
            flat: false,
            lines: Lines::default(),
        }
    }

    /// Obeys the lines that have come: `flat`, `move`, or Enter alone for the other of the two. Never waits, and never reads a
    /// terminal in whose background it runs, which would stop this program.
    pub(crate) fn listen(&mut self) {
        let stdin = std::io::stdin();
        if self.lines.ended || in_background(&stdin) || !is_ready(&stdin) {
            return;
        }
        for line in self.lines.read(&stdin) {
            self.obey(&line);
        }
    }

    fn obey(&mut self, line: &[u8]) {
        let flat = match wanted(line) {
            Some(Wanted::Flat) => true,
            Some(Wanted::Moving) => false,
            Some(Wanted::Other) => !self.flat,
            None => {
                say!("flat, move, or Enter alone for the other of the two");
                return;
            }
        };
        self.flat = flat;
        self.glove.lie_flat(flat);
        if flat {
            say!("the virtual hand lies flat; Enter lets it move");
        } else {
            say!("the virtual hand moves; Enter lays it flat");
        }
    }
}

/// Whether another job has the terminal.
fn in_background(stdin: &std::io::Stdin) -> bool {
    // Of what is no terminal the system says an error: nobody stops a reader of that.
    rustix::termios::tcgetpgrp(stdin)
        .is_ok_and(|foreground| foreground != rustix::process::getpgrp())
}

fn is_ready(descriptor: &impl AsFd) -> bool {
    let mut polled = [PollFd::new(descriptor, PollFlags::IN)];
    let nothing = Timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    poll(&mut polled, Some(&nothing)).is_ok_and(|count| count > 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn of_lines_that_come_together_each_is_read_while_the_descriptor_says_that_there_are_more() {
        let (mut there, here) = std::os::unix::net::UnixStream::pair().unwrap();
        there.write_all(&b"move\n".repeat(30)).unwrap();
        there.write_all(b"flat\nfl").unwrap();
        let mut lines = Lines::default();
        let mut heard = Vec::new();
        while is_ready(&here) {
            heard.extend(lines.read(&here));
        }
        assert_eq!(heard.len(), 31);
        assert_eq!(heard.last().map(Vec::as_slice), Some(&b"flat"[..]));
        drop(there);
        assert!(lines.read(&here).is_empty() && lines.ended);
    }

    #[test]
    fn a_line_says_what_the_hand_does_and_enter_alone_the_other() {
        assert_eq!(wanted(b"flat\r"), Some(Wanted::Flat));
        assert_eq!(wanted(b" move "), Some(Wanted::Moving));
        assert_eq!(wanted(b""), Some(Wanted::Other));
        assert_eq!(wanted(b"flatter"), None);
    }
}
