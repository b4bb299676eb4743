//! A glove on an I²C port of this computer: multiplexer and sensors without a serial bridge between.
//!
//! A system's I²C call blocks: 0.4 ms for the longest batch at 400 kHz, 1.7 ms at 100 kHz, more where a sensor stretches the clock,
//! and the adapter's timeout where the bus hangs (a second, if nobody shortens it). The bridge's loop may not stand still for that. So
//! the calls are made on a thread of their own, and [`Port`] is a [`Bus`] that hands it one batch and looks for the reply, with a deadline.
//! Any blocking `embedded-hal` bus can be behind it ([`Port::over`]); on Linux `/dev/i2c-N` ([`open`]). One that can go away, as an
//! adapter on USB, is opened again until it is back ([`Port::reopened`]). The device file itself was not tried on hardware.

use std::io::{Read as _, Write as _};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};

use embedded_hal::i2c::I2c;
use glove::bus::{Batch, Bus, Direct, Error, Reply};
use glove::timing::PORT_RETRY;
use glove::{Duration, Instant};

use super::port::Watch;
use crate::failure::Failure;
use crate::realtime;

mod address;
#[cfg(target_os = "linux")]
mod device;

pub use address::Address;

/// A batch that is not answered by then counts as hung: three transactions that the adapter gives up after [`TIMEOUT`] each, 20 ms for
/// a busy computer, and their bytes.
pub const DEADLINE: Duration = Duration::from_ticks(85_000);

/// After this long an adapter is told to give a hung bus up; it counts in steps of 10 ms.
pub const TIMEOUT: Duration = Duration::from_ticks(20_000);

/// An adapter that has not come back for this long counts as dead.
pub const DEAD: Duration = Duration::from_ticks(2_000_000);

/// How often an adapter that has not come back is looked at.
const LOOK: Duration = Duration::from_ticks(20_000);

/// Opens the I²C port at `address`. Nothing is asked of the glove.
///
/// # Errors
/// A failure that says why it does not open, and what to try.
#[cfg(target_os = "linux")]
pub fn open(address: &Address) -> Result<Port, Failure> {
    Port::open(address)
}

/// Only Linux shows its I²C ports to programs in a way that is known here.
///
/// # Errors
/// Always.
#[cfg(not(target_os = "linux"))]
pub fn open(address: &Address) -> Result<Port, Failure> {
    Err(Failure::usage(
        format!("{address}: this system has no I2C ports for programs"),
        "a serial bridge (SC18IM) and its port, or a computer with Linux",
    ))
}

/// What the thread is asked, and what it answers; [`Error::Port`] where the bus is away.
type Job = (u64, Task);
type Done = (u64, Result<Reply, Error>);

/// What the thread can do.
#[derive(Debug)]
enum Task {
    /// Makes a batch.
    Make(Batch),
    /// Opens the bus again.
    Open,
}

/// What is under way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Idle,
    /// The batch `number` was handed over.
    Asked {
        number: u64,
        deadline: Instant,
    },
    /// The batch `number` was given up; the thread is still at it.
    Hung {
        number: u64,
        since: Instant,
        now: Instant,
    },
    /// The bus went away. It is opened again when it is time to `look`; `asked` is such a try that is under way.
    Away {
        since: Instant,
        now: Instant,
        look: Instant,
        asked: Option<u64>,
    },
    /// The thread is gone.
    Gone,
}

/// An I²C port as a bus that never waits.
#[derive(Debug)]
pub struct Port {
    jobs: SyncSender<Job>,
    answers: Receiver<Done>,
    wake: UnixStream,
    readable: Arc<OwnedFd>,
    watch: Watch,
    state: State,
    number: u64,
}

impl Port {
    /// A port over any blocking bus that stays; `name` is what it is called. The thread ends with the port, as soon as the bus lets
    /// it go.
    ///
    /// # Errors
    /// The system gives no thread or no pair of sockets.
    pub fn over<I: I2c + Send + 'static>(name: PathBuf, i2c: I) -> std::io::Result<Self> {
        Self::reopened(name, i2c, |_| false, || None)
    }

    /// The same over one that may go away: after an error `is_gone` says whether it has, and `open` gives it anew once it is back.
    ///
    /// # Errors
    /// As [`Port::over`].
    pub fn reopened<I: I2c + Send + 'static>(
        name: PathBuf,
        i2c: I,
        is_gone: fn(&I) -> bool,
        open: impl FnMut() -> Option<I> + Send + 'static,
    ) -> std::io::Result<Self> {
        let (jobs, queue) = sync_channel::<Job>(1);
        let (back, answers) = sync_channel::<Done>(1);
        let (wake, waker) = UnixStream::pair()?;
        wake.set_nonblocking(true)?;
        waker.set_nonblocking(true)?;
        let thread = std::thread::Builder::new().name("i2c".to_owned());
        // It carries the bytes, so it runs as the bridge does.
        let (thread, _) = realtime::starting(move || {
            let way = Way {
                bus: Some(Direct::new(i2c)),
                is_gone,
                open,
            };
            thread.spawn(move || way.work(&queue, &back, &waker))
        })?;
        thread?;
        let readable = Arc::new(OwnedFd::from(wake.try_clone()?));
        let watch = Watch::of(name, Arc::clone(&readable));
        Ok(Self {
            jobs,
            answers,
            wake,
            readable,
            watch,
            state: State::Idle,
            number: 0,
        })
    }

    /// A handle to wait on it and to see how it fares.
    pub fn watch(&self) -> Watch {
        self.watch.clone()
    }

    /// The newest answer, if there is one.
    fn collect(&mut self) -> Result<Option<Done>, Error> {
        let mut bytes = [0; 16];
        while matches!(self.wake.read(&mut bytes), Ok(count) if count == bytes.len()) {}
        self.watch.note_read();
        match self.answers.try_recv() {
            Ok(done) => Ok(Some(done)),
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => {
                self.state = State::Gone;
                Err(Error::Port)
            }
        }
    }

    /// The bus is away; it is looked for after a while.
    fn goes_away(&mut self, since: Instant, now: Instant) {
        self.watch.set_descriptor(None);
        self.state = State::Away {
            since,
            now,
            look: now + PORT_RETRY,
            asked: None,
        };
    }

    /// Looks whether the bus is back.
    fn look_for(&mut self, since: Instant, now: Instant, look: Instant, asked: Option<u64>) {
        let away = |asked, look| State::Away {
            since,
            now,
            look,
            asked,
        };
        self.state = match asked {
            None if now < look => away(None, look),
            None => {
                self.number += 1;
                match self.jobs.try_send((self.number, Task::Open)) {
                    Ok(()) => away(Some(self.number), look),
                    Err(_) => State::Gone,
                }
            }
            Some(number) => match self.collect() {
                Err(_) => State::Gone,
                Ok(Some((answered, Ok(_)))) if answered == number => {
                    self.watch.set_descriptor(Some(Arc::clone(&self.readable)));
                    State::Idle
                }
                Ok(Some(_)) => away(None, now + PORT_RETRY),
                Ok(None) => away(asked, look),
            },
        };
    }
}

