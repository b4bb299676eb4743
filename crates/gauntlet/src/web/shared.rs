//! What the thread that drives, the server and its conversations have in common.

use std::sync::atomic::{AtomicU64, AtomicUsize};
use std::time::Duration;

use axum::extract::ws::Utf8Bytes;
use tokio::sync::watch;

use super::guard::Guard;
use super::inbox::Inbox;

/// A picture as it is sent.
#[derive(Debug, Clone)]
pub(super) struct Published {
    /// Counts pictures, from 1.
    pub(super) number: u64,
    /// When it was made, since the computer's start.
    pub(super) at: Duration,
    /// The message.
    pub(super) text: Utf8Bytes,
}

/// All of it.
#[derive(Debug)]
pub(super) struct Shared {
    pub(super) guard: Guard,
    pub(super) pictures: watch::Sender<Option<Published>>,
    pub(super) map: watch::Sender<Option<Utf8Bytes>>,
    /// The program ends.
    pub(super) over: watch::Sender<bool>,
    pub(super) inbox: Inbox,
    /// Pages that are open.
    pub(super) open: AtomicUsize,
    /// Pages so far.
    pub(super) pages: AtomicU64,
}

impl Shared {
    pub(super) fn new(guard: Guard) -> Self {
        Self {
            guard,
            pictures: watch::Sender::new(None),
            map: watch::Sender::new(None),
            over: watch::Sender::new(false),
            inbox: Inbox::default(),
            open: AtomicUsize::new(0),
            pages: AtomicU64::new(0),
        }
    }
}
