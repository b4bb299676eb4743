//! Whole-loop tests live in this package's `tests/` folder; there is no library code.
