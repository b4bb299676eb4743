//! The SC18IM700/704 UART-to-I²C bridge.
