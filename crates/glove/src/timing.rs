//! Every time the glove waits for, and the sum behind it.
//!
//! Serial: 8N1, 10 bits a byte; at 115200 baud a byte takes 86.8 µs. I²C: 9 bits a byte; at the 369 kHz that
//! [`I2C_DIVIDER`] sets, 24.4 µs, at the serial bridge's slowest useful clock (97 kHz) 93 µs.
//!
//! One scan at 115200 baud, 8 channels with 2 sensors each, as [`crate::scan`] does it:
//!
//! | what | bytes sent | bytes received | times |
//! |---|---|---|---|
//! | select a channel and read the selection back | 5 + 4 | 1 | 8 |
//! | quaternion, register pointer known | 4 | 8 | 16 |
//!
//! 8 · 10 + 16 · 12 = 272 bytes = 23.6 ms. On the I²C bus 8 · (2 + 2) + 16 · 9 = 176 bytes = 4.3 ms. Sum: 27.9 ms; the bytes of a
//! selection overlap with its work on the bus, so that the virtual glove takes 26.6 ms. With the register written before
//! every read (4 bytes more on the line and 2 on the bus, a sensor) it is 34.2 ms; without the read-back of the selection that
//! is about the 30.6 ms of a plain driver.
//!
//! The same 16 sensors in UART mode ([`crate::uart`]) at 115200 baud: 16 · (4 sent + 10 received) = 224 bytes = 19.4 ms, and 16 times
//! [`SELECTOR_SETTLE`]: 20.8 ms, 48 scans a second, besides what a sensor thinks before it answers.

use crate::{Duration, Instant};

/// Bits a byte takes on the serial line: start, 8 data, stop.
pub const BITS_PER_BYTE: u64 = 10;

/// Register value for I2CClkL and I2CClkH: 7.3728 MHz / (2 · (5 + 5)) = 369 kHz on an SC18IM700, 15 MHz / (8 · 5) =
/// 375 kHz on an SC18IM704. The BNO055 allows 400 kHz.
pub const I2C_DIVIDER: u8 = 5;

/// Register value for I2CTO: enabled (bit 0), 3 · 4.44 ms = 13.3 ms (bits 7..1). A BNO055 stretches the clock by a few
/// milliseconds at most, and the reply deadline (bytes + [`REPLY_SLACK`]) is later, so that a hung bus is reported by the
/// bridge and not mistaken for its silence.
pub const I2C_TIMEOUT: u8 = 3 << 1 | 1;

/// What one I²C byte may take when a deadline is set: 93 µs at 97 kHz plus 180 µs of clock stretching (reported by users).
pub const I2C_BYTE: Duration = Duration::from_ticks(273);

/// What a transaction may wait besides its bytes: 16 ms latency timer of a USB serial adapter left at its default, plus
/// 9 ms for a busy host to run us.
pub const REPLY_SLACK: Duration = Duration::from_ticks(25_000);

/// Silence that ends a drain: longer than the gap between two bytes of one reply on any port that is set up well (1 ms
/// latency timer), and rounded up.
pub const QUIET: Duration = Duration::from_ticks(2_000);

/// A drain gives up after this long of bytes that do not stop: 49 bytes, the longest reply, take 51 ms at 9600 baud.
pub const DRAIN_MAX: Duration = Duration::from_ticks(60_000);

/// The serial bridge forgets half a command after 655 ms without a byte (not confirmed by its vendor); a little more.
pub const IDLE_TIMEOUT: Duration = Duration::from_ticks(660_000);

/// After a channel selector has moved, nothing is sent for as long as a character takes at 115200 baud: what the switching looked
/// like to the sensor is then over.
pub const SELECTOR_SETTLE: Duration = Duration::from_ticks(87);

/// Pause before a command that a sensor in UART mode did not take is sent again, and between its pieces of two bytes: users report
/// that 2 to 3 ms end its overruns.
pub const UART_PIECES: Duration = Duration::from_ticks(2_500);

