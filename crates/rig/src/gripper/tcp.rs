//! Modbus TCP face of a virtual gripper: MBAP frames on a plain socket (hardware.md §1).
//!
//! Unit 2; FC03, FC04 and FC16. A bad request gets silence here too. One thread accepts, one thread a
//! connection serves, at most [`MAX_CONNECTIONS`] at a time; all of them end when the handle is dropped.

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use super::VirtualGripper;
use super::server::Transport;
use crate::Clock;

/// Modbus unit of the TCP variant.
pub const UNIT: u8 = 2;
/// Clients served at the same time; more are closed at once.
pub const MAX_CONNECTIONS: usize = 4;

/// How often threads look whether they are to stop.
const STOP_POLL: std::time::Duration = std::time::Duration::from_millis(20);
/// A client that takes no bytes for this long is let go.
const WRITE_DEADLINE: std::time::Duration = std::time::Duration::from_secs(1);
/// Transaction, protocol, length, unit.
const HEADER: usize = 7;
/// Largest length field: unit and PDU.
const MAX_LENGTH: usize = 254;

/// A running Modbus TCP server. Dropping it closes everything.
#[derive(Debug)]
pub struct TcpHandle {
    address: SocketAddr,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl TcpHandle {
    /// Where it listens; with port 0 asked for, the port it got.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for TcpHandle {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            // A panic in there has been printed already.
            let _ = thread.join();
        }
    }
}

/// Serves `gripper` at `address`; `clock` must be the one its other wires live on.
///
/// # Errors
/// The address cannot be bound.
pub fn serve(
    gripper: &VirtualGripper,
    address: impl ToSocketAddrs,
    clock: &Clock,
) -> io::Result<TcpHandle> {
    let listener = TcpListener::bind(address)?;
    listener.set_nonblocking(true)?;
    let address = listener.local_addr()?;
    let stop = Arc::new(AtomicBool::new(false));
    let (gripper, clock, flag) = (gripper.clone(), clock.clone(), stop.clone());
    let thread = thread::Builder::new()
        .name("rig-modbus-tcp".into())
        .spawn(move || accept(&listener, &gripper, &clock, &flag))?;
    Ok(TcpHandle {
        address,
        stop,
        thread: Some(thread),
    })
}

fn accept(listener: &TcpListener, gripper: &VirtualGripper, clock: &Clock, stop: &Arc<AtomicBool>) {
    let mut clients: Vec<JoinHandle<()>> = Vec::new();
    while !stop.load(Ordering::SeqCst) {
        clients.retain(|c| !c.is_finished());
        match listener.accept() {
            Ok((stream, _)) if clients.len() < MAX_CONNECTIONS => {
                let (gripper, clock, stop) = (gripper.clone(), clock.clone(), stop.clone());
                let serve = move || {
                    // The client is gone: nobody to tell.
                    let _ = converse(stream, &gripper, &clock, &stop);
                };
                clients.extend(
                    thread::Builder::new()
                        .name("rig-tcp-client".into())
                        .spawn(serve),
                );
            }
            Ok(_) => {}
            Err(_) => thread::sleep(STOP_POLL),
        }
    }
    for client in clients {
        let _ = client.join();
    }
}

/// Serves one client until it leaves, breaks the protocol or the server stops.
fn converse(
    mut stream: TcpStream,
    gripper: &VirtualGripper,
    clock: &Clock,
    stop: &AtomicBool,
) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(STOP_POLL))?;
    stream.set_write_timeout(Some(WRITE_DEADLINE))?;
    stream.set_nodelay(true)?;
    let mut received = Vec::new();
    let mut chunk = [0u8; 512];
    while !stop.load(Ordering::SeqCst) {
        match stream.read(&mut chunk) {
            Ok(0) => return Ok(()),
            Ok(count) => received.extend_from_slice(&chunk[..count]),
            Err(e)
                if matches!(
                    e.kind(),
                    io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut
                ) =>
            {
                continue;
            }
            Err(e) => return Err(e),
        }
        while let Some(end) = frame_end(&received)? {
            if let Some(reply) = answer(&received[..end], gripper, clock) {
                stream.write_all(&reply)?;
            }
            received.drain(..end);
        }
    }
    Ok(())
}

/// Where the first frame ends; `None` while it is not whole.
///
/// # Errors
/// A header that cannot be one: the stream has lost its frame limits and is closed.
fn frame_end(bytes: &[u8]) -> io::Result<Option<usize>> {
    let Some([_, _, protocol_high, protocol_low, high, low]) = bytes.first_chunk::<6>().copied()
    else {
        return Ok(None);
    };
    let length = usize::from(u16::from_be_bytes([high, low]));
    let protocol = u16::from_be_bytes([protocol_high, protocol_low]);
    if protocol != 0 || !(2..=MAX_LENGTH).contains(&length) {
        return Err(io::ErrorKind::InvalidData.into());
    }
    Ok((bytes.len() >= 6 + length).then_some(6 + length))
}

fn answer(frame: &[u8], gripper: &VirtualGripper, clock: &Clock) -> Option<Vec<u8>> {
    let (header, pdu) = frame.split_at_checked(HEADER)?;
    if header.last() != Some(&UNIT) {
        return None;
    }
    let mut out = [0u8; 256];
    let now = clock.now();
    let length = {
        let mut server = gripper.server();
        let length = server.serve(pdu, Transport::Tcp, now, &mut out)?;
        if server.swallow() {
            return None;
        }
        length
    };
    let mut reply = header.first_chunk::<4>()?.to_vec();
    reply.extend(u16::try_from(length + 1).ok()?.to_be_bytes());
    reply.push(UNIT);
    reply.extend_from_slice(&out[..length]);
    Some(reply)
}
