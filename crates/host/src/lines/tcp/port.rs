//! The driver's end: looks like a serial port that carries Modbus RTU, and hands blocks to the task.

use std::io::Read as _;
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use embedded_io::{ErrorType, Read, ReadReady, Write};
use gripper::registers::{COMMAND, STATUS};
use gripper::rtu::{Registers, Request, Response, function};
use tokio::sync::mpsc;

use super::address::Address;
use super::state::{BLOCK, CONNECT, EXCHANGE, Error, State, lock};
use super::task::{self, Answers, Done, Job};
use crate::clock::{Clock, ticks};
use crate::failure::{Failure, OrFail};
use crate::interrupt::Interrupt;
use crate::lines::port::Watch;

/// Answers that may lie there; more than one only after the driver gave up waiting.
const ANSWERS: usize = 4;
/// Pause between two looks whether the connection is there.
const LOOK: Duration = Duration::from_millis(2);

/// What the driver waits for.
#[derive(Debug, Clone, Copy)]
struct Asked {
    number: u64,
    unit: u8,
    function: u8,
    quantity: u16,
}

/// A gripper on the network, as a port for [`gripper::driver::ThreeFinger`]. Never blocks, connects again by itself.
#[derive(Debug)]
pub struct Port {
    address: Address,
    unit: u8,
    jobs: mpsc::Sender<Job>,
    answers: Receiver<Done>,
    wake: UnixStream,
    state: Arc<Mutex<State>>,
    watch: Watch,
    readable: Arc<OwnedFd>,
    clock: Clock,
    /// By how much longer than [`EXCHANGE`] an exchange may take.
    patience: Duration,
    number: u64,
    asked: Option<Asked>,
    /// The answer in RTU's bytes, and how many of them were read.
    reply: Vec<u8>,
    taken: usize,
}

impl Port {
    /// Connects to the gripper at `address`, as Modbus unit `unit`. Nothing is asked of the gripper.
    ///
    /// # Errors
    /// A failure that says why there is no connection, after [`CONNECT`] at most.
    pub fn connect(address: &Address, unit: u8, interrupt: &Interrupt) -> anyhow::Result<Self> {
        Self::connect_with(address, unit, Duration::ZERO, interrupt)
    }

    /// The same, where an exchange may take longer than [`EXCHANGE`] by `patience`.
    ///
    /// # Errors
    /// As [`Self::connect`].
    pub fn connect_with(
        address: &Address,
        unit: u8,
        patience: Duration,
        interrupt: &Interrupt,
    ) -> anyhow::Result<Self> {
        let port = Self::start(address, unit, patience).or_fail(
            || format!("{address} cannot be used"),
            "ending other programs",
        )?;
        let end = Instant::now() + CONNECT + Duration::from_millis(500);
        loop {
            if lock(&port.state).connected {
                return Ok(port);
            }
            let failed = port.error();
            if failed.is_some() || Instant::now() >= end || interrupt.sleep(LOOK) {
                let error = failed.unwrap_or(Error::Unreachable);
                let what = format!("no gripper answers at {address}: {error}");
                return Err(Failure::new(what, error.next_step()).into());
            }
        }
    }

    /// Starts the task; it connects by itself.
    fn start(address: &Address, unit: u8, patience: Duration) -> std::io::Result<Self> {
        let clock = Clock::start();
        let (jobs, queue) = mpsc::channel(1);
        let (back, answers) = sync_channel(ANSWERS);
        let (wake, waker) = UnixStream::pair()?;
        wake.set_nonblocking(true)?;
        waker.set_nonblocking(true)?;
        let state = Arc::new(Mutex::new(State::default()));
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .enable_time()
            .build()?;
        let way_back = Answers {
            queue: back,
            wake: waker,
            state: Arc::clone(&state),
            clock,
        };
        let target = address.clone();
        std::thread::Builder::new()
            .name("modbus-tcp".to_owned())
            .spawn(move || {
                runtime.block_on(task::run(target, unit, queue, way_back));
                // A name that is still being looked up is not waited for.
                runtime.shutdown_background();
            })?;
        let readable = Arc::new(OwnedFd::from(wake.try_clone()?));
        let watch = Watch::of(PathBuf::from(address.to_string()), Arc::clone(&readable));
        Ok(Self {
            address: address.clone(),
            unit,
            jobs,
            answers,
            wake,
            state,
            watch,
            readable,
            clock,
            patience,
            number: 0,
            asked: None,
            reply: Vec::new(),
            taken: 0,
        })
    }

