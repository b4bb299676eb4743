//! One cycle after the other: what goes out next, and what to make of what comes back.

use super::doing::Doing;
use super::family::{Block, Family, Snapshot, may_move};
use super::task::Stage;
use super::{Driver, Error};
use crate::link::{self, Field, LateReply, Refused};
use crate::registers::Kind;
use crate::rtu::{Response, function};
use crate::{Duration, Instant, Status, timing};
use embedded_io::{Read, ReadReady, Write};

/// Nobody polled for this long: a task's time goes on from here.
const STOOD: Duration = Duration::from_secs(1);

impl<S: Read + ReadReady + Write, F: Family<X>, const X: usize> Driver<S, F, X> {
    /// Takes in what the line brought.
    pub(super) fn hear(&mut self, now: Instant) -> Option<Result<Status<X>, Error>> {
        let mut block = self
            .snapshot
            .map_or(Block::default(), |snapshot| snapshot.raw);
        let overlong = self
            .doing
            .is_some_and(|doing| doing.quantity > F::REGISTERS);
        let mut kind = Ok(());
        let answer = match self.link.poll(now)? {
            Ok(Response::ReadHolding(values)) if overlong => {
                kind = self.identity.overlong_answer(values.bytes());
                Ok(())
            }
            Ok(
                Response::ReadHolding(values)
                | Response::ReadInput(values)
                | Response::ReadWrite(values),
            ) => {
                // What a shorter read leaves out keeps its last value.
                block
                    .iter_mut()
                    .zip(values.bytes())
                    .for_each(|(byte, value)| *byte = *value);
                Ok(())
            }
            // The link has checked the function code; nothing else can come.
            Ok(_) => Err(link::Error::Shape(Field::Function)),
            Err(error) => Err(error),
        };
        let doing = self.doing.take();
        if let Err(error) = answer {
            return self.fail(error, doing, overlong).map(Err);
        }
        self.misses = 0;
        let doing = doing?;
        if F::PROBES.is_empty() && doing.quantity < F::WHOLE {
            // A sign of life, not a status.
            let stale = self.link.counters().stale;
            kind = self.identity.partial_answer(doing.quantity, stale);
        }
        if let Err(kind) = kind {
            return self.refuse(kind).map(Err);
        }
        if overlong || doing.quantity < F::WHOLE {
            return None;
        }
        let understood = self.understand(&block, &doing, now);
        if understood.is_ok() {
            self.identity.whole_answer();
            self.identity.block_answer(doing.function);
        }
        Some(understood)
    }

    /// A gripper of another family answers.
    fn refuse(&mut self, kind: Kind) -> Option<Error> {
        if !self.config.check_family {
            return None;
        }
        self.verify = true;
        Some(Error::OtherGripper(kind))
    }

    /// What to make of a failure. That a read of more registers than the family has goes unanswered,
    /// or is refused, is as it should be.
    fn fail(
        &mut self,
        error: link::Error,
        doing: Option<Doing<X>>,
        overlong: bool,
    ) -> Option<Error> {
        self.note_failure(error);
        match error {
            link::Error::Timeout { received: 0 } if overlong => {
                self.identity.overlong_silence();
                return None;
            }
            link::Error::Exception(code) if overlong && self.identity.overlong_refusal(code) => {
                return None;
            }
            link::Error::Timeout { received: 0 }
                if doing.is_some_and(|doing| doing.function == function::READ_INPUT) =>
            {
                if let Err(kind) = self.identity.input_silence() {
                    return self.refuse(kind);
                }
            }
            _ => {}
        }
        Some(error.into())
    }

    fn note_failure(&mut self, error: link::Error) {
        match error {
            link::Error::Timeout { .. } => {
                self.misses = self.misses.saturating_add(1);
                self.verify = true;
                if self.misses >= timing::PATIENCE {
                    let spacing = timing::MEMORY.as_ticks() / F::READS.len().max(1) as u64;
                    let spacing = Duration::from_ticks(spacing);
                    self.next_start = timing::after(self.next_start, spacing);
                }
            }
            link::Error::Port(_) | link::Error::Noise(_) => self.verify = true,
            _ => {}
        }
        // Somebody may have put another gripper there.
        let away = matches!(error, link::Error::Port(_)) || self.misses >= timing::PATIENCE;
        if away && self.config.check_family {
            self.identity.forget();
        }
    }

