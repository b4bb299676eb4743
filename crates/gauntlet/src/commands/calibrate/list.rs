//! `gauntlet calibrate --list`: the profiles that are there.

use anyhow::Result;

use crate::results::{self, calibrations};
use crate::say;
use host::calibration::ProfileStore;
use host::next::Command;

/// Lists them.
///
/// # Errors
/// Their folder cannot be read.
pub(super) fn run(json: bool) -> Result<()> {
    let store = ProfileStore::usual()?;
    let list = store.list()?;
    let folder = store.folder().display().to_string();
    if json {
        let profiles = list.iter().map(calibrations::Listed::of).collect();
        return results::print("calibrate --list", calibrations::List { folder, profiles });
    }
    if list.is_empty() {
        let calibrate = Command::gauntlet("help").word("calibrate");
        say!("no profile in {folder}; `{calibrate}` shows how one is made");
        return Ok(());
    }
    say!("in {folder}:");
    for (path, kept) in &list {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        match kept {
            Ok(kept) => say!(
                "  {name:<22} {} hand, {}, {}",
                calibrations::hand(kept.bound.profile.side),
                kept.quality.verdict,
                kept.calibrated
            ),
            Err(failure) => say!("  {name:<22} NOT USED: {failure}"),
        }
    }
    Ok(())
}
