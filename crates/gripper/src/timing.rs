//! Every time of the link and the drivers, and the sum behind it.
//!
//! Sources: "MODBUS over Serial Line" 1.02 §2.5.1.1 (silences), Robotiq manuals (200 Hz registers,
//! 5 ms between requests). At 115200 baud one character (8N1, 10 bits) takes 86.8 µs:
//!
//! ```text
//! cycle FC23, 8 + 8 registers   request 29 × 86.8 = 2.52 ms
//!                             + the gripper's turnaround, 1.75 ms when it waits for the silence
//!                             + reply 21 × 86.8   = 1.82 ms
//!                             + silence             1.75 ms      = 7.84 ms, 127 Hz
//!                             (3.5 characters for both silences:   4.95 ms, so the 5 ms rule: 200 Hz)
//! no answer at all              request 2.52 + RESPONSE 8 + 1 character     = 10.6 ms → Timeout
//!                             + quarantine: longest reply 1.82 + silence 1.75 → next request at 14.2 ms
//! an answer in pieces           10.6 ms to its start + 21 × (86.8 µs + PAUSE 750 µs) = 28.2 ms at most
//! ```
//!
//! A line that is known to be slow (a serial tunnel) can be given patience: both the start of a reply
//! and its end may then come later by that much, and a motion may rest on a status older by it.

use crate::{Duration, Instant};

/// Bits a character takes on the line: start, 8 data, stop.
pub const BITS: u64 = 10;

/// No motion older than this is sent (age = now − stamp of its oldest sample).
pub const STALE_MOTION: Duration = Duration::from_millis(100);

/// The gripper refreshes its registers at 200 Hz.
pub const REFRESH: Duration = Duration::from_millis(5);

/// Least time from one request's start to the next one's: one refresh.
pub const CYCLE: Duration = REFRESH;

/// What a USB adapter with a 1 ms latency timer adds to a round trip.
pub const ADAPTER: Duration = Duration::from_millis(2);

/// How late a poll may come: one step of the loop.
pub const TICK: Duration = Duration::from_millis(1);

/// Default allowance from the end of a request to the start of its reply: the gripper takes up a
/// request within one refresh; adapter and tick add to it. 8 ms.
pub const RESPONSE: Duration =
    Duration::from_ticks(REFRESH.as_ticks() + ADAPTER.as_ticks() + TICK.as_ticks());

/// The same for a PC, where other programs share the cores and the adapter may be a slow one.
pub const RESPONSE_PC: Duration = Duration::from_millis(25);

/// Longest pause between two characters of one frame (t1.5 above 19200 baud).
pub const PAUSE: Duration = Duration::from_micros(750);

/// For how long an unanswered request's reply is expected to turn up late.
pub const MEMORY: Duration = Duration::from_millis(2_000);

/// Timeouts in a row after which requests are spaced out, so that no two that could be taken for
/// each other are sent within [`MEMORY`].
pub const PATIENCE: u32 = 4;

/// How long a failed port rests before it is tried again.
pub const PORT_REST: Duration = Duration::from_millis(100);

/// Longest activation: fingers open, close, turn. 30 s is several times what the manuals show.
pub const ACTIVATION: Duration = Duration::from_millis(30_000);

/// Longest mode change: the scissor's full travel at its slowest.
pub const MODE_CHANGE: Duration = Duration::from_millis(15_000);

/// Longest automatic release: a slow full opening.
pub const RELEASE: Duration = Duration::from_millis(60_000);

/// How long a gripper that answers may leave what it was told unrepeated before that is an error: it
/// repeats its registers within two refreshes.
pub const TAKEN: Duration = Duration::from_millis(1_500);

/// Longest reset: rACT cleared and seen cleared, with a few requests lost.
pub const RESET: Duration = Duration::from_millis(2_000);

/// Time of `count` characters at `baud`, rounded up. A baud of 0 counts as 1.
#[must_use]
pub const fn characters(count: usize, baud: u32) -> Duration {
    let baud = if baud == 0 { 1 } else { baud as u64 };
    Duration::from_ticks((count as u64 * BITS * 1_000_000).div_ceil(baud))
}