/// How often a sensor in UART mode is asked again that refuses with an overrun, or answers what cannot be.
pub const UART_RETRIES: u8 = 5;

/// Pause before a failed port is tried again.
pub const PORT_RETRY: Duration = Duration::from_ticks(500_000);

/// How often a silent serial bridge is asked, [`IDLE_TIMEOUT`] apart, before it counts as dead.
pub const RESYNC_TRIES: u8 = 5;

/// How often a dead serial bridge is asked: somebody may plug it in.
pub const DEAD_RETRY: Duration = Duration::from_ticks(2_000_000);

/// After BRG1 is written the serial bridge needs 1 ms; twice that.
pub const BAUD_SETTLE: Duration = Duration::from_ticks(2_000);

/// Any mode to CONFIG takes the BNO055 19 ms (data sheet table 3-6); 1 ms more.
pub const MODE_TO_CONFIG: Duration = Duration::from_ticks(20_000);

/// CONFIG to any mode takes the BNO055 7 ms (data sheet table 3-6); 3 ms more.
pub const CONFIG_TO_MODE: Duration = Duration::from_ticks(10_000);

/// Reset to configuration mode takes the BNO055 650 ms (data sheet table 0-2); it does not acknowledge meanwhile.
pub const RESET: Duration = Duration::from_ticks(650_000);

/// Pause between two tries of a step that a sensor did not answer or has not reached yet.
pub const STEP_RETRY: Duration = Duration::from_ticks(20_000);

/// How often a step is tried, [`STEP_RETRY`] apart, before the bring-up starts over: 50 · 20 ms = 1 s, more than a reset.
pub const STEP_TRIES: u8 = 50;

/// How often a sensor is looked for, [`STEP_RETRY`] apart, before the first scan begins without it: 40 · 20 ms = 0.8 s, so
/// that a glove and a bridge that are switched on together find each other.
pub const FIRST_TRIES: u8 = 40;

/// First pause after a failed bring-up; it doubles up to [`BACKOFF_MAX`].
pub const BACKOFF_MIN: Duration = Duration::from_ticks(250_000);

/// Longest pause after a failed bring-up.
pub const BACKOFF_MAX: Duration = Duration::from_ticks(2_000_000);

/// The fusion gives its first quaternion within this after the mode is set, else the sensor is brought up again.
pub const FIRST_SAMPLE: Duration = Duration::from_ticks(1_000_000);

/// The fusion runs at 100 Hz: two reads may see a step of this age however close they are.
pub const FUSION_PERIOD: Duration = Duration::from_ticks(10_000);

/// A sensor whose bytes have not changed for this long is a candidate for "frozen".
pub const FROZEN_AFTER: Duration = Duration::from_ticks(500_000);

/// A sensor whose bytes stand still for this long has no flicker to be known by: ten periods of its fusion.
pub const STANDSTILL: Duration = Duration::from_ticks(100_000);

/// All sensors together stand still to the bit for this long: what answers is not alive. Seven scans at 115200 baud; where each
/// sensor flickers in half of its reads, not one change in 16 · 7 reads is no chance.
pub const ALL_FROZEN_AFTER: Duration = Duration::from_ticks(200_000);

/// Nobody looked at the sensors for this long: what they did meanwhile is not known.
pub const UNSEEN: Duration = Duration::from_ticks(200_000);

/// A glove that did not answer for so long may have been exchanged for another one: nobody pulls out a plug and puts another
/// one in faster.
pub const EXCHANGE: Duration = Duration::from_ticks(500_000);

/// No segment of a hand keeps its fastest speed for longer than this.
pub const PEAK_SPEED: Duration = Duration::from_ticks(200_000);

/// The frozen sensor is restarted after this long.
pub const FROZEN_RESTART: Duration = Duration::from_ticks(1_000_000);

