//! The master's side of one Modbus RTU line.

/// What happened on the line since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Requests sent.
    pub requests: u32,
    /// Replies that passed every check.
    pub replies: u32,
    /// Replies whose CRC was wrong.
    pub crc: u32,
    /// Late replies to earlier requests, recognised and thrown away.
    pub stale: u32,
    /// Replies with a right CRC that do not answer the request.
    pub shape: u32,
    /// Requests without an answer in time.
    pub timeouts: u32,
    /// Exceptions: the device said no.
    pub exceptions: u32,
    /// Bytes that belong to no reply.
    pub noise: u32,
    /// Failures of the port itself.
    pub port: u32,
}
