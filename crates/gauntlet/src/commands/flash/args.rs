//! The options of `flash`.

use std::path::PathBuf;

use clap::Args;
use host::chip::link::Address;

/// Options of `flash`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet flash model.safetensors --bridge /dev/ttyUSB0
  gauntlet flash model.safetensors --bridge unix:/tmp/gauntlet/host.sock --json
  gauntlet flash weights.hae --bridge tcp:localhost:4000
  gauntlet flash model.safetensors --int16 my_hand.csv --bridge /dev/ttyUSB0

The bridge keeps its old weights until the new image is there, whole and checked: power may go at any moment. \
A broken line is waited for and opened again; the transfer goes on where the bridge says it was. At the end \
the bridge reads its flash and the CRC is compared. Refused while the clutch is closed.")]
pub struct Flash {
    /// A trained model (MODEL.safetensors) or a weights image.
    #[arg(value_name = "MODEL|IMAGE")]
    pub file: PathBuf,
    /// The bridge: a serial port, unix:PATH or tcp:HOST:PORT.
    #[arg(long, value_name = "PORT")]
    pub bridge: Address,
    /// Write the model's weights as 16-bit integers, calibrated on these hand poses: faster on a chip, half as long.
    #[arg(long, value_name = "POSES.csv")]
    pub int16: Option<PathBuf>,
    /// Print the result as JSON on standard output, and nothing else there.
    #[arg(long)]
    pub json: bool,
}
