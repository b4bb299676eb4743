//! Several exchanges on a serial line, and what they say of it together: one answer may be luck, one lost byte an accident.

use std::time::Duration;

use gripper::timing;

use super::answer::{Answer, Came, emit, holds_answer, judge, status_read};
use super::raw::{Expect, ask, hex, listen, text};
use super::{Findings, Place, late};
use crate::interrupt::Interrupt;
use crate::lines::port::Port;

/// Numbers of registers asked for, in turn: the answer to an earlier question has another length.
const QUANTITIES: [u16; 8] = [3, 2, 1, 3, 2, 1, 3, 2];
/// For an answer, however slow the tunnel.
const WAIT: Duration = Duration::from_secs(1);
/// Unanswered questions, with nothing but silence, after which silence is believed.
const SILENT: usize = 2;
/// Questions after which a line that gave no answer gives none.
const HOPELESS: usize = 4;
/// For bytes that nobody asked for.
const LISTEN: Duration = Duration::from_millis(100);
/// How often, while they come.
const LISTENS: usize = 6;

/// What several exchanges came to.
#[derive(Debug, Default)]
pub struct Tally {
    asked: usize,
    /// Good answers, and how long after the usual time for their bytes they came.
    answers: Vec<(Answer, Duration)>,
    others: Vec<Came>,
    unasked: Vec<u8>,
}

/// Listens, then asks `unit` several times.
pub fn exchanges(port: &mut Port, unit: u8, baud: u32, interrupt: &Interrupt) -> Tally {
    let mut tally = Tally::default();
    // What is still owed to whoever asked before comes first.
    for _ in 0..LISTENS {
        let heard = listen(port, LISTEN, interrupt);
        tally.unasked.extend(&heard);
        if heard.is_empty() {
            break;
        }
    }
    for quantity in QUANTITIES {
        if tally.is_decided() || interrupt.asked() {
            break;
        }
        let (came, late) = exchange(port, unit, baud, quantity, WAIT, interrupt);
        tally.asked += 1;
        match came {
            Came::Answer(answer) => tally.answers.push((answer, late)),
            other => tally.others.push(other),
        }
    }
    tally
}

/// One read of `quantity` status registers: what came, and how much later than its bytes take at `baud`.
pub fn exchange(
    port: &mut Port,
    unit: u8,
    baud: u32,
    quantity: u16,
    wait: Duration,
    interrupt: &Interrupt,
) -> (Came, Duration) {
    let sent = emit(unit, quantity);
    let reply = status_read(quantity).reply_len();
    let micros = |time: gripper::Duration| Duration::from_micros(time.as_micros());
    let question = micros(timing::characters(sent.len() + 1, baud));
    let whole = question + micros(timing::last_byte(baud, reply));
    let heard = ask(port, &sent, wait + whole, interrupt, |bytes| {
        match judge(unit, quantity, &sent, bytes) {
            Came::Answer(_) | Came::Exception(_) | Came::OtherUnit(_) => Expect::Nothing,
            Came::Echo => Expect::AnswerAfterEcho,
            _ => Expect::Answer,
        }
    });
    // As the driver sees it: late is a first byte after its time, or a last one after the pauses it allows.
    let late = heard
        .first
        .saturating_sub(question)
        .max(heard.last.saturating_sub(whole));
    (judge(unit, quantity, &sent, &heard.bytes), late)
}

impl Tally {
    fn is_decided(&self) -> bool {
        let silent = self.others.iter().all(|came| *came == Came::Silence);
        self.answers.is_empty() && (self.asked >= HOPELESS || silent && self.asked >= SILENT)
    }

    /// Whether there was a good answer.
    pub fn is_answered(&self) -> bool {
        !self.answers.is_empty()
    }

    /// Bytes that came before anything was asked.
    pub fn unasked(&self) -> &[u8] {
        &self.unasked
    }

    /// What came instead of an answer: the commonest, silence last.
    pub fn instead(&self) -> Came {
        let kind = std::mem::discriminant::<Came>;
        let common = |came: &&Came| {
            let same = self.others.iter().filter(|other| kind(other) == kind(came));
            (**came != Came::Silence, same.count())
        };
        let most = self.others.iter().max_by_key(common);
        most.cloned().unwrap_or(Came::Silence)
    }

    /// How late the answers were, the middle one and the last one.
    fn lateness(&self) -> (Duration, Duration) {
        let mut late: Vec<Duration> = self.answers.iter().map(|(_, late)| *late).collect();
        late.sort_unstable();
        let at = |index: usize| late.get(index).copied().unwrap_or_default();
        (at(late.len() / 2), at(late.len().saturating_sub(1)))
    }

    /// Tells what is odd about the answers. Returns the patience that they need, if it is more than `place` has.
    pub fn tell(&self, place: &Place<'_>, findings: &mut Findings) -> Option<Duration> {
        self.tell_of_losses(findings);
        self.tell_of_second_answers(place, findings);
        self.tell_of_surroundings(findings);
        if holds_answer(&self.unasked) {
            let what =
                "an answer came before anything was asked: late, to whoever used the port before";
            findings.note(
                "line",
                what,
                "nothing, if it does not stay; else ending whatever else asks on this line",
            );
        } else if !self.unasked.is_empty() {
            let count = self.unasked.len();
            let what = format!(
                "{count} bytes came before anything was asked ({})",
                hex(&self.unasked)
            );
            findings.note(
                "line",
                what,
                "ending whatever else talks on this line; bias of the bus",
            );
        }
        self.tell_of_lateness(place, findings)
    }

