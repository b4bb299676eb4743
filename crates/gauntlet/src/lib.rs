//! The host tool: trains the map, runs the bridge on a PC, simulates the devices, shows and records what happens.
//!
//! | module | what it is for |
//! |---|---|
//! | [`cli`], [`commands`] | the command line and its verbs |
//! | [`failure`], [`out`], [`tell`], [`progress`] | what a person reads |
//! | [`outputs`] | what files may be written over |
//! | [`port`], [`ports`], [`probe`] | serial ports: open, list, is anybody there |
//! | [`mod@line`], [`tcp`] | a gripper's line: a serial port or Modbus TCP |
//! | [`diagnose`] | which layer of a device fails |
//! | [`platform`], [`realtime`], [`slots`], [`session`], [`stopped`] | the bridge on a PC: clock and wait, priority, weights, thread and queues; how a session left the gripper |
//! | [`run`], [`live`], [`stats`], [`words`] | a run as a person sees it |
//! | [`record`], [`session_log`] | what a run hands over, and its log |
//! | [`host_link`], [`chip`], [`emulator`] | a bridge on a chip: the host protocol, watching it, the firmware in QEMU |
//! | [`reading`], [`poses`], [`training`], [`quality`], [`model`] | hand motion, the map and its measures |

pub mod chip;
pub mod cli;
pub mod commands;
pub mod diagnose;
pub mod emulator;
pub mod failure;
pub mod host_link;
pub mod interrupt;
pub mod line;
pub mod live;
pub mod model;
pub mod out;
pub mod outputs;
pub mod platform;
pub mod port;
pub mod ports;
pub mod poses;
pub mod probe;
pub mod progress;
pub mod quality;
pub mod reading;
pub mod realtime;
pub mod record;
pub mod run;
pub mod session;
pub mod session_log;
pub mod slots;
pub mod stats;
pub mod stopped;
pub mod tcp;
pub mod tell;
pub mod training;
pub mod words;
