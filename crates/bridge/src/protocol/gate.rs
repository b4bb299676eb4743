//! What is done only while the clutch is open.

use super::message::Refusal;
use crate::{App, Board};

/// The app, if its clutch is open.
pub(super) fn idle<B: Board<X>, const X: usize>(
    app: &mut App<B, X>,
) -> Result<&mut App<B, X>, Refusal> {
    if app.is_engaged() {
        Err(Refusal::Engaged)
    } else {
        Ok(app)
    }
}