/// The thread's end.
struct Way<I, O> {
    /// `None` while it is away.
    bus: Option<Direct<I>>,
    is_gone: fn(&I) -> bool,
    open: O,
}

impl<I: I2c, O: FnMut() -> Option<I>> Way<I, O> {
    /// One task after the other until the port is gone.
    fn work(mut self, queue: &Receiver<Job>, back: &SyncSender<Done>, mut waker: &UnixStream) {
        while let Ok((number, task)) = queue.recv() {
            let result = match task {
                Task::Make(batch) => self.make(&batch),
                Task::Open => self.open(),
            };
            if back.send((number, result)).is_err() {
                return;
            }
            // A full queue of wakings wakes as well.
            let _ = waker.write(&[1]);
        }
    }

    fn make(&mut self, batch: &Batch) -> Result<Reply, Error> {
        let now = Instant::from_ticks(0);
        let bus = self.bus.as_mut().ok_or(Error::Port)?;
        let started = bus.start(batch, now);
        let result = started.and_then(|()| bus.poll(now).unwrap_or(Err(Error::Other)));
        if result.is_err() && (self.is_gone)(bus.i2c_mut()) {
            // A device that is held open does not come back under its name.
            self.bus = None;
            return Err(Error::Port);
        }
        result
    }

    fn open(&mut self) -> Result<Reply, Error> {
        self.bus = (self.open)().map(Direct::new);
        self.bus.as_ref().map(|_| Reply::new()).ok_or(Error::Port)
    }
}

impl Bus for Port {
    fn start(&mut self, batch: &Batch, now: Instant) -> Result<(), Error> {
        match self.state {
            State::Idle => {}
            State::Asked { .. } => return Err(Error::Busy),
            State::Hung { .. } | State::Gone => return Err(Error::NoAnswer),
            State::Away { .. } => return Err(Error::Port),
        }
        self.number += 1;
        let task = Task::Make(batch.clone());
        if self.jobs.try_send((self.number, task)).is_err() {
            self.state = State::Gone;
            return Err(Error::Port);
        }
        self.state = State::Asked {
            number: self.number,
            deadline: now + DEADLINE,
        };
        Ok(())
    }

    fn poll(&mut self, now: Instant) -> Option<Result<Reply, Error>> {
        match self.state {
            State::Idle | State::Gone => None,
            State::Asked { number, deadline } => match self.collect() {
                Err(error) => Some(Err(error)),
                Ok(Some((answered, Err(Error::Port)))) if answered == number => {
                    self.goes_away(now, now);
                    Some(Err(Error::Port))
                }
                Ok(Some((answered, result))) if answered == number => {
                    self.state = State::Idle;
                    // A reply that lay there while the caller stood still says nothing about now.
                    let stalled = now >= deadline && result.is_ok();
                    Some(if stalled { Err(Error::Stalled) } else { result })
                }
                Ok(_) if now >= deadline => {
                    self.state = State::Hung {
                        number,
                        since: now,
                        now,
                    };
                    Some(Err(Error::BusTimeout))
                }
                Ok(_) => None,
            },
            State::Hung { number, since, .. } => {
                match self.collect() {
                    // It says why itself.
                    Err(_) => {}
                    Ok(Some((answered, result))) if answered == number => match result {
                        Err(Error::Port) => self.goes_away(since, now),
                        _ => self.state = State::Idle,
                    },
                    Ok(_) => self.state = State::Hung { number, since, now },
                }
                None
            }
            State::Away {
                since, look, asked, ..
            } => {
                self.look_for(since, now, look, asked);
                None
            }
        }
    }

    fn next_due(&self) -> Option<Instant> {
        match self.state {
            State::Idle | State::Gone => None,
            State::Asked { deadline, .. } => Some(deadline),
            State::Away {
                look, asked: None, ..
            } => Some(look),
            State::Hung { now, .. } | State::Away { now, .. } => Some(now + LOOK),
        }
    }

    fn is_up(&self) -> bool {
        matches!(self.state, State::Idle | State::Asked { .. })
    }

    fn is_dead(&self) -> bool {
        match self.state {
            State::Gone => true,
            State::Hung { since, now, .. } | State::Away { since, now, .. } => now
                .checked_duration_since(since)
                .is_some_and(|hung| hung >= DEAD),
            State::Idle | State::Asked { .. } => false,
        }
    }
}

#[cfg(test)]
mod tests;