    /// A late reply is a sign of life: whoever sends it is asked again without the long pauses kept
    /// for a gripper that is not there.
    pub(super) fn note_late(&mut self, now: Instant) {
        let stale = self.link.counters().stale;
        if stale != self.stale {
            self.stale = stale;
            self.misses = 0;
            self.next_start = self.next_start.min(timing::after(now, self.config.cycle));
        }
    }

    /// A reply the link let through: reserved bits, echo, meaning; then the task under way.
    fn understand(
        &mut self,
        block: &Block,
        doing: &Doing<X>,
        now: Instant,
    ) -> Result<Status<X>, Error> {
        if self.config.check_family
            && F::PROBES.is_empty()
            && Kind::of_status(block) == Some(Kind::TwoFinger)
        {
            self.verify = true;
            return Err(Error::OtherGripper(Kind::TwoFinger));
        }
        let judged = self
            .family
            .decode(block, doing.sent, self.config.check_reserved)
            .and_then(|snapshot| {
                if self.running.is_some() {
                    self.request_echo.take(snapshot.echo);
                    return Ok(snapshot);
                }
                if self.request_echo.believes(snapshot.echo) {
                    Ok(snapshot)
                } else {
                    Err(Field::RequestEcho)
                }
            });
        let mut snapshot = match judged {
            Ok(snapshot) => snapshot,
            Err(field) => {
                let error = self.link.reject(field, &doing.request(F::REGISTERS), now);
                return Err(error.into());
            }
        };
        let ours = self.individual.iter().any(|sent| *sent == snapshot.echo);
        self.is_individual |= ours && snapshot.status.going_to;
        if !self.is_individual {
            snapshot.status.echo = self.family.followed(&snapshot);
        }
        self.snapshot = Some(snapshot);
        self.verify = false;
        self.step_task(&snapshot, now)?;
        Ok(snapshot.status)
    }

    /// Starts the next request, if one may be sent now.
    pub(super) fn begin(&mut self, now: Instant) -> Result<(), Error> {
        let mut wanted = self.wanted(now);
        let writes = wanted.function == function::READ_WRITE;
        let mut probe = None;
        if self.identity.is_open::<F, X>() && (writes || self.identity.asked) {
            wanted = Doing::read((function::READ_HOLDING, F::REGISTERS));
            probe = self.probe(now);
        }
        let Some(doing) = probe.or_else(|| self.unambiguous(wanted, now)) else {
            // A late reply could answer every request; the first is forgotten in time.
            self.next_start = self
                .link
                .late_replies_end()
                .unwrap_or(now)
                .max(timing::after(now, timing::TICK));
            return Ok(());
        };
        let reserved = if self.config.check_reserved && doing.quantity <= F::REGISTERS {
            F::RESERVED
        } else {
            &[]
        };
        match self.link.start(&doing.request(F::REGISTERS), reserved, now) {
            Ok(()) => {}
            Err(Refused::Port(fault)) => {
                self.verify = true;
                return Err(link::Error::Port(fault).into());
            }
            // Bytes nobody asked for came in this moment, or a late reply became possible: again at next_due.
            Err(_) => {
                self.next_start = timing::after(now, timing::TICK);
                return Ok(());
            }
        }
        if doing.function == function::READ_WRITE {
            self.request_echo
                .note_sent(self.family.positions(&doing.block));
        }
        if let Some(motion) = doing.motion {
            self.sent = Some(motion);
            if self.family.is_individual() {
                self.individual.note(motion.position);
            }
        }
        self.next_start = timing::after(now, self.config.cycle.max(timing::CYCLE));
        self.doing = Some(Doing { sent: now, ..doing });
        Ok(())
    }

