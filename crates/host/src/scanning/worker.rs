//! The thread that reads: polls the scanner, hands every frame over, says what is so.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::SyncSender;

use bridge::Platform;
use glove::bus::Bus as _;
use glove::scan::BusScanner;
use glove::{Duration, Instant};

use super::shared::{Scanned, Shared};
use super::snapshot::Here;
use crate::clock::{Clock, since};
use crate::interrupt::Interrupt;
use crate::lines::Pc;
use crate::lines::glove::{GloveBus, GloveLine, Reading};
use crate::trace::TraceLog;

/// The longest wait: an end is heard within it.
const LONGEST: Duration = Duration::from_millis(20);
/// What is so is said at least this often.
const SAY: Duration = Duration::from_millis(50);

pub(super) struct Worker {
    pc: Pc,
    scanner: BusScanner<GloveBus>,
    hand: SyncSender<Scanned>,
    shared: Arc<Shared>,
    said: Option<Instant>,
}

impl Worker {
    pub fn new(
        line: GloveLine,
        reading: Reading,
        trace: TraceLog,
        clock: Clock,
        interrupt: &Interrupt,
        hand: SyncSender<Scanned>,
        shared: Arc<Shared>,
    ) -> Self {
        let config = reading.config(&line);
        trace.begin_scan(line.way(), &config);
        let pc = Pc::new(clock, [line.watch()], interrupt.clone());
        Self {
            pc: pc.traced(trace.clone()),
            scanner: line.scanner(config, trace),
            hand,
            shared,
            said: None,
        }
    }

    pub fn run(mut self) {
        while !self.shared.stop.load(Ordering::Acquire) {
            let now = self.pc.now();
            let frame = self.scanner.poll(now);
            if self.shared.begin.swap(false, Ordering::AcqRel) {
                self.shared.lock().begin();
            }
            if let Some(frame) = frame {
                let scanned = Scanned {
                    frame,
                    at: now,
                    starts: self.scanner.counters().starts,
                    ids: self.scanner.ids(),
                };
                // Full: whoever takes them is late, which is counted; gone: nobody wants them.
                let taken = self.hand.try_send(scanned).is_ok();
                self.shared.lock().frame(&frame, now, taken);
            }
            let due = self.said.is_none_or(|said| since(now, said) >= SAY);
            if frame.is_some() || due {
                self.said = Some(now);
                self.say(now);
            }
            let due = self.scanner.next_due().unwrap_or(now + LONGEST);
            self.pc.wait_until(due.clamp(now, now + LONGEST));
        }
    }

    fn say(&mut self, now: Instant) {
        let here = Here {
            state: self.scanner.state(),
            baud: self.scanner.bus_mut().line_baud(),
            health: self.scanner.health(),
            counters: *self.scanner.counters(),
            link: self.scanner.bus_mut().link_counters().copied(),
            ids: self.scanner.ids(),
        };
        let shared = Arc::clone(&self.shared);
        let mut said = shared.lock();
        while let Some(finding) = self.scanner.next_finding() {
            said.found(finding);
        }
        said.say(&here, now);
    }
}
