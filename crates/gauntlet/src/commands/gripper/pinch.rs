//! Pinch mode, where finger A closes between B and C: what would make fingers and scissor meet, before anything moves.

use host::gripper::{Activation, Status, space};

use super::args::Move;
use super::axes::Axes;
use super::bench::Bench;
use super::doing::Doing;
use host::failure::Failure;

/// Fingers that are closed alike meet beyond this, counts: with the margin that a move keeps.
const FARTHEST: u8 = 142;

/// Whether fingers at these positions would meet a scissor that is closed for the pinch.
fn meets<const X: usize>(position: &[u8; X]) -> bool {
    <[u8; space::AXES]>::try_from(&position[..])
        .is_ok_and(|[a, b, c, _]| !space::contains_counts(&[a, b, c, u8::MAX]))
}

/// How a move by one number goes. In pinch mode the mode keeps nothing apart: a target where the fingers meet is refused, and
/// where they could meet on the way every axis is led on its own, the scissor staying where it is.
///
/// # Errors
/// A failure that names the farthest position.
pub(super) fn ordered<B: Bench<X>, const X: usize>(
    doing: &Doing<'_, B>,
    options: &Move,
    (axes, target): (Axes, [u8; X]),
    status: &Status<X>,
) -> Result<(Axes, [u8; X]), Failure> {
    if axes != Axes::Fingers || !doing.driver.is_in_pinch_mode() {
        return Ok((axes, target));
    }
    if meets(&target) {
        return Err(Failure::new(
            format!(
                "--to {}: in pinch mode the fingers meet beyond {FARTHEST}",
                target[0]
            ),
            options.again_to(&[FARTHEST]),
        ));
    }
    let corner: [u8; X] = core::array::from_fn(|axis| target[axis].max(status.position[axis]));
    if !meets(&corner) {
        return Ok((axes, target));
    }
    let staying = core::array::from_fn(|axis| match axes.moves(axis) {
        true => target[axis],
        false => status.position[axis],
    });
    doing.tell.say(format_args!(
        "the scissor stays where it is, or fingers and scissor could meet: the same again takes it to its place"
    ));
    Ok((Axes::Each, staying))
}

/// Whether the scissor has a free way to its place in pinch mode.
///
/// # Errors
/// A failure with the move that frees it.
pub(super) fn may_close_scissor<B: Bench<X>, const X: usize>(
    doing: &Doing<'_, B>,
    status: &Status<X>,
) -> Result<(), Failure> {
    if status.activation != Activation::Ready || !meets(&status.position) {
        return Ok(());
    }
    let fingers: Vec<String> = status.position.iter().take(3).map(u8::to_string).collect();
    Err(Failure::new(
        format!(
            "the scissor would meet the fingers on its way to the pinch: they are closed too far, at {}",
            fingers.join(", ")
        ),
        doing.target.again(&format!("move --to {FARTHEST}")),
    ))
}