    /// How old the status may be that a write rests on: as old as a motion, and the time bytes take.
    fn fresh(&self) -> Duration {
        let bytes = link::MAX_REQUEST + link::MAX_REPLY;
        let line = timing::characters(bytes, self.config.baud).as_ticks();
        let most = timing::STALE_MOTION.as_ticks() + line;
        Duration::from_ticks(most.saturating_add(2 * self.config.patience.as_ticks()))
    }

    /// Time between polls that the driver did not ask for: the process stood still, or the machine
    /// slept. What it knew of the line and the gripper is of then.
    pub(super) fn note_gap(&mut self, now: Instant) {
        let Some(due) = self.due else {
            return;
        };
        let gap = timing::since(now, due);
        if gap > self.link.config().longest_exchange() {
            self.link.resume(now);
            self.verify = true;
        }
        if gap >= STOOD {
            self.postpone_task(gap);
        }
    }

    /// What should go out: a task's write, a motion, or a read.
    fn wanted(&self, now: Instant) -> Doing<X> {
        let read = Doing::read((function::READ_HOLDING, F::REGISTERS));
        let known = |before: &Snapshot<X>| {
            !self.verify && timing::is_within(now, before.status.stamp, self.fresh())
        };
        let Some(before) = self.snapshot.filter(known) else {
            return read;
        };
        let write = |block, motion| Doing {
            function: function::READ_WRITE,
            quantity: F::REGISTERS,
            block,
            motion,
            sent: now,
        };
        match self.running.map(|running| running.stage) {
            Some(Stage::Write(action)) => write(self.family.action(action, &before), None),
            Some(Stage::Inspect | Stage::Watch) => read,
            None => match self.motion {
                Some((motion, stamp))
                    if may_move(&before) && timing::is_within(now, stamp, timing::STALE_MOTION) =>
                {
                    write(self.family.motion(&motion, &before), Some(motion))
                }
                _ => read,
            },
        }
    }

    /// The next read that tells the family and that no late reply can answer.
    fn probe(&mut self, now: Instant) -> Option<Doing<X>> {
        let from = self.identity.step;
        for step in from..from + F::PROBES.len() {
            let Some(&request) = F::PROBES.get(step % F::PROBES.len().max(1)) else {
                continue;
            };
            let doing = Doing::read(request);
            if self.link.late_reply(&doing.request(F::REGISTERS), now) != LateReply::Possible {
                self.identity.step = (step + 1) % F::PROBES.len().max(1);
                return Some(doing);
            }
        }
        None
    }

    /// The wanted request in a form that no late reply can answer; a write that has none becomes a
    /// read. Where a later answer has superseded the late reply, its form may be used again as a last
    /// resort.
    fn unambiguous(&mut self, wanted: Doing<X>, now: Instant) -> Option<Doing<X>> {
        let read = |&form: &(u8, u16)| Doing::read(form);
        if wanted.function == function::READ_WRITE {
            let forms = F::EXCHANGES
                .iter()
                .map(|&quantity| Doing { quantity, ..wanted });
            if let Some(doing) = self.first_free(forms, now) {
                return Some(doing);
            }
        }
        // Partial reads only where a late reply could answer every whole one: they are a sign of life, no
        // status.
        let whole = |&&(_, quantity): &&(u8, u16)| quantity >= F::WHOLE;
        self.first_free(F::READS.iter().filter(whole).map(read), now)
            .or_else(|| self.first_free(F::READS.iter().map(read), now))
    }

    /// The first of `forms` that no late reply can answer; else the one whose superseded reply is
    /// forgotten first.
    fn first_free(
        &mut self,
        forms: impl Iterator<Item = Doing<X>>,
        now: Instant,
    ) -> Option<Doing<X>> {
        let mut best: Option<(Instant, Doing<X>)> = None;
        for doing in forms {
            match self.link.late_reply(&doing.request(F::REGISTERS), now) {
                LateReply::None => return Some(doing),
                LateReply::Superseded { until } if best.is_none_or(|(ends, _)| until < ends) => {
                    best = Some((until, doing))
                }
                LateReply::Superseded { .. } | LateReply::Possible => {}
            }
        }
        best.map(|(_, doing)| doing)
    }
}
