//! Telemetry samples as rows of a poses file.

use std::io::Write;

use bridge::protocol::message::Sample;

/// Head of [`write_row`]'s rows, that of a poses file.
///
/// # Errors
/// The file's fault.
pub fn write_head(out: &mut impl Write) -> std::io::Result<()> {
    write!(out, "time_s")?;
    for name in glove::hand::JOINT_NAMES {
        write!(out, ",{name}")?;
    }
    writeln!(out)
}

/// One sample as a row of a poses file: the bridge's time and the 25 joint angles.
///
/// # Errors
/// The file's fault.
pub fn write_row(out: &mut impl Write, sample: &Sample) -> std::io::Result<()> {
    write!(out, "{:.6}", sample.now_us as f64 / 1e6)?;
    for angle in sample.angles {
        write!(out, ",{angle}")?;
    }
    writeln!(out)
}