/// Silence between two frames: 3.5 characters up to 19200 baud, 1.75 ms above.
#[must_use]
pub const fn silence(baud: u32) -> Duration {
    if baud > 19_200 {
        Duration::from_micros(1_750)
    } else {
        short_silence(baud)
    }
}

/// 3.5 characters at `baud`: what slaves that follow the standard's first half take for silence at
/// any speed. With it an FC23 cycle takes the 5 ms of [`CYCLE`].
#[must_use]
pub const fn short_silence(baud: u32) -> Duration {
    Duration::from_ticks(characters(7, baud).as_ticks().div_ceil(2))
}

/// From the start of a request of `request` bytes to the latest start of its reply.
#[must_use]
pub const fn first_byte(baud: u32, request: usize, response: Duration) -> Duration {
    Duration::from_ticks(characters(request + 1, baud).as_ticks() + response.as_ticks())
}

/// From the latest start of a reply of `reply` bytes to its latest end, pauses included.
#[must_use]
pub const fn last_byte(baud: u32, reply: usize) -> Duration {
    let pause = if baud > 19_200 {
        PAUSE.as_ticks()
    } else {
        characters(3, baud).as_ticks().div_ceil(2)
    };
    Duration::from_ticks(characters(reply, baud).as_ticks() + reply as u64 * pause)
}

/// How long the line rests after a timeout: one longest reply and a silence.
#[must_use]
pub const fn quarantine(baud: u32, longest_reply: usize, silence: Duration) -> Duration {
    Duration::from_ticks(characters(longest_reply, baud).as_ticks() + silence.as_ticks())
}

/// How long a line may talk without a break before that is an error: two longest frames.
#[must_use]
pub const fn babble(baud: u32) -> Duration {
    characters(2 * crate::rtu::MAX_FRAME, baud)
}

/// `start + span`, staying at the end of time instead of overflowing.
pub(crate) fn after(start: Instant, span: Duration) -> Instant {
    Instant::from_ticks(start.as_ticks().saturating_add(span.as_ticks()))
}

/// Time from `earlier` to `later`; nothing when `later` comes first.
pub(crate) fn since(later: Instant, earlier: Instant) -> Duration {
    Duration::from_ticks(later.as_ticks().saturating_sub(earlier.as_ticks()))
}

/// Whether `stamp` lies at most `span` before `now`. One in the future is a fault of a clock: it does not.
#[must_use]
pub fn is_within(now: Instant, stamp: Instant, span: Duration) -> bool {
    now.checked_duration_since(stamp)
        .is_some_and(|age| age <= span)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sums_in_the_header_are_these() {
        assert_eq!(characters(1, 115_200), Duration::from_micros(87));
        assert_eq!(characters(29, 115_200), Duration::from_micros(2_518));
        let cycle = |silence: Duration| characters(29 + 21, 115_200) + silence + silence;
        assert_eq!(cycle(silence(115_200)), Duration::from_micros(7_841));
        assert_eq!(cycle(short_silence(115_200)), Duration::from_micros(4_949));
        let timeout = first_byte(115_200, 29, RESPONSE);
        assert_eq!(timeout, Duration::from_micros(10_605));
        let again = timeout + quarantine(115_200, 21, silence(115_200));
        assert_eq!(again, Duration::from_micros(14_178));
        assert_eq!(
            timeout + last_byte(115_200, 21),
            Duration::from_micros(28_178)
        );
    }

    #[test]
    fn a_stamp_from_the_future_is_within_no_span() {
        let at = Instant::from_ticks;
        assert!(is_within(at(9), at(9), Duration::from_ticks(0)));
        assert!(is_within(at(9), at(3), Duration::from_ticks(6)));
        assert!(!is_within(at(9), at(2), Duration::from_ticks(6)));
        assert!(!is_within(at(9), at(10), MEMORY));
    }

    #[test]
    fn slow_lines_and_nonsense_speeds_give_times_too() {
        assert_eq!(silence(9_600), Duration::from_micros(3_646));
        assert_eq!(characters(1, 0), Duration::from_secs(10));
        assert_eq!(
            after(Instant::from_ticks(u64::MAX - 3), MEMORY).as_ticks(),
            u64::MAX
        );
        assert_eq!(
            since(Instant::from_ticks(3), Instant::from_ticks(9)).as_ticks(),
            0
        );
    }
}
