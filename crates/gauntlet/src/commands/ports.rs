//! `gauntlet ports`: the serial ports of this machine.

use anyhow::Result;
use clap::Args;

use crate::results::{self, devices};
use crate::say;
use host::failure::OrFail;
use host::lines::list::{Listed, list};
use host::next::Command;

/// Options of `ports`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gauntlet ports
  gauntlet ports --json

A warning says what will go wrong with a port before you use it, and the command that helps.")]
pub struct Ports {
    /// Print the list as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Lists the ports.
///
/// # Errors
/// A failure where the system does not give the list.
pub(crate) fn run(options: &Ports) -> Result<()> {
    let ports = list().or_fail(
        || "the serial ports cannot be listed".to_owned(),
        Command::program("sh").option("-c", "ls /dev/tty*"),
    )?;
    if options.json {
        return results::print("ports", devices::Ports { ports: &ports });
    }
    if ports.is_empty() {
        let help = Command::gauntlet("help simulate");
        say!("no serial port found: plug the adapter in (a virtual one: `{help}`)");
    }
    for port in &ports {
        say!("{}", describe(port));
        for warning in &port.warnings {
            say!("    warning: {warning}");
        }
    }
    Ok(())
}

fn describe(port: &Listed) -> String {
    let mut text = format!("{}  {}", port.path.display(), port.kind);
    if let (Some(vendor), Some(product)) = (&port.vendor_id, &port.product_id) {
        text.push_str(&format!(" {vendor}:{product}"));
    }
    let names = [&port.manufacturer, &port.product, &port.serial_number];
    for name in names.into_iter().flatten() {
        text.push_str("  ");
        text.push_str(name);
    }
    if let Some(path) = &port.stable_path {
        text.push_str(&format!("\n    also {}", path.display()));
    }
    text
}
