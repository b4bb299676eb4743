//! Modbus TCP: the 3-Finger gripper's network variant (unit 2, FC04 reads, FC16 writes, port 502).
//!
//! A task on tokio, on a thread of its own, speaks Modbus TCP; [`Port`] hands it 16-byte command blocks and takes
//! 16-byte status blocks back through bounded queues, and looks like a serial port to
//! [`gripper::driver::ThreeFinger`]. So everything the driver promises (connecting only reads, no motion older than
//! 100 ms, activation only when told) holds here too, and the bridge does not care which line it has.
//!
//! What TCP adds: an exchange is a write and a read, with one deadline for both ([`EXCHANGE`]); after it the
//! connection is dropped with whatever it still holds, never resumed: a command that hangs in a network must not
//! arrive later. A block that was handed over for one connection never leaves on the next.

mod address;
mod port;
mod state;
mod stream;
mod task;

pub use address::Address;
pub use port::Port;
pub use state::{BLOCK, CONNECT, EXCHANGE, Error, PORT, RECONNECT_FIRST, RECONNECT_LAST, UNIT};
