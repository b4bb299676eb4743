//! Maps that are trained, measured, and refused.
#![allow(missing_docs, clippy::unwrap_used)]

#[path = "../support/mod.rs"]
mod support;

mod domains;
mod domains_refused;
mod export;
mod export_log;
mod reproduce;
mod training;
mod wrong_files;
