//! The commands of a log on a virtual gripper.

use std::time::{Duration, Instant};

use anyhow::Result;
use embedded_io::{Read as _, ReadReady as _, Write as _};
use rig::gripper::{Config, Family, VirtualGripper};
use rig::{Clock, MemoryWire};

use crate::results::replays::Driven;
use host::interrupt::Interrupt;
use host::lines::Model;
use host::recording::traced::Traced;
use host::replay::{self, Follow};

/// The gripper moves on so long after the last request.
const SETTLES: u64 = 1_000_000;

/// Gives a virtual gripper, which is active from the start, the requests of the log at their times; `speed` times as fast, or
/// as fast as it goes.
///
/// # Errors
/// A failure where the log's trace cannot be read.
pub(super) fn drive(
    traced: &Traced,
    speed: Option<f64>,
    follow: &mut impl Follow,
    interrupt: &Interrupt,
) -> Result<Driven> {
    let family = match traced.model {
        Model::ThreeFinger => Family::ThreeFinger,
        Model::TwoFinger85 => Family::TwoFinger85,
        Model::TwoFinger140 => Family::TwoFinger140,
        Model::HandE => Family::HandE,
    };
    let clock = Clock::new();
    let baud = if traced.home.network {
        Config::default().baud
    } else {
        traced.home.baud
    };
    let config = Config {
        unit: traced.home.unit,
        baud,
        ..Config::of(family)
    };
    let gripper = VirtualGripper::new(config);
    gripper.preset_active();
    let mut line = MemoryWire::new(&clock, gripper.clone(), baud);
    let log = replay::gripper_line(traced, follow);
    let started = Instant::now();
    let mut newest = 0;
    for (at, request) in &log.requests {
        if let Some(speed) = speed {
            let due = Duration::from_secs_f64(*at as f64 * 1e-6 / speed);
            let left = due.saturating_sub(started.elapsed());
            if !left.is_zero() && interrupt.sleep(left) {
                break;
            }
        } else if interrupt.asked() {
            break;
        }
        newest = *at;
        clock.set(rig::Instant::from_ticks(*at));
        let mut rest = &request[..];
        while let Ok(taken @ 1..) = line.write(rest) {
            rest = rest.get(taken..).unwrap_or_default();
            if rest.is_empty() {
                break;
            }
        }
        let mut replies = [0; 64];
        while matches!(line.read_ready(), Ok(true)) && line.read(&mut replies).is_ok() {}
    }
    clock.set(rig::Instant::from_ticks(newest + SETTLES));
    gripper.run_until(clock.now());
    let axes = traced.model.axes();
    Ok(Driven {
        requests: log.requests.len() as u64,
        served: gripper.writes(),
        positions: gripper.positions()[..axes].to_vec(),
        in_the_log: log.positions,
    })
}
