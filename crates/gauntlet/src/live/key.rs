//! What keys mean.

/// What a person asked for with a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Key {
    /// `q`, Escape or Ctrl-C: hold and end.
    End,
    /// Space: close or open the clutch.
    Clutch,
    /// Space where it may be text, or several at once: open the clutch if it is closed, never close it.
    Open,
    /// `c`: the hand is flat now, calibrate on it.
    Calibrate,
    /// `r`: what is asked for once more.
    Again,
}
