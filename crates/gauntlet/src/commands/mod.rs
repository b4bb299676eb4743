//! The verbs, one module each with its options. None knows of the command line as a whole.

pub mod bridge;
pub mod calibrate;
pub mod demo;
pub mod doctor;
pub mod eval;
pub mod export;
pub mod flash;
pub mod glove;
pub mod gripper;
pub mod ports;
pub mod record;
pub mod replay;
pub mod report;
pub mod reproduce;
pub mod settings;
pub mod simulate;
pub mod teleop;
pub mod train;
