//! `gauntlet ports`: the serial ports of this machine.

use anyhow::Result;

use crate::cli::Ports;
use crate::{out, say};
use host::failure::OrFail;
use host::lines::list::{Listed, list};

/// Lists the ports.
///
/// # Errors
/// A failure where the system does not give the list.
pub(super) fn run(options: &Ports) -> Result<()> {
    let ports = list().or_fail(
        || "the serial ports cannot be listed".to_owned(),
        "`ls /dev/tty*`",
    )?;
    if options.json {
        return out::json(&serde_json::json!({ "ports": ports }));
    }
    if ports.is_empty() {
        say!(
            "no serial port found: plug the adapter in (a virtual one: `gauntlet simulate --help`)"
        );
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
