//! Every time of the link and the sum behind it.

use crate::Duration;

/// No motion older than this is sent (age = now − stamp of its oldest sample).
pub const STALE_MOTION: Duration = Duration::from_millis(100);
