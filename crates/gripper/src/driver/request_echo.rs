//! Whether an echoed position request (gPRx) can be true: it was there before, or it was sent.

use heapless::Deque;

/// Motions remembered: the echo may lag by the cycles that fit into a refresh, or a few lost ones.
const SENT: usize = 8;

/// The newest positions sent, each once in a row.
#[derive(Debug)]
pub(super) struct Recent<const X: usize>(Deque<[u8; X], SENT>);

impl<const X: usize> Default for Recent<X> {
    fn default() -> Self {
        Self(Deque::new())
    }
}

impl<const X: usize> Recent<X> {
    pub(super) fn note(&mut self, position: [u8; X]) {
        if self.newest() == Some(&position) {
            return;
        }
        if self.0.is_full() {
            self.0.pop_front();
        }
        // There is room now.
        let _ = self.0.push_back(position);
    }

    pub(super) fn newest(&self) -> Option<&[u8; X]> {
        self.0.back()
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &[u8; X]> {
        self.0.iter()
    }
}

/// What the gripper may echo as the position asked for (gPRx).
#[derive(Debug)]
pub(super) struct RequestEchoWatch<const X: usize> {
    known: Option<[u8; X]>,
    sent: Recent<X>,
    doubted: Option<[u8; X]>,
}

impl<const X: usize> Default for RequestEchoWatch<X> {
    fn default() -> Self {
        Self {
            known: None,
            sent: Recent::default(),
            doubted: None,
        }
    }
}

impl<const X: usize> RequestEchoWatch<X> {
    /// These positions are in a command that leaves now.
    pub(super) fn note_sent(&mut self, position: [u8; X]) {
        self.sent.note(position);
    }

    /// Takes `echo` as it is: while a task runs the gripper writes over its own registers.
    pub(super) fn take(&mut self, echo: [u8; X]) {
        self.known = Some(echo);
        self.doubted = None;
    }

    /// Whether to believe `echo`. An unexpected one is doubted once and believed the second time in
    /// a row: then somebody else, or the gripper itself, did change it.
    pub(super) fn believes(&mut self, echo: [u8; X]) -> bool {
        let expected = self.known.is_none_or(|known| {
            (0..X).all(|axis| {
                echo[axis] == known[axis] || self.sent.iter().any(|sent| sent[axis] == echo[axis])
            })
        });
        if !expected && self.doubted != Some(echo) {
            self.doubted = Some(echo);
            return false;
        }
        self.doubted = None;
        self.known = Some(echo);
        if self.sent.newest() == Some(&echo) {
            // It has caught up: what was sent before is out of the question again.
            self.sent = Recent::default();
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_was_there_or_was_sent_is_believed_at_once() {
        let mut watch = RequestEchoWatch::default();
        assert!(watch.believes([10, 20]));
        assert!(!watch.believes([11, 20]));
        watch.note_sent([30, 40]);
        watch.note_sent([31, 41]);
        assert!(watch.believes([10, 20]) && watch.believes([30, 40]) && watch.believes([31, 41]));
        assert!(!watch.believes([30, 40]), "it had caught up");
    }

    #[test]
    fn a_foreign_echo_is_believed_when_said_twice_in_a_row() {
        let mut watch = RequestEchoWatch::default();
        assert!(watch.believes([1]));
        assert!(!watch.believes([7]) && !watch.believes([9]) && watch.believes([9]));
        assert!(watch.believes([9]) && !watch.believes([1]));
    }
}
