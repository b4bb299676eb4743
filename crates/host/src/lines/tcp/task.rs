//! The task: connects, exchanges blocks, connects again.

use std::io::Write;
use std::os::unix::net::UnixStream;
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use gripper::registers::{COMMAND, STATUS};
use tokio::net::{TcpStream, lookup_host};
use tokio::sync::mpsc;
use tokio::time::timeout;
use tokio_modbus::client::{Client, Context, tcp::attach_slave};
use tokio_modbus::{Request, Response, Slave};

use super::stream::{Seen, Watched};
use crate::clock::Clock;

use super::address::Address;
use super::state::{BLOCK, CONNECT, Error, RECONNECT_FIRST, RECONNECT_LAST, State, lock};

/// Registers of a block.
const REGISTERS: u16 = (BLOCK / 2) as u16;

/// One exchange asked for.
#[derive(Debug)]
pub(super) struct Job {
    pub(super) number: u64,
    /// The command block to write first.
    pub(super) write: Option<[u8; BLOCK]>,
    /// Nothing of it happens after this, and what was answered later is not told: the tool's clock.
    pub(super) until: gripper::Instant,
}

/// What became of it: the status block.
pub(super) type Done = (u64, Result<[u8; BLOCK], Error>);

/// The task's way back.
pub(super) struct Answers {
    pub(super) queue: SyncSender<Done>,
    /// Wakes whoever waits for an answer.
    pub(super) wake: UnixStream,
    pub(super) state: Arc<Mutex<State>>,
    /// What [`Job::until`] is counted by. Not tokio's: that one may stand still with the machine.
    pub(super) clock: Clock,
}

impl Answers {
    fn give(&mut self, number: u64, result: Result<[u8; BLOCK], Error>) {
        {
            let mut state = lock(&self.state);
            state.error = result.as_ref().err().cloned();
        }
        // A full queue holds answers nobody took; a full wake-up already wakes.
        let _ = self.queue.try_send((number, result));
        let _ = self.wake.write(&[0]);
    }

    fn connected(&self, connected: bool) {
        let mut state = lock(&self.state);
        state.connected = connected;
        state.connections += u64::from(connected);
    }
}

/// Runs until the queue of jobs is closed.
pub(super) async fn run(
    address: Address,
    unit: u8,
    mut jobs: mpsc::Receiver<Job>,
    mut answers: Answers,
) {
    let mut pause = RECONNECT_FIRST;
    loop {
        let attempt = tokio::select! {
            attempt = connect(&address, unit) => attempt,
            () = refuse(&mut jobs, &mut answers) => return,
        };
        match attempt {
            Err(error) => lock(&answers.state).error = Some(error),
            Ok(connection) => {
                answers.connected(true);
                let (exchanged, open) = serve(connection, &mut jobs, &mut answers).await;
                answers.connected(false);
                if !open {
                    return;
                }
                if exchanged {
                    pause = RECONNECT_FIRST;
                }
            }
        }
        tokio::select! {
            () = tokio::time::sleep(pause) => {}
            () = refuse(&mut jobs, &mut answers) => return,
        }
        pause = longer(pause);
    }
}

/// The pause after one of `pause`.
fn longer(pause: Duration) -> Duration {
    (pause * 2).min(RECONNECT_LAST)
}

/// Refuses every job, until the queue is closed.
async fn refuse(jobs: &mut mpsc::Receiver<Job>, answers: &mut Answers) {
    while let Some(job) = jobs.recv().await {
        let why = lock(&answers.state).error.clone();
        answers.give(job.number, Err(why.unwrap_or(Error::NotConnected)));
    }
}

/// A connection, and what came over it.
struct Connection {
    context: Context,
    seen: Arc<Seen>,
}

async fn connect(address: &Address, unit: u8) -> Result<Connection, Error> {
    let attempt = async {
        let found = lookup_host((address.host.as_str(), address.port)).await;
        let targets = found.map_err(|_| Error::Name(address.host.clone()))?;
        let mut error = Error::Name(address.host.clone());
        for target in targets {
            match TcpStream::connect(target).await.and_then(prepared) {
                Ok(stream) => {
                    let (stream, seen) = Watched::new(stream);
                    let context = attach_slave(stream, Slave(unit));
                    return Ok(Connection { context, seen });
                }
                Err(cause) => error = system(&cause),
            }
        }
        Err(error)
    };
    timeout(CONNECT, attempt)
        .await
        .unwrap_or(Err(Error::Unreachable))
}

/// Small frames leave at once, and a connection that is given up takes what it still holds with it.
fn prepared(stream: TcpStream) -> std::io::Result<TcpStream> {
    stream.set_nodelay(true)?;
    stream.set_zero_linger()?;
    Ok(stream)
}