    fn tell_of_losses(&self, findings: &mut Findings) {
        let (asked, answered) = (self.asked, self.answers.len());
        if 2 * answered < asked {
            let what = format!(
                "only {answered} of {asked} questions were answered; else {}",
                words(&self.instead())
            );
            let next = "RS-485 A against B, ground and termination; whether another program or master talks on this line";
            findings.wrong("line", what, next);
        }
    }

    fn tell_of_surroundings(&self, findings: &mut Findings) {
        let total = self.answers.len();
        let with = |is: fn(&Answer) -> bool| -> Vec<&Answer> {
            self.answers
                .iter()
                .map(|(answer, _)| answer)
                .filter(|a| is(a))
                .collect()
        };
        if !with(|a| a.echoed).is_empty() {
            let what = "the adapter gives back what it is given; the driver takes that off";
            findings.note("line", what, "nothing: it works");
        }
        if !with(|a| a.earlier).is_empty() {
            let what = "the answer to an earlier question came with the new one: answers queue up on the way";
            findings.note("line", what, "an adapter or a tunnel without the delay");
        }
        let shifted = with(|a| !a.before.is_empty() && a.second.is_none());
        if let Some(first) = shifted.first() {
            let count = first.before.len();
            let bytes = if count == 1 {
                "one extra byte"
            } else {
                "extra bytes"
            };
            let what = format!(
                "{bytes} ({}) before {} of {total} good answers: each whole frame is shifted, so that its CRC seems wrong",
                hex(&first.before),
                shifted.len()
            );
            let next = "the RS-485 bus lacks bias or termination: 120 Ω at both ends, a pull-up on its positive and a pull-down on \
                        its negative wire at the adapter (docs/wiring.md), or an adapter that has them";
            findings.by_share("line", shifted.len(), total, what, next);
        }
        let trailed = with(|a| !a.after.is_empty());
        if let Some(first) = trailed.first() {
            let what = format!(
                "{} bytes ({}) follow {} of {total} answers: they are thrown away",
                first.after.len(),
                hex(&first.after),
                trailed.len()
            );
            findings.note(
                "line",
                what,
                "nothing: it works; bias and termination of the bus take them away",
            );
        }
    }

    fn tell_of_second_answers(&self, place: &Place<'_>, findings: &mut Findings) {
        let total = self.answers.len();
        let seconds: Vec<u8> = self
            .answers
            .iter()
            .filter_map(|(answer, _)| answer.second)
            .collect();
        let Some(second) = seconds.first().copied() else {
            return;
        };
        let unit = place.unit();
        let who = if second == unit {
            format!("two devices answer as unit {unit}")
        } else {
            format!("unit {second} answers too, although unit {unit} is asked")
        };
        findings.wrong(
            "unit",
            format!("{who}: {} of {total} answers were followed by a second one", seconds.len()),
            "unplugging the other device, or giving it a unit number of its own in the maker's tool",
        );
    }

    fn tell_of_lateness(&self, place: &Place<'_>, findings: &mut Findings) -> Option<Duration> {
        let (middle, worst) = self.lateness();
        let patience = place.patience();
        if worst <= patience {
            return None;
        }
        let late = self.answers.iter().filter(|(_, late)| *late > patience);
        let (late, total) = (late.count(), self.answers.len());
        let more = format!(" ({late} of {total} too late)");
        let without = "an adapter or a tunnel without the delay";
        late::tell((place, "line"), (middle, worst), (&more, without), findings)
    }
}

/// What came, in words.
pub fn words(came: &Came) -> String {
    match came {
        Came::Silence => "no byte came".to_owned(),
        Came::Answer(_) => "an answer came".to_owned(),
        Came::Exception(code) => format!("it refused with exception {code:02X}"),
        Came::OtherUnit(unit) => format!("unit {unit} answered"),
        Came::OtherQuestion => "the answer to an earlier question came".to_owned(),
        Came::Echo => "only the adapter's own echo came".to_owned(),
        Came::Headless => "the answer came without its first byte".to_owned(),
        Came::Cut { got, of } => format!("the answer ended after {got} of {of} bytes"),
        Came::Damaged => "the answer came with a wrong CRC".to_owned(),
        Came::Noise(bytes) => match text(bytes) {
            Some(text) => format!("text came (“{text}”)"),
            None => format!(
                "{} bytes came that make no frame ({})",
                bytes.len(),
                hex(bytes)
            ),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn silence_is_what_came_only_where_nothing_else_did() {
        let tally = |others: Vec<Came>| Tally {
            others,
            ..Tally::default()
        };
        assert_eq!(tally(vec![]).instead(), Came::Silence);
        let mixed = tally(vec![Came::Silence, Came::Silence, Came::Damaged]);
        assert_eq!(mixed.instead(), Came::Damaged);
    }
}
