//! Bars made of characters.

/// A bar from zero to `value` on a track from `low` to `high`, in `width` characters, half a character fine.
pub(super) fn signed(value: f32, (low, high): (f32, f32), width: usize) -> String {
    let halves = 2 * width;
    let place = |x: f32| -> usize {
        let share = ((x - low) / (high - low)).clamp(0.0, 1.0);
        if share.is_nan() {
            0
        } else {
            (share * halves as f32).round() as usize
        }
    };
    let (zero, end) = (place(0.0), place(value));
    let (from, to) = (zero.min(end), zero.max(end));
    (0..width)
        .map(|cell| {
            let left = (from..to).contains(&(2 * cell));
            let right = (from..to).contains(&(2 * cell + 1));
            match (left, right) {
                (true, true) => '█',
                (true, false) => '▌',
                (false, true) => '▐',
                (false, false) if zero / 2 == cell && zero > 0 && zero < halves => '┆',
                (false, false) => '·',
            }
        })
        .collect()
}

/// What stands in one character of a gripper axis's bar.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Cell {
    /// Beyond the measured position.
    Empty,
    /// Up to the measured position.
    Filled,
    /// Where the commanded position is.
    Asked,
}

/// A bar of a gripper axis: filled to `reached` of 255, with a mark at `asked`.
pub(super) fn axis(asked: Option<u8>, reached: Option<u8>, width: usize) -> Vec<Cell> {
    let place = |count: u8| (usize::from(count) * width).div_ceil(255).min(width);
    let filled = reached.map_or(0, place);
    let mark = asked.map(|asked| (usize::from(asked) * width / 256).min(width.saturating_sub(1)));
    (0..width)
        .map(|cell| {
            if mark == Some(cell) {
                Cell::Asked
            } else if cell < filled {
                Cell::Filled
            } else {
                Cell::Empty
            }
        })
        .collect()
}
