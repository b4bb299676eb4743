//! The bridge as a PC has it, for any program: lines, sessions, recording, training of hands, diagnosis.
//!
//! | module | what it is for |
//! |---|---|
//! | [`lines`], [`probe`] | serial ports, Modbus TCP; does the right device answer there? |
//! | [`session`] | a bridge that is driven and watched, in this process or on a chip |
//! | [`scanning`] | a glove that is read by itself |
//! | [`recording`], [`trace`] | the session log; the bridge's trace on its way there |
//! | [`replay`] | a log through the same bridge again, or through another one |
//! | [`calibration`] | a glove calibrated by a person, or from a recorded session; its profile |
//! | [`settings`] | what a person prefers, from a file |
//! | [`teaching`] | a person who shows the hand poses that a map is trained with |
//! | [`training`] | maps of hands, and of other domains, from files |
//! | [`chip`] | the host protocol, and the emulator |
//! | [`diagnose`] | what is wrong with a line, and what to do |
//! | [`failure`], [`next`] | what failed; what helps, in words and as commands |
//! | [`report`], [`interrupt`] | who is told; Ctrl-C |
//! | [`clock`], [`realtime`], [`stats`], [`words`] | time, priority, percentiles, codes in words |
//!
//! No command line, no terminal, no printing: who calls decides what a person sees. Nothing moves by connecting; the clutch
//! is closed by [`session::Order::Engage`], an act of a person, and kept closed by a heartbeat every 100 ms.
//!
//! A gripper that follows a hand (`cargo run -p host --example follow GLOVE GRIPPER IMAGE PROFILE`):
//!
//! ```no_run
#![doc = include_str!("../examples/follow.rs")]
//! ```

pub mod calibration;
pub mod chip;
pub mod clock;
pub mod diagnose;
pub mod failure;
pub mod interrupt;
pub mod lines;
pub mod next;
pub mod probe;
pub mod realtime;
pub mod recording;
pub mod replay;
pub mod report;
pub mod scanning;
pub mod session;
pub mod settings;
pub mod stats;
pub mod teaching;
mod toml_file;
pub mod trace;
pub mod training;
pub mod words;

// The device crates and the trainer as this library was built with them: a program on top needs no version of its own.
pub use {bridge, glove, gripper, hae, trainer};
