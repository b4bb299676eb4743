//! What every command must keep: lead, rate, configuration space.
//!
//! The configuration space of the 3-Finger gripper is not convex: it forbids a scissor that is far closed *while* two
//! fingers are far closed. Each of two commands may be allowed and the way between them not, and the axes are not
//! equally fast. But what is forbidden stays forbidden when any axis closes further (the allowed set is a lower set). So
//! it is enough that the *corner*, axis by axis the greatest of the command, the measured position and the commands whose
//! effect the measurement does not show yet, is allowed: then every position the gripper can be in on its way is allowed
//! too, in whatever order its axes arrive.

use super::underway::greater;
use gripper::{Contact, space};

/// Distance kept from the edge of the configuration space, in counts, by every axis: one that ends a count or two beyond
/// its command is still inside.
const MARGIN: u8 = 2;

/// Whether an axis has stopped against something (gDTx 1 or 2).
pub fn touches(contact: Contact) -> bool {
    matches!(contact, Contact::ContactOpening | Contact::ContactClosing)
}

/// The nearest allowed position to `target`: within 0 to 255, and for four axes inside the configuration space with
/// a margin of two and a half counts. `target` must be finite.
pub fn project<const X: usize>(target: [f32; X]) -> [f32; X] {
    let boxed = target.map(|x| limit(x, 0.0, 255.0));
    let Some(four) = four(&boxed) else {
        return boxed;
    };
    // Half a count more, so that a target that is rounded to counts still keeps the margin.
    let margin = f32::from(MARGIN) + 0.5;
    let shifted = four.map(|x| (x + margin).min(255.0));
    if space::contains(&shifted) {
        return boxed;
    }
    let near = space::nearest(&shifted);
    from_four(
        core::array::from_fn(|axis| limit(near[axis] - margin, 0.0, 255.0)),
        boxed,
    )
}

/// One axis: at most `step` counts from `before`, at most `lead` from `measured`, within 0 to 255. Lead comes last: it
/// holds whatever the others want.
pub fn approach(desired: f32, before: f32, step: f32, measured: u8, lead: u8) -> f32 {
    let measured = f32::from(measured);
    let lead = f32::from(lead);
    let rated = limit(desired, before - step, before + step);
    limit(limit(rated, measured - lead, measured + lead), 0.0, 255.0)
}

/// `x` between `low` and `high`. Unlike `clamp` it has no way to panic; a NaN stays one.
fn limit(x: f32, low: f32, high: f32) -> f32 {
    if x < low {
        low
    } else if x > high {
        high
    } else {
        x
    }
}

/// Rounds to counts; a NaN, which cannot come here, would become the measured position.
pub fn round(x: f32, measured: u8) -> u8 {
    if x.is_nan() {
        return measured;
    }
    // Saturates.
    libm::roundf(x) as u8
}

/// Whether a position is allowed.
pub fn inside<const X: usize>(position: &[u8; X]) -> bool {
    match four(&position.map(f32::from)) {
        Some(four) => space::contains(&four),
        None => true,
    }
}

/// Whether a position is allowed with the margin on every axis.
fn well_inside<const X: usize>(position: &[u8; X]) -> bool {
    inside(&position.map(|x| x.saturating_add(MARGIN)))
}

/// `command`, changed where needed so that the gripper stays inside the configuration space on its way, in whatever order
/// its axes arrive. `ceiling` is, axis by axis, the farthest closed it can be by now (`supervisor::underway`); `measured`, at
/// most that, is where it was last seen. Axes only ever move towards `measured`, so a lead that was kept stays kept.
///
/// A gripper that may be outside, or within the margin of the edge, may only open, axis by axis, until it is not.
pub fn keep_inside<const X: usize>(
    command: [u8; X],
    ceiling: &[u8; X],
    measured: &[u8; X],
    target: &[f32; X],
) -> [u8; X] {
    if well_inside(&greater(&command, ceiling)) {
        return command;
    }
    if !well_inside(ceiling) {
        return core::array::from_fn(|axis| command[axis].min(measured[axis]));
    }
    match (cap_scissor(command, ceiling), cap_fingers(command, ceiling)) {
        (Some(a), Some(b)) if distance(&b, target) < distance(&a, target) => b,
        (Some(a), _) => a,
        (None, Some(b)) => b,
        (None, None) => core::array::from_fn(|axis| command[axis].min(ceiling[axis])),
    }
}

/// Lets the scissor, the last axis, close only as far as the fingers' corner allows.
fn cap_scissor<const X: usize>(mut command: [u8; X], ceiling: &[u8; X]) -> Option<[u8; X]> {
    let last = X.checked_sub(1)?;
    let (wanted, here) = (command[last], ceiling[last]);
    for scissor in (here..wanted).rev() {
        command[last] = scissor;
        if well_inside(&greater(&command, ceiling)) {
            return Some(command);
        }
    }
    None
}

/// Lets the fingers close only as far as the scissor's corner allows, all by the same share of their way.
fn cap_fingers<const X: usize>(command: [u8; X], ceiling: &[u8; X]) -> Option<[u8; X]> {
    const PARTS: u16 = 40;
    (0..PARTS).rev().find_map(|part| {
        let mut capped = command;
        for axis in 0..X.saturating_sub(1) {
            let rise = u16::from(command[axis].saturating_sub(ceiling[axis]));
            if rise > 0 {
                // At most `rise`, which is at most 255.
                capped[axis] = ceiling[axis].saturating_add((rise * part / PARTS) as u8);
            }
        }
        well_inside(&greater(&capped, ceiling)).then_some(capped)
    })
}

fn distance<const X: usize>(a: &[u8; X], b: &[f32; X]) -> f32 {
    a.iter()
        .zip(b)
        .map(|(&a, &b)| libm::fabsf(f32::from(a) - b))
        .sum()
}

/// The axes of a 3-Finger gripper, or `None` for another number of axes.
fn four<const X: usize>(x: &[f32; X]) -> Option<[f32; 4]> {
    x.as_slice().try_into().ok()
}

fn from_four<const X: usize>(x: [f32; 4], or: [f32; X]) -> [f32; X] {
    x.as_slice().try_into().unwrap_or(or)
}
