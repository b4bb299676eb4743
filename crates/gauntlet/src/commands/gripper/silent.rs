//! Why no status came from a gripper, with the next step.

use std::time::Duration;

use host::gripper::registers::Kind;

use super::args::Target;
use super::bench::Bench;
use host::failure::Failure;
use host::lines::Model;
use host::next::{Command, advice};

/// Why there is no first status; `last`: what came instead.
pub(super) fn no_answer<B: Bench<X>, const X: usize>(
    target: &Target,
    driver: &mut B,
    config: host::gripper::driver::Config,
    last: Option<host::gripper::Error>,
) -> anyhow::Error {
    let place = target.gripper.display();
    let (name, _) = driver.names();
    if let Some(host::gripper::Error::OtherGripper(kind)) = last {
        return Failure::new(
            format!(
                "a {} answers on {place}, not a {name}: nothing was written to it",
                kind.name()
            ),
            match kind {
                Kind::ThreeFinger => "--gripper-model 3f (--model 3f is the same)",
                Kind::TwoFinger => {
                    "--gripper-model 2f85, 2f140 or hande (--model 2f85 is the same): which of them it is no register says"
                }
            },
        )
        .into();
    }
    if let Some(error) = driver.line_error() {
        let what = format!(
            "no {name} answers at {place} as unit {}: {error}",
            config.unit
        );
        let next = match error {
            host::lines::tcp::Error::Timeout => target
                .patient_for("status", host::lines::MOST_PATIENCE)
                .then("; ending other programs that are connected to it; another --unit (2 by default); the gripper's power"),
            error => error.next_step().into(),
        };
        return Failure::new(what, next).into();
    }
    if let Some(late) = driver.lateness() {
        let late = late.as_ticks().div_ceil(1_000);
        return Failure::new(
            format!(
                "a gripper answers on {place} as unit {}, but late: up to {late} ms after it was asked",
                config.unit
            ),
            target
                .patient_for("status", Duration::from_millis(late))
                .then(", which waits longer; the adapter's latency timer (")
                .then(Command::gauntlet("ports"))
                .then("), or the tunnel that keeps its bytes back"),
        )
        .into();
    }
    if let Some(host::gripper::Error::Link(error @ host::gripper::link::Error::Shifted(_))) = last {
        return Failure::new(
            format!(
                "no {name} answers on {place} as unit {}: {error}",
                config.unit
            ),
            advice("an adapter with bias resistors and 120 ohms at both ends of the bus, then ")
                .then(target.again("status")),
        )
        .into();
    }
    let why = last.map_or_else(String::new, |error| format!(": {error}"));
    let refused = matches!(
        last,
        Some(host::gripper::Error::Link(
            host::gripper::link::Error::Exception(_)
        ))
    );
    if refused && target.model == Model::ThreeFinger {
        return Failure::new(
            format!(
                "no {name} answers on {place} as unit {}{why}; a {name} sends no exceptions",
                config.unit
            ),
            "--gripper-model 2f85, 2f140 or hande, if it is one of them",
        )
        .into();
    }
    Failure::new(
        format!(
            "no {name} answers on {place} as unit {} at {} baud{why}",
            config.unit, config.baud
        ),
        target.doctor().then(", which finds out which layer fails"),
    )
    .into()
}
