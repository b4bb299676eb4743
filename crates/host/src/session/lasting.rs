//! What has lasted until now. A run is judged by how it ended, and one bad frame just then is no end.

use gripper::{Duration, Instant};

/// So long something must have been so to count.
const LASTS: Duration = Duration::from_ticks(500_000);

/// Something that may be so, and since when.
#[derive(Debug, Clone)]
pub struct Lasting<T> {
    newest: Option<(T, Instant)>,
}

impl<T> Default for Lasting<T> {
    fn default() -> Self {
        Self { newest: None }
    }
}

impl<T: Copy> Lasting<T> {
    /// It is so now (`Some`), or not.
    pub fn look(&mut self, what: Option<T>, now: Instant) {
        let since = self.newest.map_or(now, |(_, since)| since);
        self.newest = what.map(|what| (what, since));
    }

    /// What it is, where it has lasted.
    pub fn lasted(&self, now: Instant) -> Option<T> {
        let (what, since) = self.newest?;
        let lasted = now.checked_duration_since(since)?;
        (lasted >= LASTS).then_some(what)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_over_for_a_moment_begins_anew() {
        let at = |ms: u64| Instant::from_ticks(1_000 * ms);
        let mut held = Lasting::default();
        held.look(Some(1), at(0));
        held.look(Some(2), at(400));
        assert_eq!(held.lasted(at(499)), None);
        assert_eq!(held.lasted(at(500)), Some(2));
        held.look(None, at(600));
        held.look(Some(3), at(700));
        assert_eq!(held.lasted(at(1_100)), None);
    }
}
