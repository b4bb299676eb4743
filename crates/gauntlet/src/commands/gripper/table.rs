//! A status as a person reads it, and as JSON.

use host::gripper::{Contact, Fault, Status};

use super::args::Target;
use super::bench::Bench;
use crate::results::devices;
use host::words;

/// Software limits lie inside the mechanical stops, at most so many counts from either end.
pub const LIMITS: u8 = 30;

/// What an axis does. gDTx says nothing while the gripper follows no position.
pub fn axis_words<const X: usize>(status: &Status<X>, axis: usize) -> &'static str {
    match status.contact[axis] {
        _ if !status.going_to => "not following a position",
        Contact::AtPosition => match status.position[axis].abs_diff(status.echo[axis]) {
            0 => Contact::AtPosition.meaning(),
            // That is normal.
            1..=LIMITS => "at its software limit, short of the position asked for",
            _ => "standing elsewhere: at a limit, or led by the mode or finger A",
        },
        contact => contact.meaning(),
    }
}

/// The position asked for; none while the gripper follows none.
fn asked<const X: usize>(status: &Status<X>, axis: usize) -> String {
    if status.going_to {
        status.echo[axis].to_string()
    } else {
        "-".to_owned()
    }
}

/// The table.
pub fn lines<B: Bench<X>, const X: usize>(
    driver: &B,
    status: &Status<X>,
    target: &Target,
) -> Vec<String> {
    let (name, axes) = driver.names();
    let place = target.gripper.display();
    let mut lines = vec![
        format!("{name} on {place}"),
        format!("  activation  {}", words::activation(status.activation)),
    ];
    for (fact, value) in driver.facts() {
        lines.push(format!("  {fact:<10}  {value}"));
    }
    match status.fault {
        Fault::None => lines.push("  fault       none".to_owned()),
        fault => {
            let (code, sentence) = (fault.code(), fault.sentence());
            lines.push(format!("  fault       {code:02X}: {sentence}"));
            lines.push(format!("  try         {}", target.cure(fault)));
        }
    }
    lines.push("  axis      position  asked  current".to_owned());
    for (axis, name) in axes.iter().enumerate() {
        lines.push(format!(
            "  {name:<8}  {:>8}  {:>5}  {:>5.2} A  {}",
            status.position[axis],
            asked(status, axis),
            f32::from(status.current[axis]) * 0.01,
            axis_words(status, axis)
        ));
    }
    if target.raw
        && let Some(bytes) = driver.raw()
    {
        lines.push(format!("  raw         {}", hex(&bytes)));
    }
    lines
}

/// One line for `watch`.
pub fn line<B: Bench<X>, const X: usize>(driver: &B, status: &Status<X>, raw: bool) -> String {
    let (_, axes) = driver.names();
    let mut text = words::activation(status.activation).to_owned();
    for (axis, name) in axes.iter().enumerate() {
        let does = match status.contact[axis] {
            _ if !status.going_to => "-",
            contact => words::contact(contact),
        };
        text.push_str(&format!(
            "  {name} {:>3}/{:<3} {does}",
            status.position[axis],
            asked(status, axis)
        ));
    }
    if status.fault != Fault::None {
        text.push_str(&format!("  {}", status.fault));
    }
    if raw && let Some(bytes) = driver.raw() {
        text.push_str(&format!("  [{}]", hex(&bytes)));
    }
    text
}

/// The same as data.
pub fn state<B: Bench<X>, const X: usize>(
    driver: &B,
    status: &Status<X>,
    target: &Target,
) -> devices::Gripper {
    let (_, names) = driver.names();
    let axes = names.iter().enumerate().map(|(axis, name)| devices::Axis {
        name,
        position: status.position[axis],
        asked: status.going_to.then_some(status.echo[axis]),
        current_ma: u32::from(status.current[axis]) * 10,
        state: axis_words(status, axis),
    });
    let facts = driver.facts();
    let fact = |name: &str| {
        let found = facts.iter().find(|(fact, _)| *fact == name);
        found.map(|(_, text)| text.clone())
    };
    let raw = driver.raw().filter(|_| target.raw);
    devices::Gripper {
        place: target.gripper.display().to_string(),
        gripper_model: target.model.option(),
        activation: words::activation(status.activation),
        going_to: status.going_to,
        mode: fact("mode"),
        motion: fact("motion"),
        controller: fact("controller"),
        fault: (status.fault != Fault::None).then(|| devices::Fault {
            code: format!("{:02X}", status.fault.code()),
            meaning: status.fault.sentence(),
            next: target.cure(status.fault),
        }),
        axes: axes.collect(),
        raw: raw.map(|bytes| hex(&bytes)),
    }
}

fn hex(bytes: &[u8]) -> String {
    let bytes: Vec<String> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
    bytes.join(" ")
}
