//! A value for each of a gripper's axes, however many it has: one or four.

use core::ops::Deref;

/// Most axes of a gripper.
pub const MOST: usize = 4;

/// A value an axis, one to [`MOST`]; reads as a slice.
#[derive(Clone, Copy)]
pub struct Axes<T> {
    values: [T; MOST],
    count: usize,
}

impl<T: Copy> Axes<T> {
    /// Of a slice: its first [`MOST`] values; `None` of an empty one.
    pub fn new(values: &[T]) -> Option<Self> {
        let first = *values.first()?;
        Some(Self {
            values: core::array::from_fn(|axis| *values.get(axis).unwrap_or(&first)),
            count: values.len().min(MOST),
        })
    }
}

impl<T: Copy, const X: usize> From<[T; X]> for Axes<T> {
    fn from(values: [T; X]) -> Self {
        const { assert!(X >= 1 && X <= MOST, "a gripper has one to four axes") };
        Self {
            values: core::array::from_fn(|axis| values[axis.min(X - 1)]),
            count: X,
        }
    }
}

impl<T> Deref for Axes<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        self.values.get(..self.count).unwrap_or_default()
    }
}

impl<T: PartialEq> PartialEq for Axes<T> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl<T: Eq> Eq for Axes<T> {}

impl<T: core::fmt::Debug> core::fmt::Debug for Axes<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        (**self).fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_axis_and_four_read_as_what_they_were_made_of() {
        assert_eq!(*Axes::from([7]), [7]);
        assert_eq!(*Axes::from([1, 2, 3, 4]), [1, 2, 3, 4]);
        assert_eq!(Axes::new(&[1, 2, 3, 4, 5]), Some(Axes::from([1, 2, 3, 4])));
        assert_eq!(Axes::<u8>::new(&[]), None);
        assert_ne!(Axes::from([7]), Axes::from([7, 7]));
    }
}
