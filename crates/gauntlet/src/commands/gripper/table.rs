//! A status as a person reads it, and as JSON.

use gripper::{Contact, Fault, Status};
use serde_json::{Value, json};

use super::bench::Bench;
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
    place: &str,
    raw: bool,
) -> Vec<String> {
    let (name, axes) = driver.names();
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
            lines.push(format!("  try         {}", fault.action()));
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
    if raw && let Some(bytes) = driver.raw() {
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
pub fn json<B: Bench<X>, const X: usize>(
    driver: &B,
    status: &Status<X>,
    place: &str,
    raw: bool,
) -> Value {
    let (name, names) = driver.names();
    let axes: Vec<Value> = names
        .iter()
        .enumerate()
        .map(|(axis, name)| {
            json!({
                "name": name,
                "position": status.position[axis],
                "asked": status.going_to.then_some(status.echo[axis]),
                "current_ma": u32::from(status.current[axis]) * 10,
                "state": axis_words(status, axis),
            })
        })
        .collect();
    let mut value = json!({
        "gripper": place,
        "model": name,
        "activation": words::activation(status.activation),
        "going_to": status.going_to,
        "fault": fault(status.fault),
        "axes": axes,
    });
    for (fact, text) in driver.facts() {
        value[fact] = text.into();
    }
    if raw {
        value["raw"] = driver.raw().map(|bytes| hex(&bytes)).into();
    }
    value
}

/// A fault as data; null for none.
pub fn fault(fault: Fault) -> Value {
    match fault {
        Fault::None => Value::Null,
        fault => json!({
            "code": format!("{:02X}", fault.code()),
            "meaning": fault.sentence(),
            "try": fault.action(),
        }),
    }
}

fn hex(bytes: &[u8]) -> String {
    let bytes: Vec<String> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
    bytes.join(" ")
}