/// A calibration takes the mean of a hand that is still for this long: 37 scans at 115200 baud, so that the sensors' noise
/// of a digit averages out and a hand that only pauses between two motions is not taken.
pub const STILL_FOR: Duration = Duration::from_ticks(1_000_000);

/// Longest time without a good sample of a sensor that the second of stillness outlasts: seven scans at 115200 baud. One
/// flipped bit must not start it anew, a sensor that is away must.
pub const STILL_GAP: Duration = Duration::from_ticks(200_000);

/// What a calibration asked for in passing may wait: the second of stillness, and one for the hand to come to rest.
pub const STILL_WAIT: Duration = Duration::from_ticks(2_000_000);

/// Time `bytes` take on the serial line at `baud`, rounded up. A baud of zero counts as 1.
pub fn serial(bytes: usize, baud: u32) -> Duration {
    let bits = bytes as u64 * BITS_PER_BYTE;
    Duration::from_ticks((bits * 1_000_000).div_ceil(u64::from(baud.max(1))))
}

/// Longest time from the first byte sent to the last received: the bytes on the line, the bytes on the I²C bus, and
/// [`REPLY_SLACK`].
pub fn reply(sent: usize, received: usize, i2c: usize, baud: u32) -> Duration {
    let i2c = Duration::from_ticks(I2C_BYTE.as_ticks() * i2c as u64);
    serial(sent + received, baud) + i2c + REPLY_SLACK
}

/// Bytes of one scan on the serial line (see above), and its work on the I²C bus.
const SCAN_BYTES: usize = 272;
const SCAN_I2C: Duration = Duration::from_ticks(4_300);

/// More than this from one question to the next one to the same sensor is a gap between scans: half as long again as a scan
/// takes at `baud`, or as the `period` that scans are begun with. 42 ms at 115200 baud without a pause.
pub fn scan_gap(baud: u32, period: Duration) -> Duration {
    let wire = serial(SCAN_BYTES, baud).as_ticks();
    let scan = wire.saturating_add(SCAN_I2C.as_ticks());
    let scan = scan.max(period.as_ticks());
    Duration::from_ticks(scan.saturating_add(scan / 2))
}

/// `now + wait`, at the end of time at most.
pub(crate) fn after(now: Instant, wait: Duration) -> Instant {
    Instant::from_ticks(now.as_ticks().saturating_add(wait.as_ticks()))
}

/// `now − earlier`, zero if `earlier` is later.
pub(crate) fn since(now: Instant, earlier: Instant) -> Duration {
    Duration::from_ticks(now.as_ticks().saturating_sub(earlier.as_ticks()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_byte_at_115200_baud_takes_86_8_microseconds() {
        assert_eq!(serial(1, 115_200).as_ticks(), 87);
        assert_eq!(serial(1000, 115_200).as_ticks(), 86_806);
        assert_eq!(serial(1, 0).as_ticks(), 10_000_000);
    }

    #[test]
    fn the_bridge_reports_a_hung_bus_before_the_deadline() {
        let hung = u64::from(I2C_TIMEOUT >> 1) * 4_440;
        assert!(hung < REPLY_SLACK.as_ticks());
    }

    #[test]
    fn a_gap_is_half_a_scan_more_than_one() {
        let none = Duration::from_ticks(0);
        assert_eq!(scan_gap(115_200, none).as_millis(), 41);
        assert_eq!(scan_gap(9_600, none).as_millis(), 431);
        assert_eq!(
            scan_gap(115_200, Duration::from_ticks(50_000)).as_millis(),
            75
        );
        scan_gap(0, Duration::from_ticks(u64::MAX));
    }

    #[test]
    fn time_does_not_overflow() {
        let end = Instant::from_ticks(u64::MAX);
        assert_eq!(after(end, RESET), end);
        assert_eq!(since(Instant::from_ticks(0), end).as_ticks(), 0);
    }
}
