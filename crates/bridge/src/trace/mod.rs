//! The trace of a bridge: everything that comes to [`crate::App`] and everything that it writes, so exactly that a replay
//! gives the same commands bit for bit.
//!
//! `App` reads no clock but its board's and no byte but its ports'. A trace therefore holds, **in the order in which they
//! happened**: each reading of the clock, each read and write of a port and each failure of one, each order. What is not in
//! it did not happen: a port that had nothing to read leaves no entry. A replay asks the trace where `App` asked the world
//! ([`Strict`]); it assumes nothing about how long a step took, and a call that the trace has not at this place is the first
//! difference. With another map or other settings `App` does something else, and bytes and instants are given by their time
//! instead ([`Loose`]).
//!
//! | part | what it knows |
//! |---|---|
//! | [`Entry`], [`Reader`] | the coding, in both directions; never panics on any bytes |
//! | [`Order`] | what a person or a program told the bridge |
//! | [`Recorder`], [`Note`], [`Tapped`] | a trace being written: ports that write down what they carry |
//! | [`Strict`], [`Loose`], [`Port`] | a trace being replayed |
//! | [`Look`], [`Seen`] | what a replay compares besides the bytes: state, angles, map, target |
//!
//! `docs/session-log.md` fixes the coding byte by byte. A session's log holds a trace in blocks.

mod code;
mod difference;
mod entry;
mod loose;
mod order;
mod port;
mod recorder;
mod seen;
mod strict;

pub use code::{Damage, MAGIC, VERSION};
pub use difference::{Difference, What};
pub use entry::{Call, Entry, Part, Reader};
pub use loose::Loose;
pub use order::{Order, configuration, settings};
pub use port::{Failed, GLOVE, GRIPPER, HOST, PORTS, Port, Source, port_name};
pub use recorder::{Note, Noted, Recorder, Sink, Tapped};
pub use seen::{Look, Seen, state_name};
pub use strict::Strict;
