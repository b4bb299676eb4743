//! The synthetic shapes.
