//! The scanner's moves: which transaction is next, and what its reply means.

use super::round::{ActiveStep, Job, Phase};
use super::{BusScanner, Frame};
use crate::bus::{Batch, Bus, Error, Reply, Transaction};
use crate::imu::bringup::{BringUp, Next};
use crate::imu::{self, SAMPLE_BYTES, register};
use crate::timing::{self, after, since};
use crate::{Instant, scan::sensor::Sensor};

impl<B: Bus> BusScanner<B> {
    /// Does what is due at `now`; returns a frame when a scan is complete. Never waits, and starts at most one
    /// transaction.
    pub fn poll(&mut self, now: Instant) -> Option<Frame> {
        let mut frame = None;
        if let Some(result) = self.bus.poll(now) {
            frame = self.take(result, now);
        }
        if !self.bus.is_up() {
            self.lose_bus();
            return frame;
        }
        if self.job.is_none() {
            let more = self.start_next(now);
            frame = frame.or(more);
        }
        frame
    }

    /// When [`BusScanner::poll`] has something to do even if no byte arrives; `None` only if it has nothing at all to do.
    pub fn next_due(&self) -> Option<Instant> {
        if self.job.is_some() || !self.bus.is_up() {
            return self.bus.next_due();
        }
        let steps = self
            .sensors
            .iter()
            .filter(|s| !s.is_running())
            .map(|s| s.due)
            .min();
        let running = self.sensors.iter().any(Sensor::is_running);
        let scan = match self.phase {
            Phase::Starting => None,
            Phase::Reading { .. } => Some(Instant::from_ticks(0)),
            Phase::Between { began, .. } => running.then(|| after(began, self.config.period)),
        };
        match (steps, scan) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        }
    }

    /// The way to the sensors is gone: what was under way is void, and nothing about pointers and channels is known.
    fn lose_bus(&mut self) {
        self.job = None;
        self.step = None;
        self.mux.forget();
        self.sensors.iter_mut().for_each(Sensor::forget);
        if let Phase::Reading { began, .. } = self.phase {
            self.phase = Phase::Between {
                began,
                stepped: false,
            };
        }
    }

    fn take(&mut self, result: Result<Reply, Error>, now: Instant) -> Option<Frame> {
        match result {
            Ok(_) => self.answered = now,
            Err(_) => self.mux.forget(),
        }
        let job = self.job.take()?;
        if result == Err(Error::Stalled) {
            self.ask_again(job, now);
            return None;
        }
        match job {
            Job::Sample {
                sensor,
                stamp,
                selects,
            } => {
                self.take_sample(sensor, stamp, selects, result, now);
                self.finish_scan(now)
            }
            Job::Select { sensor } => {
                self.take_selection(sensor, result, now);
                None
            }
            Job::Step => {
                self.take_step(result.as_deref().map_err(|e| *e));
                None
            }
        }
    }

    /// Nobody looked at the bus for so long that the reply says nothing about now: it is asked for anew. A scan begins anew as
    /// a whole, since the samples it has are as old; a step makes its transaction again by itself.
    fn ask_again(&mut self, job: Job, now: Instant) {
        let (Job::Sample { .. }, Phase::Reading { began, .. }) = (job, self.phase) else {
            return;
        };
        if self.ask_who_is_there(now) {
            self.phase = Phase::Between {
                began,
                stepped: false,
            };
        } else {
            self.begin_reading(now);
        }
    }

    fn begin_reading(&mut self, now: Instant) {
        if since(now, self.seen) >= timing::PEAK_SPEED {
            let then = self.seen;
            self.sensors
                .iter_mut()
                .for_each(|sensor| sensor.not_seen_since(then));
        }
        self.phase = Phase::Reading {
            next: 0,
            began: now,
        };
    }

    fn take_sample(
        &mut self,
        k: usize,
        stamp: Instant,
        selects: bool,
        result: Result<Reply, Error>,
        now: Instant,
    ) {
        let at_sensor = |cause| imu::Error::Bus {
            register: register::QUATERNION,
            cause,
        };
        let unsupported = at_sensor(Error::Unsupported);
        let sample = result.map_err(at_sensor).and_then(|reply| {
            let (confirmation, sample) = reply
                .split_at_checked(usize::from(selects))
                .ok_or(unsupported)?;
            if let [read_back] = confirmation {
                self.confirm(k, *read_back).map_err(imu::Error::Mux)?;
            }
            <[u8; SAMPLE_BYTES]>::try_from(sample).map_err(|_| unsupported)
        });
        let baud = self.bus.line_baud().unwrap_or(self.config.baud);
        let longest = timing::scan_gap(baud, self.config.period);
        let Some(sensor) = self.sensors.get_mut(k) else {
            return;
        };
        sensor.ask(stamp, longest);
        match sample {
            Ok(raw) => {
                sensor.take(raw, stamp, &mut self.counters);
                if sensor.health.is_good() {
                    self.seen = stamp;
                }
            }
            Err(error) => sensor.miss(error, now, &mut self.counters),
        }
    }

    fn confirm(&mut self, k: usize, read_back: u8) -> Result<(), Error> {
        self.mux
            .confirm(imu::channel(k), read_back)
            .inspect_err(|_| {
                self.counters.mux_errors = self.counters.mux_errors.wrapping_add(1);
            })
    }

    fn take_selection(&mut self, k: usize, result: Result<Reply, Error>, now: Instant) {
        let confirmed = result.and_then(|reply| match reply.as_slice() {
            [read_back] => self.confirm(k, *read_back),
            _ => Err(Error::Unsupported),
        });
        if let Err(cause) = confirmed {
            self.fail_step(imu::Error::Mux(cause), now);
        }
    }

    fn take_step(&mut self, result: Result<&[u8], Error>) {
        if let Some(active) = &mut self.step {
            active.bring_up.supply(result);
        }
    }

    fn fail_step(&mut self, error: imu::Error, now: Instant) {
        let Some(active) = self.step.take() else {
            return;
        };
        if let Some(sensor) = self.sensors.get_mut(active.sensor)
            && sensor.step_failed(active.bring_up.step(), error, now)
        {
            self.counters.failed_starts = self.counters.failed_starts.wrapping_add(1);
        }
    }

    /// Starts the next transaction there is. Each round of the loop ends one thing, so it ends.
    fn start_next(&mut self, now: Instant) -> Option<Frame> {
        // A step that needs no transaction, then the next thing; a scan over; a sensor found.
        for _ in 0..4 {
            if self.step.is_some() {
                if self.advance_step(now) {
                    return None;
                }
                continue;
            }
            match self.phase {
                Phase::Starting => {
                    if !self.begin_step(now) {
                        if self.sensors.iter().any(|s| !s.tried) {
                            return None;
                        }
                        self.phase = Phase::Between {
                            began: now,
                            stepped: false,
                        };
                    }
                }
                Phase::Reading { .. } => {
                    if let Some(frame) = self.finish_scan(now) {
                        return Some(frame);
                    }
                    if self.start_sample(now) {
                        return None;
                    }
                }
                Phase::Between { began, stepped } => {
                    if (!stepped || self.is_in_doubt()) && self.begin_step(now) {
                        self.phase = Phase::Between {
                            began,
                            stepped: true,
                        };
                    } else if !self.begin_scan(began, now) {
                        return None;
                    }
                }
            }
        }
        None
    }

    /// Picks the sensor whose step has been due for longest; false if none is due.
    fn begin_step(&mut self, now: Instant) -> bool {
        let due = self
            .sensors
            .iter()
            .enumerate()
            .filter(|(_, s)| s.is_due(now));
        let Some((k, sensor)) = due.min_by_key(|(_, s)| s.due) else {
            return false;
        };
        let Some(step) = sensor.step else {
            return false;
        };
        let bring_up = BringUp::new(step, imu::address(k), self.config.imu);
        self.step = Some(ActiveStep {
            sensor: k,
            bring_up,
        });
        true
    }

    /// Starts the step's next transaction, or ends it. True if a transaction was started or nothing can be.
    fn advance_step(&mut self, now: Instant) -> bool {
        let Some(active) = &self.step else {
            return false;
        };
        let (k, step) = (active.sensor, active.bring_up.step());
        match active.bring_up.next() {
            Next::Transaction(transaction) => self.start_step(k, transaction, now),
            Next::Done(outcome) => {
                if let Some(id) = outcome.unique_id
                    && let Err(error) = self.recognise(k, id, now)
                {
                    self.fail_step(error, now);
                    return false;
                }
                self.step = None;
                let relative = self.config.imu.mode == imu::Mode::Imu;
                if let Some(sensor) = self.sensors.get_mut(k)
                    && sensor.step_done(step, outcome, relative, now)
                    && let Some(starts) = self.counters.starts.get_mut(k)
                {
                    *starts = starts.wrapping_add(1);
                }
                false
            }
            Next::Failed(error) => {
                self.fail_step(error, now);
                false
            }
        }
    }

    fn start_step(&mut self, k: usize, transaction: Transaction, now: Instant) -> bool {
        let mut batch = Batch::new();
        let channel = imu::channel(k);
        let job = if self.mux.selected() == Some(channel) {
            let _ = batch.push(transaction);
            Job::Step
        } else {
            if let Err(cause) = self.mux.select(channel, &mut batch) {
                self.fail_step(imu::Error::Mux(cause), now);
                return false;
            }
            Job::Select { sensor: k }
        };
        match self.bus.start(&batch, now) {
            Ok(()) => self.job = Some(job),
            Err(cause) => self.fail_step(imu::Error::Mux(cause), now),
        }
        true
    }

    /// Begins a scan if its time has come and there is a sensor to read.
    fn begin_scan(&mut self, began: Instant, now: Instant) -> bool {
        let first = self.counters.frames == 0;
        let due = first || now >= after(began, self.config.period);
        if !due || self.ask_who_is_there(now) || !self.sensors.iter().any(Sensor::is_running) {
            // Another step may come due before the next scan.
            self.phase = Phase::Between {
                began,
                stepped: false,
            };
            return false;
        }
        self.begin_reading(now);
        true
    }

    /// Starts the next sensor's sample. False if there is none left, or it could not be started.
    fn start_sample(&mut self, now: Instant) -> bool {
        let Phase::Reading { next, began } = self.phase else {
            return false;
        };
        let mut left = self.sensors.iter().enumerate().skip(next);
        let Some((k, sensor)) = left.find(|(_, sensor)| sensor.is_running()) else {
            return false;
        };
        self.phase = Phase::Reading { next: k + 1, began };
        let plain = sensor.reads_plain();
        let mut batch = Batch::new();
        let selects = self.mux.selected() != Some(imu::channel(k));
        let started = sample_batch(k, plain)
            .and_then(|sample| {
                if selects {
                    self.mux.select(imu::channel(k), &mut batch)?;
                }
                batch.push(sample).map_err(|_| Error::Unsupported)
            })
            .and_then(|()| self.bus.start(&batch, now));
        match started {
            Ok(()) => {
                self.job = Some(Job::Sample {
                    sensor: k,
                    stamp: now,
                    selects,
                })
            }
            Err(cause) => {
                let error = imu::Error::Bus {
                    register: register::QUATERNION,
                    cause,
                };
                if let Some(sensor) = self.sensors.get_mut(k) {
                    sensor.miss(error, now, &mut self.counters);
                }
            }
        }
        true
    }

    /// If no sensor is left to read: closes the scan.
    fn finish_scan(&mut self, now: Instant) -> Option<Frame> {
        let Phase::Reading { next, began } = self.phase else {
            return None;
        };
        if self.sensors.iter().skip(next).any(Sensor::is_running) {
            return None;
        }
        self.phase = Phase::Between {
            began,
            stepped: false,
        };
        self.judge_together(now);
        let sequence = self.counters.frames;
        self.counters.frames = sequence.wrapping_add(1);
        Some(Frame {
            samples: core::array::from_fn(|k| self.sensors[k].sample()),
            sequence,
        })
    }
}

/// The 8-byte read, alone if the register pointer stands where it should.
fn sample_batch(k: usize, plain: bool) -> Result<Transaction, Error> {
    if plain {
        Transaction::read(imu::address(k), SAMPLE_BYTES)
    } else {
        Transaction::write_read(imu::address(k), &[register::QUATERNION], SAMPLE_BYTES)
    }
}