/// Serves jobs over one connection. Returns whether an exchange succeeded, and whether there may be more jobs.
async fn serve(
    mut connection: Connection,
    jobs: &mut mpsc::Receiver<Job>,
    answers: &mut Answers,
) -> (bool, bool) {
    let mut exchanged = false;
    while let Some(job) = jobs.recv().await {
        let timer = Timer {
            clock: answers.clock,
            until: job.until,
        };
        let Some(left) = timer.left() else {
            // It waited in the queue for too long; the connection is not at fault.
            answers.give(job.number, Err(Error::Timeout));
            continue;
        };
        let exchange = exchange(&mut connection, job.write.as_ref(), &timer);
        let result = timeout(left, exchange)
            .await
            .ok()
            // What a timeout finds done is done, however late: this process may have stood still.
            .filter(|_| timer.left().is_some())
            .unwrap_or(Err(Error::Timeout));
        let lost = !matches!(result, Ok(_) | Err(Error::Exception(_)));
        exchanged |= result.is_ok();
        if lost {
            lock(&answers.state).connected = false;
        }
        answers.give(job.number, result);
        if lost {
            return (exchanged, true);
        }
    }
    // Nothing is under way: the last answer has come.
    let _ = timeout(Duration::from_millis(50), connection.context.disconnect()).await;
    (exchanged, false)
}

/// The time of one exchange.
struct Timer {
    clock: Clock,
    until: gripper::Instant,
}

impl Timer {
    /// What is left of it.
    fn left(&self) -> Option<Duration> {
        let left = self.until.checked_duration_since(self.clock.now())?;
        (left.as_ticks() > 0).then(|| Duration::from_micros(left.as_ticks()))
    }
}

/// Writes the command block, if there is one, and reads the status block.
async fn exchange(
    connection: &mut Connection,
    write: Option<&[u8; BLOCK]>,
    timer: &Timer,
) -> Result<[u8; BLOCK], Error> {
    if let Some(block) = write {
        let words: Vec<u16> = block
            .chunks_exact(2)
            .map(|pair| u16::from_be_bytes([pair[0], pair[1]]))
            .collect();
        let request = Request::WriteMultipleRegisters(COMMAND, words.into());
        match call(connection, request, timer).await? {
            Response::WriteMultipleRegisters(COMMAND, REGISTERS) => {}
            other => return Err(mismatch(&other)),
        }
    }
    let request = Request::ReadInputRegisters(STATUS, REGISTERS);
    let words = match call(connection, request, timer).await? {
        Response::ReadInputRegisters(words) if words.len() == BLOCK / 2 => words,
        other => return Err(mismatch(&other)),
    };
    let mut block = [0; BLOCK];
    for (bytes, word) in block.chunks_exact_mut(2).zip(words) {
        bytes.copy_from_slice(&word.to_be_bytes());
    }
    Ok(block)
}

fn mismatch(response: &Response) -> Error {
    Error::Mismatch(match response {
        Response::ReadInputRegisters(words) => {
            format!("{} registers instead of {REGISTERS}", words.len())
        }
        Response::WriteMultipleRegisters(address, count) => {
            format!("it confirms {count} registers from {address:#06X}")
        }
        _ => "another kind of answer".to_owned(),
    })
}

async fn call(
    connection: &mut Connection,
    request: Request<'_>,
    timer: &Timer,
) -> Result<Response, Error> {
    use tokio_modbus::{Error as Modbus, ProtocolError};
    // Nothing is asked, and nothing written, that would be too late.
    if timer.left().is_none() {
        return Err(Error::Timeout);
    }
    connection.seen.begin();
    match connection.context.call(request).await {
        Ok(Ok(response)) => Ok(response),
        Ok(Err(exception)) => Err(Error::Exception(exception.into())),
        Err(Modbus::Protocol(ProtocolError::HeaderMismatch { message, .. })) => {
            let other = connection.seen.other_number();
            Err(other.unwrap_or(Error::Mismatch(message)))
        }
        Err(Modbus::Protocol(ProtocolError::FunctionCodeMismatch { request, .. })) => Err(
            Error::Mismatch(format!("another function than {}", request.value())),
        ),
        Err(Modbus::Transport(cause)) => {
            Err(connection.seen.end().unwrap_or_else(|| transport(&cause)))
        }
    }
}

fn transport(cause: &std::io::Error) -> Error {
    use std::io::ErrorKind;
    match cause.kind() {
        ErrorKind::InvalidData | ErrorKind::InvalidInput if cause.raw_os_error().is_none() => {
            Error::Malformed(cause.to_string())
        }
        // A count that promises more bytes than the frame has.
        ErrorKind::UnexpectedEof => {
            Error::Malformed("it ends before the bytes it promises".to_owned())
        }
        _ => system(cause),
    }
}

fn system(cause: &std::io::Error) -> Error {
    use std::io::ErrorKind;
    match cause.kind() {
        ErrorKind::ConnectionRefused => Error::Refused,
        ErrorKind::TimedOut => Error::Unreachable,
        ErrorKind::ConnectionReset | ErrorKind::BrokenPipe | ErrorKind::ConnectionAborted => {
            Error::Closed
        }
        _ => Error::System(cause.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_between_attempts_double_up_to_two_seconds() {
        let pauses: Vec<u128> =
            std::iter::successors(Some(RECONNECT_FIRST), |&pause| Some(longer(pause)))
                .take(8)
                .map(|pause| pause.as_millis())
                .collect();
        assert_eq!(pauses, [100, 200, 400, 800, 1_600, 2_000, 2_000, 2_000]);
    }
}
