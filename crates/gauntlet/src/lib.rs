//! The host tool: trains the map, runs the bridge on a PC, simulates the devices, shows and records what happens.
//!
//! | module | what it is for |
//! |---|---|
//! | [`cli`], [`commands`], [`options`] | the command line, its verbs, options that several of them have |
//! | [`out`], [`tell`], [`progress`] | what a person reads |
//! | [`results`] | what a program reads (`--json`) |
//! | [`reading`], [`outputs`], [`played`] | files that are read, files that may be written over, motion that is played |
//! | [`wearer`] | the virtual person in an honest virtual glove, calibrated on the virtual clock |
//! | [`run`], [`live`] | a run as a person sees it, of a bridge in this process or on a chip |
//! | [`web`] | a page in a browser that shows them |
//!
//! Everything that another program could use is in [`host`].

pub mod cli;
pub mod commands;
mod flat_hand;
mod heard;
mod line_log;
pub mod live;
pub mod options;
pub mod out;
pub mod outputs;
pub mod played;
pub mod progress;
pub mod reading;
pub mod results;
pub mod run;
pub mod tell;
pub mod wearer;
pub mod web;