    /// How to set up the driver on this line: the answer comes within [`EXCHANGE`] or the port says why not; the
    /// times of a serial line are made too small to matter.
    pub fn driver_config(&self) -> gripper::driver::Config {
        let millis = u64::try_from(EXCHANGE.as_millis()).unwrap_or(u64::MAX);
        gripper::driver::Config {
            unit: self.unit,
            baud: 1_000_000,
            response: gripper::Duration::from_ticks((millis + 50) * 1_000),
            silence: Some(gripper::Duration::from_ticks(100)),
            patience: ticks(self.patience),
            // Only the 3-Finger gripper speaks Modbus TCP.
            check_family: false,
            ..gripper::driver::Config::default()
        }
    }

    /// Where it leads.
    pub fn address(&self) -> &Address {
        &self.address
    }

    /// The newest failure since the last good answer.
    pub fn error(&self) -> Option<Error> {
        lock(&self.state).error.clone()
    }

    /// How often it was connected.
    pub fn connections(&self) -> u64 {
        lock(&self.state).connections
    }

    /// A handle to wait on this line and to see how it fares.
    pub fn watch(&self) -> Watch {
        self.watch.clone()
    }

    /// Takes over what the task answered.
    fn collect(&mut self) -> Result<(), Error> {
        let mut bytes = [0; 16];
        while matches!(self.wake.read(&mut bytes), Ok(count) if count == bytes.len()) {}
        while let Ok((number, result)) = self.answers.try_recv() {
            let Some(asked) = self.asked.filter(|asked| asked.number == number) else {
                // The driver gave it up before.
                continue;
            };
            self.asked = None;
            let block = result.inspect_err(|_| self.note_connection())?;
            self.note_connection();
            self.reply = reply(asked, &block).ok_or(Error::Unsupported)?;
            self.taken = 0;
        }
        Ok(())
    }

    fn note_connection(&self) {
        let connected = lock(&self.state).connected;
        let descriptor = connected.then(|| Arc::clone(&self.readable));
        self.watch.set_descriptor(descriptor);
    }
}

/// The status block as the RTU reply the driver waits for.
fn reply(asked: Asked, block: &[u8; BLOCK]) -> Option<Vec<u8>> {
    let values = block.get(..2 * usize::from(asked.quantity))?;
    let values = Registers::from_bytes(values)?;
    let response = match asked.function {
        function::READ_HOLDING => Response::ReadHolding(values),
        function::READ_INPUT => Response::ReadInput(values),
        _ => Response::ReadWrite(values),
    };
    let mut frame = vec![0; response.buffer_len()];
    response.emit(asked.unit, &mut frame).ok()?;
    Some(frame)
}

/// The exchange an RTU request stands for: registers read, and the block written before.
fn exchange(request: &Request<'_>) -> Option<(u16, Option<[u8; BLOCK]>)> {
    match *request {
        Request::ReadHolding {
            address: STATUS,
            quantity,
        }
        | Request::ReadInput {
            address: STATUS,
            quantity,
        } => Some((quantity, None)),
        Request::ReadWrite {
            read_address: STATUS,
            read_quantity,
            write_address: COMMAND,
            values,
        } => Some((read_quantity, Some(values.bytes().try_into().ok()?))),
        _ => None,
    }
}

impl ErrorType for Port {
    type Error = Error;
}

impl ReadReady for Port {
    fn read_ready(&mut self) -> Result<bool, Error> {
        if self.taken == self.reply.len() {
            self.collect()?;
        }
        Ok(self.taken < self.reply.len())
    }
}

impl Read for Port {
    fn read(&mut self, out: &mut [u8]) -> Result<usize, Error> {
        self.watch.note_read();
        let rest = self.reply.get(self.taken..).unwrap_or(&[]);
        let count = rest.len().min(out.len());
        out[..count].copy_from_slice(&rest[..count]);
        self.taken += count;
        Ok(count)
    }
}

impl Write for Port {
    /// Takes one whole request, or none.
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        let (unit, request) = Request::parse(bytes).map_err(|_| Error::Unsupported)?;
        let (quantity, write) = exchange(&request).ok_or(Error::Unsupported)?;
        self.note_connection();
        if !lock(&self.state).connected {
            return Err(self.error().unwrap_or(Error::NotConnected));
        }
        self.number += 1;
        let job = Job {
            number: self.number,
            write,
            until: self.clock.now() + ticks(EXCHANGE + self.patience),
        };
        // The queue is full only while the task is stuck in an exchange the driver gave up.
        self.jobs.try_send(job).map_err(|_| Error::NotConnected)?;
        self.reply.clear();
        self.taken = 0;
        self.asked = Some(Asked {
            number: self.number,
            unit,
            function: request.function(),
            quantity,
        });
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Error> {
        Ok(())
    }
}
