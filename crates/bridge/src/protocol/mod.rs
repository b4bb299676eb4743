//! The host protocol: how a host flashes weights into the bridge, closes its clutch, watches it.
//!
//! postcard messages ([`message`]) in COBS frames with a CRC-32 ([`frame`]), stop and wait; [`Server`] is the bridge's end.
//! Any garbage on the line is survived and counted. `docs/protocol.md` fixes the bytes.

mod configuration;
pub mod frame;
mod gate;
mod incoming;
pub mod message;
mod outgoing;
mod profiles;
mod server;
mod slow;
mod streaming;
mod telling;
mod wire;

pub use server::{Machine, Outcome, Server};
