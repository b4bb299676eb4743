//! The TCA9548A multiplexer.
